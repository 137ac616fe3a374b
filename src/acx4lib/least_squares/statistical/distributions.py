"""Probabilities and quantiles of the distributions of tests, named as in ``scipy.stats``.

The values are those of that package to the last bit. It is not imported, since loading it takes
longer than adjusting a small flight.
"""

from __future__ import annotations

from scipy import special


def norm_cdf(x: float) -> float:
    """Return the probability of a standard normal value below x."""
    return float(special.ndtr(x))


def norm_sf(x: float) -> float:
    """Return the probability of a standard normal value above x."""
    return float(special.ndtr(-x))


def norm_ppf(q: float) -> float:
    """Return what a standard normal value is below with probability q."""
    return float(special.ndtri(q))


def chi2_cdf(x: float, df: float) -> float:
    """Return the probability of a chi-square value below x >= 0."""
    return float(special.chdtr(df, x))


def chi2_sf(x: float, df: float) -> float:
    """Return the probability of a chi-square value above x >= 0."""
    return float(special.chdtrc(df, x))


def chi2_ppf(q: float, df: float) -> float:
    """Return what a chi-square value is below with probability q."""
    return float(2 * special.gammaincinv(df / 2, q))


def chi2_isf(q: float, df: float) -> float:
    """Return what a chi-square value is above with probability q."""
    return float(special.chdtri(df, q))


def t_sf(x: float, df: float) -> float:
    """Return the probability of a value of Student's t above x."""
    return float(special.stdtr(df, -x))


def t_ppf(q: float, df: float) -> float:
    """Return what a value of Student's t is below with probability q."""
    return float(special.stdtrit(df, q))


def t_isf(q: float, df: float) -> float:
    """Return what a value of Student's t is above with probability q."""
    return float(-special.stdtrit(df, q))


def f_sf(x: float, dfn: float, dfd: float) -> float:
    """Return the probability of a value of Fisher's F above x >= 0."""
    return float(special.fdtrc(dfn, dfd, x))
