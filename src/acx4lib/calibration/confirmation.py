"""Tests of estimated mountings against declared ones, and known causes of a difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.observations import strips_of
from acx4lib.calibration.estimates import Calibration, from_bundle, is_determined, parameters
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, exp, log, rotation_from_opk
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import propagate, sigmas

# --- Are the estimated mountings the declared ones? Tests of the declared values
#
# Unknowns absorb systematic errors without a trace in the residuals: a delay at one speed is a
# lever arm, an undulation is one too, and true north in place of grid north is a boresight. Only
# declared values contradict them.


FAR_M, FAR_DEG = 0.05, 3.0
"""Differences from values without sigma that are reported: more than the errors of a survey."""

LONGEST_M = 10.0
"""Lever arm, not declared, that is longer than inside an aircraft."""

ALPHA = 1e-4
"""Probability of not confirming right values with right sigma: that of data snooping."""

NORTHS = 0.25
"""Share of the meridian convergence within which an angle without sigma equals it."""

LEAST_CONVERGENCE = np.radians(0.1)
"""Least meridian convergence that may explain an angle without sigma."""

SURVEYED_M = 0.03
"""Error of a lever arm measured by tape, m: within it, components agree."""

TURNED = np.radians(5.0)
"""Tolerance of boresight differences of 90 or 180 degrees, radians."""

EXCHANGED_DEG = 0.5
"""Least difference that an exchange of angles may explain."""

EXPLAINED = 0.12
"""Largest remaining share of a difference that an exchange of axes explains."""

BESIDE = 0.35
"""Largest share of a difference across an axis, within noise, to count as along this axis."""

UNSEEN = 1e-4
"""Share of a declared value's variance below which the other observations do not control it."""

SIGMAS = 3.0
"""Multiple of a standard deviation within which an angle differs by the convergence."""


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """A declared part of a mounting beside the estimated one.

    Attributes
    ----------
    camera : str
    part : str
        ``"lever arm"`` or ``"boresight"``.
    difference : tuple of float
        Estimated, by the other observations alone, minus declared: along or about the body's x,
        y, z axes, m or degrees; NaN where nothing is declared.
    p : float
        Probability of such differences or larger ones; NaN where there is no sigma.
    statement : str
        The difference in words, with possible causes; empty where nothing is declared.
    mistake : str
        The known mistake that explains the difference; empty if none does.
    """

    camera: str
    part: str
    difference: tuple[float, float, float]
    p: float
    statement: str = ""
    mistake: str = ""

    @property
    def objection(self) -> str:
        """Why the declared value is not confirmed: its sigma, or a known mistake; else empty."""
        if self.mistake or self.p < ALPHA:
            return "; ".join(filter(None, (self.statement, self.mistake)))
        return ""

    @property
    def sentence(self) -> str:
        """A sentence with the part, its camera and the objection."""
        return f"not confirmed: {self.part} of {self.camera} {self.objection}"

    @property
    def remark(self) -> str:
        """A remark on a declared approximation, without sigma, that is far off; else empty."""
        size = np.linalg.norm(np.nan_to_num(self.difference))
        far = FAR_M if self.part == "lever arm" else FAR_DEG
        if self.objection or not self.statement or np.isfinite(self.p) or not size > far:
            return ""
        return f"{self.part} of {self.camera} {self.statement}"


