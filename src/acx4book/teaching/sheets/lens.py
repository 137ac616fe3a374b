"""Lab 4: the lens from a calibration: distortion with standard deviations, micrometres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, estimated
from acx4book.teaching.grading import named, scaled, values, variances, wrong_sign
from acx4book.teaching.sheets.estimates import TITLES, parameters
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.geometry.camera import Interior, distortion
from acx4lib.results.tables import covariance
from acx4lib.stages.mounting import calibrate
from acx4sim.files import SimulatedFlight

INNER = ("f_mm", "xp_mm", "yp_mm")
RADII_MM = (10.0, 20.0, 30.0)
RADIAL = tuple(f"dr_{radius:.0f}_um" for radius in RADII_MM)
PLACE_MM = (20.0, 15.0)
AT_PLACE = ("dx_um", "dy_um")
LENS = ("k1", "k2", "k3", "p1", "p2")

QUESTIONS = (
    *(
        Question(name=name, unit="mm", asks=TITLES[name], digits=4, with_sigma=True)
        for name in INNER
    ),
    *(
        Question(
            name=name,
            unit="um",
            asks=f"radial distortion at a radius of {radius:.0f} mm",
            digits=2,
            with_sigma=True,
        )
        for name, radius in zip(RADIAL, RADII_MM, strict=True)
    ),
    *(
        Question(
            name=name,
            unit="um",
            asks=f"{name[:2]}: whole distortion {PLACE_MM[0]:.0f} mm right of and "
            f"{PLACE_MM[1]:.0f} mm above the principal point",
            digits=2,
            with_sigma=True,
        )
        for name in AT_PLACE
    ),
)


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly two heights, crossing and opposite strips."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE)


def _given(case: Case) -> Sequence[str]:
    """Return the half diagonal of the images, in a sentence."""
    camera = case.block.cameras[0]
    corner = camera.pixel_mm / 2 * np.hypot(camera.width_px, camera.height_px)
    return [f"The corners of the images are {corner:.1f} mm from their middle."]


def _um(lens: Interior) -> Array:
    """Return the five distortions of the questions, shape (5,), micrometres."""
    bare = replace(lens, xp=0.0, yp=0.0)
    radial = replace(bare, p1=0.0, p2=0.0)
    along = distortion(radial, np.array([[radius, 0.0] for radius in RADII_MM]))[:, 0]
    return 1e3 * np.concatenate([along, distortion(bare, np.array([PLACE_MM]))[0]])


def _jacobian() -> Array:
    """Return d(distortions) / d(k1, k2, k3, p1, p2), shape (5, 5): they are linear."""
    none = Interior(f=1.0)
    return np.column_stack([_um(replace(none, **{name: 1.0})) for name in LENS])


def _covariance(calibration: Calibration) -> Array:
    names = [f"CAM/{name}" for name in LENS]
    return covariance(calibration).loc[names, names].to_numpy()


def _calibration(case: Case) -> Calibration:
    return calibrate(case.flight).mountings["single_step"].calibration


def _solve(case: Case) -> Rights:
    """Calibrate, and propagate the covariance of the lens."""
    calibration = _calibration(case)
    J = _jacobian()
    sigma = np.sqrt(np.diagonal(J @ _covariance(calibration) @ J.T))
    estimates = parameters(calibration, case.true_camera)
    lens = _um(calibration.cameras[0].interior)
    true = _um(Interior(f=1.0, **{name: case.true_camera[name] for name in LENS}))
    return {
        **{name: estimates[name] for name in INNER},
        **{
            name: estimated(*map(float, answer))
            for name, answer in zip(
                (*RADIAL, *AT_PLACE), zip(lens, sigma, true, strict=True), strict=True
            )
        },
    }


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with a lens."""
    names = (*RADIAL, *AT_PLACE)
    yield wrong_sign(
        right, names, "this is the correction: the distortion is what is subtracted from a point"
    )
    yield scaled(right, names, 1e-3, "given in mm; asked for in µm")
    yield scaled(right, names, 1e-3 / case.block.cameras[0].pixel_mm, "given in pixels")
    yield wrong_sign(right, INNER[1:], "the principal point has the wrong sign")
    calibration = _calibration(case)
    lens = calibration.cameras[0].interior
    for says, wrong in (
        ("only k1 is used", replace(lens, k2=0.0, k3=0.0)),
        ("p1 and p2 are forgotten", replace(lens, p1=0.0, p2=0.0)),
        ("p1 and p2 are swapped", replace(lens, p1=lens.p2, p2=lens.p1)),
    ):
        yield Mistake(says=says, gives=named(names, _um(wrong)))
    r = np.array(RADII_MM)
    yield Mistake(
        says="divided by the radius: the distortion is r (k1 r² + k2 r⁴ + k3 r⁶)",
        gives=named(RADIAL, values(right, RADIAL) / r),
    )
    yield Mistake(
        says="this is at the point's distance from the middle, not its part along the axis",
        gives=dict.fromkeys(AT_PLACE, float(np.hypot(*values(right, AT_PLACE)))),
    )
    yield variances(right)
    alone = np.sqrt(_jacobian() ** 2 @ np.diagonal(_covariance(calibration)))
    yield Mistake(
        says="the covariances are forgotten: k1, k2 and k3 are strongly correlated",
        gives_sigma=named(names, alone),
    )


SHEET = Sheet(
    name="lab-4",
    title="The lens",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
