"""Reduced normal equations: solution, inverse, and directions left open.

A `Dense` system is a whole matrix. Large blocks have a border and a band (`Bordered`, `Banded`):
the columns of the *border* are connected with all others, and a pose has six columns, connected
with its neighbours only. Only border and band of the inverse are computed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy
from numpy.lib.stride_tricks import as_strided, sliding_window_view

from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask

SINGULAR = 1e-11
"""Eigenvalue of the scaled normal matrix below which a direction is not determined."""

LEAST = 1e-32
"""Least eigenvalue in conditions, the square of the precision; smaller ones are rounding."""


class Inverse(Protocol):
    """The covariance of the reduced unknowns, and the directions left open."""

    @property
    def dense(self) -> Array:
        """The whole covariance matrix, shape (n, n)."""
        ...

    @property
    def undetermined(self) -> Mask:
        """Columns that take part in a direction left open, shape (n,)."""
        ...

    @property
    def defect(self) -> int:
        """Number of directions that are left open."""
        ...

    @property
    def condition(self) -> float:
        """Condition of the scaled normal matrix."""
        ...

    @property
    def weakest(self) -> Array:
        """Eigenvector of the scaled matrix's smallest eigenvalue, shape (n,), scaled unknowns."""
        ...

    def at(self, rows: Index, columns: Index) -> Array:
        """Return the entries at two arrays of columns that broadcast against each other."""
        ...

    def times(self, J: Array) -> Array:
        """Return J times the covariance, shape (..., n) as J."""
        ...


def held_at_zero(inverse: Inverse, rows: Index, columns: Index) -> Array:
    """Return entries of an inverse; zero where a column is -1, that of a held unknown."""
    out = inverse.at(np.maximum(rows, 0), np.maximum(columns, 0))
    out[(rows < 0) | (columns < 0)] = 0.0
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class Dense:
    """A dense system, scaled by the diagonal from before the points were eliminated.

    Attributes
    ----------
    N : ndarray, shape (n, n)
        Normal matrix; its lower triangle is enough.
    diagonal : ndarray, shape (n,)
    """

    N: Array
    diagonal: Array

    @cached_property
    def scale(self) -> Array:
        """Scale factors of the unknowns, for a unit diagonal, shape (n,)."""
        return 1 / np.sqrt(np.where(self.diagonal > 0, self.diagonal, 1.0))

    @cached_property
    def _scaled(self) -> Array:
        return self.N * self.scale[:, None] * self.scale

    @cached_property
    def _factor(self) -> Array | None:
        """Cholesky's lower triangle; None where it breaks down."""
        if len(self.N) == 0:
            return None
        factor, info = scipy.linalg.lapack.dpotrf(self._scaled, lower=1, clean=0)
        ok = info == 0 and np.min(np.diagonal(factor)) ** 2 > SINGULAR
        return np.asarray(factor) if ok else None

    @cached_property
    def spectrum(self) -> tuple[Array, Array]:
        """Eigenvalues, ascending, and eigenvectors of the scaled matrix."""
        if not np.isfinite(self._scaled).all():
            raise np.linalg.LinAlgError("the normal equations hold numbers that are not finite")
        values, vectors = scipy.linalg.eigh(self._scaled, check_finite=False)
        return values, vectors

    def solve(self, g: Array) -> Array:
        """Return the solution; the shortest one where directions are left open."""
        if len(g) == 0:
            return np.zeros(0)
        if self._factor is not None:
            solved, _ = scipy.linalg.lapack.dpotrs(self._factor, self.scale * g, lower=1)
            return np.asarray(self.scale * solved)
        values, vectors = self.spectrum
        keep = values > SINGULAR
        part = vectors[:, keep]
        return np.asarray(self.scale * (part @ ((part.T @ (self.scale * g)) / values[keep])))

    def inverse(self) -> DenseInverse:
        """Return the inverse; the pseudo-inverse where directions are left open."""
        n, scale = len(self.N), self.scale
        nothing_open = np.zeros(n, dtype=bool)
        if n == 0:
            return DenseInverse(dense=np.zeros((0, 0)), undetermined=nothing_open, system=self)
        if self._factor is not None:
            lower, _ = scipy.linalg.lapack.dpotri(self._factor, lower=1)
            cov = np.tril(lower) + np.tril(lower, -1).T
            # the trace of the inverse bounds its largest eigenvalue
            if np.trace(cov) * SINGULAR < 1:
                cov *= scale[:, None] * scale
                return DenseInverse(dense=cov, undetermined=nothing_open, system=self)
        values, vectors = self.spectrum
        keep = values > SINGULAR
        part = vectors[:, keep] * scale[:, None]
        return DenseInverse(
            dense=(part / values[keep]) @ part.T,
            undetermined=np.linalg.norm(vectors[:, ~keep], axis=1) > 1e-4,
            defect=int(np.sum(~keep)),
            system=self,
        )


