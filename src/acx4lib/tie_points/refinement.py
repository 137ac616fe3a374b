"""Refinement of the heads by tie points, with their turns from exposure to exposure.

Thousands of tie points of one exposure share errors: a shutter opens late while the aircraft
turns, the ground has parallax, a mount gives. Their number does not average these errors out; the
number of exposures does. So they are a variance component of their own: at every exposure each
head has its own turn, with the same variance for all heads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize, sparse

from acx4lib import expected, shown
from acx4lib.bundle.start import HUBER_WIDTH, SUSPECT, sizes, spread
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import (
    INTERIOR,
    Camera,
    border_distance,
    correct,
    correct_jacobian,
    xy_from_colrow,
)
from acx4lib.geometry.frames import (
    exp,
    opk_from_rotation,
    opk_jacobian,
    rotation_from_opk,
    skew,
    transform,
)
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.reduced_system import Dense
from acx4lib.synthetic_image.frame import head_from_synthetic, synthetic_from_head
from acx4lib.tie_points.ties import TiePoints, check_ties

if TYPE_CHECKING:
    import pandas as pd


ALPHA = 0.01
"""Probability of a component where the noise of the tie points explains the scatter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OneExposure:
    """The normal equations of one exposure's tie points, at the common estimate.

    Attributes
    ----------
    N : ndarray, shape (n, n)
    h : ndarray, shape (n,)
        J^T P d.
    """

    N: Array
    h: Array


def components(exposures: Sequence[OneExposure], axis: Index, sigma0_sq: float) -> Array:
    """Return the variance of a head's turns between exposures, beyond the noise of tie points.

    Parameters
    ----------
    exposures : sequence of OneExposure
        Two or more; those that do not determine all unknowns by themselves take no part.
    axis : ndarray of int, shape (n,)
        Which component of its head an unknown is; heads have one variance for each.
    sigma0_sq : float
        Variance of unit weight of the tie points.

    Returns
    -------
    ndarray, shape (n,)
        For every unknown that of its component; zero where the scatter is no more than chance.

    Notes
    -----
    Of the estimate x_i of one exposure, x_i less the common one has the variance c_i + 2 t: that
    of its noise, and that of two heads. The variance t is the one at which the sum of their
    weighted squares is its expectation [1]_.

    References
    ----------
    .. [1] R. C. Paule and J. Mandel, "Consensus values and weighting factors", Journal of Research
       of the National Bureau of Standards 87, 1982.
    """
    turns, noise = [], []
    for exposure in exposures:
        if np.linalg.matrix_rank(exposure.N, hermitian=True) == len(exposure.N):
            turns.append(-np.linalg.solve(exposure.N, exposure.h))
            noise.append(sigma0_sq * np.diag(np.linalg.inv(exposure.N)))
    out = np.zeros(len(axis))
    if len(turns) < 2:
        return out
    x, c = np.array(turns), np.array(noise)
    for k in np.unique(axis):
        rows = np.flatnonzero(axis == k)
        out[rows] = _variance(x[:, rows], c[:, rows])
    return out


def _variance(x: Array, c: Array) -> float:
    """Return t if x of exposures (rows) scatters about its mean with the variance c + 2 t."""
    dof = (len(x) - 1) * x.shape[1]
    if statistics.chi2_sf(_weighted_squares(x, c, 0.0), dof) > ALPHA:
        return 0.0
    largest = float(np.sum((x - x.mean(axis=0)) ** 2))
    return float(
        optimize.brentq(
            lambda t: _weighted_squares(x, c, t) - dof, 0.0, largest, xtol=1e-15 * largest
        )
    )


def _weighted_squares(x: Array, c: Array, t: float) -> float:
    weight = 1 / (c + 2 * t)
    mean = np.sum(weight * x, axis=0) / np.sum(weight, axis=0)
    return float(np.sum(weight * (x - mean) ** 2))


def covariance(exposures: Sequence[OneExposure], axis: Index, variance: Array) -> Array:
    """Return the covariance of the estimate due to turns of heads at single exposures.

    Parameters
    ----------
    exposures, axis
        As in `components`.
    variance : ndarray, shape (n,)
        From `components`.

    Returns
    -------
    ndarray, shape (n, n)
        N^-1 (sum of N_i Q N_i) N^-1, where Q has twice the variance for each head, since the held
        head turns as well, and once between heads.
    """
    same_axis = axis[:, None] == axis
    Q = np.where(same_axis, variance[:, None] * (1 + np.eye(len(axis))), 0.0)
    N = np.sum([exposure.N for exposure in exposures], axis=0)
    solved = np.linalg.solve(N, np.concatenate([exposure.N for exposure in exposures], axis=1))
    n = len(axis)
    parts = solved.reshape(n, len(exposures), n).swapaxes(0, 1)
    return np.einsum("eij,jk,elk->il", parts, Q, parts)


