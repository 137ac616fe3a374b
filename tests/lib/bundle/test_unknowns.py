"""The columns of the unknowns, and what is left of them when some are held."""

import numpy as np

from acx4lib.bundle.unknowns import holding, layout


def test_held_columns_leave_no_gap():
    columns = layout(2, 3, free=("f", "k1"), free_mount=("lever_x",), free_shift=("east",))
    assert columns.n_columns == 2 * 3 + 1 + 18
    left = holding(columns, columns.interior[1, [0, 3]])
    assert left.n_columns == columns.n_columns - 2
    assert left.interior[0, [0, 3]].tolist() == [0, 1]
    assert np.all(left.interior[1] == -1)
    assert left.mount[:, 0].tolist() == [2, 3]
    assert np.all(left.mount[:, 1:] == -1)
    assert left.shift.tolist() == [4, -1, -1]
    assert left.pose.ravel().tolist() == list(range(5, 23))
    assert left.drift.shape == (0, 3)
