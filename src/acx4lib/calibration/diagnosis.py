"""Diagnosis of an adjustment: what it tells of its observations and of what it calibrates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from acx4lib.bundle import variance_components
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors import expected_failures
from acx4lib.bundle.variance_components import Component, SigmaTest
from acx4lib.calibration import confirmation, determination, estimates, stability, trajectory_errors
from acx4lib.calibration.confirmation import Confirmation
from acx4lib.calibration.determination import Pair, Part
from acx4lib.calibration.estimates import Calibration, Parameter
from acx4lib.calibration.stability import Turns
from acx4lib.calibration.trajectory_errors import ByCourse
from acx4lib.expected import Array

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
        return tuple(confirmation.confirmations(self.bundle))

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
