"""Damping of Gauss-Newton steps by the gain ratio (Levenberg, Marquardt, Nielsen)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

FIRST = 1e-3
"""Damping where the first full step fails, as a share of the diagonal."""

LEAST_SHRINKAGE = 1 / 3
"""Factor on the damping after a step that kept all of its promise."""

NEGLIGIBLE, MOST = 1e-14, 1e20
"""Damping below which steps are full, and above which there is nothing left to try."""

FULL_GAIN = 0.25
"""Gain of a full step below which a shorter one is tried."""


def gain(decrease: float, promised: float) -> float:
    """Return the decrease of the cost divided by the predicted one; none promised, none gained."""
    return decrease / promised if promised > 0 else -np.inf


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Damping of the next step, and how it goes on from there.

    Attributes
    ----------
    value : float
        Share of the diagonal; zero for a full step.
    kept : float
        The value with which damping begins again if the full step fails.
    growth : float
        Factor after a step that fails; it doubles from failure to failure.

    Notes
    -----
    After a success
    the damping changes by ``max(1/3, 1 - (2 gain - 1)^3)`` [1]_.

    References
    ----------
    .. [1] H. B. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05, 1999.
    """

    value: float = 0.0
    kept: float = FIRST
    growth: float = 2.0

    @property
    def most_hopeful(self) -> float:
        """The value after a step that keeps all of its promise."""
        return LEAST_SHRINKAGE * self.value

    @property
    def exhausted(self) -> bool:
        """Whether no step can be expected to help any more."""
        return self.value > MOST

    def helps(self, gain: float) -> bool:
        """Tell whether a step with this gain is taken."""
        return gain > (0.0 if self.value else FULL_GAIN)

    def after_success(self, gain: float, *, near: bool) -> Damping:
        """Return the damping after a step that was taken; near the minimum the next one is full."""
        if self.value == 0.0:
            return self
        value = max(self.most_hopeful, self.value * (1 - (2 * gain - 1) ** 3))
        if near or value < NEGLIGIBLE:
            return Damping(kept=max(value, NEGLIGIBLE))
        return Damping(value=value)

    def after_failure(self) -> Damping:
        """Return the damping after a step that was not taken."""
        if self.value == 0.0:
            return replace(self, value=self.kept)
        return replace(self, value=self.value * self.growth, growth=2 * self.growth)
