"""Weakest combination, correlations, nested tests and detectable errors of an adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations import PoseObservations
from acx4lib.bundle.reliability import parameter_effects, reliability
from acx4lib.bundle.unknowns import Layout, holding
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import (
    Calibration,
    GroupTest,
    estimated_columns,
    parameters,
    reported_covariance,
)
from acx4lib.calibration.mounting import Mountings
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.collinearity import mounted_jacobian
from acx4lib.geometry.frames import Pose, opk_jacobian
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM, POSE, REPORTED
from acx4lib.least_squares import adjustment, processors
from acx4lib.least_squares.covariance import correlation, propagate, sigmas
from acx4lib.least_squares.reduced_system import Inverse, held_at_zero

if TYPE_CHECKING:
    import pandas as pd

# --- Weak directions of an adjustment: condition, weakest combination, strong correlations


STRONG = 0.9
"""Absolute correlation above which a pair of parameters is named."""

SHARE = 0.05
"""Share of the weakest combination below which an unknown is not named."""

CARRIED = float(1 / np.finfo(float).eps)
"""Condition above which the weakest direction has no correct digit in double precision, 4.5e15."""

POSES = dict(
    zip(
        POSE,
        (
            *(f"{axis} of {{}}positions" for axis in AXES),
            *(f"{{}}attitudes about {axis}" for axis in "xyz"),
        ),
        strict=True,
    )
)
"""Name of an unknown of many poses, by its name in one; ``all`` where poses change alike."""


class Part(NamedTuple):
    """An unknown of the weakest combination; one entry stands for all poses.

    Attributes
    ----------
    unknown : str
        ``camera/parameter``, or one of `POSES`.
    share : float
        Square of its component in the eigenvector; all squares add up to one.
    """

    unknown: str
    share: float


class Pair(NamedTuple):
    """Two parameters, ``camera/parameter``, that are determined only together."""

    row: str
    column: str
    correlation: float


def weakest_combination(bundle: Bundle) -> tuple[Part, ...]:
    """Return the combination of unknowns that changes the residuals least.

    They form the eigenvector of the smallest eigenvalue of the normal matrix, after the points
    are eliminated and the unknowns are scaled to a diagonal of one. Empty where several
    directions are left open altogether: none of them is the weakest.

    Returns
    -------
    tuple of Part
        The largest first, down to a share of 5 %.
    """
    solution, layout = bundle.solution, bundle.network.layout
    if solution.defect > 1 or layout.n_columns == 0:
        return ()
    v, parts = solution.weakest, []
    for label, columns in zip(POSES.values(), layout.pose.T, strict=True):
        of_pose = v[columns[columns >= 0]]
        share = float(of_pose @ of_pose)
        n = len(of_pose)
        is_alike = n > 1 and np.sum(of_pose) ** 2 > 0.8 * n * share
        parts.append(Part(label.format("all " if is_alike else ""), share))
    names = bundle.network.column_names()
    for column in np.setdiff1d(np.arange(len(v)), layout.pose.ravel()):
        owner, key = names[column].rsplit("/", 1)
        if key in REPORTED and key not in BORESIGHT:  # a turn about a camera's axis has no other
            key = REPORTED[key][0]
        parts.append(Part(f"{owner}/{key}", float(v[column] ** 2)))
    return tuple(sorted((p for p in parts if p.share >= SHARE), key=lambda part: -part.share))


def strong_correlations(calibration: Calibration) -> tuple[Pair, ...]:
    """Return the pairs of reported parameters that correlate by more than 0.9, largest first.

    Parameters that the observations leave open altogether have no correlations.
    """
    listed = parameters(calibration)
    known = [i for i, p in enumerate(listed) if np.isfinite(p.sigma)]
    names = [p.full_name for p in listed]
    related = correlation(reported_covariance(calibration))
    pairs = [
        Pair(names[i], names[j], float(related[i, j]))
        for i, j in combinations(known, 2)
        if abs(related[i, j]) > STRONG
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair.correlation)))


# --- Correlations between the parameters that a bundle estimates (section 4.1); tests by
# adjusting


EXTERIOR = ("east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg")
"""The exterior orientation as results report it: relative to the grid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Correlations:
    """Correlations of a camera's interior with the exterior orientation of its images.

    Attributes
    ----------
    interior : tuple of str
        Names of the estimated interior parameters, as results report them.
    values : ndarray, shape (n_images, n_interior, 6)
        Correlations with the components of `EXTERIOR`, for oriented images only.
    """

    interior: tuple[str, ...]
    values: Array

    @property
    def largest(self) -> Array:
        """The largest absolute correlation of every pair, shape (n_interior, 6)."""
        return np.abs(self.values).max(axis=0, initial=0.0)


