"""Validation on check points by direct georeferencing (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from acx4lib import shown
from acx4lib.block import Block, SurveyedPoints
from acx4lib.bundle.adjust import Bundle, mounted_orientation
from acx4lib.bundle.gross_errors import adjust_rejecting, elsewhere
from acx4lib.bundle.rejections import CRITICAL, Rejection, Stopped, within_limits
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.common_errors import by_turns
from acx4lib.calibration.estimates import Calibration
from acx4lib.errors import AdjustmentError, unsolvable
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.collinearity import Measurement, directions
from acx4lib.geometry.frames import transform
from acx4lib.geometry.intersection import intersect, largest_angles
from acx4lib.geometry.parameters import AXES, Prior
from acx4lib.georeferencing import accuracy, direct, error_sources
from acx4lib.georeferencing.accuracy import NormalisedTest, Triple, triple
from acx4lib.georeferencing.direct import Georeferenced, Rays
from acx4lib.georeferencing.error_sources import ErrorSources, block_matrix, turned
from acx4lib.least_squares import adjustment, processors, statistics
from acx4lib.least_squares.adjustment import two_sided_p
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.model import Model

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Validation:
    """Check points of a block, compared with one method's calibration.

    Attributes
    ----------
    method : str
    block : Block
    georeferenced : Georeferenced
    pairs : Differences
        One per pair of images.
    points : Differences
        One per point, from all its rays.
    rejected : tuple of Rejection
        In these, a ``control_point`` is one of the block's check points.
    stopped : tuple of Stopped
        Groups with too many rejections, in which none was made.
    n_failed : int
        Pairs whose rays meet at less than the block's smallest angle, or behind the cameras.
    n_left_out : int
        Check points in fewer than two images, or whose rays meet behind the cameras.
    cost : float
        Weighted sum of squared residuals of all points' rays; weights include the trajectory.
    redundancy : int
    joint_chi_square : float
        All the points' differences together, d^T C^-1 d, with their full covariance.
    mean_cov : ndarray, shape (3, 3)
        Covariance of the mean of the points' differences, m^2.
    """

    method: str
    block: Block
    georeferenced: Georeferenced
    pairs: Differences
    points: Differences
    rejected: tuple[Rejection, ...]
    stopped: tuple[Stopped, ...]
    n_failed: int
    n_left_out: int
    cost: float
    redundancy: int
    joint_chi_square: float
    mean_cov: Array

    def __repr__(self) -> str:
        """Describe the comparison and its fit in one line."""
        counts = shown.count(len(self.points), "point"), shown.count(len(self.pairs), "pair")
        rms = accuracy.from_differences(self.points.d).rms if len(self.points) else ()
        fit = f"RMS {', '.join(f'{value:.3f}' for value in rms)} m" if rms else ""
        return shown.line(f"Validation of {self.method}", *counts, fit)

    def table(self) -> pd.DataFrame:
        """Return mean, scatter, RMS and expected RMS of the differences, m.

        For pairs of images, as in Table 4, and for points from all their rays.
        """
        rows = {}
        for name, of in (("pairs", self.pairs), ("points", self.points)):
            found = accuracy.from_differences(of.d)
            by_sigma = np.sqrt(np.mean(of.sigma**2, axis=0)) if len(of) else np.full(3, np.nan)
            for i, axis in enumerate(AXES):
                rows[name, axis, "m"] = {
                    "n": found.n,
                    "mean": found.mean[i],
                    "scatter": found.std[i],
                    "RMS": found.rms[i],
                    "expected RMS": float(by_sigma[i]),
                }
        return shown.row_table(("of", "coordinate", "unit"), rows)

    @property
    def n_observations(self) -> int:
        """Number of image coordinates of the points."""
        return self.redundancy + 3 * len(self.points)

    @property
    def sigma0_sq(self) -> float:
        """Variance of unit weight; one without redundancy."""
        return self.cost / self.redundancy if self.redundancy > 0 else 1.0

    @property
    def chi_square_p(self) -> float:
        """Two-sided probability of such a cost or a more extreme one."""
        return two_sided_p(self.cost, self.redundancy)

    @property
    def joint_dof(self) -> int:
        """Degrees of freedom of `joint_chi_square`."""
        return 3 * len(self.points)

    @property
    def joint_chi_square_p(self) -> float:
        """Two-sided probability of such a `joint_chi_square` or a more extreme one."""
        return two_sided_p(self.joint_chi_square, self.joint_dof)

    @property
    def expected_rejections(self) -> float:
        """Number of measurements that chance rejects: of both components, of three rays or more."""
        n_images = self.points.n_images
        return 2 * int(n_images[n_images > 2].sum()) * 2 * statistics.norm_sf(CRITICAL)

    @property
    def height_offset(self) -> tuple[float, float]:
        """The median height difference, m, and its share of the flying height."""
        if not len(self.points):
            return 0.0, 0.0
        above = np.median(self.georeferenced.T_m_c.r[:, 2]) - self.block.check.x_m[:, 2]
        offset = float(np.median(self.points.d[:, 2]))
        return offset, offset / float(np.median(above))

    @property
    def spread(self) -> NormalisedTest | None:
        """Test of the predicted sigma of the points; None without any."""
        if not len(self.points):
            return None
        among = error_sources.axis_covariances(self.points.sources)
        return accuracy.normalised_test(self.points.d, self.points.sigma, among)

    @property
    def survey_sigma(self) -> Triple:
        """RMS of the sigma of the surveyed points: east, north, height, m; zero without any."""
        sigma = self.block.check.sigma_m[self.points.point_idx]
        return triple(np.sqrt(np.mean(sigma**2, axis=0)) if len(sigma) else np.zeros(3))


def validate(
    block: Block, calibration: Calibration, model: Model = Model(), *, method: str
) -> Validation:
    """Intersect every check point from pairs of rays and from all rays, and compare.

    First, measurements that do not fit the others of their point, of three or more, are rejected.
    Check points surveyed far from the intersection of their rays, unlike the others, follow.

    Parameters
    ----------
    block : Block
        The block with the check points.
    calibration : Calibration
    model : Model
        Of which refraction counts.
    method : str
        Name of the calibration in the results; it has no other effect.

    Raises
    ------
    AdjustmentError
        Where the numbers of the block make the computation fail.
    ValueError
        Where the calibration lacks a camera, or the name cannot stand in results.
    """
    if not method or "/" in method:
        raise ValueError(f"method: expected a name without '/', got {method!r}")
    try:
        return _validated(block, direct.georeference(block, calibration, model), method)
    except np.linalg.LinAlgError as error:
        raise unsolvable(str(error), "the equations of the check points") from error


def _validated(block: Block, georeferenced: Georeferenced, method: str) -> Validation:
    rows, selected = _check_measurements(block)
    kept, w = _fitting(block, georeferenced, selected)
    unfit = [
        Rejection(kind="image_point", row=int(row), component=-1, statistic=float(statistic))
        for row, statistic in zip(rows[~kept], w[~kept], strict=True)
    ]
    rejected, stopped = within_limits(block, rows, unfit)
    kept = ~np.isin(rows, [r.row for r in rejected])
    selected = selected.select(np.flatnonzero(kept), selected.group[kept])
    measurement = direct.measured(block, georeferenced, selected)
    absurd = elsewhere(
        measurement.T_m_c.r, directions(measurement), selected.group, block.check.x_m
    )
    if absurd.any():
        nowhere = differences_at(block, georeferenced, *_renumbered(selected, absurd))
        w = np.max(np.abs(nowhere.d) / nowhere.sigma, axis=1)
        rejected += tuple(
            Rejection(kind="control_point", row=int(i), component=-1, statistic=float(statistic))
            for i, statistic in zip(nowhere.point_idx, w, strict=True)
        )
        credible = np.flatnonzero(~absurd[selected.group])
        selected = selected.select(credible, selected.group[credible])
    rays, idx, n_failed = _pairs(block, georeferenced, selected)
    pairs, paired, _ = _compared(block, georeferenced, rays, idx)
    met = np.zeros(len(block.check), dtype=bool)
    met[: selected.n_groups] = _meet(direct.measured(block, georeferenced, selected), selected)
    rays, idx = _renumbered(selected, met)
    at_points, compared, rays = _compared(block, georeferenced, rays, idx)
    met[idx[~compared]] = False
    return Validation(
        method=method,
        block=block,
        georeferenced=georeferenced,
        pairs=pairs,
        points=at_points,
        rejected=rejected,
        stopped=stopped,
        n_failed=n_failed + int(np.sum(~paired)),
        n_left_out=int(np.sum(~met & ~absurd)),
        cost=cost(block, georeferenced, rays),
        redundancy=rays.colrow.size - 3 * rays.n_groups,
        joint_chi_square=error_sources.chi_square(at_points.sources, at_points.d),
        mean_cov=error_sources.mean_covariance(at_points.sources),
    )


def _check_measurements(block: Block) -> tuple[Index, Rays]:
    """Return the measurements of check points, sorted by point and image; group = check point."""
    check_idx = np.full(len(block.points), -1)
    check_idx[block.check.point_idx] = np.arange(len(block.check))
    points = block.image_points
    rows = np.flatnonzero((check_idx[points.point_idx] >= 0) & np.isfinite(points.sigma_px))
    rows = rows[np.lexsort((points.image_idx[rows], check_idx[points.point_idx[rows]]))]
    return rows, _rays(block, rows, check_idx[points.point_idx[rows]])


def _rays(block: Block, rows: Index, group: Index) -> Rays:
    points = block.image_points[rows]
    return Rays(
        image_idx=points.image_idx, group=group, colrow=points.colrow, sigma_px=points.sigma_px
    )


def _fitting(block: Block, georeferenced: Georeferenced, selected: Rays) -> tuple[Mask, Array]:
    """Return the mask of rays that fit the others of their point, and w of the rejected rays."""
    kept = np.ones(len(selected.group), dtype=bool)
    statistic = np.zeros(len(selected.group))
    while True:
        counts = np.bincount(selected.group[kept], minlength=len(block.check))
        testable = np.flatnonzero(kept & (counts >= 3)[selected.group])
        if len(testable) == 0:
            return kept, statistic
        _, group = np.unique(selected.group[testable], return_inverse=True)
        w = normalised_residuals(block, georeferenced, selected.select(testable, group))
        worst = np.zeros(group.max() + 1)
        np.maximum.at(worst, group, w)
        out = (w == worst[group]) & (w > CRITICAL)
        if not out.any():
            return kept, statistic
        kept[testable[out]] = False
        statistic[testable[out]] = w[out]


def _pairs(block: Block, georeferenced: Georeferenced, selected: Rays) -> tuple[Rays, Index, int]:
    """Return the pairs of rays that meet at a sufficient angle, their points; count the others."""
    pairs = np.column_stack(error_sources.pairs_within(selected.group))
    group = np.repeat(np.arange(len(pairs)), 2)
    paired = selected.select(pairs.ravel(), group)
    measurement = direct.measured(block, georeferenced, paired)
    angle = largest_angles(directions(measurement), group, len(pairs))
    good = (angle >= block.smallest_angle) & _meet(measurement, paired)
    group = np.repeat(np.arange(int(good.sum())), 2)
    points = selected.group[pairs[good, 0]]
    return selected.select(pairs[good].ravel(), group), points, int(np.sum(~good))


def _compared(
    block: Block, georeferenced: Georeferenced, rays: Rays, idx: Index
) -> tuple[Differences, Mask, Rays]:
    """Return finite differences of groups of rays, the mask of these groups, and their rays.

    Rays that are almost parallel may meet where the map ends, or nowhere in numbers.
    """
    differences = differences_at(block, georeferenced, rays, idx)
    known: Mask = np.isfinite(np.hstack([differences.d, differences.sigma])).all(axis=1)
    if known.all():
        return differences, known, rays
    rays, _ = _renumbered(rays, known)
    return differences_at(block, georeferenced, rays, idx[known]), known, rays


def _meet(measurement: Measurement, selected: Rays) -> Mask:
    """Tell which groups of rays meet, in front of all their cameras."""
    d = directions(measurement)
    x_m = intersect(measurement.T_m_c.r, d, selected.group, selected.n_groups)
    along = np.sum((x_m[selected.group] - measurement.T_m_c.r) * d, axis=1)
    out = np.bincount(selected.group, minlength=selected.n_groups) > 0
    out[selected.group[~(along > 0)]] = False
    return out


def _renumbered(selected: Rays, keep: Mask) -> tuple[Rays, Index]:
    """Return the rays of some groups, with new group numbers, and these groups."""
    rows = np.flatnonzero(keep[selected.group])
    points, group = np.unique(selected.group[rows], return_inverse=True)
    return selected.select(rows, group), points


# --- Differences between intersected and surveyed points, with the sources of their errors


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Differences:
    """Estimated minus surveyed coordinates along the axes of the flight's CRS.

    Attributes
    ----------
    point_idx : ndarray, shape (n,)
        Indices of the block's check points.
    image_idx : ndarray, shape (n, 2)
        First and last image of the intersection.
    n_images : ndarray, shape (n,)
    d, sigma : ndarray, shape (n, 3)
        East, north, height, m; sigma a priori.
    sources : ErrorSources
        Of `d`, along the same axes; the survey is part of a difference's own covariance.
    """

    point_idx: Index
    image_idx: Index
    n_images: Index
    d: Array
    sigma: Array
    sources: ErrorSources

    def __len__(self) -> int:
        """Count the differences."""
        return len(self.d)


def differences_at(
    block: Block,
    georeferenced: Georeferenced,
    selected: Rays,
    check_idx: Index,
) -> Differences:
    """Intersect groups of rays, and compare every intersection with its check point.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    selected : Rays
        At least one ray in every group.
    check_idx : ndarray, shape (n_groups,)
        Indices into `block.check`.
    """
    intersections = direct.intersect_rays(block, georeferenced, selected)
    d, sigma = compare(block, intersections.x_m, intersections.cov, check_idx)
    groups = np.arange(len(check_idx))
    starts = np.searchsorted(selected.group, groups)
    ends = np.searchsorted(selected.group, groups, side="right")
    check = block.check[check_idx]
    along_grid = turned(intersections.sources, check.R_g_m)
    survey = np.eye(3) * check.sigma_m[:, None, :] ** 2
    return Differences(
        point_idx=check_idx,
        image_idx=np.column_stack([selected.image_idx[starts], selected.image_idx[ends - 1]]),
        n_images=ends - starts,
        d=d,
        sigma=sigma,
        sources=replace(along_grid, survey=survey),
    )


def compare(block: Block, x_m: Array, cov: Array, check_idx: Index) -> tuple[Array, Array]:
    """Return estimated minus surveyed coordinates of check points and their sigma.

    Parameters
    ----------
    block : Block
    x_m : ndarray, shape (n, 3)
        Estimated coordinates, mapping frame, m.
    cov : ndarray, shape (n, 3, 3)
        Their covariances, m^2.
    check_idx : ndarray, shape (n,)
        Indices into `block.check`.

    Returns
    -------
    d, sigma : ndarray, shape (n, 3)
        East, north, height in the flight's CRS, m; sigma includes that of the survey.
    """
    check: SurveyedPoints = block.check[check_idx]
    met = np.isfinite(x_m).all(axis=1)
    d = np.full((len(x_m), 3), np.nan)
    d[met] = block.frame.to_grid(x_m[met]) - block.frame.to_grid(check.x_m[met])
    cov_grid = propagate(check.R_g_m, cov)
    return d, np.sqrt(np.diagonal(cov_grid, axis1=1, axis2=2) + check.sigma_m**2)


def rays_of_pairs(block: Block, pairs: Differences, which: Sequence[int] | None = None) -> Rays:
    """Return the rays of pairs, one to the point from each image of a pair.

    Parameters
    ----------
    block : Block
        That of the pairs.
    pairs : Differences
        Of pairs of images.
    which : sequence of int, optional
        Which of the pairs; by default all.
    """
    points = block.image_points
    keys = zip(points.image_idx.tolist(), points.point_idx.tolist(), strict=True)
    row_of = {key: row for row, key in enumerate(keys)}
    chosen = np.arange(len(pairs)) if which is None else np.asarray(which, dtype=np.intp)
    point = block.check.point_idx[pairs.point_idx]
    rows = [row_of[int(i), int(point[k])] for k in chosen for i in pairs.image_idx[k]]
    return _rays(block, np.array(rows, dtype=np.intp), np.repeat(np.arange(len(chosen)), 2))


# --- Tests of the rays of a point against each other, within errors of pixels and trajectory


def normalised_residuals(block: Block, georeferenced: Georeferenced, selected: Rays) -> Array:
    """Test rays against the others of their group, with weights that include the trajectory's.

    All rays of a group have their joint covariance, and the point moves linearly. Errors common to
    several groups have no effect.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    selected : Rays

    Returns
    -------
    w : ndarray, shape (n,)
        The larger of the two normalised residuals of every ray; zero where no other observation
        controls it.

    Notes
    -----
    Baarda's test for correlated observations: w = (P v)_i / sqrt((P Q_vv P)_ii).
    """
    first = direct.intersect_rays(block, georeferenced, selected)
    exposure = block.images.exposure_idx[selected.image_idx]
    w = np.zeros(len(selected.group))
    starts = np.searchsorted(selected.group, np.arange(selected.n_groups + 1))
    for start, end in pairwise(starts):
        rows = slice(start, end)
        B = first.by_point[rows].reshape(-1, 3)
        C = direct.by_trajectory(first.by_body[rows], exposure[rows], georeferenced)
        P = np.linalg.inv(C + np.diag(np.repeat(selected.sigma_px[rows] ** 2, 2)))
        PB, v = P @ B, first.v[rows].ravel()
        inverse = np.linalg.inv(B.T @ PB)
        Pv = P @ (v - B @ (inverse @ (PB.T @ v)))
        variance = np.diag(P) - np.einsum("ij,jk,ik->i", PB, inverse, PB)
        controlled = variance > 1e-6 * np.diag(P)
        of_each = np.abs(Pv) / np.sqrt(np.where(controlled, variance, np.inf))
        w[rows] = np.nan_to_num(of_each).reshape(-1, 2).max(axis=1)
    return w


def cost(block: Block, georeferenced: Georeferenced, selected: Rays) -> float:
    """Return the weighted sum of squares of all residuals, with the common errors of rays.

    Parameters
    ----------
    block, georeferenced, selected
        As `normalised_residuals` takes them.

    Returns
    -------
    float
        Where all sigma are right, it has the chi-square distribution, with a degree of freedom for
        every image coordinate less three for every point.

    Notes
    -----
    Rays of one exposure share the errors of its pose, and all rays share those of the calibration.
    Let S be the covariance of these errors, v the residuals with weights P of pixels alone, A their
    derivatives by these errors, and N = A^T P Q_vv P A the normal matrix reduced by the points. The
    least sum is v^T P v - b^T S (I + N S)^-1 b, with b = A^T P v.
    """
    from scipy.sparse.linalg import splu  # noqa: PLC0415 loads long, and planning solves nothing

    fit = direct.intersect_rays(block, georeferenced, selected)
    n, sigma = len(selected.group), selected.sigma_px[:, None]
    if n == 0:
        return 0.0
    rows, v = np.arange(n), (fit.v / sigma).ravel()
    used, place = np.unique(block.images.exposure_idx[selected.image_idx], return_inverse=True)
    by_body = block_matrix(fit.by_body / sigma[:, None], rows, place, (n, len(used)))
    by_parameters = (fit.by_parameters / sigma[:, None]).reshape(2 * n, -1)
    A = sparse.hstack([by_body, sparse.csr_array(by_parameters)], format="csr")
    normal = np.zeros((selected.n_groups, 3, 3))
    B = fit.by_point / sigma[:, None]
    np.add.at(normal, selected.group, np.swapaxes(B, 1, 2) @ B)
    groups = np.arange(selected.n_groups)
    by_points = block_matrix(B, rows, selected.group, (n, len(groups)))
    inverse = block_matrix(np.linalg.inv(normal), groups, groups, (len(groups),) * 2)
    moved, b = A.T @ by_points, A.T @ v
    N = A.T @ A - moved @ inverse @ moved.T
    # S: of the poses of these exposures, independent or all together, and of the calibration
    first, second = np.indices((len(used),) * 2).reshape(2, -1)
    if georeferenced.shared is None:
        first, second = first[first == second], second[first == second]
    poses = georeferenced.between(used[first], used[second])
    cov_poses = block_matrix(poses, first, second, (len(used),) * 2)
    S = sparse.block_diag([cov_poses, georeferenced.cov_parameters], format="csr")
    with processors.on_one_thread():
        try:
            joint = splu((sparse.eye_array(len(b)) + N @ S).tocsc())
        except RuntimeError as error:  # SuperLU has no error of its own
            raise np.linalg.LinAlgError(str(error)) from error
        return float(v @ v - np.asarray(S @ b) @ joint.solve(b))


# --- Exposures that took no part in a calibration, predicted by it: a test without check points


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A block adjusted with its cameras held at a calibration.

    Attributes
    ----------
    method : str
    bundle : Bundle
        Poses and tie points are its unknowns, positions and attitudes its observations.
    squares : float
        Weighted sum of squared residuals, where the cameras are observations with the calibration's
        covariance.
    effective : float
        Degrees of freedom of the chi-square distribution, times a factor, that scatters as these
        sums of single exposures do: at most the redundancy, less where points of an exposure share
        errors.
    """

    method: str
    bundle: Bundle
    squares: float
    effective: float

    def __repr__(self) -> str:
        """Describe the fit in one line."""
        return shown.line(
            f"Prediction by {self.method}",
            f"rays {self.rays_rms_px:.3f} px",
            f"positions {', '.join(f'{v:.3f}' for v in self.position_rms_m)} m",
            f"p of χ² {self.chi_square_p:.3f}",
        )

    @property
    def _seen(self) -> Mask:
        """Poses with measurements: the others have no residuals."""
        network = self.bundle.network
        seen = np.zeros(len(network.pose_names), dtype=bool)
        seen[network.pose_idx[network.image_points.image_idx]] = True
        return seen

    @property
    def rays_rms_px(self) -> float:
        """Root mean square of the residuals of image coordinates, px."""
        v = self.bundle.network.residuals(self.bundle.state)[0][0]
        return float(np.sqrt(np.mean(v**2)))

    @property
    def position_rms_m(self) -> tuple[float, ...]:
        """Root mean square of adjusted minus recorded positions along the grid's axes, m."""
        observed, state = self.bundle.network.observed, self.bundle.state
        known = self._seen & np.isfinite(observed.sigma_position).all(axis=1)
        if not known.any():
            return (np.nan,) * 3
        errors = transform(observed.R_g_m, state.T_m_b.r - observed.T_m_b.r)[known]
        return tuple(np.sqrt(np.mean(errors**2, axis=0)).tolist())

    @property
    def sigma0_sq(self) -> float:
        """Variance of unit weight."""
        redundancy = self.bundle.solution.redundancy
        return self.squares / redundancy if redundancy > 0 else 1.0

    @property
    def chi_square_p(self) -> float:
        """Two-sided probability of such a weighted sum of squared residuals or a more extreme."""
        return two_sided_p(self.effective * self.sigma0_sq, self.effective)

    @property
    def n_exposures(self) -> int:
        """Number of exposures with measurements."""
        return len(np.unique(self.bundle.network.exposure_idx[self._seen]))


