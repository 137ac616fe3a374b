"""Labs 4 to 7, on calibrations: lens, gross errors, mounting, and all estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import (
    Case,
    Mistake,
    Question,
    Right,
    Rights,
    Sheet,
    computed,
    estimated,
)
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
from acx4files.results.tables import covariance
from acx4files.stages.mounting import calibrate
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.calibration import estimates
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.mounting import Mountings
from acx4lib.expected import Array
from acx4lib.geometry.camera import Interior, distortion
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk, turn
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.model import Model
from acx4sim.files import SimulatedFlight
from acx4sim.plan import GrossErrors, Options

# --- lab 7: estimated parameters as right answers --------------------------------------------


TITLES = {
    "f_mm": "focal length",
    "xp_mm": "x of the principal point",
    "yp_mm": "y of the principal point",
    "lever_x_m": "x of the lever arm",
    "lever_y_m": "y of the lever arm",
    "lever_z_m": "z of the lever arm",
    "boresight_omega_deg": "ω of the boresight",
    "boresight_phi_deg": "φ of the boresight",
    "boresight_kappa_deg": "κ of the boresight",
}
"""Parameters in words."""


def parameters(calibration: Calibration, truth: Mapping[str, float]) -> dict[str, Right]:
    """Return calibrated parameters of one camera as answers, with their simulated values."""
    return {
        p.name: estimated(p.value, p.sigma, truth[p.name])
        for p in estimates.parameters(calibration)
        if p.name in truth
    }


# --- Lab 7: the calibration proved on an independent block: bias, precision, accuracy


AXES = ("east", "north", "height")
RMS = tuple(f"rms_{axis}_m" for axis in AXES)
ALLOWED_M = 0.15
"""Standard deviation of heights allowed in the accuracy class of the sheet, m."""

N, MEAN, STD, T, CHI = "n_points", "mean_height_m", "std_height_m", "t_height", "chi2_height"

QUESTIONS_ESTIMATES = (
    Question(name=N, unit="", asks="number of check points that were compared", digits=0),
    *(
        Question(name=name, unit="m", asks=f"RMS of the differences in {axis}", digits=3)
        for name, axis in zip(RMS, AXES, strict=True)
    ),
    Question(name=MEAN, unit="m", asks="mean of the differences in height", digits=3),
    Question(name=STD, unit="m", asks="standard deviation of the differences in height", digits=3),
    Question(name=T, unit="", asks="t of the mean in height: is there a bias?", digits=2),
    Question(
        name=CHI,
        unit="",
        asks=f"χ² of the standard deviation in height against σ = {ALLOWED_M} m",
        digits=1,
    ),
)


def _fly_estimates(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the whole block and an independent one."""
    camera = flights.drawn_camera(truth)
    return flights.fly(errors, title, camera, flights.WHOLE, proof=flights.PROOF)


def _given_estimates(case: Case) -> Sequence[str]:
    """Return the number of check points, in a sentence."""
    return [f"{len(case.flight.block('validation').check)} check points are in the images."]


def _validation(case: Case) -> Validation:
    single = calibrate(case.flight)["single_step"].calibration
    return validate(case.flight.block("validation"), single, method="single_step")


def _statistics(d: Array, *, ddof: int = 1) -> dict[str, float]:
    """Return the statistics of differences, shape (n, 3), m, by question."""
    n, height = len(d), d[:, 2]
    mean, std = height.mean(), height.std(ddof=ddof)
    return {
        N: float(n),
        **named(RMS, np.sqrt((d**2).mean(axis=0))),
        MEAN: float(mean),
        STD: float(std),
        T: float(mean / (std / np.sqrt(n))),
        CHI: float((n - 1) * (std / ALLOWED_M) ** 2),
    }


def _solve_estimates(case: Case) -> Rights:
    """Calibrate, and compare the check points."""
    statistics = _statistics(_validation(case).points.d)
    digits = {question.name: question.digits for question in QUESTIONS_ESTIMATES}
    right = {name: computed(value, digits[name]) for name, value in statistics.items()}
    return {**right, N: computed(statistics[N], 1)}


