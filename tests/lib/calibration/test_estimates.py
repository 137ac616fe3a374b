"""What a calibration reports: names, units, standard deviations, and what is not determined.

The geometries that determine too little have files of their own: test_geometry_*.py.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4files.results import sentences
from acx4files.results.sentences import not_determined
from acx4lib import design
from acx4lib.block import select_images
from acx4lib.bundle.unknowns import layout
from acx4lib.calibration import estimates
from acx4lib.calibration.estimates import (
    ENOUGH,
    NEEDS,
    features,
    from_bundle,
    needed,
    parameters,
    saying_what_lacks,
)
from acx4lib.errors import NotConverged
from acx4lib.geometry.camera import INTERIOR, Interior
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.parameters import MOUNT, REPORTED
from support import blocks
from support.flights.simulated import fly
from support.helpers import numeric_jacobian


@pytest.fixture
def found(mounted):
    return from_bundle(mounted)


def test_parameters_are_reported_with_the_names_and_units_of_results(found):
    listed = [(p.name, p.unit) for p in parameters(found)]
    assert listed == [
        ("f_mm", "mm"),
        ("xp_mm", "mm"),
        ("yp_mm", "mm"),
        ("k1", "mm^-2"),
        ("p1", "mm^-1"),
        ("p2", "mm^-1"),
        ("lever_x_m", "m"),
        ("lever_y_m", "m"),
        ("lever_z_m", "m"),
        ("boresight_omega_deg", "deg"),
        ("boresight_phi_deg", "deg"),
        ("boresight_kappa_deg", "deg"),
    ]
    assert {p.camera for p in parameters(found)} == {"CAM"}


def test_standard_deviations_are_a_posteriori(found):
    twice = replace(found, sigma0_sq=4 * found.sigma0_sq)
    for a, b in zip(parameters(found), parameters(twice), strict=True):
        assert b.sigma == pytest.approx(2 * a.sigma)
    for p, variance in zip(parameters(found)[:9], np.diag(found.cov), strict=False):
        assert p.sigma == pytest.approx(np.sqrt(found.sigma0_sq * variance))


def test_boresight_angles_are_reported_in_degrees_of_omega_phi_kappa(found):
    """The columns turn about the camera's axes; results count omega, phi, kappa."""
    (camera,) = found.cameras

    def reported(step):
        turned = Pose(R=camera.T_b_c.R @ exp(step), r=camera.T_b_c.r)
        return np.degrees(turned.opk)

    numeric = numeric_jacobian(reported, np.zeros(3), step=1e-5)
    J = estimates.to_reported(found)
    columns = found.layout.mount[0, 3:]
    assert_allclose(J[np.ix_(columns, columns)], numeric, atol=1e-7)  # 57 deg of 1e-10
    others = np.delete(np.arange(found.n_columns), columns)
    assert_allclose(J[np.ix_(others, others)], np.eye(len(others)), atol=0)


# --- the limits ------------------------------------------------------------------------------


def with_sigmas(**sigma):
    """A calibration of one camera whose parameters have these standard deviations."""
    free = tuple(name for name in sigma if name in INTERIOR)
    columns = layout(1, 0, free=free, free_mount=MOUNT)
    names = [n for n in INTERIOR if n in free] + list(MOUNT)
    good = dict.fromkeys(MOUNT, 1e-5) | sigma
    camera = replace(
        blocks.CAMERA, interior=Interior(f=50.0), T_b_c=Pose(R=np.eye(3), r=np.zeros(3))
    )
    return estimates.Calibration(
        cameras=(camera,),
        layout=columns,
        cov=np.diag([good[name] ** 2 for name in names]),
        sigma0_sq=1.0,
        open_columns=np.zeros(columns.n_columns, dtype=bool),
    )


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("lever_x", 1.0),
        ("lever_z", 1.0),
        ("boresight_x", np.radians(0.1)),
        ("boresight_z", np.radians(0.1)),
        ("f", 0.1),  # 0.2 % of 50 mm
        ("xp", 0.1),
        ("yp", 0.1),
    ],
)
def test_a_parameter_is_not_determined_above_the_stated_limit(name, limit):
    assert not_determined(with_sigmas(**{name: 0.99 * limit})) == []
    (line,) = not_determined(with_sigmas(**{name: 1.01 * limit}))
    assert line.startswith(f"CAM {estimates.REPORTED[name][0]} is not determined (sigma ")
    assert needed(name) in line


@pytest.mark.parametrize(("related", "lines"), [(0.9999, 1), (0.5, 2)])
def test_heads_whose_lever_arms_move_as_one_are_one_sentence(related, lines):
    one = with_sigmas(lever_z=5.0)
    columns = layout(2, 0, free=(), free_mount=MOUNT)
    cov = np.kron(np.eye(2), one.cov)
    first, second = columns.mount[:, MOUNT.index("lever_z")]
    cov[first, second] = cov[second, first] = related * 25.0
    heads = tuple(replace(one.cameras[0], name=name) for name in "AB")
    found = not_determined(
        replace(
            one,
            cameras=heads,
            layout=columns,
            cov=cov,
            open_columns=np.zeros(columns.n_columns, dtype=bool),
        )
    )
    assert len(found) == lines
    together = "lever_z_m of A, B is not determined (sigma 5 m; correlation +1.00 with each other)"
    assert found[0].startswith(together if lines == 1 else "A lever_z_m is not determined (sigma")


