"""What an adjustment needs to know of its application."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

from acx4lib.expected import Array, Mask
from acx4lib.least_squares.normal_equations import Equations, Precision

S = TypeVar("S")


class Problem(Protocol[S]):
    """What an adjustment needs from its application.

    A problem may also have a method ``normals(state, damping)`` that returns `Normals` of its
    own; otherwise they are assembled from its equations.
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