def parameter_correlations(calibration: Calibration) -> pd.DataFrame:
    """Return the correlation matrix of all reported parameters, by their names in results."""
    import pandas as pd  # noqa: PLC0415 it loads long

    listed, one = parameters(calibration), len(calibration.cameras) == 1
    names = [p.name if one else p.full_name for p in listed]
    matrix = correlation(reported_covariance(calibration))
    return pd.DataFrame(matrix, index=names, columns=names)


def interior_exterior(bundle: Bundle) -> Correlations:
    """Return how the interior orientation correlates with the exterior, image by image.

    Parameters
    ----------
    bundle : Bundle
        An adjustment of one camera.
    """
    network, images = bundle.network, bundle.network.block.images
    columns = network.layout.interior[0]
    estimated = np.flatnonzero(columns >= 0)
    oriented = np.flatnonzero(bundle.oriented)
    pose_idx, camera_idx = network.pose_idx[oriented], images.camera_idx[oriented]
    by_body, by_mount = mounted_jacobian(
        bundle.state.T_m_b[pose_idx], bundle.state.T_b_c[camera_idx]
    )
    unknowns = np.concatenate(
        [network.layout.mount[camera_idx], network.layout.pose[pose_idx]], axis=1
    )
    inverse, free = bundle.solution.inverse, columns[estimated]
    interior = held_at_zero(inverse, free[:, None], unknowns[:, None, :])
    cross = interior @ np.swapaxes(np.concatenate([by_mount, by_body], axis=2), 1, 2)
    frame, T_m_c = network.block.frame, bundle.T_m_c[oriented]
    to_grid = np.zeros((len(T_m_c), 6, 6))
    to_grid[:, :3, :3] = frame.grid_axes(T_m_c.r)
    to_grid[:, 3:, 3:] = opk_jacobian(frame.pose_to_grid(T_m_c)[1])
    sigma_exterior = sigmas(propagate(to_grid, bundle.camera_pose_covariances[oriented]))
    sigma_interior = sigmas(inverse.at(free[:, None], free))
    values = cross @ np.swapaxes(to_grid, 1, 2)
    return Correlations(
        interior=tuple(REPORTED[INTERIOR[i]][0] for i in estimated),
        values=values / sigma_interior[:, None] / sigma_exterior[:, None, :],
    )


def largest_pairs(correlations: Correlations, *, n: int = 4) -> dict[str, float]:
    """Return the largest absolute correlations by the names of their pairs, largest first.

    Parameters
    ----------
    correlations : Correlations
    n : int
        Number of pairs.

    Returns
    -------
    dict
        ``xp_mm/phi_deg`` and the like.
    """
    largest = correlations.largest
    order = np.argsort(-largest, axis=None, kind="stable")[:n]
    return {
        f"{correlations.interior[i]}/{EXTERIOR[j]}": float(largest[i, j])
        for i, j in zip(*np.unravel_index(order, largest.shape), strict=True)
    }


def nested_f_ratio(bundle: Bundle, test: GroupTest, against: Sequence[Camera]) -> float:
    """Return the F-ratio of a group from an adjustment that holds it at the given values.

    The observations are the same. In a linear problem the ratio equals that of `group_tests`.

    Parameters
    ----------
    bundle : Bundle
        In which the group was estimated.
    test : GroupTest
    against : sequence of Camera
        With the values to hold, in the order of the bundle's cameras.

    Returns
    -------
    float
        (v^T P v of this adjustment - v^T P v of the bundle) / (k sigma0^2).

    Raises
    ------
    AdjustmentError
        Where the adjustment does not converge.
    """
    network = bundle.network
    k = [camera.name for camera in network.block.cameras].index(test.camera)
    _, columns = estimated_columns(network.layout, k, test.keys)
    interiors, mounts, source = list(bundle.state.interiors), bundle.state.T_b_c, against[k]
    values = {key: getattr(source.interior, key) for key in test.keys if key in INTERIOR}
    interiors[k] = replace(interiors[k], **values)
    R, r = mounts.R.copy(), mounts.r.copy()
    r[k] = np.where(np.isin(LEVER_ARM, test.keys), source.T_b_c.r, r[k])
    if set(test.keys) & set(BORESIGHT):
        R[k] = source.T_b_c.R
    start = replace(bundle.state, interiors=tuple(interiors), T_b_c=Pose(R=R, r=r))
    held = adjust(replace(network, layout=holding(network.layout, columns), start=start))
    drop = held.solution.cost - bundle.solution.cost
    return drop / len(test.keys) / bundle.solution.sigma0_sq


