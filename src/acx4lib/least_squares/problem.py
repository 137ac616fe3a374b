"""What an adjustment needs to know of its application."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.dense import Inverse
from acx4lib.least_squares.statistical.correlated import Correlation
from acx4lib.least_squares.statistical.residuals import Group

S = TypeVar("S")


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """One group of linearised observations, v = estimated - observed.

    Attributes
    ----------
    kind : str
        Name for reports.
    v, sigma : ndarray, shape (m, d)
        An infinite sigma takes a component out.
    A : ndarray, shape (m, d, k)
        dv / d(unknowns of the observation's unit); k may be zero.
    columns : ndarray, shape (n_units, k)
        Where these unknowns stand in the reduced system; -1 for one that is held.
    unit : ndarray, shape (m,)
        Observations of one unit share their columns.
    B : ndarray, shape (m, d, 3), optional
        dv / d(point).
    point : ndarray, shape (m,), optional
    correlation : Correlation, optional
        Of observations that are correlated: of columns alone, each its own unit, in order.
    """

    kind: str
    v: Array
    sigma: Array
    A: Array
    columns: Index
    unit: Index
    B: Array | None = None
    point: Index | None = None
    correlation: Correlation | None = None

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals."""
        z = self.v / self.sigma
        return float(np.sum(z**2 if self.correlation is None else z * self.correlation.times(z)))

    def weighed(self, x: Array) -> Array:
        """Return the weights times x, shape (m, d, ...)."""
        sigma = self.sigma.reshape(*self.sigma.shape, *(1,) * (x.ndim - 2))
        if self.correlation is None:
            return x / sigma**2
        weighed: Array = self.correlation.times(x / sigma) / sigma
        return weighed

    def tested(self, explained: Array) -> Group:
        """Return the residuals with their redundancy numbers.

        Parameters
        ----------
        explained : ndarray, shape (m, d), or (p, d) for the pairs of correlated observations
            Covariances of the adjusted observations.
        """
        redundancy: Array = 1 - explained / self.sigma**2 if self.correlation is None else explained
        used, together = np.isfinite(self.sigma), None
        if self.correlation is not None:
            sigma = self.sigma[self.correlation.first] * self.sigma[self.correlation.second]
            z = self.v / self.sigma
            redundancy, together = self.correlation.tested(z, explained / sigma)
        return Group(
            kind=self.kind,
            v=self.v,
            sigma=self.sigma,
            redundancy=np.where(used, redundancy, np.nan),
            together=together,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Precision:
    """Covariances, residuals and redundancy numbers from the normal equations.

    Attributes
    ----------
    inverse : Inverse
        Covariance of the reduced unknowns.
    cov_points : ndarray, shape (n_points, 3, 3)
        Zero for points that are held.
    groups : tuple of Group
    """

    inverse: Inverse
    cov_points: Array
    groups: tuple[Group, ...]


class Problem(Protocol[S]):
    """What an adjustment needs from its application.

    A problem may also have a method ``normals(state, damping, before)`` that returns `Normals` of
    its own, and may take over the memory of those before; otherwise they are assembled from its
    equations.
    """

    @property
    def n_columns(self) -> int:
        """Number of reduced unknowns."""
        ...

    @property
    def n_points(self) -> int:
        """Number of points, free or held."""
        ...

    @property
    def free_points(self) -> Mask:
        """Which points are unknowns."""
        ...

    def equations(self, state: S) -> Sequence[Equations]:
        """Return the linearised observations; residuals are NaN at an impossible state."""
        ...

    def moved(self, state: S, dx: Array, dp: Array) -> S:
        """Return the state after a step in the columns and in the points."""
        ...

    def column_names(self) -> Sequence[str]:
        """Return a name per column, for messages."""
        ...


class Normals(Protocol):
    """Normal equations of a problem at one state."""

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals; infinite at an impossible state."""
        ...

    @property
    def n_observations(self) -> int:
        """Number of observed components that take part."""
        ...

    @property
    def promised(self) -> float:
        """The decrease of cost that the step predicts."""
        ...

    def step(self) -> tuple[Array, Array]:
        """Return the step of columns and points."""
        ...

    def precision(self) -> Precision:
        """Return covariances, residuals and redundancy numbers, all without damping."""
        ...