# --- Refinement of the heads' rotations by least squares over all tie points (section 2.1)
#
# The paper shifts the heads by mean differences (`ties.refine_by_mean_differences`). But an error
# of a head's rotation shifts its pixels by amounts that vary over the overlap. Here the rotations
# of all heads are estimated together; the first head is held.
#
# The held head is a datum, not the truth. Tie points cannot detect an error of the first head, or
# one that all heads share; it remains.


FREE = {"rotations": (3, 4, 5), "six": (0, 1, 2, 3, 4, 5)}
"""Unknowns of a head among Xc, Yc, Zc and the rotation about its axes."""

BLOCKS = (4, 3)
"""Blocks along columns and rows of a frame, where there is one exposure."""

MOST_TIMES = 10.0
"""Largest ratio of the sigma of an unknown from a block alone to the sigma from an even share of
all tie points, for a block in the variance: heads that see other ground share only borders."""

STEPS, NEARLY_MM, DONE_MM = 100, 5e-6, 1e-12
"""Largest number of steps with one loss, and steps in the image that end them (the first 1e-3 px,
while points are rejected)."""

TUKEY_WIDTH = 5.0
"""In spreads; with normally distributed errors in two coordinates, efficiency is 95 %."""

Loss = Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """The refined orientation of heads, and its quality.

    Attributes
    ----------
    orientation : RelativeOrientation
        Its `cov_joint` takes into account that tie points reduce the heads' errors, including
        those of interior orientations, and that tie points have noise.
    sigma0 : float
        Standard deviation of unit weight; one if the `sigma_px` of the tie points are right.
    rejected : ndarray, shape (n_ties,)
        Tie points that disagree with most others; they have no weight.
    turn_sigma : ndarray, shape (n_heads, 3)
        Of the changes of omega, phi, kappa, rad: where tie points are precise, the standard
        deviation of the removed error.
    held : str
        The head whose orientation is held.
    unreached : tuple of str
        Heads without tie points; their orientation does not change.
    by_exposure : tuple of float
        Standard deviations of a head's errors at a single exposure, beyond the noise of tie points:
        of its unknowns, about or along its axes, rad or mm. Part of the covariance. With a single
        exposure, of its errors in a block of the frame (`BLOCKS`).
    one_exposure : bool
        Whether all tie points are of a single exposure.
    """

    orientation: RelativeOrientation
    sigma0: float
    rejected: Mask
    turn_sigma: Array
    held: str
    unreached: tuple[str, ...]
    by_exposure: tuple[float, ...] = ()
    one_exposure: bool = False

    def __repr__(self) -> str:
        """Describe the fit of the tie points in one line."""
        names = shown.names([head.name for head in self.orientation.heads])
        n = f"{int(self.rejected.sum())} of {shown.count(len(self.rejected), 'tie point')} rejected"
        return shown.line("Refined", names, f"{self.held} held", f"σ0 {self.sigma0:.3f}", n)

    def table(self) -> pd.DataFrame:
        """Return the refined orientation of every head."""
        return self.orientation.table()

    @property
    def sentence(self) -> str:
        """A note on turns of heads from exposure to exposure; empty without turns."""
        turns = np.degrees(self.by_exposure[-3:])
        listed = ", ".join(f"{turn:.4f}" for turn in turns)
        differs = f"say of a head differs by {listed} degrees about its x, y, z"
        if self.one_exposure:
            text = "tie points are of one exposure: how heads scatter between exposures is not seen"
            why = "(parallax, what lenses leave); standard deviations count it"
            return f"{text}; what blocks of the frame {differs} {why}" if np.any(turns) else text
        why = (
            "(parallax of other flying heights, shutters that open at other times, a mount that "
            "gives); standard deviations count it"
        )
        text = f"beyond the noise of tie points, what exposures {differs} {why}"
        return text if np.any(turns) else ""


# --- refinement ------------------------------------------------------------------------------


