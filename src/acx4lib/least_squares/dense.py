"""Dense reduced normal equations: solution, inverse, and directions left open.

`banded` is for large blocks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy

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
