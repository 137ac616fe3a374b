"""The block that an adjustment of a report has, for a flight that is measured in its heads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.report import identity
from acx4book.report.material import Material, block_of, image_residuals
from acx4lib import flight as flights
from acx4lib.results import adjustments, folder
from acx4lib.results.adjustments import of_carried
from acx4lib.results.provenance import Provenance
from acx4lib.synthetic_image.transferred_points import carry
from support.flights import in_heads, pictured
from support.run_results import SINGLE


@pytest.fixture(scope="module")
def material(tmp_path_factory):
    flight = flights.read(in_heads.write(tmp_path_factory.mktemp("flight") / "in_heads"))
    results = tmp_path_factory.mktemp("results")
    orientation, camera = pictured.orientation(), flight.synthetic_camera
    carried = {name: carry(flight.block(name), orientation, camera) for name in flight.carried}
    adjustments.write(results, "synthetic", [of_carried(flight, carried)])
    return Material(
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
    assert "**Synthetic images.** Points were measured" in identity.method(material)


def test_residuals_stand_where_they_were_measured(run):
    table = image_residuals(run, SINGLE)
    block = run.flight.calibration
    one = table.iloc[7]
    i = block.images.names.index(one["image"])
    k = block.points.index(one["point"])
    seen = block.image_points
    row = np.flatnonzero((seen.image_idx == i) & (seen.point_idx == k))
    assert_allclose(seen.colrow[row[0]], [one["col_px"], one["row_px"]])
    rows = run.residuals[SINGLE]
    own = rows[(rows["image_or_exposure"] == one["image"]) & (rows["point"] == one["point"])]
    assert list(own["v"]) == [one["v_col"], one["v_row"]]
