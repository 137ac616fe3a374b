"""Errors that change slowly: first-order Gauss-Markov processes beside white noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array


@dataclass(frozen=True, kw_only=True)
class GaussMarkov:
    """Correlation in time of errors with standard deviation sigma.

    Their covariance at the times t_i and t_j is
    ``sigma_i sigma_j (share**2 exp(-|t_i - t_j| / time_constant_s) + (1 - share**2) delta_ij)``:
    the variance sigma**2 is the sum of a slow part, share**2 of it, and white noise.

    Attributes
    ----------
    share : float
        Standard deviation of the slow part as a share of sigma, 0 to 1; 0, the default, is white
        noise alone. With 0.8, the white noise has 0.6 of sigma.
    time_constant_s : float
        Time after which the slow part's correlation is 1/e.
    """

    share: float = 0.0
    time_constant_s: float = 1.0

    def __post_init__(self) -> None:
        expected.positive_number("time_constant_s", self.time_constant_s)
        if not 0 <= self.share <= 1:
            raise ValueError(f"share: expected a number from 0 to 1, got {self.share}")

    def together(self, time_s: Array) -> Array:
        """Return the correlation of the slow part at n times, shape (n, n)."""
        lag: Array = np.abs(np.subtract.outer(time_s, time_s)) / self.time_constant_s
        return np.exp(-lag)


WHITE = GaussMarkov()
"""Independent errors."""
