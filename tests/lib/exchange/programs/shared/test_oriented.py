"""What readers of other adjustments have in common: proof, tables, names."""

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.shared import oriented
from acx4lib.exchange.programs.shared.oriented import Oriented
from acx4lib.exchange.safe.opened import Opened
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose

CAMERA = Camera(name="C", width_px=100, height_px=80, pixel_mm=0.01, interior=Interior(f=1.0))
FILE = Opened(file="x.json", data=b"{}")


def images(**changes):
    given = {
        "cameras": {"C": CAMERA},
        "images": ("a", "b"),
        "camera_of": ("C", "C"),
        "exposure_of": ("a", "b"),
        "T_w_c": Pose(
            R=np.stack([np.eye(3), np.full((3, 3), np.nan)]),
            r=np.array([[0.0, 0, 10], [np.nan] * 3]),
        ),
        "points": ("p", "q"),
        "x_w": np.array([[0.0, 0, 0], [np.nan] * 3]),
        "image_idx": np.array([0, 0, 1]),
        "point_idx": np.array([0, 1, 0]),
        "colrow": np.array([[49.5, 42.5], [1.0, 2], [3, 4]]),
    }
    return Oriented(**given | changes)


def test_only_what_is_known_proves_anything():
    assert oriented.misfits(images()).tolist() == [3.0]
    assert "to 3 px rms" in oriented.proved(images(), "its points")
    nothing = images(x_w=np.full((2, 3), np.nan))
    assert "prove nothing" in oriented.proved(nothing, "its points")


def test_images_taken_together_belong_to_heads():
    assert images().block == "calibration"
    assert images(exposure_of=("e", "e")).block == "heads"


def test_tables_have_names_instead_of_places():
    tables = oriented.tables_of(images(), "heads", FILE)
    assert tables["heads/image_points.csv"]["point"] == ["p", "q", "p"]
    assert tables["heads/images.csv"]["camera"] == ["C", "C"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": ("p", "=1+1")}, "x.json:1: point: '=1\\+1' would be computed as a formula"),
        ({"images": ("", "b")}, "x.json:1: image: is empty; must be a name"),
    ],
)
def test_names_that_no_flight_may_use_are_refused(changes, message):
    with pytest.raises(FlightError, match=message):
        oriented.tables_of(images(**changes), "heads", FILE)
