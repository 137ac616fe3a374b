"""Conventions are found: search, mounted cameras, readings."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4files import conventions
from acx4files.conventions import (
    MOST_IMAGES,
    MOST_MEASUREMENTS,
    RIGHT,
    SHARED,
    Found,
    Moves,
    best_reading,
    measuring_noise,
    mounted,
    notes,
    other_unit,
    sightings,
    size,
)
from acx4files.flight.reader import read
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import Pose, turn
from support.flights import planted, simulated
from support.helpers import repeats, rotation_angle

# --- mistakes planted in flights are named, clean flights get no sentence --------------------


VARIANTS = list(product(planted.DESIGNS, ("small", "medium"), planted.FORMS))


def cases():
    """Return every mistake in two of the variants, all variants in turn."""
    turn = cycle(VARIANTS)
    for number, (name, mistake) in enumerate(planted.MISTAKES.items()):
        usual = mistake.forms[number % len(mistake.forms)]
        for form in mistake.forms:
            design, size = next((d, s) for d, s, f in turn if f == form)
            case = f"{name}, {design}, {size}, {form}"
            marks = () if form == usual else pytest.mark.repeats
            yield pytest.param(name, design, size, form, id=case, marks=marks)


def said(folder):
    """Return what `acx4 check` says of the calibration block."""
    try:
        flight = read(folder)
    except FlightError as error:
        return str(error)
    found = best_reading(flight, "calibration")
    return found.sentence if found else ""


@pytest.mark.parametrize(("name", "design", "size", "form"), list(cases()))
def test_a_planted_mistake_is_named(tmp_path, name, design, size, form):
    mistake = planted.MISTAKES[name]
    flight = planted.clean(design, form, size)
    message = said(planted.write(flight, tmp_path / "flight", mistake))
    assert planted.is_right(mistake, form, message), message


@pytest.mark.parametrize(("design", "size", "form"), VARIANTS)
@pytest.mark.parametrize("seed", [1, repeats(2), repeats(3)])
def test_a_clean_flight_gets_no_sentence(tmp_path, design, size, form, seed):
    flight = planted.clean(design, form, size, seed=seed)
    assert said(planted.write(flight, tmp_path / "flight")) == ""


@pytest.mark.parametrize("name", ["sign of roll", "gon", "the next row", "row from the bottom"])
@pytest.mark.parametrize("form", planted.FORMS)
def test_tie_points_are_enough(tmp_path, name, form):
    mistake = planted.MISTAKES[name]
    flight = planted.clean("single-head", form, "small")
    for folder, planted_in in (("right", None), ("wrong", mistake)):
        planted.write(flight, tmp_path / folder, planted_in)
        control = pd.read_csv(tmp_path / folder / "control_points.csv")
        control[:0].to_csv(tmp_path / folder / "control_points.csv", index=False)
    assert said(tmp_path / "right") == ""
    assert planted.is_right(mistake, form, said(tmp_path / "wrong"))


def test_too_few_exposures_say_nothing(tmp_path):
    folder = planted.write(
        planted.clean("single-head", "geodetic", "small"),
        tmp_path / "flight",
        planted.MISTAKES["sign of roll"],
    )
    images = pd.read_csv(folder / "calibration/images.csv")[:5]
    points = pd.read_csv(folder / "calibration/image_points.csv")
    images.to_csv(folder / "calibration/images.csv", index=False)
    points[points["image"].isin(images["image"])].to_csv(
        folder / "calibration/image_points.csv", index=False
    )
    assert best_reading(read(folder), "calibration") is None


def test_gross_errors_do_not_hide_a_sign(tmp_path):
    folder = planted.write(
        planted.clean("single-head", "geodetic", "medium"),
        tmp_path / "flight",
        planted.MISTAKES["sign of pitch"],
    )
    points = pd.read_csv(folder / "calibration/image_points.csv")
    points.loc[::20, "col_px"] += 60.0  # 5 %
    points.to_csv(folder / "calibration/image_points.csv", index=False)
    (sentence,) = notes(read(folder))
    assert sentence.startswith("calibration: with pitch of opposite sign the residuals of attitude")


@pytest.mark.parametrize(
    ("given", "found", "unit", "says"),
    [
        (0.61, 0.0061, "°", "the residuals of it fall from 0.61° to 0.0061°"),
        (418.2, 0.16, "m", "the residuals of it fall from 418 m to 0.16 m"),
        (3e-4, 1.04, "σ", "the residuals of it rise from 0.0003 σ to 1 σ"),
        (np.inf, 1.2, "px", "the residuals of it are 1.2 px; as the numbers are, rays do not meet"),
    ],
)
def test_the_figure_stands_beside_the_given_one(given, found, unit, says):
    reading = Found(name="this", quantity="it", given=given, found=found, unit=unit)
    assert reading.sentence == f"with this {says}"


# --- Units of standard deviations, by what the residuals are in terms of them


@pytest.fixture(scope="module")
def block():
    return simulated.fly("single-head", seed=1, blocks=("calibration",)).flight.calibration


def unit_of(block):
    seen = sightings(block)
    return other_unit(block, seen, mounted(seen, block.trajectory.T_m_b[seen.exposures]))


def with_sigma(block, *, attitude=1.0, position=1.0, image=1.0):
    trajectory, points = block.trajectory, block.image_points
    return replace(
        block,
        trajectory=replace(
            trajectory,
            sigma_attitude=attitude * trajectory.sigma_attitude,
            sigma_position=position * trajectory.sigma_position,
        ),
        image_points=replace(points, sigma_px=image * points.sigma_px),
    )


@pytest.mark.parametrize(
    ("factors", "name"),
    [
        ({"attitude": 3600.0}, "sigma of attitude in seconds of arc"),
        ({"attitude": 60.0}, "sigma of attitude in minutes of arc"),
        ({"attitude": np.pi / 180}, "sigma of attitude in radians"),
        ({"position": 1000.0}, "sigma of position in mm"),
        ({"image": 0.0046}, "sigma of image measurements in mm"),
    ],
)
def test_a_sigma_in_another_unit_is_named(block, factors, name):
    found = unit_of(with_sigma(block, **factors))
    assert found is not None
    assert found.name == name
    assert 0.6 < found.found < 1.6  # residuals agree with sigma then


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0, 4.0])
def test_a_sigma_that_is_a_little_wrong_is_no_other_unit(block, factor):
    assert unit_of(with_sigma(block, attitude=factor, position=factor, image=factor)) is None


def test_metres_of_a_receiver_without_corrections_are_no_millimetres(block):
    """Its error hardly changes from exposure to exposure, so that residuals are small."""
    sigma = np.full_like(block.trajectory.sigma_position, 3.0)
    found = unit_of(replace(block, trajectory=replace(block.trajectory, sigma_position=sigma)))
    assert found is not None
    assert (found.name, found.quantity) == (SHARED, "position")
    assert found.given < 0.1


# --- mountings on a trajectory taken as exact: derivatives, truth, robustness ----------------


@pytest.fixture(scope="module")
def flown():
    return simulated.fly("single-head", seed=1, blocks=("calibration",), exact=True)


@pytest.fixture(scope="module")
def mounted_block(flown):
    return flown.flight.calibration


def body(block, seen):
    return block.trajectory.T_m_b[seen.exposures]


def test_exact_data_give_the_truth(flown, mounted_block):
    seen = sightings(mounted_block)
    found = mounted(seen, body(mounted_block, seen))
    true = flown.truth["cameras"]["CAM"]
    (camera,) = found.cameras
    assert found.misfit < 1e-8  # 1e-4 px; the prior of the lens pulls by less
    assert_allclose(camera.interior.f, true["f_mm"], atol=2e-3)
    assert_allclose(camera.T_b_c.r, [true[f"lever_{a}_m"] for a in "xyz"], atol=0.03)


def test_any_start_of_the_boresight_does(mounted_block):
    seen = sightings(mounted_block)
    (camera,) = seen.cameras
    right = mounted(seen, body(mounted_block, seen))
    away = replace(camera, T_b_c=Pose(R=camera.T_b_c.R @ turn(0, 2.5), r=camera.T_b_c.r))
    found = mounted(replace(seen, cameras=(away,)), body(mounted_block, seen))
    assert rotation_angle(found.cameras[0].T_b_c.R, right.cameras[0].T_b_c.R) < 1e-6


def test_a_delay_is_told_from_a_lever_arm_that_cannot_be(mounted_block):
    seen = sightings(mounted_block)
    speed = 70.0 * mounted_block.trajectory.T_m_b.R[seen.exposures, :, 0]
    late = Pose(R=body(mounted_block, seen).R, r=body(mounted_block, seen).r + 0.5 * speed)
    assert mounted(seen, late).misfit > 0.005  # of 35 m in 600 m to 1000 m; the boresight helps
    found = mounted(seen, late, Moves("r", speed[:, :, None], str, (1.0,), sigma=10.0))
    assert_allclose(found.sizes, [-0.5], atol=0.01)
    assert found.misfit < 1e-4


def test_derivatives_agree_with_differences(mounted_block):
    seen = sightings(mounted_block)
    T_m_b = body(mounted_block, seen)
    velocity = np.random.default_rng(1).normal(size=(len(seen.exposures), 3, 1))
    moves = Moves("r", velocity, str, (1.0,))
    state = replace(conventions.started(seen, T_m_b), sizes=np.array([0.1]))
    v, A, B = conventions._linear(seen, T_m_b, state, moves)
    steps = np.array([*[1e-6] * 3, *[1e-3] * 6, 1e-9, 1e-12, 1e-15, 1e-8, 1e-8, 1e-4])
    for column, dx in enumerate(np.diag(steps)):
        there, back = (
            conventions._linear(seen, T_m_b, conventions._moved(state, s * dx, state.x_m), moves)[0]
            for s in (1, -1)
        )
        numeric = (there - back) / (2 * steps[column])
        assert_allclose(A[:, :, column], numeric, atol=1e-5 * np.abs(numeric).max())
    shifted = replace(state, x_m=state.x_m + np.array([0.0, 0.0, 1e-3]))
    numeric = (conventions._linear(seen, T_m_b, shifted, moves)[0] - v) / 1e-3
    assert_allclose(B[:, :, 2], numeric, atol=1e-5 * np.abs(numeric).max())


def test_size_is_the_standard_deviation_of_normal_residuals():
    v = np.random.default_rng(2).normal(scale=[2.0, 2.0], size=(40_000, 2))
    assert_allclose(size(v), 2.0, rtol=0.02)  # 40 000 numbers: 0.5 %
    v[::20] = np.nan  # one in twenty behind the camera
    assert size(v) < 2.3


def test_noise_of_measuring_is_found_under_errors_of_the_trajectory(mounted_block):
    rng = np.random.default_rng(3)
    seen = sightings(mounted_block)
    px = seen.cameras[0].pixel_mm / seen.cameras[0].interior.f
    noisy = replace(seen, colrow=seen.colrow + 0.5 * rng.normal(size=seen.colrow.shape))
    T_m_b = body(mounted_block, seen)
    shaken = Pose(R=T_m_b.R, r=T_m_b.r + rng.normal(size=T_m_b.r.shape))
    found = mounted(noisy, shaken)
    assert found.misfit > 5 * px  # 1 m are 15 px
    noise = measuring_noise(noisy, shaken, found)  # the lens takes up a part of the metre
    assert 1 / RIGHT < noise / (0.5 * px) < RIGHT


# --- which measurements readings are compared by ---------------------------------------------


def block_of(tmp_path, size):
    flight = planted.clean("single-head", "grid", size)
    return read(planted.write(flight, tmp_path / "flight")).calibration


def test_surveyed_points_are_enough_where_there_are_some(tmp_path):
    block = block_of(tmp_path, "medium")
    seen = sightings(block)
    assert len(seen.exposures) == 37
    assert np.isfinite(seen.x_m).all()
    names = [block.points[i] for i in block.control.point_idx]
    assert len(seen.x_m) == len(names)


def test_sixty_images_of_a_large_block_are_looked_at(tmp_path):
    block = block_of(tmp_path, "large")
    for own in (sightings(block), sightings(_without_control(block))):
        assert MOST_IMAGES / 2 < len(own.exposures) <= MOST_IMAGES
        assert len(own) <= 1.05 * MOST_MEASUREMENTS  # rays of whole tie points
        assert own.point_idx.max() == len(own.x_m) - 1


def _without_control(block):
    none = np.zeros(len(block.control), dtype=bool)
    return replace(block, control=block.control[none])
