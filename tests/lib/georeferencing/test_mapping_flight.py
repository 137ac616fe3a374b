"""A regular flight: its overlaps, and errors that grow with the height as closed forms say."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.estimates import given
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.georeferencing import budget, direct
from acx4lib.georeferencing.budget import SOURCES, MappingFlight

CAMERA = Camera(name="CAM", width_px=3000, height_px=4000, pixel_mm=0.01, interior=Interior(f=50.0))
FLIGHT = MappingFlight(
    height_m=1000.0,
    sigma_position_m=(0.02, 0.02, 0.03),
    sigma_attitude=(1e-4, 1e-4, 2e-4),
    sigma_px=0.5,
)


def turned(degrees):
    R = rotation_from_opk(np.radians([0.0, 0.0, degrees]))
    return replace(CAMERA, T_b_c=Pose(R=R, r=np.zeros(3)))


@pytest.mark.parametrize(
    ("degrees", "length", "width"), [(0, 600, 800), (90, 800, 600), (180, 600, 800)]
)
def test_base_and_distance_of_strips_follow_from_the_overlaps(degrees, length, width):
    """The footprint is 3000 px x 0.01 mm x H / f = 600 m by 800 m; it turns with the camera."""
    base, apart = budget.spacing(turned(degrees), FLIGHT)
    assert base == pytest.approx(0.4 * length)
    assert apart == pytest.approx(0.7 * width)


def test_a_lifted_lens_sees_as_much_more_ground():
    lever = replace(CAMERA, T_b_c=Pose(R=np.eye(3), r=np.array([0.0, 0.0, 50.0])))
    assert budget.spacing(lever, FLIGHT)[0] == pytest.approx(0.4 * 600 * 1.05)


def test_overlaps_of_60_and_30_percent_show_a_point_in_two_to_six_images():
    """Along: two or three; across: one or two."""
    block = budget.fly(CAMERA, FLIGHT)
    x, y = np.meshgrid(np.linspace(-119, 119, 30), np.linspace(-279, 279, 30))
    ground = np.column_stack([x.ravel(), y.ravel(), np.zeros(900)])
    g = direct.georeference(block, given(block.cameras))
    _, point_idx, _ = budget.shown(block, g, ground)
    among = np.bincount(point_idx, minlength=900)
    assert sorted(set(among.tolist())) == [2, 3, 4, 6]
    # mean number of images: (1 / 0.4) (1 / 0.7), up to the grid's steps
    assert among.mean() == pytest.approx(1 / 0.4 / 0.7, rel=0.05)


def test_strips_are_flown_there_and_back():
    R = budget.fly(CAMERA, FLIGHT).trajectory.T_m_b.R
    strips = budget.fly(CAMERA, FLIGHT).images.strips
    forward = {strip: R[i, 0, 0] for i, strip in enumerate(strips)}
    assert [round(forward[str(j)]) for j in range(-2, 3)] == [1, -1, 1, -1, 1]


def test_errors_grow_with_the_height_but_those_of_positions_do_not():
    """With the overlaps, every angle of a ray stays: image and attitude ~ H, positions not."""
    low, high = (
        budget.over_ground(given([CAMERA]), replace(FLIGHT, height_m=h)).mean
        for h in (1000.0, 3000.0)
    )
    for name, factor in {
        "image points": 9.0,
        "GNSS": 1.0,
        "roll": 9.0,
        "pitch": 9.0,
        "heading": 9.0,
    }.items():
        i = SOURCES.index(name)
        assert_allclose(high[:, i], factor * low[:, i], rtol=1e-6)


def test_sigma_scales_its_own_part_alone():
    once = budget.over_ground(given([CAMERA]), FLIGHT, n=4).mean
    twice = budget.over_ground(
        given([CAMERA]), replace(FLIGHT, sigma_attitude=(2e-4, 1e-4, 2e-4)), n=4
    ).mean
    factor = np.where(np.array(SOURCES) == "roll", 4.0, 1.0)
    assert_allclose(twice, factor * once, rtol=1e-9, atol=1e-18)


def test_many_points_stand_for_all_the_ground():
    """The mean over the grid is within one percent of that over a grid three times as fine."""
    found, fine = (budget.over_ground(given([CAMERA]), FLIGHT, n=n).rms for n in (32, 96))
    assert found == pytest.approx(fine, rel=0.01)


def test_the_format_is_symmetric_for_a_symmetric_flight():
    """A camera without lever arm and boresight, strips there and back: left is as good as right."""
    format_ = budget.over_format(given([CAMERA]), FLIGHT, n=15)
    sigma = format_.sigma
    assert sigma.shape == (15, 11, 3)
    assert_allclose(format_.colrow[-1, -1], [2999, 3999])
    assert_allclose(sigma, sigma[::-1], rtol=1e-6)
    assert_allclose(sigma, sigma[:, ::-1], rtol=1e-6)


def test_height_is_worst_where_two_neighbours_alone_see_the_point():
    """Two images 240 m apart: (H / B) (H / f) s sqrt 2 in the middle of their common strip."""
    quiet = replace(FLIGHT, sigma_position_m=(0.0,) * 3, sigma_attitude=(0.0,) * 3)
    block = budget.fly(CAMERA, quiet)
    g = direct.georeference(block, given(block.cameras))
    found = budget.predict(block, g, np.array([[120.0, 0.0, 0.0]]), sigma_px=0.5)
    assert found.sigma[0, 2] == pytest.approx(1000 / 240 * 20 * 0.005 * np.sqrt(2), rel=1e-9)


def test_without_overlap_nothing_is_determined():
    alone = replace(FLIGHT, forward=0.0, side=0.0)
    assert np.isnan(budget.over_ground(given([CAMERA]), alone, n=3).rms).all()


def test_wrong_flights_are_refused():
    with pytest.raises(ValueError, match="forward: expected an overlap from 0 to less than 1"):
        replace(FLIGHT, forward=1.0)
    with pytest.raises(ValueError, match="height_m"):
        replace(FLIGHT, height_m=0.0)
    with pytest.raises(ValueError, match="sigma_attitude"):
        replace(FLIGHT, sigma_attitude=(-1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="expected one camera, got 2"):
        budget.over_ground(given([CAMERA, replace(CAMERA, name="B")]), FLIGHT)
    oblique = replace(
        CAMERA, T_b_c=Pose(R=rotation_from_opk(np.radians([80.0, 0.0, 0.0])), r=np.zeros(3))
    )
    assert budget.looks_down(CAMERA)
    assert not budget.looks_down(oblique)
    with pytest.raises(ValueError, match="looks down"):
        budget.over_ground(given([oblique]), FLIGHT)
