"""What a change of a camera's parameters moves on the ground, over its format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.calibration.estimates import reported_values, with_reported
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.covariance import sigmas
from acx4lib.results.campaigns.comparison import Comparison

NODES = 15
"""Nodes along each side of the format."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundEffects:
    """Derivatives of points on level ground, seen by a camera of which body and height are known.

    Attributes
    ----------
    colrow : ndarray, shape (n, 2)
        Nodes over the format, pixels; those that see the ground.
    xy : ndarray, shape (n, 2)
        Where they lie, forward and left of the body, m.
    J : ndarray, shape (n, 2, k)
        d(forward, left) / d(parameter), m per unit of the parameter.
    """

    colrow: Array
    xy: Array
    J: Array

    def of(self, which: Index) -> GroundEffects:
        """Return the effects of some of the parameters."""
        return replace(self, J=self.J[:, :, which])

    def moved(self, d: Array) -> Array:
        """Return what changes of all parameters together move, m, shape (n, 2)."""
        out: Array = self.J @ d
        return out

    def rms(self, d: Array) -> Array:
        """Return the root mean square of what every parameter moves by itself, m, shape (k,)."""
        each = np.sum((self.J * d) ** 2, axis=1)
        out: Array = np.sqrt(each.mean(axis=0))
        return out

    def sigma(self, cov: Array) -> Array:
        """Return the standard deviation of the plane vector at the nodes, m, shape (n,)."""
        variance = np.einsum("nia,ab,nib->n", self.J, cov, self.J, optimize=True)
        out: Array = np.sqrt(variance)
        return out


def ground_effects(
    camera: Camera, names: Sequence[str], steps: Array, *, height_m: float
) -> GroundEffects:
    """Return what a camera's parameters move on level ground, in a single image.

    The body is level and its pose is right, as with direct georeferencing onto a known height. A
    change of the focal length changes the scale in the image, one of the lever arm's z the height.

    Parameters
    ----------
    camera : Camera
    names : sequence of str
        Parameters by their names in results, in any number.
    steps : ndarray, shape (k,)
        Steps of the central differences, such as standard deviations.
    height_m : float
        Of the body above the ground.
    """
    expected.shape("steps", steps, (len(names),))
    expected.positive("steps", steps)
    expected.positive_number("height_m", height_m)
    w, h = camera.width_px - 1, camera.height_px - 1
    col, row = np.meshgrid(np.linspace(0, w, NODES), np.linspace(0, h, NODES))
    colrow = np.column_stack([col.ravel(), row.ravel()])
    own = reported_values(camera)
    J = np.empty((len(colrow), 2, len(names)))
    for k, (name, step) in enumerate(zip(names, steps.tolist(), strict=True)):
        ahead, behind = (
            _on_ground(with_reported(camera, {name: own[name] + s}), colrow, height_m)
            for s in (step, -step)
        )
        J[:, :, k] = (ahead - behind) / (2 * step)
    xy = _on_ground(camera, colrow, height_m)
    seen = np.isfinite(xy).all(axis=1) & np.isfinite(J).all(axis=(1, 2))
    return GroundEffects(colrow=colrow[seen], xy=xy[seen], J=J[seen])


def _on_ground(camera: Camera, colrow: Array, height_m: float) -> Array:
    """Return where rays of a camera on a level body meet the ground, m, NaN for rays upwards."""
    r = camera.T_b_c.r + np.array([0.0, 0.0, height_m])
    n = len(colrow)
    ray = rays(camera, Pose(R=np.tile(camera.T_b_c.R, (n, 1, 1)), r=np.tile(r, (n, 1))), colrow)
    down = np.where(ray[:, 2] < 0, -ray[:, 2], np.nan)
    out: Array = r[:2] + ray[:, :2] * (r[2] / down)[:, None]
    return out


# --- of a comparison -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Effects on the ground of the parameters of a comparison, camera by camera.

    Attributes
    ----------
    height_m : float
    of : dict of str to GroundEffects
        By camera; the parameters are those of the camera, in their order.
    """

    height_m: float
    of: Mapping[str, GroundEffects]


def ground_of(comparison: Comparison, *, height_m: float | None = None) -> Ground:
    """Return what the parameters of a comparison move on the ground.

    Parameters
    ----------
    comparison : Comparison
    height_m : float, optional
        By default the flying height of the first campaign, rounded to 10 m.
    """
    expected.instance("comparison", comparison, Comparison)
    first = comparison.campaigns[0]
    height = max(10.0, round(first.height_m, -1)) if height_m is None else height_m
    sigma = sigmas(comparison.covs[0])
    of = {}
    for camera in first.calibration.cameras:
        own = comparison.of_camera(camera.name)
        if len(own):
            names = [comparison.parameters[i].name for i in own]
            of[camera.name] = ground_effects(camera, names, sigma[own], height_m=height)
    return Ground(height_m=height, of=of)