def confirmations(bundle: Bundle) -> list[Confirmation]:
    """Compare the mountings that a bundle estimated with the declared ones.

    Parts that are held, not determined, or not declared are left out.

    Parameters
    ----------
    bundle : Bundle
        With the mountings as unknowns; its block has the cameras as declared.

    Notes
    -----
    Declared values with sigma are observations of the bundle. Let d be the estimates minus the
    declared values, D the variances of these and Q the covariance of the estimates. Then D - Q is
    the covariance of d, d' (D - Q)^-1 d is chi-square with as many degrees of freedom as values,
    and D (D - Q)^-1 d is the difference that the other observations alone would have.
    """
    block, calibration = bundle.network.block, from_bundle(bundle)
    outcomes = zip(parameters(calibration), is_determined(calibration), strict=True)
    determined = {(p.camera, p.key) for p, good in outcomes if good}
    out: list[Confirmation] = []
    for k, camera in enumerate(block.cameras):
        if all((camera.name, key) in determined for key in LEVER_ARM):
            difference = _of_lever_arm(calibration, k, camera)
            if difference.declared.any() or difference.size > LONGEST_M:
                out.append(
                    _of_part(
                        camera, "lever arm", difference, _lever_said(block, camera, difference)
                    )
                )
        if all((camera.name, key) in determined for key in BORESIGHT):
            difference = _of_boresight(calibration, k, camera)
            if difference.declared.any():
                out.append(
                    _of_part(
                        camera,
                        "boresight",
                        difference,
                        _turn_said(block, camera, calibration.cameras[k], difference),
                    )
                )
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class _Difference:
    """Estimated minus declared values of one part, about or along the body's axes, m or radians.

    Attributes
    ----------
    d : ndarray, shape (3,)
        From the other observations alone.
    p : float
        Probability of such differences or larger ones; NaN without sigma.
    declared : ndarray of bool, shape (3,)
    sigma, sigma_estimated : ndarray, shape (3,)
        Of the declared values, infinite without, and of the estimates.
    """

    d: Array
    p: float
    declared: Mask
    sigma: Array
    sigma_estimated: Array

    @property
    def size(self) -> float:
        """Length of the difference of the declared components, or of all if none is declared."""
        return float(np.linalg.norm(self.d[self.declared] if self.declared.any() else self.d))

    def significant(self, rough: float = 0.0) -> bool:
        """Tell whether the difference exceeds its sigma; `rough` is used without a declared one."""
        of_declared = np.where(np.isfinite(self.sigma), self.sigma, rough)
        tolerance = SIGMAS * np.hypot(of_declared, self.sigma_estimated)
        return bool(np.any(self.declared & (np.abs(self.d) > tolerance)))


def _of_lever_arm(calibration: Calibration, k: int, camera: Camera) -> _Difference:
    columns = calibration.layout.mount[k, :3]
    cov = calibration.cov[np.ix_(columns, columns)]
    d = calibration.cameras[k].T_b_c.r - camera.T_b_c.r
    return _difference(d, cov, camera.prior.lever_declared, camera.prior.lever_sigma)


def _of_boresight(calibration: Calibration, k: int, camera: Camera) -> _Difference:
    columns, R = calibration.layout.mount[k, 3:], calibration.cameras[k].T_b_c.R
    cov = propagate(R, calibration.cov[np.ix_(columns, columns)])
    d = camera.T_b_c.R @ log(camera.T_b_c.R.T @ R)
    return _difference(d, cov, camera.prior.boresight_declared, camera.prior.boresight_sigma)


def _difference(d: Array, cov: Array, declared: Mask, sigma: Array) -> _Difference:
    """Return the difference and its test, from the estimates and their covariance."""
    alone, p = d.copy(), np.nan
    if len(tested := np.flatnonzero(np.isfinite(sigma))):
        scale = sigma[tested]
        by_others = np.eye(len(tested)) - cov[np.ix_(tested, tested)] / scale[:, None] / scale
        values, vectors = np.linalg.eigh(by_others)
        controlled = values > UNSEEN  # along the others, the estimates equal the declared values
        parts = (vectors.T @ (d[tested] / scale))[controlled]
        p = statistics.chi2_sf(np.sum(parts**2 / values[controlled]), max(1, controlled.sum()))
        alone[tested] = scale * (vectors[:, controlled] @ (parts / values[controlled]))
    return _Difference(d=alone, p=p, declared=declared, sigma=sigma, sigma_estimated=sigmas(cov))