def places(order: Index) -> Index:
    """Return the column of each unknown, given the unknown of each column, -1 for a held one."""
    free = np.flatnonzero(order >= 0)
    place = np.empty(len(free), dtype=np.intp)
    place[order[free]] = free
    return place


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseInverse:
    """The inverse of a dense system: see `Inverse`."""

    dense: Array
    undetermined: Mask
    system: Dense
    order: Index | None = None
    defect: int = 0

    def reordered(self, order: Index) -> DenseInverse:
        """Return the inverse by unknowns: column i of the system is ``order[i]``, -1 if held."""
        place = places(order)
        if np.array_equal(place, np.arange(len(order))):
            return self
        return replace(
            self,
            dense=self.dense[np.ix_(place, place)],
            undetermined=self.undetermined[place],
            order=order,
        )

    @property
    def _untouched(self) -> int:
        """Number of unknowns without observations; as many eigenvalues are zero."""
        return int(np.sum(self.system.diagonal == 0))

    @property
    def condition(self) -> float:
        """Condition of the scaled normal matrix, of the unknowns that observations touch."""
        values, _ = self.system.spectrum
        if self._untouched == len(values):
            return 1.0
        return float(values[-1] / max(values[self._untouched], LEAST))

    @property
    def weakest(self) -> Array:
        """Eigenvector of the scaled matrix's smallest eigenvalue, in scaled unknowns.

        Unknowns that no observation touches, such as those of an image without measurements, have
        no part in it.
        """
        vectors = self.system.spectrum[1]
        if self._untouched == len(vectors):
            return np.zeros(len(vectors))
        weakest = vectors[:, self._untouched]
        if self.order is None:
            return weakest
        return weakest[places(self.order)]

    def at(self, rows: Index, columns: Index) -> Array:
        """Return the entries at two arrays of columns."""
        return self.dense[rows, columns]

    def times(self, J: Array) -> Array:
        """Return J times the covariance."""
        return J @ self.dense


# --- border and band of large blocks ----------------------------------------------------------


