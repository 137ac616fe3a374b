"""Weakly determined parameters: too weak for ground points, or dependent on wind and hills.

A parameter is weak if it causes more than a quarter of the variance of a ground point, or if its
sigma depends on wind and hills that nobody plans: see `calibration.stability.calm_sigmas`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import (
    ENOUGH,
    Calibration,
    Parameter,
    is_determined,
    needed,
    parameters,
    to_reported,
)
from acx4lib.calibration.stability import calm_sigmas
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.parameters import AXES, LEVER_ARM
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.error_sources import ErrorSources

MOST = 0.25
"""Share of the variance of a ground point above which a parameter is weak."""

RESTS = 4.0
"""Ratio of sigma in calm air over level ground to sigma above which it rests on wind and hills."""

ALONG = (*LEVER_ARM, "xp", "yp", "delay")
"""Parameters that correlate with a delay of the positions at one height and one speed."""

SPEEDS = "strips flown at different speeds at one height, or the lever arm held"
"""The geometry that separates them."""

CHECK_POINTS, CORNERS = "check points", "the ground under the format's corners"
"""Ground points of the shares."""


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
        Ground points of the share.
    """

    parameter: Parameter
    share: float = 0.0
    axis: int = 0
    calm: float = 1.0
    of: str = CHECK_POINTS

    @property
    def reason(self) -> str:
        """The reasons of its weakness, as a phrase."""
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
    """Return a sentence per weak parameter, heads alike together: reasons and remedies.

    Parameters
    ----------
    found : sequence of Weak
        All of one adjustment.
    features : frozenset of str
        Geometry of the flight, as `estimates.features` returns it.
    late : bool
        Whether a delay of the positions was estimated, too.
    """
    groups: dict[tuple[str, str, str], list[str]] = {}
    for weakness in found:
        p = weakness.parameter
        cure = needed(p.key, features)
        if late and cure == ENOUGH and p.key in ALONG:
            cure = SPEEDS
        groups.setdefault((p.name, weakness.reason, cure), []).append(p.camera)
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
    """Return the camera parameters with too large a share of the variance of ground points.

    Parameters
    ----------
    calibration : Calibration
    shares : ndarray, shape (3, n), or None
        As `shares` returns them.
    of : str
        Ground points of the shares.
    """
    if shares is None:
        return []
    listed = zip(parameters(calibration), is_determined(calibration), shares.T, strict=True)
    return [
        Weak(parameter=p, share=float(by_axis.max()), axis=int(by_axis.argmax()), of=of)
        for p, determined, by_axis in listed
        if determined and by_axis.max() > MOST
    ]


def of_bundle(bundle: Bundle, calibration: Calibration) -> list[Weak]:
    """Return the parameters of a bundle that rest on wind and hills.

    Parameters
    ----------
    bundle : Bundle
        Of `adjust.mounted_orientation`.
    calibration : Calibration
        Of the bundle, with the sigma that is told.
    """
    calm = calm_sigmas(bundle)
    if calm is None:
        return []
    listed = [*parameters(calibration), *trajectory_errors.parameters(bundle)]
    determined = [*is_determined(calibration), *trajectory_errors.is_determined(bundle)]
    return [
        Weak(parameter=p, calm=float(ratio))
        for p, settled, ratio in zip(listed, determined, calm, strict=True)
        if settled and ratio > RESTS
    ]


def together(found: Sequence[Weak]) -> list[Weak]:
    """Merge the entries of each parameter, with all its reasons."""
    out: dict[str, Weak] = {}
    for weakness in found:
        key = weakness.parameter.full_name
        other = out.get(key, weakness)
        larger = max(weakness, other, key=lambda weak: weak.share)
        out[key] = Weak(
            parameter=weakness.parameter,
            share=larger.share,
            axis=larger.axis,
            of=larger.of,
            calm=max(weakness.calm, other.calm),
        )
    return [*out.values()]


# --- shares ----------------------------------------------------------------------------------


def shares(sources: ErrorSources, calibration: Calibration) -> Array | None:
    """Return the relative decrease of ground point variances if a parameter becomes known.

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
    the variance of a point with the derivatives J: the remainder is the variance given the
    parameter. J_e^2 c would also count the part that another parameter compensates.
    """
    if len(sources) == 0:
        return None
    total = np.diagonal(sources.cov, axis1=1, axis2=2).mean(axis=0)
    T = to_reported(calibration)
    C = sources.cov_parameters @ T.T
    variance = np.diagonal(T @ C)
    by_each = np.mean((sources.by_parameters @ C) ** 2, axis=0)
    known = np.where(variance > 0, variance, np.inf)
    return by_each / known / total[:, None]


def shares_at_corners(calibration: Calibration, block: Block) -> Array | None:
    """Return `shares` for the ground under the corners of the format, the largest over all cameras.

    The images are those of a regular mapping flight at the height of a block, with the accuracies
    of this block. None where a camera does not look down, or something is not known.
    """
    by_camera = [_at_corners(calibration, camera, block) for camera in calibration.cameras]
    known = [of_camera for of_camera in by_camera if of_camera is not None]
    return np.max(known, axis=0) if known else None


def _at_corners(calibration: Calibration, camera: Camera, block: Block) -> Array | None:
    flight = budget.like(block, camera)
    if flight is None or not budget.looks_down(camera):
        return None
    sources = budget.at_corners(calibration, camera, flight)
    return shares(sources, calibration)