def test_a_boresight_is_judged_by_the_attitudes_that_determine_it():
    rough = replace(with_sigmas(boresight_z=np.radians(1.2)), limit_boresight_deg=3.0)
    assert not_determined(rough) == []
    assert "up to 1.2 degrees" in sentences.rough_boresights(rough)
    assert sentences.rough_boresights(with_sigmas()) == ""
    (line,) = not_determined(replace(rough, limit_boresight_deg=1.1))
    assert "boresight_kappa_deg" in line
    block = blocks.standard()
    rolled = np.tile(np.radians([3.0, 3.0, 5.0]), (len(block.trajectory), 1))
    assert estimates.boresight_limit(block) == estimates.LIMIT_BORESIGHT_DEG
    block = replace(block, trajectory=replace(block.trajectory, sigma_attitude=rolled))
    assert_allclose(estimates.boresight_limit(block), 3.0)


def test_an_open_parameter_has_an_infinite_sigma_and_says_so(found):
    opened = replace(found, open_columns=np.arange(found.n_columns) == 0)
    assert np.isinf(parameters(opened)[0].sigma)
    (line,) = not_determined(opened)
    assert line.startswith("CAM f_mm is not determined (left open by the observations;")


def test_an_open_turn_about_one_axis_opens_the_angles_that_it_moves(found):
    """A turn about the camera's x axis moves omega, phi and kappa of a turned camera."""
    opened = replace(found, open_columns=np.arange(found.n_columns) == found.layout.mount[0, 3])
    infinite = {p.key for p in parameters(opened) if np.isinf(p.sigma)}
    assert infinite == {"boresight_x", "boresight_y", "boresight_z"}


def test_a_camera_with_other_reported_values_has_these_and_keeps_the_others(found):
    camera = found.cameras[0]
    values = estimates.reported_values(camera)
    assert list(values) == [name for name, _ in estimates.REPORTED.values()]
    new = {"f_mm": 51.0, "lever_y_m": 0.5, "boresight_kappa_deg": 7.0, "no such name": 1.0}
    changed = estimates.reported_values(estimates.with_reported(camera, new))
    for name, value in values.items():
        assert_allclose(changed[name], new.get(name, value), rtol=1e-12, atol=1e-15)


# --- A flight is asked only for what it does not have


ALL = {"heights", "control", "opposite", "crosswise", "corners", "sides"}


def flown(strips=blocks.BOTH_WAYS, **options):
    options = {"ties": blocks.terrain(150, half_m=450.0), "control": blocks.crosses()} | options
    return blocks.simulate(blocks.fly(strips, tilt_deg=0.0), **options)


def test_a_flight_with_everything_has_every_feature():
    assert features(flown()) >= ALL


@pytest.mark.parametrize(
    ("strips", "lacking"),
    [
        (((1000.0, -150.0, 0.0), (1000.0, 150.0, 180.0)), {"heights", "crosswise"}),
        (((1000.0, 0.0, 0.0), (1500.0, 0.0, 0.0)), {"opposite", "crosswise"}),
        (((1000.0, 0.0, 0.0), (1500.0, 0.0, 90.0)), {"opposite"}),
    ],
)
def test_strips_lack_what_they_do_not_fly(strips, lacking):
    assert ALL - features(flown(strips)) == lacking


def test_points_in_two_strips_are_an_overlap():
    block = blocks.in_strips(blocks.standard(), 3)
    assert "overlap" in features(block)
    alone = select_images(block, np.array(block.images.strips) == "A")
    assert "overlap" not in features(alone)


def test_measurements_in_the_middle_are_neither_in_corners_nor_on_all_sides():
    over_one_place = ((1000.0, 0.0, 0.0), (1000.0, 0.0, 180.0))
    block = blocks.simulate(
        blocks.fly(over_one_place, base_m=20.0), ties=blocks.terrain(60, half_m=60.0)
    )
    assert not {"corners", "sides"} & features(block)


@pytest.mark.parametrize("key", [*REPORTED, "shift", "delay"])
def test_every_need_can_be_met(key):
    have = frozenset(name for _, any_of in NEEDS[key] for name in any_of.split()[:1])
    assert needed(key, have) == ENOUGH
    for text, any_of in NEEDS[key]:
        assert needed(key, have - set(any_of.split())) == text
    assert needed(key) == ", and ".join(text for text, _ in NEEDS[key])


def test_what_does_not_converge_says_what_its_block_lacks_and_what_helps():
    block = design.lowest_height(fly("single-head", seed=1).flight.calibration)
    bare = design.without_control(block)
    with pytest.raises(NotConverged) as error, saying_what_lacks(bare, ("f", "lever_z")):
        raise NotConverged("no convergence after 9 iterations")
    said = str(error.value)
    n = len(np.unique(bare.images.exposure_idx))
    assert said.startswith(f"no convergence after 9 iterations; {n} exposures may be too little")
    assert "It would need: control points or accurate GNSS heights; control points." in said
    assert said.endswith("estimate less: estimate and fix in flight.toml")