LARGEST_DENSE = 4000
"""Largest number of unknowns for which a singular system is examined."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bordered:
    """Normal equations of a border and of poses in an order that keeps neighbours close.

    Attributes
    ----------
    P : ndarray, shape (6 n_poses, 6 band)
        ``P[i, k]`` belongs to the columns i and i + k of the poses: the lower band of LAPACK,
        transposed.
    C : ndarray, shape (n_border, 6 n_poses)
    D : ndarray, shape (n_border, n_border)
    g : ndarray, shape (n_border + 6 n_poses,)
    diagonal : ndarray, shape (n_border + 6 n_poses,)
        Diagonal before the points were eliminated.
    """

    P: Array
    C: Array
    D: Array
    g: Array
    diagonal: Array

    def dense(self) -> Array:
        """Return the whole matrix, lower triangle and upper."""
        m, (n, width) = len(self.D), self.P.shape
        N = np.zeros((m + n, m + n))
        N[:m, :m], N[:m, m:], N[m:, :m] = self.D, self.C, self.C.T
        rows = np.zeros(n * (n + width + 1))  # longer by one than below: each begins one later
        rows.reshape(n, -1)[:, :width] = self.P
        upper = rows[: n * (n + width)].reshape(n, -1)[:, :n]
        N[m:, m:] = upper + np.triu(upper, 1).T
        return N

    def hold(self, held: Mask) -> None:
        """Replace rows and columns of the poses by those of the identity, in place.

        Parameters
        ----------
        held : ndarray of bool, shape (6 n_poses,)
        """
        m = len(self.D)
        _scale(self.P, np.where(held, 0.0, 1.0))
        self.P[held, 0] = 1.0
        self.C[:, held] = 0.0
        self.g[m:][held], self.diagonal[m:][held] = 0.0, 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class BorderedCovariance:
    """The part of a covariance matrix that belongs to a border and a band.

    Attributes
    ----------
    P : ndarray, shape (n_poses, band, 6, 6)
        ``P[i, d]`` is the block of poses i and i + d.
    C, D : ndarray
        Like those of `Bordered`.
    """

    P: Array
    C: Array
    D: Array

    @classmethod
    def of(cls, cov: Array, n_border: int, band: int) -> BorderedCovariance:
        """Return border and band of a dense matrix."""
        m, n_poses = n_border, (len(cov) - n_border) // 6
        P = np.zeros((n_poses, band, 6, 6))
        blocks = cov[m:, m:].reshape(n_poses, 6, n_poses, 6)
        for d in range(band):
            i = np.arange(n_poses - d)
            P[i, d] = blocks[i, :, i + d, :]
        return cls(P=P, C=cov[:m, m:], D=cov[:m, :m])


class Banded:
    """A bordered system, factored: the band by Cholesky, the border by its Schur complement.

    The factor takes the place of the band, which is the largest part of a large system.

    Raises
    ------
    LinAlgError
        Where the band or the border is not positive definite.
    """

    def __init__(self, system: Bordered) -> None:
        m = len(system.D)
        self.scale = 1 / np.sqrt(np.where(system.diagonal > 0, system.diagonal, 1.0))
        _scale(system.P, self.scale[m:])
        self.band = scipy.linalg.cholesky_banded(
            system.P.T, lower=True, overwrite_ab=True, check_finite=False
        )
        self.Y = self._through_band(system.C.T * self.scale[m:, None] * self.scale[:m])
        corner = system.D * self.scale[:m, None] * self.scale[:m] - self.Y.T @ self.Y
        self.corner = scipy.linalg.cholesky(corner, lower=True) if m else np.zeros((0, 0))
        pivots = np.concatenate([self.band[0], np.diagonal(self.corner)])
        if not np.min(pivots) ** 2 > SINGULAR:  # nor where one is not a number
            raise scipy.linalg.LinAlgError("singular to working precision")

    def _through_band(self, g: Array, *, transposed: bool = False) -> Array:
        """Return L^-1 g or L^-T g of the band's factor L, for g of shape (n,) or (n, k)."""
        if not g.size:
            return g
        solved, _ = scipy.linalg.lapack.dtbtrs(
            self.band, g, uplo="L", trans="T" if transposed else "N"
        )
        return np.asarray(solved.reshape(g.shape))

    def _solve_scaled(self, g: Array) -> Array:
        m = len(self.corner)
        poses = self._through_band(g[m:])
        border = (
            scipy.linalg.cho_solve((self.corner, True), g[:m] - self.Y.T @ poses) if m else g[:0]
        )
        return np.concatenate(
            [border, self._through_band(poses - self.Y @ border, transposed=True)]
        )

    def solve(self, g: Array) -> Array:
        """Return the solution for right-hand sides g, shape (n,) or (n, k)."""
        scale = self.scale if g.ndim == 1 else self.scale[:, None]
        return scale * self._solve_scaled(scale * g)

    def inverse(self) -> BorderedCovariance:
        """Return border and band of the inverse."""
        m = len(self.corner)
        border, poses = self.scale[:m], self.scale[m:]
        D = scipy.linalg.cho_solve((self.corner, True), np.eye(m)) if m else np.zeros((0, 0))
        X = self._through_band(self.Y, transposed=True) * poses[:, None]
        D = border[:, None] * D * border
        X = X / border
        return BorderedCovariance(P=_selected_inverse(self.band.T, poses, X, D), C=-D @ X.T, D=D)

    def spectrum(self) -> tuple[float, Array]:
        """Return the condition of the scaled matrix and its weakest eigenvector."""
        n = len(self.scale)
        start = np.ones(n) / np.sqrt(n)
        operator, eigsh = scipy.sparse.linalg.LinearOperator, scipy.sparse.linalg.eigsh
        inverse = operator((n, n), matvec=self._solve_scaled, dtype=float)
        itself = operator((n, n), matvec=self._times_scaled, dtype=float)
        try:
            largest_of_inverse, weakest = eigsh(inverse, k=1, which="LA", v0=start, tol=1e-6)
            largest = eigsh(itself, k=1, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)
        except scipy.sparse.linalg.ArpackError as error:
            raise scipy.linalg.LinAlgError(str(error)) from error
        return float(largest[0] * largest_of_inverse[0]), weakest[:, 0]

    def _times_scaled(self, x: Array) -> Array:
        m, depth = len(self.corner), len(self.band) - 1
        poses = scipy.linalg.blas.dtbmv(depth, self.band, x[m:], lower=1, trans=1) + self.Y @ x[:m]
        border = self.corner @ (self.corner.T @ x[:m]) + self.Y.T @ poses
        poses = scipy.linalg.blas.dtbmv(depth, self.band, poses, lower=1)
        return np.concatenate([border, poses])