def refine_by_rotations(
    orientation: RelativeOrientation, ties: TiePoints, *, free: str = "rotations"
) -> Refined:
    """Turn the heads so that all their overlaps agree; hold the first head.

    Robust least squares over the differences in the synthetic image: first with Huber's loss,
    which has one minimum, then with Tukey's. Then points with misfits above `start.SUSPECT`
    spreads are rejected, and the others are adjusted without weights.

    Parameters
    ----------
    orientation : RelativeOrientation
    ties : TiePoints
        Of one exposure, or of many exposures for a common result.
    free : {"rotations", "six"}
        Three rotations of every head, or Xc, Yc, Zc as well. The positions of the heads then
        compensate effects of interior orientations in the overlaps; the rest of the frame does
        not always improve.

    Returns
    -------
    Refined
        Heads without tie points keep their orientation; the first head with tie points is held.

    Raises
    ------
    AdjustmentError
        Where groups of heads share no tie points, or too few.
    ValueError
        For tie points of other heads, or another value of `free`.
    """
    expected.one_of("free", free, FREE)
    check_ties(ties, orientation)
    sigma = _sigma_mm(orientation, ties)
    used: Mask = np.isfinite(sigma)
    heads = orientation
    for loss in (_huber, _tukey):
        heads = _adjusted(heads, ties[used], sigma[used], FREE[free], loss, NEARLY_MM)
    used[used] = _in_spreads(tie_differences(heads, ties[used]), sigma[used]) <= SUSPECT
    heads = _adjusted(heads, ties[used], sigma[used], FREE[free], np.ones_like, DONE_MM)
    return _refined(orientation, heads, ties, sigma=sigma, used=used, free=FREE[free])


def _sigma_mm(orientation: RelativeOrientation, ties: TiePoints) -> Array:
    """Return the standard deviation of a difference in one coordinate, shape (n,)."""
    variance = np.zeros(len(ties))
    for k, colrow, rows, _ in _sides(ties):
        for s in 0.5 * np.eye(2):
            ahead, behind = (synthetic_from_head(orientation, k, colrow + d) for d in (s, -s))
            # mean of the two directions of the synthetic image
            variance[rows] += 0.5 * np.sum((ahead - behind) ** 2, axis=1)
    return ties.sigma_px * np.sqrt(variance)


# --- unknowns --------------------------------------------------------------------------------


def _columns(orientation: RelativeOrientation, ties: TiePoints, free: tuple[int, ...]) -> Index:
    """Return the columns of the unknowns; every head has `PER_HEAD` columns."""
    tied = _tied(orientation, ties)
    return np.array([PER_HEAD * k + j for k in tied[1:] for j in free], dtype=np.intp)


def _tied(orientation: RelativeOrientation, ties: TiePoints) -> Index:
    """Return the heads with tie points; raise if these do not connect all of them."""
    n = len(orientation.heads)
    links = sparse.coo_array((np.ones(len(ties)), (ties.head_a, ties.head_b)), shape=(n, n))
    n_groups, group = sparse.csgraph.connected_components(links, directed=False)
    sets = [np.flatnonzero(group == g) for g in range(n_groups)]
    tied = [heads for heads in sets if len(heads) > 1]
    if not tied:
        raise AdjustmentError("no two heads share a good tie point, so nothing can be refined")
    if len(tied) > 1:
        groups = " and ".join(f"heads {_names(orientation, heads)}" for heads in tied)
        msg = f"{groups} share no good tie point, so nothing turns one group to the other"
        raise AdjustmentError(msg)
    return tied[0]


def _names(orientation: RelativeOrientation, heads: Index) -> str:
    return ", ".join(orientation.heads[k].name for k in heads)


# --- steps -----------------------------------------------------------------------------------


def _in_spreads(d: Array, sigma: Array) -> Array:
    """Return the lengths of differences, divided by their robust standard deviation."""
    each = np.broadcast_to(sigma[:, None], d.shape)
    return sizes(d, each)[:, 0] / spread(d, each)


def _huber(u: Array) -> Array:
    return HUBER_WIDTH / np.maximum(u, HUBER_WIDTH)


def _tukey(u: Array) -> Array:
    return np.square(1 - np.square(np.minimum(u / TUKEY_WIDTH, 1.0)))