# --- The smallest detectable errors of each group of observations, and their effects


@dataclass(frozen=True, kw_only=True)
class Detectable:
    """One component of one group of observations.

    Attributes
    ----------
    kind : str
        Of the group, as `Group.kind`.
    component : int
        Its column in the group.
    redundancy : ndarray, shape (n,)
        Redundancy numbers of the n observations that take part.
    bias : ndarray, shape (n,)
        Smallest error of each that is found with a probability of 80 %, in the unit of the
        observation, angles in radians; infinite where nothing controls it.
    effect : float
        Largest effect of such an error on a parameter, in its sigmas; NaN without parameters.
    on : str
        That parameter, ``camera/parameter`` with the library's name of it.
    """

    kind: str
    component: int
    redundancy: Array
    bias: Array
    effect: float
    on: str


def detectable(bundle: Bundle) -> tuple[Detectable, ...]:
    """Return every component of every group of observations that takes part in a bundle."""
    layout, names, out = bundle.network.layout, bundle.network.column_names(), []
    columns = np.concatenate([layout.interior.ravel(), layout.mount.ravel()])
    columns = columns[columns >= 0]  # what images share
    effects = parameter_effects(bundle, columns)
    for group, effect in zip(bundle.solution.groups, effects, strict=True):
        tested = reliability(group)
        for d in range(tested.redundancy.shape[1]):
            used = np.isfinite(tested.redundancy[:, d])
            if not used.any():
                continue
            largest, on = np.nan, ""
            if len(columns):
                by_parameter = np.abs(effect[used, d]).max(axis=0)
                largest = float(by_parameter.max())
                on = names[columns[int(np.argmax(by_parameter))]]
            out.append(
                Detectable(
                    kind=group.kind,
                    component=d,
                    redundancy=tested.redundancy[used, d],
                    bias=tested.detectable[used, d],
                    effect=largest,
                    on=on,
                )
            )
    return tuple(out)


# --- The lever arm that an interior orientation took up: two-step against single step
# (section 4.2)
#
# A bundle that observes positions and holds a wrong lever arm distributes its error over f, x_p,
# y_p, the tilts of the images, the ground and the residuals of the positions. Least squares gives
# the share of each, and so the expected difference of the two methods.


