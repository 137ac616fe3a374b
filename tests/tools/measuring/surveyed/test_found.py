import numpy as np
import pytest

from acx4tools.measuring.flights import Measured, read_unmeasured
from acx4tools.measuring.surveyed.found import find_surveyed


@pytest.fixture
def control(whole):
    unmeasured = read_unmeasured(whole.flight)
    table = unmeasured.tables["calibration"].control
    frame = unmeasured.flight.calibration.frame
    return table.text["point"], frame.from_grid(table.stack("east_m", "north_m", "height_m"))


def test_found_and_not_found_are_all_that_pictures_show(whole, views, surface, control):
    surveyed = whole.outcome.surveyed
    pairs = {(row.image, row.point) for row in surveyed.rows}
    lacking = {(image, p) for p, images in surveyed.not_found.items() for image in images}
    assert not pairs & lacking
    assert len(pairs) == len(surveyed.rows)


def test_a_point_measured_once_is_matched_and_not_looked_for(whole, views, surface, control):
    row = max(whole.outcome.surveyed.rows, key=lambda one: one.image == "C1-04")
    given = Measured(**{**row.__dict__, "sigma_px": 0.8})
    found = find_surveyed(views, surface, *control, [given])
    own = [one for one in found.rows if one.point == row.point]
    assert own
    before = {one.image: one for one in whole.outcome.surveyed.rows if one.point == row.point}
    for one in own:
        assert one.image != given.image
        assert one.sigma_px >= 0.8  # that of the given measurement is in it
        if one.image in before:
            seen = before[one.image]
            off = np.hypot(one.col_px - seen.col_px, one.row_px - seen.row_px)
            assert off < 4.0  # half a pixel of these pictures