def _mistakes_estimates(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with differences."""
    checked = _validation(case)
    d, (n, mean, std, chi) = checked.points.d, values(right, (N, MEAN, STD, CHI))
    yield Mistake(
        says="pairs are counted: pairs of one point are not independent; one difference per point",
        gives=_statistics(checked.pairs.d),
    )
    yield wrong_sign(right, [MEAN, T], "the sign is wrong: estimated less surveyed")
    yield Mistake(
        says="the RMS divides by n − 1; it has no mean to be estimated, so by n",
        gives=named(RMS, values(right, RMS) * np.sqrt(n / (n - 1))),
    )
    yield Mistake(
        says="these are standard deviations: the RMS holds the mean, too",
        gives=named(RMS, d.std(axis=0, ddof=1)),
    )
    biased = _statistics(d, ddof=0)
    yield Mistake(
        says="divided by n; the mean was estimated, so by n − 1",
        gives={name: biased[name] for name in (STD, T, CHI)},
    )
    yield Mistake(says="this is the RMS: take the mean off first", gives={STD: right[RMS[2]].value})
    yield Mistake(
        says="the σ of the mean is the standard deviation divided by √n",
        gives={T: float(mean / std)},
    )
    yield Mistake(says="n in place of n − 1", gives={CHI: float(chi * n / (n - 1))})
    yield Mistake(says="the ratio is not squared", gives={CHI: float((n - 1) * std / ALLOWED_M)})
    yield Mistake(says="(n − 1) is forgotten", gives={CHI: float(chi / (n - 1))})
    yield scaled(right, [*RMS, MEAN, STD], 1000.0, "given in mm; asked for in m")
    yield scaled(right, [*RMS, MEAN, STD], 100.0, "given in cm; asked for in m")


LAB_7 = Sheet(
    name="lab-7",
    title="Proof on an independent block",
    fly=_fly_estimates,
    questions=QUESTIONS_ESTIMATES,
    given=_given_estimates,
    solve=_solve_estimates,
    mistakes=_mistakes_estimates,
)


# --- lab 4: the lens from a calibration, distortion in micrometres ---------------------------


INNER = ("f_mm", "xp_mm", "yp_mm")
RADII_MM = (10.0, 20.0, 30.0)
RADIAL = tuple(f"dr_{radius:.0f}_um" for radius in RADII_MM)
PLACE_MM = (20.0, 15.0)
AT_PLACE = ("dx_um", "dy_um")
LENS = ("k1", "k2", "k3", "p1", "p2")

QUESTIONS_LENS = (
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


def _fly_lens(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly two heights, crossing and opposite strips."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE)


def _given_lens(case: Case) -> Sequence[str]:
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
    return calibrate(case.flight)["single_step"].calibration


def _solve_lens(case: Case) -> Rights:
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


def _mistakes_lens(case: Case, right: Rights) -> Iterator[Mistake]:
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


LAB_4 = Sheet(
    name="lab-4",
    title="The lens",
    fly=_fly_lens,
    questions=QUESTIONS_LENS,
    given=_given_lens,
    solve=_solve_lens,
    mistakes=_mistakes_lens,
)


# --- lab 5: one bundle, its residuals, and the gross errors ----------------------------------


CONTROL, ERROR = "control_point", "control_error_m"
GNSS, ATTITUDE = "gnss_exposure", "attitude_exposure"

QUESTIONS_GROSS_ERRORS = (
    Question(
        name=CONTROL, unit="", asks="number of the control point with an error: 7 for P07", digits=0
    ),
    Question(
        name=ERROR,
        unit="m",
        asks="its error, as surveyed less true, in the coordinate that is wrong",
        digits=1,
    ),
    Question(
        name=GNSS,
        unit="",
        asks="exposure with the largest error of position: 305 for C3-05",
        digits=0,
    ),
    Question(
        name=ATTITUDE,
        unit="",
        asks="exposure with the largest error of attitude: 305 for C3-05",
        digits=0,
    ),
    Question(name="rejected_points", unit="", asks="number of rejected image points", digits=0),
    Question(
        name="sigma0_squared",
        unit="",
        asks="σ0² of the single-step adjustment without the gross errors",
        digits=2,
    ),
    Question(
        name="smallest_error_px",
        unit="px",
        asks=f"smallest error of a measurement with σ = 0.4 px and redundancy 0.8 for which the "
        f"expected w is the critical value {CRITICAL}",
        digits=2,
    ),
)


def _fly_gross_errors(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the whole block, with one wrong target, one wrong position and one wrong heading."""
    rng = np.random.default_rng([truth, *b"gross errors"])
    planted = GrossErrors(
        image_points=0.01,
        image_px=(10.0, 200.0),
        control_m=round(float(rng.uniform(0.6, 1.6)), 2),
        gnss_m=round(float(rng.uniform(2.0, 4.0)), 2),
        heading_deg=round(float(rng.uniform(0.3, 0.6)), 2),
    )
    options = Options(gross_errors=planted)
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE, options=options)


def _given_gross_errors(case: Case) -> Sequence[str]:
    """Return number and kinds of the errors, in a sentence."""
    return [
        "One control point, the position of one exposure and the attitude of another are wrong, "
        f"and some of the {len(case.block.image_points)} image points."
    ]


