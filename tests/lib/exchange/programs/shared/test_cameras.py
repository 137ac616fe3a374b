"""Lenses as cameras of flight.toml."""

import numpy as np
import pytest

from acx4lib.exchange.lens import Pinhole
from acx4lib.exchange.programs.shared.cameras import Lens, refitted

HOLE = Pinhole(fx=1000.0, fy=1000.0, cx=500.0, cy=400.0)


def lens(**wanted):
    return Lens(
        **{"width_px": 1000, "height_px": 800, "hole": HOLE, "ideal": HOLE.points, **wanted}
    )


def test_a_pixel_size_is_that_of_the_file_of_the_user_or_said():
    found = refitted({"a": lens(pixel_um=3.7500001), "b": lens()}, pixel_um=None)
    sizes = [found.settings["cameras"][name]["pixel_um"] for name in "ab"]
    assert sizes == [3.75, 5.0]
    assert found.assumed[0].startswith("Pixels of b: 5 µm, since no file says it")
    given = refitted({"b": lens()}, pixel_um=2.0)
    assert given.settings["cameras"]["b"]["focal_mm"] == 2.0
    assert not given.assumed


def test_what_is_zero_is_not_written():
    table = refitted({"a": lens()}, pixel_um=None).settings["cameras"]["a"]
    assert table == {
        "width_px": 1000,
        "height_px": 800,
        "pixel_um": 5.0,
        "focal_mm": 5.0,
        "xp_mm": 0.0025,
        "yp_mm": -0.0025,
    }


def test_some_of_them():
    both = refitted({"a": lens(), "b": lens()}, pixel_um=None)
    one = both.only({"b"})
    assert set(one.cameras) == set(one.settings["cameras"]) == {"b"}
    assert one.found == both.found[1:]


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"ideal": lambda colrow: np.full_like(colrow, np.nan)}, "a: lens: expected a ray"),
        ({"pixel_um": 0.5}, "a: focal_mm 0.5 must lie between 1 and 10000"),
    ],
)
def test_what_no_flight_has_is_told_with_the_camera(wanted, message):
    with pytest.raises(ValueError, match=message):
        refitted({"a": lens(**wanted)}, pixel_um=None)
