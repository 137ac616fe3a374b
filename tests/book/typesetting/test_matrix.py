"""Figures of matrices."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from acx4book.typesetting import matrix, style, svg
from acx4book.typesetting.matrix import sigma_figure
from acx4lib.georeferencing.budget import SOURCES, Budget
from acx4lib.georeferencing.mapping_flight import Format
from support.figures import drawn, panels

VALUES = np.array([[1.0, -0.72, 0.0], [-0.72, 1.0, 0.31], [0.0, 0.31, 1.0]])


def covered(patch, i, j):
    """Tell whether a shape covers the middle of a cell."""
    bars = patch.get_path().to_polygons()
    return any(mpl.path.Path(bar).contains_point((j + 0.5, i + 0.5)) for bar in bars)


def test_a_cell_has_the_colour_of_its_sign_as_dense_as_its_size_and_zero_has_none():
    with style.applied():
        _, ax = style.subplots(figsize=(2, 2))
        matrix.signed_cells(ax, VALUES)
    for (i, j), value in np.ndenumerate(VALUES):
        seen = [patch for patch in ax.patches if covered(patch, i, j)]
        assert len(seen) == (value != 0)
        for patch in seen:
            colour = style.BLUE if value > 0 else style.ORANGE
            assert mpl.colors.same_color(patch.get_facecolor()[:3], colour)
            assert patch.get_alpha() == pytest.approx(abs(value), abs=0.5 / matrix.LEVELS)


def test_a_matrix_is_in_colours_that_a_page_sets():
    names = ["f_mm", "lever_z_m", "k1"]
    fig = matrix.correlation_matrix(pd.DataFrame(VALUES, index=names, columns=names))
    drawn = svg.vector(fig)
    assert "<image" not in drawn
    assert style.BLUE in drawn
    assert style.ORANGE in drawn
    written = [t.get_text() for t in fig.axes[0].texts]
    assert written == ["−.72", "−.72", "+.31", "+.31"]


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


# --- Standard deviations over the format are drawn where they are, in centimetres


def test_panels_have_plan_height_and_the_calibrations_part():
    """Variances of 1, 4 and 9 cm^2 of image points, and 16 cm^2 of the interior in height."""
    variance = np.zeros((4, 3, len(SOURCES)))
    variance[:, :, SOURCES.index("image points")] = np.array([1.0, 4.0, 9.0]) * 1e-4
    variance[:, 2, SOURCES.index("interior orientation")] = 16e-4
    variance[3] = np.nan
    col, row = np.meshgrid([0.0, 99.0], [0.0, 199.0])
    shown = Format(colrow=np.stack([col, row], axis=-1), budget=Budget(variance=variance))
    axes = panels(drawn(sigma_figure(shown)))[:3]
    for ax, cm in zip(axes, (np.sqrt(5.0), 5.0, 4.0), strict=True):
        image = np.ma.filled(ax.images[0].get_array(), np.nan)
        np.testing.assert_allclose(image.ravel(), [cm, cm, cm, np.nan])
        assert ax.get_ylim() == (199.0, 0.0)
    assert [ax.get_title(loc="left") for ax in axes] == ["plan", "height", "height, calibration"]