# --- causes of differences -------------------------------------------------------------------


def _of_part(
    camera: Camera, part: str, difference: _Difference, words: tuple[str, str]
) -> Confirmation:
    unit = np.degrees(1.0) if part == "boresight" else 1.0
    x, y, z = (float(v) for v in np.where(difference.declared, unit * difference.d, np.nan))
    text, mistake = words
    return Confirmation(
        camera=camera.name,
        part=part,
        difference=(x, y, z),
        p=difference.p,
        statement=text,
        mistake=mistake,
    )


def _lever_said(block: Block, camera: Camera, difference: _Difference) -> tuple[str, str]:
    """Return a lever arm's difference in words, and the known mistake that explains it."""
    if not difference.declared.any():
        heights = "are the heights of control and trajectory of one system?"
        return "", f"is {difference.size:.1f} m long, and none is declared: {heights}"
    text = f"differs from the declared one by {_listed(difference.d, difference.declared, '.2f')} m"
    if not difference.significant(SURVEYED_M):
        return (text if np.isfinite(difference.p) or difference.significant() else ""), ""
    if difference.declared.all() and (axes := _exchanged_lever(camera.T_b_c.r, difference.d)):
        return text, f"the declared one with {axes} would agree"
    looks = _looks_like(block, difference)
    return (f"{text}; {looks} would look like this" if looks else text), ""


def _looks_like(block: Block, difference: _Difference) -> str:
    """Return at most two mistakes that remove a lever arm's difference; empty where none does."""
    d = np.where(difference.declared, difference.d, 0.0)
    axis = int(np.argmax(np.abs(d)))
    across = np.delete(np.abs(d), axis)
    tolerance = SIGMAS * np.hypot(SURVEYED_M, np.delete(difference.sigma_estimated, axis))
    if np.any(across > tolerance) or np.linalg.norm(across) > BESIDE * difference.size:
        return ""
    size = abs(d[axis])
    if axis == 0 and np.isfinite(speed := _speed(block)):
        return (
            f"a clock that is {1000 * size / speed:.0f} ms off, or positions of an antenna "
            f"{size:.2f} m {'before' if d[0] < 0 else 'behind'} the IMU,"
        )
    if axis == 2:
        return (
            f"heights of two systems, such as geoid models {size:.2f} m apart, or positions of an "
            f"antenna {size:.2f} m {'above' if d[2] < 0 else 'below'} the IMU,"
        )
    return ""


LEVER_MISTAKES: tuple[tuple[str, Array], ...] = (
    ("all signs reversed", -np.eye(3)),
    ("x and y exchanged", np.eye(3)[[1, 0, 2]]),
    ("y and z reversed", np.diag([1.0, -1.0, -1.0])),
    ("x and y exchanged and z reversed", np.diag([1.0, 1.0, -1.0]) @ np.eye(3)[[1, 0, 2]]),
)
"""Axes of other conventions, by their effect on a lever arm."""


def _exchanged_lever(declared: Array, d: Array) -> str:
    """Return the exchange of axes that explains a difference; empty where none does."""
    size = float(np.linalg.norm(d))
    for name, exchange in LEVER_MISTAKES:
        if np.linalg.norm(declared + d - exchange @ declared) < EXPLAINED * size:
            return name
    return ""


def _turn_said(
    block: Block, camera: Camera, estimated: Camera, difference: _Difference
) -> tuple[str, str]:
    """Return a boresight's difference in words, and the known mistake that explains it."""
    shown = _listed(np.degrees(difference.d), difference.declared, ".3f")
    text = f"differs from the declared one by {shown}° about the body's axes"
    if not difference.significant():
        return text, ""
    convergence = _convergence(block)
    if _is_convergence(difference, convergence):
        d, gamma = np.degrees([abs(difference.d[2]), abs(convergence)])
        return (
            f"differs from the declared one in kappa by {d:.2f}°, about the meridian "
            f"convergence, {gamma:.2f}°",
            "is the heading read against true or grid north?",
        )
    turn = estimated.T_b_c.R @ camera.T_b_c.R.T
    if turned := _right_angle(turn, difference.declared):
        return text, turned
    if difference.declared.all() and (angles := _exchanged_angles(camera.T_b_c, turn)):
        return text, f"the declared one with {angles} would agree"
    return text, ""


