"""Parameters that are determined, but weakly: too weak for the ground, or resting on chance.

A parameter is weak that has more than a quarter of the variance of a ground point, or whose sigma
rests on what nobody plans: see `calibration.trust.steady`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import (
    ENOUGH,
    Calibration,
    Parameter,
    from_bundle,
    is_determined,
    needed,
    parameters,
    to_reported,
)
from acx4lib.calibration.stability import calm_sigmas
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.parameters import AXES, LEVER_ARM
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.error_sources import ErrorSources

MOST = 0.25
"""Share of the variance of a ground point above which a parameter is weak."""

RESTS = 4.0
"""Ratio of sigma in calm air over level ground to sigma above which it rests on wind and hills."""

ALONG = (*LEVER_ARM, "xp", "yp", "delay")
"""Parameters that a delay of the positions is like: along the flight, at one height and speed."""

SPEEDS = "strips flown at different speeds at one height, or the lever arm held"
"""What tells them apart."""

CHECK_POINTS, CORNERS = "check points", "the ground under the format's corners"
"""What shares are of."""


@dataclass(frozen=True, kw_only=True)
class Weak:
    """One weak parameter.

    Attributes
    ----------
    parameter : Parameter
    share : float
        Its largest share of the variance of ground points; zero where it is no parameter of a
        camera.
    axis : int
        The axis of this share: 0 east, 1 north, 2 height.
    calm : float
        By how many times its sigma would be larger in calm air over level ground; one where this
        was not computed.
    of : str
        What the share is of.
    """

    parameter: Parameter
    share: float = 0.0
    axis: int = 0
    calm: float = 1.0
    of: str = CHECK_POINTS

    @property
    def reason(self) -> str:
        """What makes it weak."""
        p, why = self.parameter, []
        if self.share > MOST:
            where = f"{self.of} in {AXES[self.axis]}"
            why.append(f"{100 * self.share:.0f} % of the variance of {where}")
        if self.calm > RESTS:
            why.append("it rests on wind and hills, which nobody plans")
        return "; ".join([f"sigma {p.sigma:.3g} {p.unit}", *why])


def sentences(
    found: Sequence[Weak], features: frozenset[str] = frozenset(), *, late: bool = False
) -> list[str]:
    """Return one sentence per weak parameter, or of heads alike: why, and what would determine it.

    Parameters
    ----------
    found : sequence of Weak
        All of one adjustment.
    features : frozenset of str
        What the flight has of this geometry, as `estimates.features` returns it.
    late : bool
        Whether a delay of the positions was estimated, too.
    """
    groups: dict[tuple[str, str, str], list[str]] = {}
    for one in found:
        p = one.parameter
        cure = needed(p.key, features)
        if late and cure == ENOUGH and p.key in ALONG:
            cure = SPEEDS
        groups.setdefault((p.name, one.reason, cure), []).append(p.camera)
    return [
        f"{_named(name, cameras)} is weak ({reason}); it would need: {cure}"
        for (name, reason, cure), cameras in groups.items()
    ]


def _named(name: str, cameras: Sequence[str]) -> str:
    """Return the name of a parameter of one camera, or of several in the same state."""
    if len(cameras) > 1:
        return f"{name} of {', '.join(cameras)}"
    return f"{cameras[0]} {name}".strip()


def of_calibration(
    calibration: Calibration, shares: Array | None, *, of: str = CHECK_POINTS
) -> list[Weak]:
    """Return the parameters of cameras that have too much of the variance of ground points.

    Parameters
    ----------
    calibration : Calibration
    shares : ndarray, shape (3, n), or None
        As `shares` returns them.
    of : str
        What they are of.
    """
    if shares is None:
        return []
    listed = zip(parameters(calibration), is_determined(calibration), shares.T, strict=True)
    return [
        Weak(parameter=p, share=float(own.max()), axis=int(own.argmax()), of=of)
        for p, determined, own in listed
        if determined and own.max() > MOST
    ]


def of_bundle(bundle: Bundle) -> list[Weak]:
    """Return the parameters of a bundle that rest on wind and hills.

    Parameters
    ----------
    bundle : Bundle
        Of `uses.mounted_orientation`.
    """
    calm = calm_sigmas(bundle)
    if calm is None:
        return []
    calibration = from_bundle(bundle)
    listed = [*parameters(calibration), *trajectory_errors.parameters(bundle)]
    determined = [*is_determined(calibration), *trajectory_errors.is_determined(bundle)]
    return [
        Weak(parameter=p, calm=float(ratio))
        for p, told, ratio in zip(listed, determined, calm, strict=True)
        if told and ratio > RESTS
    ]


def together(found: Sequence[Weak]) -> list[Weak]:
    """Return one for each parameter, with all that makes it weak."""
    out: dict[str, Weak] = {}
    for one in found:
        key = one.parameter.full_name
        other = out.get(key, one)
        larger = max(one, other, key=lambda weak: weak.share)
        out[key] = Weak(
            parameter=one.parameter,
            share=larger.share,
            axis=larger.axis,
            of=larger.of,
            calm=max(one.calm, other.calm),
        )
    return [*out.values()]


# --- shares ----------------------------------------------------------------------------------


def shares(sources: ErrorSources, calibration: Calibration) -> Array | None:
    """Return by what share the variance of ground points falls if one parameter becomes known.

    Parameters
    ----------
    sources : ErrorSources
        Of points, with the covariance of the calibration.
    calibration : Calibration

    Returns
    -------
    ndarray, shape (3, n), or None
        Along the axes of the points, for every reported parameter; None without points. Shares of
        correlated parameters do not add up to that of all.

    Notes
    -----
    A parameter with the variance c and the covariances C e with all of them has (J C e)^2 / c of
    the variance of a point with the derivatives J: what is left is the variance given the
    parameter. J_e^2 c would count what another parameter takes back.
    """
    if len(sources) == 0:
        return None
    total = np.diagonal(sources.cov, axis1=1, axis2=2).mean(axis=0)
    to = to_reported(calibration)
    C = sources.cov_parameters @ to.T
    variance = np.diagonal(to @ C)
    by_each = np.mean((sources.by_parameters @ C) ** 2, axis=0)
    known = np.where(variance > 0, variance, np.inf)
    return by_each / known / total[:, None]


def shares_at_corners(calibration: Calibration, block: Block) -> Array | None:
    """Return `shares` for the ground under the corners of the format, the largest of all cameras.

    The images are those of a regular mapping flight at the height of a block, with the accuracies
    of this block. None where a camera does not look down, or something is not known.
    """
    found = [_at_corners(calibration, camera, block) for camera in calibration.cameras]
    there = [one for one in found if one is not None]
    return np.max(there, axis=0) if there else None


def _at_corners(calibration: Calibration, camera: Camera, block: Block) -> Array | None:
    flight = budget.like(block, camera)
    if flight is None or not budget.looks_down(camera):
        return None
    sources = budget.at_corners(calibration, camera, flight)
    return shares(sources, calibration)