def _scale(P: Array, scale: Array) -> None:
    """Multiply rows and columns of `Bordered.P` by factors, shape (6 n_poses,), in place."""
    n, width = P.shape
    ahead = sliding_window_view(np.append(scale, np.zeros(width)), width)[:n]
    P *= scale[:, None]
    P *= ahead


BLOCK = 96
"""Columns that are inverted together."""


def _selected_inverse(factor: Array, scale: Array, X: Array, D: Array) -> Array:
    """Return the band of S (U^T U)^-1 S + X D X^T, shape (n_poses, band, 6, 6).

    Takahashi's recursion over blocks of a few poses, from the last to the first: with
    ``G = U_00^-1 U_01``, ``Z_01 = -G Z_11`` and ``Z_00 = (U_00^T U_00)^-1 - Z_01 G^T``.

    Parameters
    ----------
    factor : ndarray, shape (6 n_poses, 6 band)
        The upper factor U, in the layout of `Bordered.P`.
    scale : ndarray, shape (6 n_poses,)
        The diagonal of S.
    X : ndarray, shape (6 n_poses, n_border)
    D : ndarray, shape (n_border, n_border)
    """
    n, width = factor.shape
    out = np.zeros((n // 6, width // 6, 6, 6))
    size = max(min(BLOCK, width - 6), 6)
    XD, Z_11 = X @ D, np.zeros((0, 0))
    for start in reversed(range(0, n, size)):
        stop = min(start + size, n)
        here, ahead = slice(start, stop), slice(stop, min(stop + width - 6, n))
        L_00, L_10 = _factor_block(factor, here, ahead)
        G = scipy.linalg.blas.dtrsm(1.0, L_00, L_10, side=1, lower=1).T if L_10.size else L_10.T
        Z_11 = Z_11[: ahead.stop - stop, : ahead.stop - stop]
        Z_01 = -G @ Z_11
        lower, _ = scipy.linalg.lapack.dpotri(L_00, lower=1)
        Z_00 = np.where(np.tri(len(lower), dtype=bool), lower, lower.T) - Z_01 @ G.T
        Z_11 = np.block([[Z_00, Z_01], [Z_01.T, Z_11]])
        rows = np.zeros((stop - start, stop - start + width - 6))
        used = slice(start, ahead.stop)
        part = rows[:, : ahead.stop - start]
        part[:] = Z_11[: stop - start]
        part *= scale[here, None]
        part *= scale[used]
        part += XD[here] @ X[used].T
        down, right = rows.strides
        blocks = ((stop - start) // 6, width // 6, 6, 6)
        strides = (6 * (down + right), 6 * right, down, right)
        out[start // 6 : stop // 6] = as_strided(rows, blocks, strides)
    return out


def _factor_block(factor: Array, here: slice, ahead: slice) -> tuple[Array, Array]:
    """Return columns of the lower factor: on the diagonal, where only L counts, and below.

    A number of `Bordered.P` stands one row further and one column less than the one above it in
    the matrix: the matrix is a view of the band with shorter rows.
    """
    n, width, each = here.stop - here.start, factor.shape[1], factor.itemsize
    strides = ((width - 1) * each, each)
    upper = as_strided(factor[here.start :], (n, ahead.stop - here.start), strides)
    inside = np.tri(n, ahead.stop - ahead.start, width - n - 1, dtype=bool)
    return upper[:, :n].copy().T, (upper[:, n:] * inside).T


@dataclass(frozen=True, kw_only=True, eq=False)
class BandedInverse:
    """Border and band of the inverse of a large system: see `Inverse`.

    Attributes
    ----------
    factored : Banded
    part : BorderedCovariance
    order : ndarray, shape (n_bordered,)
        The unknown of each column of the bordered system, -1 for one that is held.
    """

    factored: Banded
    part: BorderedCovariance
    order: Index
    defect: int = 0

    @property
    def undetermined(self) -> Mask:
        """No column: a singular system cannot be factored."""
        return np.zeros(len(self._place), dtype=bool)

    @cached_property
    def _place(self) -> Index:
        return places(self.order)

    @cached_property
    def dense(self) -> Array:
        """The whole inverse, shape (n, n), which is large."""
        solved = self.factored.solve(np.eye(len(self.order)))
        return np.asarray(solved[np.ix_(self._place, self._place)])

    @cached_property
    def _spectrum(self) -> tuple[float, Array]:
        condition, weakest = self.factored.spectrum()
        return condition, weakest[self._place]

    @property
    def condition(self) -> float:
        """Condition of the scaled normal matrix."""
        return self._spectrum[0]

    @property
    def weakest(self) -> Array:
        """Eigenvector of the scaled matrix's smallest eigenvalue, in scaled unknowns."""
        return self._spectrum[1]

    def at(self, rows: Index, columns: Index) -> Array:
        """Return entries; outside border and band they need the whole inverse."""
        i, j = np.broadcast_arrays(self._place[rows], self._place[columns])
        low, high = np.minimum(i, j), np.maximum(i, j)
        m = len(self.part.D)
        a, b = (low - m) // 6, (high - m) // 6
        inside = (low < m) | (b - a < self.part.P.shape[1])
        if not inside.all():
            return self.dense[rows, columns]
        out = np.empty(low.shape)
        corner, border = high < m, (low < m) & (high >= m)
        out[corner] = self.part.D[low[corner], high[corner]]
        out[border] = self.part.C[low[border], high[border] - m]
        band = low >= m
        a, b = a[band], b[band]
        out[band] = self.part.P[a, b - a, (low[band] - m) % 6, (high[band] - m) % 6]
        return out

    def times(self, J: Array) -> Array:
        """Return J times the covariance; the whole inverse is not needed for it."""
        ordered = np.zeros((len(self.order), J.size // len(self._place)))
        ordered[self._place] = J.reshape(-1, len(self._place)).T
        return self.factored.solve(ordered)[self._place].T.reshape(J.shape)


def too_large() -> AdjustmentError:
    """Return the error of a large system that is singular."""
    msg = (
        f"the normal equations are singular and too large to examine (over {LARGEST_DENSE} "
        "unknowns besides points): adjust a part of the block to see which unknowns are open"
    )
    return AdjustmentError(msg)
