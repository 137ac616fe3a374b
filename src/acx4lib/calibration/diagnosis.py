"""Diagnosis of an adjustment: what it tells of its observations and of what it calibrates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from acx4lib.block import Block
from acx4lib.bundle import variance_components
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors import expected_failures
from acx4lib.bundle.variance_components import Component, SigmaTest
from acx4lib.calibration import determination, estimates, stability, trajectory_errors
from acx4lib.calibration.determination import Pair, Part
from acx4lib.calibration.estimates import Calibration, Parameter
from acx4lib.calibration.stability import Turns
from acx4lib.calibration.trajectory_errors import ByCourse
from acx4lib.expected import Array, Mask
from acx4lib.geometry.frames import log
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import propagate, sigmas

MOST = 0.25
"""Share of the variance of a ground point above which a parameter is weak."""

RESTS = 4.0
"""Ratio of sigma in calm air over level ground to sigma above which it rests on wind and hills."""

CHECK_POINTS, CORNERS = "check points", "the ground under the format's corners"
"""Ground points of the shares."""


@dataclass(frozen=True, kw_only=True)
class Weak:
    """A parameter that is determined, but weakly.

    Attributes
    ----------
    parameter : Parameter
    share : float
        Its largest share of the variance of ground points, above `MOST`; otherwise zero.
    axis : int
        The axis of this share: 0 east, 1 north, 2 height.
    calm : float
        By how many times its sigma would be larger in calm air over level ground, above `RESTS`;
        otherwise one.
    of : str
        Ground points of the share.
    """

    parameter: Parameter
    share: float = 0.0
    axis: int = 0
    calm: float = 1.0
    of: str = CHECK_POINTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """Analyses of an adjusted bundle, each made when it is asked for.

    Attributes
    ----------
    bundle : Bundle
    calibration : Calibration
        The cameras that it calibrates.
    applied : mapping of str to float
        Factors that were applied to the sigma of every group of observations.
    """

    bundle: Bundle
    calibration: Calibration
    applied: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def features(self) -> frozenset[str]:
        """Features of the block's geometry, as `estimates.features` returns them."""
        return estimates.features(self.bundle.network.block)

    @property
    def expected_rejections(self) -> float:
        """Number of observations that chance rejects."""
        return expected_failures(self.bundle)

    @cached_property
    def components(self) -> tuple[Component, ...]:
        """Factors of the sigma of every group of observations."""
        return tuple(variance_components.components(self.bundle, applied=self.applied))

    @property
    def sigma_tests(self) -> tuple[SigmaTest, ...]:
        """Tests of the sigma of every group of observations."""
        return tuple(variance_components.sigma_tests(self.bundle))

    @property
    def weakest(self) -> tuple[Part, ...]:
        """The combination of unknowns that changes the residuals least."""
        return determination.weakest_combination(self.bundle)

    @property
    def correlated(self) -> tuple[Pair, ...]:
        """Pairs of parameters that are determined only together."""
        return determination.strong_correlations(self.calibration)

    @property
    def confirmations(self) -> tuple[Confirmation, ...]:
        """Declared mountings beside the estimated ones."""
        return tuple(confirmations(self.bundle))

    @property
    def between_strips(self) -> Turns | None:
        """Test of steps of the boresight between strips."""
        return stability.between_strips(self.bundle)

    @property
    def over_time(self) -> Turns | None:
        """Test of a drift of the boresight."""
        return stability.over_time(self.bundle)

    def weak(self, shares: Array | None = None, *, of: str = CORNERS) -> list[Weak]:
        """Return the parameters that are determined, but weakly.

        Parameters
        ----------
        shares : ndarray, shape (3, n), or None
            Of the parameters in the variance of ground points, as `budget.parameter_shares`.
        of : str
            These ground points.
        """
        bundle, calibration = self.bundle, self.calibration
        listed = [*estimates.parameters(calibration), *trajectory_errors.parameters(bundle)]
        determined = [
            *estimates.is_determined(calibration),
            *trajectory_errors.is_determined(bundle),
        ]
        calm = stability.calm_sigmas(bundle)
        ratios = np.ones(len(listed)) if calm is None else calm
        by_share = {w.parameter.full_name: w for w in of_shares(calibration, shares, of=of)}
        by_wind = [
            replace(by_share.pop(p.full_name, Weak(parameter=p)), calm=float(ratio))
            for p, good, ratio in zip(listed, determined, ratios, strict=True)
            if good and ratio > RESTS
        ]
        return [*by_wind, *by_share.values()]

    @property
    def by_course(self) -> ByCourse | None:
        """Test of recorded headings by course."""
        return trajectory_errors.by_course(self.bundle)

    @cached_property
    def focal_sigma(self) -> float:
        """Relative standard deviation of the first camera's focal length; 0 if held."""
        first = self.calibration.cameras[0]
        listed = estimates.parameters(self.calibration)
        of_f = (p.sigma for p in listed if (p.camera, p.key) == (first.name, "f"))
        sigma = next(of_f, 0.0) / first.interior.f
        return float(sigma) if np.isfinite(sigma) else 0.0

    @cached_property
    def height_scale(self) -> float:
        """Ratio of the bundle's flying height over control to the trajectory's.

        One where control or trajectory give no height. The estimated focal length is part of the
        ratio: a wrong one changes free orientations, and observed orientations change it.
        """
        bundle, network = self.bundle, self.bundle.network
        control = network.control.x_m[:, 2]
        images = np.flatnonzero(bundle.oriented)
        if len(network.block.control) == 0 or len(control) == 0 or len(images) == 0:
            return 1.0
        by_focal_length = bundle.state.interiors[0].f / network.block.cameras[0].interior.f
        observed = network.block.T_m_b_images.r[images, 2] - control.mean()
        adjusted = bundle.T_m_c.r[images, 2] - control.mean()
        scale = float(np.median(adjusted / observed))
        return scale if abs(scale - 1) > abs(by_focal_length - 1) else by_focal_length


