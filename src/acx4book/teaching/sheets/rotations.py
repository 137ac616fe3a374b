"""Lab 2: the attitude of one exposure, from roll, pitch and heading to omega, phi and kappa."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, computed
from acx4book.teaching.grading import named, of_angles, of_rotation, values, wrong_sign
from acx4lib.expected import Array
from acx4lib.geometry.frames import (
    opk_from_rotation,
    rotation_from_opk,
    rotation_from_rph,
    turn,
)
from acx4sim.files import SimulatedFlight

GAMMA = "convergence_deg"
BODY = ("body_omega_deg", "body_phi_deg", "body_kappa_deg")
CAMERA = ("camera_omega_deg", "camera_phi_deg", "camera_kappa_deg")
IMAGE = 1
"""Index of the exposure: the second."""

NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""North, east, down to east, north, up."""

FRD = np.diag([1.0, -1.0, -1.0])
"""Forward, right, down to forward, left, up."""

GREEK = ("ω", "φ", "κ")

QUESTIONS = (
    Question(
        name=GAMMA,
        unit="deg",
        asks="meridian convergence at the exposure, true azimuth minus grid azimuth",
        digits=4,
    ),
    *(
        Question(name=name, unit="deg", asks=f"{angle} of the IMU's body, on the grid", digits=3)
        for name, angle in zip(BODY, GREEK, strict=True)
    ),
    *(
        Question(name=name, unit="deg", asks=f"{angle} of the camera, on the grid", digits=3)
        for name, angle in zip(CAMERA, GREEK, strict=True)
    ),
)


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly one strip with a known camera."""
    camera = flights.drawn_camera(truth)
    known = flights.certificate(camera)
    return flights.fly(errors, title, camera, flights.WHOLE[:1], known=known)


def _given(case: Case) -> Sequence[str]:
    """Return the student's exposure."""
    return [
        f"Your exposure is `{case.block.images.names[IMAGE]}`. The boresight is known: the "
        "`mount_*` angles in `flight.toml`."
    ]


def _gamma(case: Case) -> float:
    """Return the convergence, radians."""
    frame = case.block.frame
    return float(frame.grid.convergence(_place(case)[None, :2])[0])


def _place(case: Case) -> Array:
    """Return longitude and latitude, degrees, and height of the exposure."""
    return case.block.frame.to_geographic(case.block.T_m_b_images.r[[IMAGE]])[0]


def _rph(case: Case) -> Array:
    """Return roll, pitch and heading as the trajectory has them, radians."""
    table = case.flight.trajectories["calibration"]
    exposure = case.block.trajectory.exposures[case.block.images.exposure_idx[IMAGE]]
    row = table.text["exposure"].index(exposure)
    return np.radians(table.stack("roll_deg", "pitch_deg", "heading_deg")[row])


def _body(case: Case, *, gamma: float, rph: Array | None = None) -> Array:
    """Return R_g_b: body axes to the grid's."""
    R_n_b = rotation_from_rph(_rph(case) if rph is None else rph)
    R_g_b: Array = turn(2, gamma) @ NED @ R_n_b @ FRD
    return R_g_b


def _opk_deg(R: Array) -> Array:
    return np.degrees(opk_from_rotation(R))


def _solve(case: Case) -> Rights:
    """Turn the body's attitude, then the camera's."""
    block = case.block
    R_g_m = block.trajectory.R_g_m[block.images.exposure_idx[IMAGE]]
    R_g_b = R_g_m @ block.T_m_b_images[IMAGE].R
    R_b_c = block.cameras[0].T_b_c.R
    angles = {
        GAMMA: float(np.degrees(_gamma(case))),
        **named(BODY, _opk_deg(R_g_b)),
        **named(CAMERA, _opk_deg(R_g_b @ R_b_c)),
    }
    digits = {question.name: question.digits for question in QUESTIONS}
    return {name: computed(value, digits[name]) for name, value in angles.items()}


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with attitudes."""
    yield wrong_sign(right, [GAMMA], "the convergence has the wrong sign: true minus grid azimuth")
    yield from of_angles(right, [GAMMA])
    for names in (BODY, CAMERA):
        yield from of_rotation(right, names)
    R_b_c = case.block.cameras[0].T_b_c.R
    for says, R_g_b in _wrong_bodies(case):
        gives = {**named(BODY, _opk_deg(R_g_b)), **named(CAMERA, _opk_deg(R_g_b @ R_b_c))}
        yield Mistake(says=says, gives=gives)
    yield Mistake(
        says="the convergence is not zero: it is zero on the central meridian of the map alone",
        gives={GAMMA: 0.0},
    )
    yield Mistake(
        says="κ is the heading: that turns clockwise from north, κ counter-clockwise from east",
        gives={BODY[2]: float(np.degrees(_rph(case)[2]))},
    )
    yield from _wrong_cameras(right, R_b_c)


def _wrong_bodies(case: Case) -> Iterator[tuple[str, Array]]:
    """Yield wrong R_g_b by common mistakes."""
    gamma, rph = _gamma(case), _rph(case)
    yield (
        "the meridian convergence is forgotten: heading counts from true north, κ on the grid",
        _body(case, gamma=0.0),
    )
    yield "the meridian convergence has the wrong sign", _body(case, gamma=-gamma)
    yield "roll and pitch are swapped", _body(case, gamma=gamma, rph=rph[[1, 0, 2]])
    yield (
        "the body's axes are forward, right, down; here they are forward, left, up",
        _body(case, gamma=gamma) @ FRD,
    )
    yield (
        "90° are missing: heading counts from north, κ from east",
        turn(2, -np.pi / 2) @ _body(case, gamma=gamma),
    )


def _wrong_cameras(right: Rights, R_b_c: Array) -> Iterator[Mistake]:
    """Yield wrong angles of the camera by common mistakes."""
    body = values(right, BODY)
    R_g_b = rotation_from_opk(np.radians(body))
    yield Mistake(
        says="these are the body's angles: multiply by the boresight",
        gives=named(CAMERA, body),
    )
    yield Mistake(
        says="these are the camera's angles; asked for the body's",
        gives=named(BODY, values(right, CAMERA)),
    )
    yield Mistake(
        says="the boresight is transposed: it takes camera axes to the body's",
        gives=named(CAMERA, _opk_deg(R_g_b @ R_b_c.T)),
    )
    yield Mistake(
        says="the matrices are multiplied in the wrong order: inner letters must touch",
        gives=named(CAMERA, _opk_deg(R_b_c @ R_g_b)),
    )
    yield Mistake(
        says="angles are added: rotations are multiplied as matrices",
        gives=named(CAMERA, body + _opk_deg(R_b_c)),
    )


SHEET = Sheet(
    name="lab-2",
    title="Rotations: the attitude of one exposure",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
