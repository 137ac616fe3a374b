"""Are the estimated mountings those that were declared? A declared value is tested, and says so.

Unknowns absorb systematic errors without a trace in the residuals: a delay at one speed is a lever
arm, an undulation is one too, and true north in place of grid north is a boresight. Only what was
known before contradicts them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.observations.strips import strips_of
from acx4lib.calibration.estimates import Calibration, from_bundle, is_determined, parameters
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import log
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.statistical import distributions

FAR_M, FAR_DEG = 1.0, 3.0
"""Differences from values declared without sigma above which these are not confirmed."""

LONGEST_M = 10.0
"""Lever arm, not declared, that is longer than inside an aircraft."""

ALPHA = 1e-4
"""Probability of not confirming right values with right sigma: that of data snooping."""

NORTHS = 0.25
"""Share of the meridian convergence within which an angle without sigma is one with it."""

LEAST_CONVERGENCE = np.radians(0.1)
"""Meridian convergence below which no angle without sigma is taken for it."""

HINTED = 0.9
"""Share of a difference along one axis from which its usual cause is named."""

UNSEEN = 1e-4
"""Share of a declared value's variance below which the other observations say nothing of it."""

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
    objection : str
        Why the declared value is not confirmed; empty where it is.
    """

    camera: str
    part: str
    difference: tuple[float, float, float]
    p: float
    objection: str = ""

    @property
    def sentence(self) -> str:
        """What is not confirmed and why."""
        return f"not confirmed: {self.part} of {self.camera} {self.objection}"


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
    told = zip(parameters(calibration), is_determined(calibration), strict=True)
    determined = {(p.camera, p.key) for p, good in told if good}
    out: list[Confirmation] = []
    for k, camera in enumerate(block.cameras):
        if all((camera.name, key) in determined for key in LEVER_ARM):
            found = _of_lever_arm(calibration, k, camera)
            if found.declared.any() or found.size > LONGEST_M:
                out.append(_judged(camera, "lever arm", found, _lever_objection(block, found)))
        if all((camera.name, key) in determined for key in BORESIGHT):
            found = _of_boresight(calibration, k, camera)
            if found.declared.any():
                out.append(_judged(camera, "boresight", found, _turn_objection(block, found)))
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class _Difference:
    """Estimated minus declared values of one part, about or along the body's axes, m or radians.

    Attributes
    ----------
    d : ndarray, shape (3,)
        As the other observations alone would have it.
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
        """Length of the difference from what is declared, or of all if nothing is."""
        return float(np.linalg.norm(self.d[self.declared] if self.declared.any() else self.d))

    def contradicts(self, far: float) -> bool:
        """Tell whether it is significant; without sigma, whether it is larger than a limit."""
        rest = np.linalg.norm(self.d[self.declared & ~np.isfinite(self.sigma)])
        return bool(self.p < ALPHA or rest > far)


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
        both = np.eye(len(tested)) - cov[np.ix_(tested, tested)] / scale[:, None] / scale
        values, vectors = np.linalg.eigh(both)
        seen = values > UNSEEN  # of the others, the estimates are the declared values themselves
        parts = (vectors.T @ (d[tested] / scale))[seen]
        p = distributions.chi2_sf(np.sum(parts**2 / values[seen]), max(1, seen.sum()))
        alone[tested] = scale * (vectors[:, seen] @ (parts / values[seen]))
    return _Difference(d=alone, p=p, declared=declared, sigma=sigma, sigma_estimated=sigmas(cov))


# --- objections ------------------------------------------------------------------------------


def _judged(camera: Camera, part: str, found: _Difference, objection: str) -> Confirmation:
    unit = np.degrees(1.0) if part == "boresight" else 1.0
    x, y, z = (float(v) for v in np.where(found.declared, unit * found.d, np.nan))
    return Confirmation(
        camera=camera.name, part=part, difference=(x, y, z), p=found.p, objection=objection
    )


def _lever_objection(block: Block, found: _Difference) -> str:
    """Return what speaks against a declared lever arm, with what would look like this."""
    if not found.declared.any():
        heights = "are the heights of control and trajectory of one system?"
        return f"is {found.size:.1f} m long, and none is declared: {heights}"
    if not found.contradicts(FAR_M):
        return ""
    shown = _listed(found.d, found.declared, ".2f")
    said = f"differs from the declared one by {shown} m"
    along = np.abs(np.where(found.declared, found.d, 0.0))
    if along[0] > HINTED * found.size and np.isfinite(speed := _speed(block)):
        return f"{said}; a clock that is {1000 * along[0] / speed:.0f} ms off would look like this"
    if along[2] > HINTED * found.size:
        return f"{said}; heights of two systems would look like this"
    return said


def _turn_objection(block: Block, found: _Difference) -> str:
    """Return what speaks against a declared boresight, the meridian convergence above all."""
    contradicted = found.contradicts(np.radians(FAR_DEG))
    convergence = _convergence(block)
    if _is_convergence(found, convergence, contradicted=contradicted):
        d, gamma = np.degrees([abs(found.d[2]), abs(convergence)])
        return (
            f"differs from the declared one in kappa by {d:.2f}°, about the meridian "
            f"convergence, {gamma:.2f}°: is the heading read against true or grid north?"
        )
    if not contradicted:
        return ""
    shown = _listed(np.degrees(found.d), found.declared, ".3f")
    return f"differs from the declared one by {shown}° about the body's axes"


def _is_convergence(found: _Difference, convergence: float, *, contradicted: bool) -> bool:
    """Tell whether kappa differs by the convergence, within what is known of both values."""
    if not (found.declared[2] and np.isfinite(convergence)):
        return False
    off = abs(abs(found.d[2]) - abs(convergence))
    if np.isfinite(found.sigma[2]):
        sigma = float(np.hypot(found.sigma[2], found.sigma_estimated[2]))
        return contradicted and bool(off < SIGMAS * sigma < abs(convergence))
    return bool(abs(convergence) > LEAST_CONVERGENCE and off < NORTHS * abs(convergence))


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
    same = (np.diff(strips.idx) == 0) & (strips.idx[1:] >= 0) & (dt != 0)
    speeds = np.linalg.norm(steps[same], axis=1) / np.abs(dt[same])
    return float(np.median(speeds)) if len(speeds) else np.nan


def _listed(values: Array, declared: Mask, digits: str) -> str:
    """Return signed numbers in brackets; a dash where nothing is declared."""
    each = (f"{v:+{digits}}" if known else "-" for v, known in zip(values, declared, strict=True))
    return f"({', '.join(each)})"
