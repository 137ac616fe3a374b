"""Weighted sums of squares of standard normal values: what a quadratic form of residuals is."""

from __future__ import annotations

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array

STEP, NODES = 0.15, 160
"""Of the trapezoidal rule: probabilities have a relative error below 1e-9."""
BEND = 0.25
"""How fast the path of integration turns to the right, where it is as near to the branch as it
steps: then the integrand falls faster than by a power."""
LEAST = 0.5
"""Smallest distance of the path from the pole at zero, over the standard deviation."""


def tails(x: float, weights: Array) -> tuple[float, float]:
    """Return the probabilities of a weighted sum of squares below and above a value.

    Parameters
    ----------
    x : float
        Value of the sum, not negative.
    weights : ndarray, shape (n,)
        Weight of each squared standard normal value, not negative; one at least is positive.

    Returns
    -------
    below, above : float
        Both with a relative error below 1e-9, however small they are.

    Notes
    -----
    With K(s) = -1/2 sum log(1 - 2 w s), the probability above x is the integral of
    exp(K(s) - s x) / s over a path that goes upward through the real axis between zero and
    1 / (2 max(w)), divided by 2 pi i; below zero it is minus the probability below x [1]_. The
    integral is taken through the saddle point of the exponent, as for an expansion about it [2]_,
    but numerically: the trapezoidal rule has an error that falls exponentially.

    References
    ----------
    .. [1] J. P. Imhof, "Computing the distribution of quadratic forms in normal variables", 1961.
    .. [2] R. Lugannani, S. Rice, "Saddle point approximation for the distribution of the sum of
       independent random variables", 1980.
    """
    expected.not_negative("weights", weights)
    largest = float(np.max(weights, initial=0.0))
    if not largest > 0:
        msg = "weights: expected one that is positive"
        raise ValueError(msg)
    if not x > 0:
        return 0.0, 1.0
    w, x = weights[weights > 0] / largest, float(x) / largest
    is_above = x >= float(w.sum())
    part = _part(x, w, is_above=is_above)
    return (1 - part, part) if is_above else (part, 1 - part)


def _part(x: float, w: Array, *, is_above: bool) -> float:
    """Return the probability above x, or below it; the largest weight is one."""
    least = LEAST / np.sqrt(2 * np.sum(w**2))
    c = _saddle(x, w)
    c = max(c, least) if is_above else min(c, -least)
    spread = np.sqrt(np.sum(2 * (w / (1 - 2 * w * c)) ** 2))
    scale = min(abs(c), 0.5 - c, 1 / spread)
    bend = BEND * scale / (0.5 - c)
    t = STEP * (np.arange(NODES) + 0.5)
    s = c + scale * (1j * t + bend * t**2)
    exponent = -0.5 * np.sum(np.log(1 - 2 * w[:, None] * s), axis=0) - s * x
    found = np.sum((np.exp(exponent) / s * scale * (1j + 2 * bend * t)).imag) * STEP / np.pi
    return float(found if is_above else -found)


def _saddle(x: float, w: Array) -> float:
    """Return where the derivative of K is x, by bisection."""
    low, high = -len(w) / (2 * x), 0.5 - 0.5 / max(x, 1e-300)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if np.sum(w / (1 - 2 * w * middle)) < x:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