def of_shares(
    calibration: Calibration, shares: Array | None, *, of: str = CHECK_POINTS
) -> list[Weak]:
    """Return the camera parameters with too large a share of the variance of ground points.

    Parameters
    ----------
    calibration, shares, of
        As in `Diagnosis.weak`.
    """
    if shares is None:
        return []
    listed = estimates.parameters(calibration)
    determined = estimates.is_determined(calibration)
    return [
        Weak(parameter=p, share=float(by_axis.max()), axis=int(by_axis.argmax()), of=of)
        for p, good, by_axis in zip(listed, determined, shares.T, strict=True)
        if good and by_axis.max() > MOST
    ]


def of(
    bundle: Bundle,
    calibration: Calibration | None = None,
    *,
    applied: Mapping[str, float] | None = None,
) -> Diagnosis:
    """Return the diagnosis of a bundle.

    Parameters
    ----------
    bundle : Bundle
    calibration : Calibration, optional
        The cameras calibrated by the method; by default those of the bundle.
    applied : mapping of str to float, optional
        Factors that were applied to the sigma of every group.
    """
    calibrated = calibration or estimates.from_bundle(bundle)
    return Diagnosis(bundle=bundle, calibration=calibrated, applied=dict(applied or {}))


# --- Declared mountings against estimated ones
#
# Unknowns absorb systematic errors without a trace in the residuals: a delay at one speed is a
# lever arm, an undulation is one too, and true north in place of grid north is a boresight. Only
# declared values contradict them.


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
    calibration, gamma = estimates.from_bundle(bundle), _convergence(bundle.network.block)
    open_ones = {(p.camera, p.key) for p in estimates.undetermined(calibration)}
    estimated = {(p.camera, p.key) for p in estimates.parameters(calibration)}
    determined = estimated - open_ones
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
