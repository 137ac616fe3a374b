"""Tests of declared mountings against estimated ones.

Unknowns absorb systematic errors without a trace in the residuals: a delay at one speed is a
lever arm, an undulation is one too, and true north in place of grid north is a boresight. Only
declared values contradict them.
"""

from __future__ import annotations

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

LONGEST_M = 10.0
"""Lever arm, not declared, that is longer than inside an aircraft."""

ALPHA = 1e-4
"""Probability of not confirming right values with right sigma: that of data snooping."""

UNSEEN = 1e-4
"""Share of a declared value's variance below which the other observations do not control it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Confirmation:
    """A part of a mounting beside the declared one.

    Attributes
    ----------
    camera : str
    part : str
        ``"lever arm"`` or ``"boresight"``.
    declared : ndarray, shape (3,)
        Which components are declared.
    difference : ndarray, shape (3,)
        Estimated, by the other observations alone, minus declared: along or about the body's x,
        y, z axes, m or degrees. Of a lever arm that is not declared, the estimate.
    sigma : ndarray, shape (3,)
        Of the estimate, m or degrees.
    p : float
        Probability of such differences or larger ones; NaN where there is no sigma.
    convergence_deg : float
        The meridian convergence, where kappa differs by about this much: heading was read against
        the other north. Otherwise NaN.
    """

    camera: str
    part: str
    declared: Mask
    difference: Array
    sigma: Array
    p: float
    convergence_deg: float = np.nan

    @property
    def confirmed(self) -> bool:
        """Whether neither the test nor the kind of difference objects to what is declared."""
        return bool(self.declared.any() and np.isnan(self.convergence_deg) and not self.p < ALPHA)


def confirmations(bundle: Bundle) -> list[Confirmation]:
    """Compare the mountings that a bundle estimated with the declared ones.

    Parts that are held, not determined, or not declared are left out, but for lever arms longer
    than `LONGEST_M`.

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
    calibration, gamma = from_bundle(bundle), _convergence(bundle.network.block)
    outcomes = zip(parameters(calibration), is_determined(calibration), strict=True)
    determined = {(p.camera, p.key) for p, good in outcomes if good}
    out: list[Confirmation] = []
    for columns, told, found in zip(
        calibration.layout.mount, bundle.network.block.cameras, calibration.cameras, strict=True
    ):
        name, prior = told.name, told.prior
        if all((name, key) in determined for key in LEVER_ARM):
            cov = calibration.cov[np.ix_(columns[:3], columns[:3])]
            d, p = _by_the_others(found.T_b_c.r - told.T_b_c.r, cov, prior.lever_sigma)
            if prior.lever_declared.any() or np.linalg.norm(d) > LONGEST_M:
                out.append(
                    Confirmation(
                        camera=name,
                        part="lever arm",
                        declared=prior.lever_declared,
                        difference=d,
                        sigma=sigmas(cov),
                        p=p,
                    )
                )
        if all((name, key) in determined for key in BORESIGHT) and prior.boresight_declared.any():
            cov = propagate(found.T_b_c.R, calibration.cov[np.ix_(columns[3:], columns[3:])])
            d = told.T_b_c.R @ log(told.T_b_c.R.T @ found.T_b_c.R)
            d, p = _by_the_others(d, cov, prior.boresight_sigma)
            by_north = (
                prior.boresight_declared[2]
                and gamma > max(np.radians(0.1), 3 * float(sigmas(cov)[2]))  # it is seen
                and abs(abs(d[2]) - gamma) < gamma / 4
                and np.linalg.norm(d[:2]) < gamma
                and not p >= ALPHA
            )
            out.append(
                Confirmation(
                    camera=name,
                    part="boresight",
                    declared=prior.boresight_declared,
                    difference=np.degrees(d),
                    sigma=np.degrees(sigmas(cov)),
                    p=p,
                    convergence_deg=float(np.degrees(gamma)) if by_north else np.nan,
                )
            )
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


def _convergence(block: Block) -> float:
    """Return the size of the meridian convergence in the middle of the exposures, radians."""
    lonlath = block.frame.to_geographic(np.median(block.trajectory.T_m_b.r, axis=0)[None])
    return abs(float(block.frame.grid.convergence(lonlath[:, :2])[0]))