def _adjusted(
    orientation: RelativeOrientation,
    ties: TiePoints,
    sigma: Array,
    free: tuple[int, ...],
    loss: Loss,
    done_mm: float,
) -> RelativeOrientation:
    """Return the orientation after steps of Gauss and Newton; weights follow from differences."""
    columns = _columns(orientation, ties, free)
    in_mm = np.repeat([1.0, orientation.heads[0].interior.f], 3)
    for _ in range(STEPS):
        d = tie_differences(orientation, ties)
        weight = loss(_in_spreads(d, sigma)) / sigma**2
        N, h = _normals(_by_pair(orientation, ties), d, weight, len(orientation.heads))
        system = Dense(N=N[np.ix_(columns, columns)], diagonal=np.diag(N)[columns])
        dx = np.zeros((len(orientation.heads), PER_HEAD))
        dx.flat[columns] = -system.solve(h[columns])
        orientation = _moved(orientation, dx)
        if np.max(np.abs(dx[:, :6] * in_mm)) < done_mm:
            break
    return orientation


def _moved(orientation: RelativeOrientation, dx: Array) -> RelativeOrientation:
    R = rotation_from_opk(orientation.opk) @ exp(dx[:, 3:6])
    return replace(orientation, xyz_mm=orientation.xyz_mm + dx[:, :3], opk=opk_from_rotation(R))


# --- quality ---------------------------------------------------------------------------------