def _right_angle(turn: Array, declared: Mask) -> str:
    """Return a phrase on a rotation by 90 or 180 degrees about a body axis; else empty."""
    for angle in (90, -90, 180):
        for axis in np.flatnonzero(declared):
            remaining = turn @ exp(-np.radians(angle) * np.eye(3)[axis])
            if np.linalg.norm(log(remaining)) < TURNED:
                return f"it is turned by {abs(angle)}° about the body's {'xyz'[axis]} axis"
    return ""


def _exchanged_angles(declared: Pose, turn: Array) -> str:
    """Return the exchange of angles that explains a rotation of the body; empty where none does."""
    omega, phi, kappa = declared.opk
    exchanges = {
        "omega and phi exchanged": (phi, omega, kappa),
        "the sign of omega reversed": (-omega, phi, kappa),
        "the sign of phi reversed": (omega, -phi, kappa),
        "the sign of kappa reversed": (omega, phi, -kappa),
    }
    matrices = {name: rotation_from_opk(np.array(opk)) for name, opk in exchanges.items()}
    matrices["its matrix transposed"] = declared.R.T
    estimated = turn @ declared.R
    remaining = {name: np.linalg.norm(log(R @ estimated.T)) for name, R in matrices.items()}
    best = min(remaining, key=lambda name: float(remaining[name]))
    size = np.linalg.norm(log(turn))
    return best if size > np.radians(EXCHANGED_DEG) and remaining[best] < EXPLAINED * size else ""


def _is_convergence(difference: _Difference, convergence: float) -> bool:
    """Tell whether kappa differs by the convergence, within the sigma of both values."""
    if not (difference.declared[2] and np.isfinite(convergence)):
        return False
    deviation = abs(abs(difference.d[2]) - abs(convergence))
    if np.isfinite(difference.sigma[2]):
        sigma = float(np.hypot(difference.sigma[2], difference.sigma_estimated[2]))
        return difference.p < ALPHA and bool(deviation < SIGMAS * sigma < abs(convergence))
    tilts = np.linalg.norm(difference.d[:2])  # of a rough mounting, as large as kappa
    is_seen = abs(convergence) > max(LEAST_CONVERGENCE, tilts)
    return bool(is_seen and deviation < NORTHS * abs(convergence))


def _convergence(block: Block) -> float:
    """Return the meridian convergence in the middle of the exposures, radians."""
    lonlath = block.frame.to_geographic(np.median(block.trajectory.T_m_b.r, axis=0)[None])
    return float(block.frame.grid.convergence(lonlath[:, :2])[0])


def _speed(block: Block) -> float:
    """Return the median speed between successive exposures of a strip, m/s; NaN without times."""
    strips, trajectory = strips_of(block), block.trajectory
    if strips.unit != "s" or not strips.names:
        return np.nan
    dt, steps = np.diff(trajectory.time_s), np.diff(trajectory.T_m_b.r, axis=0)
    same_strip = (np.diff(strips.idx) == 0) & (strips.idx[1:] >= 0) & (dt != 0)
    speeds = np.linalg.norm(steps[same_strip], axis=1) / np.abs(dt[same_strip])
    return float(np.median(speeds)) if len(speeds) else np.nan


def _listed(values: Array, declared: Mask, digits: str) -> str:
    """Return signed numbers in brackets; a dash where nothing is declared."""
    each = (f"{v:+{digits}}" if known else "-" for v, known in zip(values, declared, strict=True))
    return f"({', '.join(each)})"