def _planted(case: Case, kind: str) -> dict[str, Any]:
    return next(
        gross_error for gross_error in case.truth["gross_errors"] if gross_error["kind"] == kind
    )


def _solve_gross_errors(case: Case) -> Rights:
    """Look for gross errors as the command does."""
    bundle = calibrate(case.flight)["single_step"].bundle
    count = sum(rejection.kind == "image_point" for rejection in bundle.rejected)
    planted = sum(
        gross_error["kind"] == "image_point" for gross_error in case.truth["gross_errors"]
    )
    control = _planted(case, "control_point")
    error = next(value for name, value in control.items() if name.endswith("_m"))
    return {
        CONTROL: computed(_number(control["point"]), 1),
        ERROR: Right(value=error, truth=error, bound=0.15),
        GNSS: computed(_number(_planted(case, "gnss")["image_or_exposure"]), 1),
        ATTITUDE: computed(_number(_planted(case, "attitude")["image_or_exposure"]), 1),
        "rejected_points": Right(
            value=count, truth=planted, bound=max(0.5, abs(count - planted) + 0.5)
        ),
        "sigma0_squared": computed(bundle.solution.sigma0_sq, 2, share=0.03),
        "smallest_error_px": computed(CRITICAL * 0.4 / 0.8**0.5, 2),
    }


def _number(name: str) -> float:
    """Return the digits of a name as a number: 7 of P07, 305 of C3-05."""
    return float("".join(c for c in name if c.isdigit()))


def _mistakes_gross_errors(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with gross errors."""
    yield wrong_sign(right, [ERROR], "the sign is wrong: surveyed less true")
    yield scaled(right, [ERROR], 100.0, "given in cm; asked for in m")
    yield swapped(right, GNSS, ATTITUDE, "the exposures are swapped: position and attitude")
    spoiled = adjust(mounted_orientation(case.block, Model(free=case.flight.estimate_mounting)))
    yield Mistake(
        says="the gross errors are still among the observations",
        gives={"sigma0_squared": spoiled.solution.sigma0_sq},
    )
    bundle = calibrate(case.flight)["single_step"].bundle
    yield Mistake(
        says="all rejections are counted; asked for those of image points",
        gives={"rejected_points": float(len(bundle.rejected))},
    )
    for says, wrong in (
        ("the redundancy is forgotten: a residual shows only this part of an error", 0.4),
        ("divided by the redundancy, not by its root", 0.4 / 0.8),
        ("multiplied by the root of the redundancy; divide", 0.4 * 0.8**0.5),
        ("given in σ; asked for in pixels", 1.0 / 0.8**0.5),
    ):
        yield Mistake(says=says, gives={"smallest_error_px": CRITICAL * wrong})


LAB_5 = Sheet(
    name="lab-5",
    title="Residuals and gross errors",
    fly=_fly_gross_errors,
    questions=QUESTIONS_GROSS_ERRORS,
    given=_given_gross_errors,
    solve=_solve_gross_errors,
    mistakes=_mistakes_gross_errors,
)


# --- lab 6: boresight and lever arm, by steps and from one image -----------------------------


BORESIGHT = ("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg")
LEVER = ("lever_x_m", "lever_y_m", "lever_z_m")
OF_IMAGE = tuple(f"image_{name}" for name in (*LEVER, *BORESIGHT))
TWO_STEP = "two_step_lever_z_m"
IMAGE = 2
"""Index of the image for the computation by hand: the third."""

QUESTIONS_MOUNTING = (
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


def _fly_mounting(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly two heights, crossing and opposite strips."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE)


def _given_mounting(case: Case) -> Sequence[str]:
    """Return the student's image."""
    return [f"Your image is `{case.block.images.names[IMAGE]}`."]


def _solve_mounting(case: Case) -> Rights:
    """Calibrate by both methods."""
    methods = calibrate(case.flight)
    single, two = _by_method(case, methods)
    of_image = named(OF_IMAGE, _reported(_of_image(methods)))
    digits = {question.name: question.digits for question in QUESTIONS_MOUNTING}
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


def _mistakes_mounting(case: Case, right: Rights) -> Iterator[Mistake]:
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
    single, two = _by_method(case, calibrate(case.flight))
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


LAB_6 = Sheet(
    name="lab-6",
    title="Boresight and lever arm",
    fly=_fly_mounting,
    questions=QUESTIONS_MOUNTING,
    given=_given_mounting,
    solve=_solve_mounting,
    mistakes=_mistakes_mounting,
)
