"""Residuals after an adjustment, with what tests of single observations need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from acx4lib.expected import Array, Mask

LEAST = 1e-6
"""Control below which no other observation controls an observation."""


class Together(NamedTuple):
    """What the tests of correlated observations need: those of the others count as well.

    Attributes
    ----------
    weighted : ndarray, shape (m, d)
        sigma (P v), v the residuals and P their weights.
    control : ndarray, shape (m, d)
        sigma^2 times the diagonal of P Q_vv P, Q_vv the covariance of the residuals.
    own : ndarray, shape (m, d)
        sigma^2 times the diagonal of P.
    """

    weighted: Array
    control: Array
    own: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Residuals of one group after the adjustment.

    Attributes
    ----------
    kind : str
    v, sigma, redundancy : ndarray, shape (m, d)
        The redundancy number is the share of an error that shows in its own residual; NaN
        where the component takes no part.
    together : Together, optional
        Where the errors are correlated. With independent ones, `weighted` is v / sigma,
        `control` the redundancy number, and `own` one.
    """

    kind: str
    v: Array
    sigma: Array
    redundancy: Array
    together: Together | None = None

    @property
    def used(self) -> Mask:
        """Which components took part."""
        return np.isfinite(self.sigma)

    @property
    def weighted(self) -> Array:
        """Weighted residuals times sigma, sigma (P v), shape (m, d)."""
        return self.v / self.sigma if self.together is None else self.together.weighted

    @property
    def squares(self) -> Array:
        """What each component adds to the weighted sum of squared residuals, shape (m, d)."""
        if self.together is None:
            return np.square(self.v / self.sigma)
        return self.v / self.sigma * self.together.weighted

    @property
    def control(self) -> Array:
        """How far the others control an observation: sigma^2 (P Q_vv P)_ii, shape (m, d)."""
        return self.redundancy if self.together is None else self.together.control

    @property
    def error(self) -> Array:
        """What an observation differs by from its prediction, where its sigma is very large."""
        if self.together is None:
            return self.v
        return self.sigma * self.weighted / np.where(self.control > 0, self.control, np.nan)

    @property
    def explained(self) -> Array:
        """Variance of this prediction."""
        if self.together is None:
            return np.maximum(1 - self.redundancy, 0.0) * self.sigma**2
        return self.sigma**2 * (1 / np.where(self.control > 0, self.control, np.nan) - 1)

    @cached_property
    def w(self) -> Array:
        """Baarda's normalised residuals, a priori sigma; NaN where no observation controls them."""
        w = np.full_like(self.v, np.nan)
        controlled = self.used & (self.control > LEAST)
        control = self.control[controlled]
        if self.together is None:
            w[controlled] = self.v[controlled] / (self.sigma[controlled] * np.sqrt(control))
        else:
            w[controlled] = self.weighted[controlled] / np.sqrt(control)
        return w