def _refined(
    start: RelativeOrientation,
    now: RelativeOrientation,
    ties: TiePoints,
    *,
    sigma: Array,
    used: Mask,
    free: tuple[int, ...],
) -> Refined:
    """Return the result with its covariance, if the tie points determine it."""
    columns = _columns(start, ties[used], free)
    d, parts = tie_differences(now, ties[used]), list(_by_pair(now, ties[used]))
    weight = 1 / sigma[used] ** 2
    N, _ = _normals(parts, d, weight, len(now.heads))
    inverse = Dense(N=N[np.ix_(columns, columns)], diagonal=np.diag(N)[columns]).inverse()
    redundancy = 2 * int(used.sum()) - len(columns)
    if inverse.defect or redundancy <= 0:
        loose = inverse.undetermined if inverse.defect else np.ones(len(columns), dtype=bool)
        names = _names(start, np.unique(columns[loose] // PER_HEAD))
        msg = (
            f"{used.sum()} good tie points do not tell how to turn {names}: every overlap needs "
            "several, well apart"
        )
        raise AdjustmentError(msg)
    u = d / sigma[used, None]
    sigma0_sq = float(np.sum(u**2)) / redundancy
    group, is_one = ties[used].exposure_idx, len(np.unique(ties[used].exposure_idx)) == 1
    if is_one:
        group = _block(now, ties[used])
    exposures = list(_exposures(parts, d, weight, group, columns, len(now.heads)))
    axis, noise = columns % PER_HEAD, sigma0_sq * inverse.dense
    telling = _telling(exposures, inverse.dense.diagonal()) if is_one else exposures
    variance = components(telling, axis, sigma0_sq)
    if np.any(variance):
        noise = noise + covariance(exposures, axis, variance)
    cov, cov_change = _covariances(start, now, N, columns, noise)
    tied = _tied(start, ties[used])
    untied = np.setdiff1d(np.arange(len(start.heads)), tied)
    return Refined(
        orientation=replace(now, cov_joint=cov),
        sigma0=float(np.sqrt(sigma0_sq)),
        rejected=~used,
        turn_sigma=sigmas(cov_change)[: 6 * len(start.heads)].reshape(-1, 6)[:, 3:],
        held=start.heads[tied[0]].name,
        unreached=tuple(start.heads[k].name for k in untied),
        by_exposure=tuple(np.sqrt(variance[np.unique(axis, return_index=True)[1]]).tolist()),
        one_exposure=is_one,
    )


def _block(orientation: RelativeOrientation, ties: TiePoints) -> Index:
    """Return the block of the frame of every tie point."""
    size = np.array([[camera.width_px, camera.height_px] for camera in orientation.heads])
    position = (ties.colrow_a + 0.5) / size[ties.head_a] * BLOCKS
    col, row = np.clip(position.astype(int), 0, np.array(BLOCKS) - 1).T
    block: Index = row * BLOCKS[0] + col
    return block


def _telling(blocks: Sequence[OneExposure], variance: Array) -> Sequence[OneExposure]:
    """Return the blocks that determine all unknowns alone; none if fewer than half of the frame."""
    least = 1 / (MOST_TIMES**2 * len(blocks) * variance)
    whole = [
        block for block in blocks if np.linalg.matrix_rank(block.N, hermitian=True) == len(least)
    ]
    precise = [block for block in whole if np.all(1 / np.linalg.inv(block.N).diagonal() >= least)]
    return precise if 2 * len(precise) >= np.prod(BLOCKS) else []


def _exposures(
    parts: Sequence[tuple[Index, Index, Array]],
    d: Array,
    weight: Array,
    exposure_idx: Index,
    columns: Index,
    n_heads: int,
) -> Iterator[OneExposure]:
    """Yield the normal equations of every exposure by itself."""
    for exposure in np.unique(exposure_idx):
        inside = [exposure_idx[rows] == exposure for rows, _, _ in parts]
        here = [(r[i], p, J[i]) for (r, p, J), i in zip(parts, inside, strict=True)]
        N, h = _normals(here, d, weight, n_heads)
        yield OneExposure(N=N[np.ix_(columns, columns)], h=h[columns])


def _covariances(
    start: RelativeOrientation, now: RelativeOrientation, N: Array, columns: Index, noise: Array
) -> tuple[Array, Array]:
    """Return the joint covariances of the refined orientation, and of the changes.

    Estimated parameters no longer depend on their former values. They depend on the errors of the
    held parameters as far as these affect the tie points.
    """
    n_heads = len(start.heads)
    pose = (PER_HEAD * np.arange(n_heads)[:, None] + np.arange(6)).ravel()
    interior = np.setdiff1d(np.arange(PER_HEAD * n_heads), pose)
    order = np.concatenate([pose, interior])  # the order of cov_joint, in columns
    J = np.eye(len(N))
    J[columns] = -np.linalg.solve(N[np.ix_(columns, columns)], N[columns])
    J[np.ix_(columns, columns)] = 0.0
    to_angles = _angles_from_turns(now)
    J = to_angles @ J[np.ix_(order, order)] @ np.linalg.inv(_angles_from_turns(start))
    added = np.zeros_like(N)
    added[np.ix_(columns, columns)] = noise
    by_ties = propagate(to_angles, added[np.ix_(order, order)])
    after, change = (propagate(M, start.cov_joint) + by_ties for M in (J, J - np.eye(len(J))))
    return after, change


def _angles_from_turns(orientation: RelativeOrientation) -> Array:
    """Return d(omega, phi, kappa) / d(rotations about the heads' axes), as in `cov_joint`."""
    out = np.eye(PER_HEAD * len(orientation.heads))
    for k, opk in enumerate(orientation.opk):
        angles = slice(6 * k + 3, 6 * k + 6)
        out[angles, angles] = opk_jacobian(opk)
    return out


# --- Differences between heads in the synthetic image: at tie points, and over the whole frame


PER_HEAD = 6 + len(INTERIOR)
"""Number of parameters of a head: Xc, Yc, Zc, rotation, interior orientation."""


# --- at tie points ---------------------------------------------------------------------------


def tie_differences(orientation: RelativeOrientation, ties: TiePoints) -> Array:
    """Return the positions of tie points from the second head minus those from the first.

    Returns
    -------
    ndarray, shape (n, 2)
        mm in the synthetic image, in the order of the tie points.
    """
    out = np.zeros((len(ties), 2))
    for k, colrow, rows, sign in _sides(ties):
        out[rows] += sign * synthetic_from_head(orientation, k, colrow)
    return out


def _sides(ties: TiePoints) -> Iterator[tuple[int, Array, Index, float]]:
    """Yield each head, its pixels, the rows of its tie points, and its sign in the differences."""
    sides = ((ties.head_a, ties.colrow_a, -1.0), (ties.head_b, ties.colrow_b, 1.0))
    for heads, colrow, sign in sides:
        for k in np.unique(heads):
            rows = np.flatnonzero(heads == k)
            yield int(k), colrow[rows], rows, sign


def synthetic_from_head_jacobian(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return d(synthetic_from_head) / d(pose and interior orientation of the head).

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    colrow : ndarray, shape (n, 2)
        Pixels of the head.

    Returns
    -------
    ndarray, shape (n, 2, 16)
        By Xc, Yc, Zc (mm), a rotation about the head's axes (R exp(delta), rad), and the ten
        parameters of `camera.INTERIOR`.
    """
    camera, R = orientation.heads[k], rotation_from_opk(orientation.opk[k])
    xy = xy_from_colrow(camera, colrow)
    ray_h = np.column_stack([correct(camera.interior, xy), np.full(len(xy), -camera.interior.f)])
    ray_s = transform(R, ray_h)
    by_place = np.zeros((len(xy), 2, 3))
    by_place[:, :, :2], by_place[:, :, 2] = np.eye(2), -ray_s[:, :2] / ray_s[:, 2:]
    by_ray = -(orientation.xyz_mm[k, 2] / ray_s[:, 2])[:, None, None] * by_place @ R
    by_interior = by_ray[:, :, :2] @ correct_jacobian(camera.interior, xy)
    by_interior[:, :, 0] -= by_ray[:, :, 2]  # the ray's third component is -f
    return np.concatenate([by_place, -by_ray @ skew(ray_h), by_interior], axis=2)


def _by_pair(
    orientation: RelativeOrientation, ties: TiePoints
) -> Iterator[tuple[Index, Index, Array]]:
    """Yield for each pair of heads its tie points, its parameters, and d(differences) by these."""
    for a, b in sorted({*zip(ties.head_a.tolist(), ties.head_b.tolist(), strict=True)}):
        rows = np.flatnonzero((ties.head_a == a) & (ties.head_b == b))
        by_a = synthetic_from_head_jacobian(orientation, a, ties.colrow_a[rows])
        by_b = synthetic_from_head_jacobian(orientation, b, ties.colrow_b[rows])
        parameters = np.concatenate([PER_HEAD * k + np.arange(PER_HEAD) for k in (a, b)])
        yield rows, parameters, np.concatenate([-by_a, by_b], axis=2)


def _normals(
    parts: Iterable[tuple[Index, Index, Array]], d: Array, weight: Array, n_heads: int
) -> tuple[Array, Array]:
    """Return J^T P J and J^T P d by all parameters of all heads, `PER_HEAD` each."""
    n = PER_HEAD * n_heads
    N, h = np.zeros((n, n)), np.zeros(n)
    for rows, parameters, by_both in parts:
        J = by_both.reshape(2 * len(rows), by_both.shape[2])
        PJ = np.repeat(weight[rows], 2)[:, None] * J
        N[np.ix_(parameters, parameters)] += PJ.T @ J
        h[parameters] += PJ.T @ d[rows].ravel()
    return N, h


# --- the whole frame -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameDifferences:
    """Differences between the synthetic images of two orientations, over the whole frame.

    Attributes
    ----------
    xy : ndarray, shape (n, 2)
        Nodes of the synthetic image that a head sees, mm.
    head : ndarray, shape (n,)
        The head whose pixels are used there.
    d_px : ndarray, shape (n, 2)
        Differences in x and y, pixels of the synthetic image.
    """

    xy: Array
    head: Index
    d_px: Array

    @property
    def rms_px(self) -> float:
        """RMS length, px."""
        return float(np.sqrt(np.mean(np.sum(self.d_px**2, axis=1))))

    @property
    def largest_px(self) -> float:
        """Largest length, px."""
        return float(np.max(np.hypot(*self.d_px.T)))


def frame_differences(
    orientation: RelativeOrientation,
    other: RelativeOrientation,
    synthetic: Camera,
    *,
    spacing_px: int = 120,
) -> FrameDifferences:
    """Return the position differences between the synthetic images of two orientations.

    Parameters
    ----------
    orientation, other : RelativeOrientation
        Orientations of the same heads; `other` may be the truth.
    synthetic : Camera
    spacing_px : int
        Spacing of the nodes, which include the frame's borders.

    Returns
    -------
    FrameDifferences
        `orientation` minus `other`; at each node for the head whose border is farthest away.
    """
    expected.whole("spacing_px", spacing_px)
    w, h = synthetic.width_px, synthetic.height_px
    cols = np.linspace(-0.5, w - 0.5, max(w // spacing_px, 1) + 1)
    rows = np.linspace(-0.5, h - 0.5, max(h // spacing_px, 1) + 1)
    xy = xy_from_colrow(synthetic, np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2))
    colrows = [head_from_synthetic(orientation, k, xy) for k in range(len(orientation.heads))]
    by_head = [border_distance(c, colrows[k]) for k, c in enumerate(orientation.heads)]
    far = np.nan_to_num(np.stack(by_head), nan=-1.0)
    head = np.argmax(far, axis=0)
    d_px = np.full((len(xy), 2), np.nan)
    for k, colrow in enumerate(colrows):
        used = (head == k) & (far[k] >= 0)
        d_px[used] = (xy[used] - synthetic_from_head(other, k, colrow[used])) / synthetic.pixel_mm
    covered = np.isfinite(d_px[:, 0])
    return FrameDifferences(xy=xy[covered], head=head[covered], d_px=d_px[covered])