ABSORBING = ("f", "xp", "yp")
"""The parameters of an interior orientation that absorb a lever arm."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Absorption:
    """The change of interior orientation in `two_step_gnss`, and the lever arm that explains it.

    With n cameras, m = 3 n.

    Attributes
    ----------
    cameras : tuple of str
    by_lever : ndarray, shape (m, m)
        d(f, x_p, y_p of every camera) / d(lever arm of every camera less the held lever arm), along
        the body's axes, mm per m.
    shift_mm : ndarray, shape (m,)
        Interior orientation of `two_step_gnss` less that of `single_step`.
    lever_m : ndarray, shape (m,)
        Lever arm of `single_step` less the held lever arm of `two_step_gnss`, body's axes.
    cov_mm : ndarray, shape (m, m)
        A priori covariance of `shift_mm` - `by_lever` @ `lever_m`.
    """

    cameras: tuple[str, ...]
    by_lever: Array
    shift_mm: Array
    lever_m: Array
    cov_mm: Array

    @property
    def lever_seen_m(self) -> Array:
        """The lever arm that corresponds to the shift, in the form of `lever_m`."""
        return np.linalg.solve(self.by_lever, self.shift_mm)

    @property
    def cov_lever_m(self) -> Array:
        """A priori covariance of `lever_seen_m` - `lever_m`, shape (m, m)."""
        return propagate(np.linalg.inv(self.by_lever), self.cov_mm)


def absorption(mountings: Mountings) -> Absorption | None:
    """Compare the two methods; None where they cannot be compared.

    Both must have an outcome and estimate f, x_p and y_p, and the single step must have no
    unknown errors of GNSS positions.

    Notes
    -----
    By Gauss and Markov the single step, which uses the same observations and also the attitudes, is
    uncorrelated with its difference from any other unbiased estimate. So the covariance of the
    difference is the difference of the covariances [1]_. Both methods share nearly all of their
    errors, so this difference is far smaller than either covariance. Both covariances are therefore
    computed at the state of the single step: at different states, the derivatives alone would make
    them differ by as much.

    References
    ----------
    .. [1] J. A. Hausman, "Specification tests in econometrics", Econometrica 46, 1978.
    """
    if not {"single_step", "two_step_gnss"} <= set(mountings.methods):
        return None
    single, gnss = mountings["single_step"], mountings["two_step_gnss"]
    by_single, by_gnss = single.calibration, gnss.calibration
    if np.any(_columns(by_single.layout) < 0) or np.any(_columns(by_gnss.layout) < 0):
        return None
    if trajectory_errors.parameters(single.bundle):
        return None
    network, state = gnss.bundle.network, single.bundle.state
    same = replace(
        gnss.bundle.state, interiors=state.interiors, T_m_b=single.bundle.T_m_c, x_m=state.x_m
    )
    with processors.on_one_thread():
        inverse = adjustment.normals(network, same).precision().inverse
    J, rows = by_lever_arms(network, inverse), _columns(network.layout)
    lever, held = (
        np.concatenate([camera.T_b_c.r for camera in of.cameras]) for of in (by_single, by_gnss)
    )
    return Absorption(
        cameras=tuple(camera.name for camera in by_single.cameras),
        by_lever=J,
        shift_mm=_interior(by_gnss) - _interior(by_single),
        lever_m=lever - held,
        cov_mm=inverse.at(rows[:, None], rows) - _covariance(by_single, J),
    )


def by_lever_arms(network: Network, inverse: Inverse) -> Array:
    """Return d(interior orientation) / d(lever arms beyond those held) of a two-step bundle.

    Parameters
    ----------
    network : Network
        Free exterior orientations whose positions are observed.
    inverse : Inverse
        Covariance of its unknowns.

    Returns
    -------
    ndarray, shape (3 n_cameras, 3 n_cameras)
        f, x_p, y_p of every camera by the lever arm of every camera along the body's axes, mm/m.

    Notes
    -----
    An observed position that is off by e changes the unknowns by Q A^T P e. A lever arm that is
    longer than the one held by l has every position observed short of the camera by R_m_b l.
    """
    observed, block = network.observed, network.block
    rows, positions = _columns(network.layout), network.layout.pose[:, :3]
    Q = inverse.at(rows[:, None, None], positions)
    n_cameras = len(block.cameras)
    J = np.zeros((len(rows), n_cameras, 3))
    for k in range(n_cameras):
        of_camera = block.images.camera_idx == k
        affected = of_camera if observed.of_positions is None else np.ones_like(of_camera)
        by_image = _weighed(observed, block.T_m_b_images.R * of_camera[:, None, None])
        J[:, k] = -np.einsum("rna,nab->rb", Q[:, affected], by_image[affected])
    return J.reshape(len(rows), -1)


def _weighed(observed: PoseObservations, errors: Array) -> Array:
    """Return the weights of observed positions times their errors, (n, 3, k)."""
    if observed.of_positions is None:
        weight = 1 / observed.sigma_position**2
        P = np.einsum("nai,na,naj->nij", observed.R_g_m, weight, observed.R_g_m)
        return np.asarray(P @ errors)
    sigma = observed.sigma_position[:, :, None]
    along_grid = observed.of_positions.times(observed.R_g_m @ errors / sigma) / sigma
    return np.swapaxes(observed.R_g_m, -1, -2) @ along_grid


def effective_heights(calibration: Calibration, by_lever: Array) -> Array:
    """Return the flying heights at which a lever arm alone would change f, x_p, y_p as much.

    Parameters
    ----------
    calibration : Calibration
    by_lever : ndarray, shape (3 n_cameras, 3 n_cameras)
        As `by_lever_arms` returns it.

    Returns
    -------
    ndarray, shape (n_cameras, 3)
        For lever arm components along each camera's x, y, z, which x_p, y_p and f absorb, m.
    """
    heights = []
    for k, camera in enumerate(calibration.cameras):
        by_own_arm = by_lever[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] @ camera.T_b_c.R
        heights.append(
            [-camera.interior.f / by_own_arm[row, axis] for axis, row in enumerate((1, 2, 0))]
        )
    return np.array(heights)


def _columns(layout: Layout) -> Index:
    """Return the columns of f, x_p, y_p of every camera, shape (3 n_cameras,)."""
    return layout.interior[:, [INTERIOR.index(name) for name in ABSORBING]].ravel()


def _interior(calibration: Calibration) -> Array:
    interiors = [camera.interior for camera in calibration.cameras]
    return np.array([getattr(i, name) for i in interiors for name in ABSORBING])


def _covariance(calibration: Calibration, by_lever: Array) -> Array:
    """Return the covariance of interior orientation + by_lever @ lever arm, a priori."""
    layout = calibration.layout
    columns = np.concatenate([_columns(layout), layout.mount[:, :3].ravel()])
    J = np.hstack([np.eye(len(by_lever)), by_lever])[:, columns >= 0]
    free = columns[columns >= 0]
    return propagate(J, calibration.cov[np.ix_(free, free)])