def predict(
    block: Block,
    calibration: Calibration,
    model: Model = Model(),
    *,
    method: str,
) -> Prediction:
    """Adjust a block with its cameras held at a calibration, to test the calibration.

    Rays of the block's own tie points meet, and meet where the trajectory has them, if interior
    orientation and mounting are right. Gross errors are rejected as in the single step.

    Parameters
    ----------
    block : Block
        A block with tie points that took no part in the calibration.
    calibration : Calibration
        Its cameras in the order of the block's.
    model : Model
        Refraction, and the errors of this block's own trajectory to estimate.
    method : str
        Name of the calibration in the results; it has no other effect.

    Raises
    ------
    AdjustmentError
        Where the block has too few points, or it does not converge.
    ValueError
        Where there is not one camera for each of the block's.

    Notes
    -----
    Let the cameras that fit the block best differ by d from the calibration, C be their covariance
    from the block alone, and K that of the calibration. The sum of squares is larger by d^T C^-1 d
    with cameras held, and by d^T (C + K)^-1 d with the calibration as observations. Every camera
    parameter is then an unknown and an observation: the redundancy is the same.
    """
    held = tuple(replace(camera, prior=Prior()) for camera in calibration.cameras)
    cameras_held = replace(model, free=(), fix=("lever_arm", "boresight"))
    network = partial(mounted_orientation, model=cameras_held)
    block = replace(block, cameras=held)
    bundle = adjust_rejecting(block, network)
    if calibration.turns is not None:
        bundle = by_turns(bundle, network, calibration.turns)
    return Prediction(
        method=method,
        bundle=bundle,
        squares=bundle.solution.cost - _by_cameras(bundle, calibration),
        effective=_effective_redundancy(bundle),
    )


