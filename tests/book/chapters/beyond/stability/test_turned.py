"""A planted turn: of one head, at one exposure, by the collinearity equations."""

import numpy as np
from scipy.spatial.transform import Rotation

from acx4book.chapters.beyond.stability import turned


def test_only_the_points_of_one_image_move_by_what_a_turn_makes():
    still = turned.flown(1)
    moved = turned.turning(still)
    a, b = (flight.tables[turned.POINTS] for flight in (still, moved))
    shift = (b[["col_px", "row_px"]] - a[["col_px", "row_px"]]).to_numpy()
    images = a["image"][np.abs(shift[:, 0]) > 0]
    assert set(images) == {f"{turned.EXPOSURE}_{turned.HEAD}"}
    camera = still.plan.cameras[turned.HEAD]
    own = (a["image"] == images.iloc[0]).to_numpy()
    f = camera.f_mm / camera.pixel_um * 1000
    x = a.loc[own, "col_px"] - (camera.width_px - 1) / 2
    y = (camera.height_px - 1) / 2 - a.loc[own, "row_px"]
    turn = Rotation.from_euler("y", turned.ARCSEC / 3600, degrees=True)
    ray = turn.inv().apply(np.column_stack([x, y, np.full(len(x), -f)]))  # in the turned axes
    turned_x, turned_y = -f * ray[:, :2].T / ray[:, 2]
    expected = np.column_stack([turned_x - x, -(turned_y - y)])  # rows count downwards
    np.testing.assert_allclose(shift[own], expected, atol=1e-3)


def test_the_planted_turn_is_found_and_nothing_else(rigid):
    own = turned.planted(rigid)
    assert own["p_joint"] < 1e-3
    assert abs(own["turn_arcsec"] - turned.ARCSEC) < 4 * own["sigma_arcsec"]
    assert np.sum(rigid.p_joint < 0.05) == 1
