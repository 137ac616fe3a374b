"""Tests of declared mountings against estimated ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.estimates import from_bundle, is_determined, parameters
from acx4lib.expected import Array, Mask
from acx4lib.geometry.frames import log
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

UNSEEN = 1e-4
"""Share of a declared value's variance below which the other observations do not control it."""

SIGMAS = 3.0
"""Multiple of a standard deviation of the estimate above which it differs from a declared value."""

NORTHS = 0.25
"""Share of the meridian convergence within which a difference of kappa equals it."""

LEAST_CONVERGENCE = np.radians(0.1)
"""Least meridian convergence that may explain a difference of kappa."""


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
        The difference in words; empty where nothing is declared.
    mistake : str
        Why it is not confirmed even without sigma: a lever arm that is not declared and too long,
        or an angle that differs by the meridian convergence; else empty.
    """

    camera: str
    part: str
    difference: tuple[float, float, float]
    p: float
    statement: str = ""
    mistake: str = ""

    @property
    def objection(self) -> str:
        """Why the declared value is not confirmed: its sigma, or the mistake; else empty."""
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
    convergence = abs(_convergence(block))
    outcomes = zip(parameters(calibration), is_determined(calibration), strict=True)
    determined = {(p.camera, p.key) for p, good in outcomes if good}
    out: list[Confirmation] = []
    for columns, told, found in zip(
        calibration.layout.mount, block.cameras, calibration.cameras, strict=True
    ):
        name, prior = told.name, told.prior
        if all((name, key) in determined for key in LEVER_ARM):
            cov = calibration.cov[np.ix_(columns[:3], columns[:3])]
            d, p = _by_the_others(found.T_b_c.r - told.T_b_c.r, cov, prior.lever_sigma)
            out += _lever_arm(name, d, p, prior.lever_declared, sigmas(cov))
        if all((name, key) in determined for key in BORESIGHT):
            R = found.T_b_c.R
            cov = propagate(R, calibration.cov[np.ix_(columns[3:], columns[3:])])
            d = told.T_b_c.R @ log(told.T_b_c.R.T @ R)
            d, p = _by_the_others(d, cov, prior.boresight_sigma)
            kappa_seen = max(LEAST_CONVERGENCE, SIGMAS * float(sigmas(cov)[2]))
            gamma = convergence if convergence > kappa_seen else np.nan
            out += _boresight(name, d, p, prior.boresight_declared, gamma)
    return out


def _by_the_others(d: Array, cov: Array, sigma: Array) -> tuple[Array, float]:
    """Return estimated minus declared values by the other observations alone, and their test.

    Parameters
    ----------
    d : ndarray, shape (3,)
        Estimated minus declared values.
    cov : ndarray, shape (3, 3)
        Covariance of the estimates.
    sigma : ndarray, shape (3,)
        Of the declared values, infinite without.
    """
    if len(tested := np.flatnonzero(np.isfinite(sigma))) == 0:
        return d, np.nan
    scale = sigma[tested]
    by_others = np.eye(len(tested)) - cov[np.ix_(tested, tested)] / scale[:, None] / scale
    values, vectors = np.linalg.eigh(by_others)
    controlled = values > UNSEEN  # along the others, the estimates equal the declared values
    parts = (vectors.T @ (d[tested] / scale))[controlled]
    p = statistics.chi2_sf(np.sum(parts**2 / values[controlled]), max(1, controlled.sum()))
    alone = d.copy()
    alone[tested] = scale * (vectors[:, controlled] @ (parts / values[controlled]))
    return alone, p


def _lever_arm(
    camera: str, d: Array, p: float, declared: Mask, sigma: Array
) -> Iterator[Confirmation]:
    """Yield the comparison of a lever arm, m; `sigma` are those of the estimate."""
    text = mistake = ""
    if not declared.any():
        if not np.linalg.norm(d) > LONGEST_M:
            return
        mistake = (
            f"is {np.linalg.norm(d):.1f} m long, and none is declared: are the heights of control "
            "and trajectory of one system?"
        )
    elif np.isfinite(p) or np.any(declared & (np.abs(d) > SIGMAS * sigma)):
        text = f"differs from the declared one by {_listed(d, declared, '.2f')} m"
    yield Confirmation(
        camera=camera,
        part="lever arm",
        difference=_triple(d, declared),
        p=p,
        statement=text,
        mistake=mistake,
    )


def _boresight(
    camera: str, d: Array, p: float, declared: Mask, convergence: float
) -> Iterator[Confirmation]:
    """Yield the comparison of a boresight, radians; NaN for a convergence that is not seen."""
    if not declared.any():
        return
    mistake, degrees = "", np.degrees(d)
    is_rough = np.linalg.norm(d[:2]) >= convergence  # turned about x or y by as much
    is_off = declared[2] and abs(abs(d[2]) - convergence) < NORTHS * convergence
    if is_off and not is_rough and not p >= ALPHA:
        mistake = (
            f"kappa by about the meridian convergence, {np.degrees(convergence):.2f}°: is the "
            "heading read against true or grid north?"
        )
    yield Confirmation(
        camera=camera,
        part="boresight",
        difference=_triple(degrees, declared),
        p=p,
        statement=f"differs from the declared one by {_listed(degrees, declared, '.3f')}° about "
        "the body's axes",
        mistake=mistake,
    )


def _convergence(block: Block) -> float:
    """Return the meridian convergence in the middle of the exposures, radians."""
    lonlath = block.frame.to_geographic(np.median(block.trajectory.T_m_b.r, axis=0)[None])
    return float(block.frame.grid.convergence(lonlath[:, :2])[0])


def _triple(values: Array, declared: Mask) -> tuple[float, float, float]:
    """Return the differences of what is declared; NaN elsewhere."""
    x, y, z = np.where(declared, values, np.nan).tolist()
    return x, y, z


def _listed(values: Array, declared: Mask, digits: str) -> str:
    """Return signed numbers in brackets; a dash where nothing is declared."""
    each = (f"{v:+{digits}}" if known else "-" for v, known in zip(values, declared, strict=True))
    return f"({', '.join(each)})"
