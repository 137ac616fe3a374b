"""The block that an adjustment of a report has, for a flight that is measured in its heads."""

import pytest

from acx4book.report import describe
from acx4book.report.material import Material, block_of
from acx4lib import flight as flights
from acx4lib.results import adjustments, folder
from acx4lib.results.carried import of_carried
from acx4lib.results.provenance import Provenance
from acx4lib.synthetic_image.carried import carry
from support.flights import in_heads, pictured


@pytest.fixture(scope="module")
def material(tmp_path_factory):
    flight = flights.read(in_heads.write(tmp_path_factory.mktemp("flight") / "in_heads"))
    results = tmp_path_factory.mktemp("results")
    orientation, camera = pictured.orientation(), flight.synthetic_camera
    carried = {name: carry(flight.block(name), orientation, camera) for name in flight.carried}
    adjustments.write(results, "synthetic", [of_carried(flight, carried)])
    return Material(
        folder=results,
        found=folder.read(results),
        flight=flight,
        provenance=Provenance(files={}, stages={}),
    )


@pytest.mark.parametrize(
    ("adjustment", "block", "cameras"),
    [
        ("heads/bundle/LEFT", "heads", ("LEFT", "RIGHT")),
        ("mounting/rig", "heads", ("LEFT", "RIGHT")),
        ("mounting/rig_calibration", "calibration", ("LEFT", "RIGHT")),
        ("mounting/single_step", "calibration", ("CAM",)),
        ("validation/single_step", "validation", ("CAM",)),
        ("validation/rig", "validation", ("LEFT", "RIGHT")),
    ],
)
def test_every_adjustment_has_the_images_that_it_adjusted(material, adjustment, block, cameras):
    found = block_of(material, adjustment)
    assert found.name == block
    assert tuple(camera.name for camera in found.cameras) == cameras
    assert len(found.image_points) > 40


def test_the_method_says_that_points_were_carried(material):
    assert describe.CARRIED in describe.method(material)
