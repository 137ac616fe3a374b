"""Whether the heads of a rig keep their places: the free rig against the rigid one.

In the rigid rig every head has one boresight at all exposures. In the free rig the heads turn at an
exposure, each by three small angles against the first head there. The free rig has smaller
residuals in any case; an F test says whether they are smaller than by chance. Positions are no part
of it: a lens that moves by a millimetre moves a point on the ground by as much.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.covariance import sigmas
from acx4lib.least_squares.normal_equations import column_normals, point_normals, strips
from acx4lib.least_squares.problem import Equations
from acx4lib.least_squares.statistical import distributions
from acx4lib.least_squares.statistical.many_tests import holm

MOST_COLUMNS = 10_000
"""Unknowns of the free rig without its points, whose normal matrix has 0.8 GB."""

OPEN = 1e-9
"""Eigenvalue of the scaled normal matrix, as a share of the largest, of what is no deformation."""


@dataclass(frozen=True, kw_only=True)
class FTest:
    """A test of additional unknowns.

    Attributes
    ----------
    explained : float
        By how much the weighted sum of squared residuals is smaller with them.
    left : float
        What is left of it.
    dof : int
        Number of the unknowns.
    redundancy : int
        With them.
    """

    explained: float
    left: float
    dof: int
    redundancy: int

    @property
    def f(self) -> float:
        """(explained / dof) / (left / redundancy)."""
        return self.explained / self.dof / (self.left / self.redundancy)

    @property
    def p(self) -> float:
        """Probability of such an F, or a larger one, if the additional unknowns are zero."""
        return distributions.f_sf(self.f, self.dof, self.redundancy)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rigidity:
    """Tests of a rig, exposure by exposure and of all exposures at once.

    Attributes
    ----------
    heads : tuple of str
    exposures : tuple of str
        Those at which two or more heads have measurements.
    turns, sigma : ndarray, shape (n_exposures, n_heads, 3)
        Rotation of every head against the first one that measured, about the head's axes, if the
        rig is rigid at all other exposures; radians, sigma a posteriori. Zero of the first head,
        NaN of one that has not measured.
    tests : tuple of FTest
        One for each exposure.
    whole : FTest
        Of all exposures at once, less what the boresights take up.
    """

    heads: tuple[str, ...]
    exposures: tuple[str, ...]
    turns: Array
    sigma: Array
    tests: tuple[FTest, ...]
    whole: FTest

    @property
    def p_joint(self) -> Array:
        """Probabilities of the tests by exposure, comparable with one joint level, by Holm."""
        return holm(np.array([test.p for test in self.tests]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Turns:
    """The additional unknowns: three angles for each of these images."""

    images: Index
    exposure: Index

    def columns(self, exposure: int) -> Index:
        own = np.flatnonzero(self.exposure == exposure)
        return (3 * own[:, None] + np.arange(3)).ravel()


def rigidity(bundle: Bundle) -> Rigidity:
    """Test whether the heads of a rig turn against each other.

    Parameters
    ----------
    bundle : Bundle
        Of a rig, as `rig.calibrate` adjusts it, with free boresights.

    Raises
    ------
    AdjustmentError
        Where no exposure has measurements of two heads, or there are too many unknowns.

    Notes
    -----
    From the rigid adjustment alone: with M and g the normal equations of the angles of an exposure,
    reduced by all other unknowns, the sum of squares falls by g^T M^-1 g. This is exact where the
    residuals are linear in the angles, which are seconds of arc.
    """
    expected.instance("bundle", bundle, Bundle)
    network, solution = bundle.network, bundle.solution
    turning = _turning(network)
    if not len(turning.images):
        msg = "no exposure has measurements of two heads, so that nothing can turn between them"
        raise AdjustmentError(msg)
    n = network.n_columns + 3 * len(turning.images)
    if n > MOST_COLUMNS:
        msg = f"the free rig has {n} unknowns besides its points; at most {MOST_COLUMNS} are tested"
        raise AdjustmentError(msg)
    M, g = _reduced_by_rigid(network, _with_turns(bundle, turning), n)
    omega, r = solution.sigma0_sq * solution.redundancy, solution.redundancy
    n_images = len(network.block.images)
    angles, sigma = np.full((n_images, 3), np.nan), np.full((n_images, 3), np.nan)
    exposures, tests = np.unique(turning.exposure), []
    for exposure in exposures.tolist():
        own = turning.columns(exposure)
        cov = np.linalg.inv(M[np.ix_(own, own)])
        explained = float(g[own] @ cov @ g[own])
        tests.append(_test(explained, omega, len(own), r))
        images = turning.images[turning.exposure == exposure]
        angles[images] = (-cov @ g[own]).reshape(-1, 3)
        sigma[images] = np.sqrt(solution.sigma0_sq) * sigmas(cov).reshape(-1, 3)
    return Rigidity(
        heads=tuple(camera.name for camera in network.block.cameras),
        exposures=tuple(network.pose_names[e] for e in exposures),
        turns=_by_head(network, angles, exposures),
        sigma=_by_head(network, sigma, exposures),
        tests=tuple(tests),
        whole=_whole(M, g, omega, r),
    )


def _turning(network: Network) -> _Turns:
    """Return the images that turn: of every exposure all measured ones but the first head's."""
    images = network.block.images
    measured = np.unique(network.image_points.image_idx)
    order = np.lexsort((images.camera_idx[measured], network.pose_idx[measured]))
    ordered = measured[order]
    exposure = network.pose_idx[ordered]
    later: Mask = np.append(False, exposure[1:] == exposure[:-1])
    return _Turns(images=ordered[later], exposure=exposure[later])