def _by_cameras(bundle: Bundle, calibration: Calibration) -> float:
    """Return the part of a sum of squares with held cameras that calibration errors explain."""
    n = calibration.n_columns
    held = {field.name: getattr(bundle.network.layout, field.name) for field in fields(Layout)}
    later = {name: np.where(columns < 0, columns, columns + n) for name, columns in held.items()}
    camera_columns = {"interior": calibration.layout.interior, "mount": calibration.layout.mount}
    network = replace(bundle.network, layout=Layout(**(later | camera_columns)))
    cameras = np.arange(n)
    try:
        cov = adjustment.covariance(network, bundle.state, cameras)
        scale = 1 / sigmas(cov)
        z = scale * adjustment.normals(network, bundle.state).step()[0][:n]
        alone, joint = (
            c * scale[:, None] * scale
            for c in (cov, cov + calibration.sigma0_sq * calibration.total_cov)
        )
        return float(z @ (np.linalg.solve(alone, z) - np.linalg.solve(joint, z)))
    except (AdjustmentError, np.linalg.LinAlgError):  # the block alone leaves cameras open
        return 0.0


def _effective_redundancy(bundle: Bundle) -> float:
    """Return the effective redundancy, from the scatter of the exposures' sums of squares."""
    network, group = bundle.network, bundle.solution.group("image_point")
    exposure = network.block.images.exposure_idx[network.image_points.image_idx]
    squares, redundancy = (
        np.bincount(exposure, np.nansum(values, axis=1))
        for values in ((group.v / group.sigma) ** 2, group.redundancy)
    )
    mean, n = squares.sum() / redundancy.sum(), int((redundancy > 0).sum())
    scatter = np.sum((squares - mean * redundancy) ** 2) * n / max(n - 1, 1)
    whole = float(bundle.solution.redundancy)
    return min(whole, 2 * float(squares.sum()) ** 2 / scatter) if n > 1 and scatter > 0 else whole
