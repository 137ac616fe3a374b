"""Sources of the errors of points: image points and survey, exposures, calibration.

Differences at check points are correlated: all depend on the same parameters, neighbours also
on the same exposures. Tests of several points, and of their mean, need these parts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from acx4lib.bundle.observations import SharedErrors
from acx4lib.expected import Array, Index
from acx4lib.least_squares import processors
from acx4lib.least_squares.covariance import half, propagate


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorSources:
    """A priori errors of n points, by their sources.

    Attributes
    ----------
    image, survey : ndarray, shape (n, 3, 3)
        Covariances of errors of a single point, m^2: the noise of its image points, and the
        errors of the surveyed coordinates with which it is compared.
    point, exposure : ndarray, shape (k,)
        Pairs of a point and an exposure that it depends on, sorted by point.
    by_body : ndarray, shape (k, 3, 6)
        d(point) / d(body pose of the exposure).
    by_parameters : ndarray, shape (n, 3, p)
        d(point) / d(columns of the calibration).
    cov_body : ndarray, shape (n_exposures, 6, 6)
        Of the body poses.
    cov_parameters : ndarray, shape (p, p)
    shared : SharedErrors, optional
        Covariances between the body poses of two exposures; independent by default.
    """

    image: Array
    survey: Array
    point: Index
    exposure: Index
    by_body: Array
    by_parameters: Array
    cov_body: Array
    cov_parameters: Array
    shared: SharedErrors | None = None

    def __len__(self) -> int:
        """Count the points."""
        return len(self.image)

    @property
    def own(self) -> Array:
        """Covariance of the errors that only this point has, shape (n, 3, 3), m^2."""
        return self.image + self.survey

    @property
    def cov(self) -> Array:
        """Covariance of every point by itself, shape (n, 3, 3), m^2."""
        out = self.own
        np.add.at(out, self.point, propagate(self.by_body, self.cov_body[self.exposure]))
        point, a, b = self.neighbours
        between = self.by_body[a] @ self.between(a, b) @ np.swapaxes(self.by_body[b], 1, 2)
        np.add.at(out, point, between + np.swapaxes(between, 1, 2))
        return out + propagate(self.by_parameters, self.cov_parameters)

    @property
    def neighbours(self) -> tuple[Index, Index, Index]:
        """Points with pairs of rows of their different exposures, three arrays of shape (k,)."""
        a, b = pairs_within(self.point[:0] if self.shared is None else self.point)
        return self.point[a], a, b

    def between(self, a: Index, b: Index) -> Array:
        """Return the covariances between the body poses of pairs of rows, shape (n, 6, 6)."""
        if self.shared is None:
            return np.zeros((len(a), 6, 6))
        return self.shared.between(self.exposure[a], self.exposure[b])


def pairs_within(group: Index) -> tuple[Index, Index]:
    """Return the rows of every pair within groups; rows are sorted by group.

    Parameters
    ----------
    group : ndarray, shape (n,)
        Ascending from zero.

    Returns
    -------
    first, second : ndarray, shape (k,)
    """
    counts = np.bincount(group)
    starts = np.cumsum(counts) - counts
    pairs = [
        start + np.stack(np.triu_indices(count, 1))
        for start, count in zip(starts, counts, strict=True)
    ]
    rows = np.concatenate(pairs, axis=1) if pairs else np.zeros((2, 0), dtype=np.intp)
    return rows[0], rows[1]


def turned(sources: ErrorSources, R: Array) -> ErrorSources:
    """Return the sources along other axes.

    Parameters
    ----------
    sources : ErrorSources
    R : ndarray, shape (n, 3, 3)
        From the present axes of every point to the new ones.
    """
    return replace(
        sources,
        image=propagate(R, sources.image),
        survey=propagate(R, sources.survey),
        by_body=R[sources.point] @ sources.by_body,
        by_parameters=R @ sources.by_parameters,
    )


def mean_covariance(sources: ErrorSources) -> Array:
    """Return the covariance of the mean of all points, shape (3, 3); NaN without points."""
    n = len(sources)
    if n == 0:
        return np.full((3, 3), np.nan)
    by_body = np.zeros((len(sources.cov_body), 3, 6))
    np.add.at(by_body, sources.exposure, sources.by_body)
    summed = sources.own.sum(axis=0) + propagate(by_body, sources.cov_body).sum(axis=0)
    summed = summed + propagate(sources.by_parameters.sum(axis=0), sources.cov_parameters)
    if sources.shared is not None:
        summed = summed + sources.shared.among(by_body)
    return summed / n**2


def chi_square(sources: ErrorSources, d: Array) -> float:
    """Return d^T C^-1 d of all errors together, with 3 n degrees of freedom.

    Parameters
    ----------
    sources : ErrorSources
    d : ndarray, shape (n, 3)
        Errors of the points, m.

    Raises
    ------
    LinAlgError
        Where the covariance is singular in numbers.

    Notes
    -----
    C = S + K K^T, where S is sparse (a point shares exposures with its neighbours only, unless the
    trajectory's errors change slowly) and K, the part of the parameters, has few columns. Hence
    C^-1 = S^-1 - S^-1 K (I + K^T S^-1 K)^-1 K^T S^-1 (Woodbury).
    """
    # predictions solve no equations and need not load this package, which takes long
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    d = d.ravel()
    if len(d) == 0:
        return 0.0
    K = (sources.by_parameters @ half(sources.cov_parameters)).reshape(len(d), -1)
    with processors.on_one_thread():
        try:
            S = splu(
                _without_parameters(sources), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0
            )
        except RuntimeError as error:  # SuperLU has no error of its own
            raise np.linalg.LinAlgError(str(error)) from error
        by_S, K_by_S = S.solve(d), S.solve(K)
        shared = np.linalg.solve(np.eye(K.shape[1]) + K.T @ K_by_S, K.T @ by_S)
        return float(d @ by_S - (K_by_S.T @ d) @ shared)


def joint_covariance(sources: ErrorSources) -> Array:
    """Return the covariance of all errors together, shape (3 n, 3 n), m^2.

    Of a few hundred points: `chi_square` needs no such matrix.
    """
    K = (sources.by_parameters @ half(sources.cov_parameters)).reshape(3 * len(sources), -1)
    return _without_parameters(sources).toarray() + K @ K.T


def axis_covariances(sources: ErrorSources) -> Array:
    """Return the covariances between the points, an axis at a time, shape (3, n, n), m^2."""
    n = len(sources)
    if n == 0:
        return np.zeros((3, 0, 0))
    K = sources.by_parameters @ half(sources.cov_parameters)
    S = _without_parameters(sources)
    return np.stack([S[i::3, i::3].toarray() + K[:, i] @ K[:, i].T for i in range(3)])


def _without_parameters(sources: ErrorSources) -> sparse.csc_array:
    """Return the joint covariance from image points, survey and trajectory, shape (3 n, 3 n)."""
    n, n_exposures = len(sources), len(sources.cov_body)
    unshared = block_matrix(sources.own, np.arange(n), np.arange(n), (n, n))
    by_body = sources.by_body @ half(sources.cov_body)[sources.exposure]
    shared = block_matrix(by_body, sources.point, sources.exposure, (n, n_exposures))
    joint = unshared + shared @ shared.T
    if sources.shared is not None:
        J = block_matrix(
            sources.by_body, sources.point, sources.exposure, (n, n_exposures)
        ).toarray()
        by_exposure = np.moveaxis(J.reshape(3 * n, n_exposures, 6), 1, 0)
        joint = joint + sparse.csr_array(sources.shared.among(by_exposure))
    return joint.tocsc()


def block_matrix(
    values: Array, row: Index, column: Index, shape: tuple[int, int]
) -> sparse.csr_array:
    """Return a sparse matrix of dense blocks at the given rows and columns of blocks.

    Parameters
    ----------
    values : ndarray, shape (k, height, width)
        Blocks at one place are added.
    row, column : ndarray, shape (k,)
    shape : tuple of int
        Number of blocks.
    """
    _, height, width = values.shape
    i = height * row[:, None, None] + np.arange(height)[:, None] + np.zeros(width, dtype=np.intp)
    j = width * column[:, None, None] + np.arange(width) + np.zeros((height, 1), dtype=np.intp)
    whole = (height * shape[0], width * shape[1])
    return sparse.csr_array((values.ravel(), (i.ravel(), j.ravel())), shape=whole)