def _with_turns(bundle: Bundle, turning: _Turns) -> list[Equations]:
    """Return the linearised observations; those of image points have the angles, too.

    An angle acts on its image as the boresight of the head does.
    """
    network = bundle.network
    seen, *others = network.equations(bundle.state)
    camera = network.block.images.camera_idx
    n_images = len(camera)
    angles = np.full((n_images, 3), -1)
    angles[turning.images] = network.n_columns + np.arange(3 * len(turning.images)).reshape(-1, 3)
    boresight = network.layout.mount[camera, 3:]
    at = np.argmax(seen.columns[:, :, None] == boresight[:, None, :], axis=1)
    A = np.take_along_axis(seen.A, at[seen.unit][:, None, :], axis=2)
    both = replace(
        seen,
        A=np.concatenate([seen.A, A], axis=2),
        columns=np.concatenate([seen.columns, angles], axis=1),
    )
    return [both, *others]


def _reduced_by_rigid(network: Network, equations: list[Equations], n: int) -> tuple[Array, Array]:
    """Return the normal equations of the angles, reduced by all unknowns of the rigid rig."""
    N, g = column_normals(n, equations)
    V, h = point_normals(network.free_points, equations)
    for points, strip in strips(n, network.free_points, equations):
        L_inv = np.linalg.inv(np.linalg.cholesky(V[points]))
        Z = (L_inv @ strip).reshape(3 * len(strip), -1)
        N -= Z.T @ Z
        g -= Z.T @ np.einsum("pij,pj->pi", L_inv, h[points]).ravel()
    rigid, free = np.arange(network.n_columns), np.arange(network.n_columns, n)
    scale = 1 / np.sqrt(N.diagonal()[rigid])
    scaled = N[np.ix_(rigid, rigid)] * scale[:, None] * scale
    across = N[np.ix_(rigid, free)] * scale[:, None]
    gain = np.linalg.solve(scaled, np.column_stack([across, g[rigid] * scale]))
    left = np.column_stack([N[np.ix_(free, free)], g[free]]) - across.T @ gain
    return left[:, :-1], left[:, -1]


def _test(explained: float, omega: float, dof: int, redundancy: int) -> FTest:
    return FTest(explained=explained, left=omega - explained, dof=dof, redundancy=redundancy - dof)


def _whole(M: Array, g: Array, omega: float, redundancy: int) -> FTest:
    """Test all angles at once; a turn that a head has at all exposures is its boresight."""
    scale = 1 / np.sqrt(M.diagonal())
    values, vectors = np.linalg.eigh(M * scale[:, None] * scale)
    kept = values > OPEN * values[-1]
    along = vectors[:, kept].T @ (scale * g)
    return _test(float(np.sum(along**2 / values[kept])), omega, int(kept.sum()), redundancy)


def _by_head(network: Network, values: Array, exposures: Index) -> Array:
    """Return values of images by exposure and head; zero for the first head that measured."""
    out = np.full((len(network.pose_names), len(network.block.cameras), 3), np.nan)
    measured = np.unique(network.image_points.image_idx)
    camera = network.block.images.camera_idx[measured]
    out[network.pose_idx[measured], camera] = np.nan_to_num(values[measured])
    by_exposure: Array = out[exposures]
    return by_exposure
