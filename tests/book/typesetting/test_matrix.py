"""Figures of matrices."""

import matplotlib as mpl
import numpy as np
import pytest

from acx4book.typesetting import matrix, style


@pytest.mark.parametrize("gap", [0.0, 0.2])
def test_cells_cover_what_is_filled_and_nothing_else(gap):
    filled = np.array([[True, True, False, True], [False, False, False, False], [True] * 4])
    with style.applied():
        _, ax = style.subplots(figsize=(2, 2))
        matrix.cells(ax, filled, style.BLUE, gap=gap)
    shape = ax.patches[0].get_path()
    rows, columns = np.indices(filled.shape)
    middles = np.column_stack([columns.ravel(), rows.ravel()]) + 0.5
    bars = shape.to_polygons()
    seen = [any(mpl.path.Path(bar).contains_point(m) for bar in bars) for m in middles]
    assert np.array_equal(np.reshape(seen, filled.shape), filled)
    assert len(bars) == (7 if gap else 3)
