"""A lens that no calibration touched goes back to its program as it came."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError, OutputError
from acx4tools.exchange.lens import Pinhole
from acx4tools.exchange.lens_models import OPF, Lens
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward.calibrated import Calibrated
from acx4tools.exchange.outward.taken import Taken, require_near, sentences
from support.run_results import estimated

LENSES = {
    "as made by a factory": (-0.101, 0.144, -0.027, 1e-4, -4e-4),
    "of which f, xp, yp are fitted": (-0.28, 0.11, -0.045, 2e-3, -1e-3),
}


def imported(coefficients, fy=1460.0):
    """Return a camera as an import writes it, with ten digits, and its lens."""
    lens = Lens(
        width_px=1280,
        height_px=960,
        hole=Pinhole(fx=1460.0, fy=fy, cx=631.3, cy=497.2),
        distortion=OPF.distortion(coefficients),
        pixel_um=3.75,
        wrong=lambda found, expected: FlightError([f"f:1: lens: {found}; {expected}"]),
    )
    camera = lens.refitted("CAM").camera
    values = {key: float(f"{value:.10g}") for key, value in vars(camera.interior).items()}
    return lens, camera.with_interior(replace(camera.interior, **values))


def calibrated(camera, *, touched):
    """Return a calibration of a camera, with interior parameters that are estimated or not."""
    calibration = replace(estimated("CAM"), cameras=(camera,))
    if not touched:  # the last six columns are those of the mounting
        layout = replace(
            calibration.layout, interior=np.full((1, 10), -1), mount=np.arange(6)[None]
        )
        calibration = replace(
            calibration,
            layout=layout,
            cov=calibration.cov[10:, 10:],
            open_columns=calibration.open_columns[10:],
        )
    return Calibrated(flight=None, method="single_step", calibration=calibration)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("way", [brown.of_all, brown.square])
def test_an_untouched_lens_goes_back_as_it_came(name, way):
    lens, camera = imported(LENSES[name])
    one = way(calibrated(camera, touched=False))["CAM"]
    k1, k2, k3, p1, p2 = LENSES[name]
    hole = lens.hole
    found = [one.hole.fx, one.hole.fy, one.hole.cx, one.hole.cy]
    assert_allclose(found, [hole.fx, hole.fy, hole.cx, hole.cy], atol=1e-4)
    assert_allclose(
        [one.k1, one.k2, one.k3, one.p1, one.p2], [k1, k2, k3, p1, p2], rtol=1e-4, atol=1e-7
    )
    assert one.left.returned


def test_a_lens_that_was_estimated_is_the_nearest_one():
    _, camera = imported(LENSES["as made by a factory"])
    one = brown.of_all(calibrated(camera, touched=True))["CAM"]
    assert one == brown.brown(camera)
    assert not one.left.returned


def test_a_lens_of_other_pixels_than_the_program_has_is_the_nearest_one():
    """Two focal lengths are no lens of one."""
    _, camera = imported(LENSES["as made by a factory"], fy=1463.0)
    one = brown.square(calibrated(camera, touched=False))["CAM"]
    assert not one.left.returned
    assert brown.of_all(calibrated(camera, touched=False))["CAM"].left.returned


def test_what_goes_back_as_it_came_is_not_held_against_the_refit():
    _, camera = imported(LENSES["of which f, xp, yp are fitted"])
    lenses = brown.lenses(brown.of_all(calibrated(camera, touched=False)))
    assert lenses["CAM"].largest_px > 0.05
    taken = Taken(files={}, lenses=lenses)
    require_near(taken)
    assert "not estimated, so that it goes back as it came" in sentences(taken)[0]
    nearest = brown.lenses(brown.of_all(calibrated(camera, touched=True)))
    with pytest.raises(OutputError, match=r"more than 0\.05 px"):
        require_near(Taken(files={}, lenses=nearest))
