"""Lab 6: boresight and lever arm by single step, by two steps, and from one image."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, computed
from acx4book.teaching.grading import (
    named,
    of_rotation,
    scaled,
    swapped,
    too_small,
    values,
    variances,
    wrong_sign,
)
from acx4book.teaching.sheets.estimates import TITLES, parameters
from acx4lib.calibration.mounting import Mountings
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk, turn
from acx4lib.stages.mounting import calibrate
from acx4sim.files import SimulatedFlight

BORESIGHT = ("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg")
LEVER = ("lever_x_m", "lever_y_m", "lever_z_m")
OF_IMAGE = tuple(f"image_{name}" for name in (*LEVER, *BORESIGHT))
TWO_STEP = "two_step_lever_z_m"
IMAGE = 2
"""Index of the image for the computation by hand: the third."""

QUESTIONS = (
    *(
        Question(
            name=name,
            unit="deg" if name in BORESIGHT else "m",
            asks=f"{TITLES[name]}, single-step method",
            digits=4,
            with_sigma=True,
        )
        for name in (*BORESIGHT, *LEVER)
    ),
    Question(
        name=TWO_STEP,
        unit="m",
        asks="z of the lever arm, two-step method",
        digits=3,
        with_sigma=True,
    ),
    *(
        Question(
            name=f"image_{name}",
            unit="deg" if name in BORESIGHT else "m",
            asks=f"{TITLES[name]}, from your image alone",
            digits=3 if name in BORESIGHT else 2,
        )
        for name in (*LEVER, *BORESIGHT)
    ),
)


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly two heights, crossing and opposite strips."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE)


def _given(case: Case) -> Sequence[str]:
    """Return the student's image."""
    return [f"Your image is `{case.block.images.names[IMAGE]}`."]


def _solve(case: Case) -> Rights:
    """Calibrate by both methods."""
    methods = calibrate(case.flight).mountings
    single, two = _by_method(case, methods)
    of_image = named(OF_IMAGE, _reported(_of_image(methods)))
    digits = {question.name: question.digits for question in QUESTIONS}
    by_hand = {name: computed(value, digits[name]) for name, value in of_image.items()}
    return {
        **{name: single[name] for name in (*BORESIGHT, *LEVER)},
        TWO_STEP: two["lever_z_m"],
        **by_hand,
    }


def _by_method(case: Case, methods: Mountings) -> tuple[Rights, Rights]:
    """Return the parameters of the single-step and of the two-step method."""
    single, two = (
        parameters(methods[method].calibration, case.true_camera)
        for method in ("single_step", "two_step")
    )
    return single, two


def _of_image(methods: Mountings) -> Pose:
    """Return the mounting of the image by eqs (12) and (13)."""
    per_image = methods["two_step"].per_image
    if per_image is None:
        msg = "the two-step method has a mounting of every image"
        raise ValueError(msg)
    return per_image[IMAGE]


def _reported(T: Pose) -> Array:
    return np.concatenate([T.r, np.degrees(T.opk)])


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with a mounting."""
    for prefix in ("", "image_"):
        angles = [prefix + name for name in BORESIGHT]
        lever = [prefix + name for name in LEVER]
        yield from of_rotation(right, angles)
        yield wrong_sign(
            right, lever, "the lever arm's sign is wrong: it goes from the IMU to the camera"
        )
        yield swapped(
            right, lever[0], lever[1], "x and y are swapped: the body's x is forward, y left"
        )
        yield scaled(right, lever, 1000.0, "given in mm; asked for in m")
    yield from _wrong_axes(case, right)
    yield from _other_methods(case)
    yield variances(right)
    n = len(case.block.images)
    yield too_small(right, dict.fromkeys((*BORESIGHT, *LEVER, TWO_STEP), n), f"{n} images")


def _other_methods(case: Case) -> Iterator[Mistake]:
    """Yield the mistakes of answers from the other method."""
    single, two = _by_method(case, calibrate(case.flight).mountings)
    for says, rights, names in (
        ("this is of the two-step method; asked for the single step", two, (*BORESIGHT, *LEVER)),
        ("this is of the single step; asked for the two-step method", single, (TWO_STEP,)),
    ):
        answers = {name: rights[name.removeprefix("two_step_")] for name in names}
        yield Mistake(
            says=says,
            gives={name: right.value for name, right in answers.items()},
            gives_sigma={n: right.sigma for n, right in answers.items() if right.sigma is not None},
        )


def _wrong_axes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield the mistakes of an image's mounting in wrong axes."""
    lever, opk = np.split(values(right, OF_IMAGE), 2)
    T_m_b = case.block.T_m_b_images[IMAGE]
    R_g_m = case.block.trajectory.R_g_m[case.block.images.exposure_idx[IMAGE]]
    R_g_b = R_g_m @ T_m_b.R
    R_b_c = rotation_from_opk(np.radians(opk))
    yield Mistake(
        says="the lever arm is in mapping axes: turn it into the body, eq. (12)",
        gives=named(OF_IMAGE[:3], R_g_b @ lever),
    )
    yield Mistake(
        says="the lever arm is in camera axes: turn it by the body's attitude, not the camera's",
        gives=named(OF_IMAGE[:3], R_b_c.T @ lever),
    )
    yield Mistake(
        says="these are the angles of the camera against the grid: take the body's off, eq. (13)",
        gives=named(OF_IMAGE[3:], np.degrees(opk_from_rotation(R_g_b @ R_b_c))),
    )
    yield from _convergence(case, R_g_b, R_b_c)


def _convergence(case: Case, R_g_b: Array, R_b_c: Array) -> Iterator[Mistake]:
    """Yield the mistake of headings counted from grid north."""
    frame = case.block.frame
    place = frame.to_geographic(case.block.T_m_b_images.r[[IMAGE]])[:, :2]
    gamma = float(frame.grid.convergence(place)[0])
    R_t_b = turn(2, -gamma) @ R_g_b
    yield Mistake(
        says="the meridian convergence is forgotten: headings count from true north",
        gives=named(OF_IMAGE[3:], np.degrees(opk_from_rotation(R_t_b.T @ R_g_b @ R_b_c))),
    )


SHEET = Sheet(
    name="lab-6",
    title="Boresight and lever arm",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
