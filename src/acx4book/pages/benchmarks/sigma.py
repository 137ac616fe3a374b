"""The page on the errors from ``make coverage``: their tests, shares and biases."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy import special, stats

from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS, TITLES, at_commit, inside, myst_table
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.adjustment import two_sided_p
from acx4lib.least_squares.statistics import holm

ALPHA = 0.01
"""Probability that any of all tests fails by chance."""

CONFIDENCE = 0.95
"""Confidence of intervals, and power of what can be found."""

MAIN = "single_step"
"""The method whose parameters are shown one by one."""

LEVELS = (1, 2, 3)
"""Multiples of sigma at which coverage is counted."""

RESAMPLED = 20_000
"""Samples of a bootstrap: its p values are multiples of 1 / 20 001."""

Share = tuple[float, float, float]
"""A share, and the ends of its confidence interval."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Errors:
    """Errors over many flights.

    Attributes
    ----------
    parameters : DataFrame
        Columns seed, method, parameter, error, sigma, decorrelated; of a head's parameters the
        name has the head before it, and those that follow from others have no decorrelated error.
    points : DataFrame
        Columns seed, method, point, and d and sigma by axis, m.
    about : mapping
        Date, processor, commit, seeds.
    """

    parameters: pd.DataFrame
    points: pd.DataFrame
    about: Mapping[str, Any]

    @property
    def methods(self) -> list[str]:
        """Names of the methods, the main one first."""
        return sorted(self.parameters["method"].unique(), key=lambda m: m != MAIN)

    def normalised(self, method: str) -> pd.DataFrame:
        """Return errors over sigma, a row per flight and a column per parameter."""
        rows = self.parameters[self.parameters["method"] == method]
        return _wide(rows.assign(z=rows["error"] / rows["sigma"]), "z")

    def chi_squares(self, method: str) -> tuple[Array, int]:
        """Return the joint chi-square of every flight, and its degrees of freedom."""
        rows = self.parameters[self.parameters["method"] == method]
        wide = _wide(rows, "decorrelated").dropna(axis=1, how="all")
        return np.sum(wide.to_numpy() ** 2, axis=1), wide.shape[1]

    def validated(self, method: str) -> Array:
        """Return differences over sigma, shape (n_flights, n_points, 3).

        NaN for a point missing in a flight.
        """
        rows = self.points[self.points["method"] == method]
        parts = []
        for axis in AXES:
            z = rows.assign(z=rows[f"d_{axis}_m"] / rows[f"sigma_{axis}_m"])
            parts.append(z.pivot_table(index="seed", columns="point", values="z").to_numpy())
        return np.stack(parts, axis=-1) if len(rows) else np.zeros((0, 0, 3))

    @cached_property
    def tests(self) -> pd.DataFrame:
        """All tests: method, quantity, name, value, p, and p by Holm over all tests."""
        rows = [row for method in self.methods for row in _tests(self, method)]
        table = pd.DataFrame(rows, columns=["method", "quantity", "test", "value", "p"])
        return table.assign(joint_p=holm(table["p"].to_numpy(dtype=float)))


def _wide(rows: pd.DataFrame, values: str) -> pd.DataFrame:
    names = list(dict.fromkeys(rows["parameter"]))
    return rows.pivot_table(index="seed", columns="parameter", values=values, dropna=False)[names]


def read(folder: Path) -> Errors:
    """Read the errors of ``make coverage`` from a folder."""
    about, (parameters, points, heads) = read_stored(
        folder, "coverage", "parameters", "points", "heads", make="coverage"
    )
    return Errors(parameters=pd.concat([parameters, heads]), points=points, about=about)


def read_stored(
    folder: Path, name: str, *parts: str, make: str = "bench"
) -> tuple[dict[str, Any], list[pd.DataFrame]]:
    """Return the content of ``NAME.json``, and the tables.

    Parameters
    ----------
    folder : Path
    name : str
    parts : str
        The tables are ``NAME_PART.csv``; without parts the table is ``NAME.csv``.
    make : str
        The target of ``make`` that writes these files.

    Raises
    ------
    FileNotFoundError
        If a file is missing: the message says how to make it.
    """
    tables = [folder / f"{name}_{part}.csv" for part in parts] or [folder / f"{name}.csv"]
    about = folder / f"{name}.json"
    if not all(path.is_file() for path in (about, *tables)):
        msg = f"no benchmark of {name} in {folder}: make {make}"
        raise FileNotFoundError(msg)
    return json.loads(about.read_text(encoding="utf-8")), [pd.read_csv(path) for path in tables]


# --- tests -----------------------------------------------------------------------------------


def _tests(errors: Errors, method: str) -> Iterator[tuple[str, str, str, float, float]]:
    """Yield method, quantity, name of the test, value and p."""
    for name, z in errors.normalised(method).items():
        yield method, str(name), "mean", float(z.mean()), float(stats.ttest_1samp(z, 0.0).pvalue)
        dof = len(z) - 1
        p_spread = two_sided_p(float(dof * z.var()), dof)
        yield method, str(name), "spread", float(z.std()), p_spread
    squares, n = errors.chi_squares(method)
    total = float(squares.sum())
    yield method, "joint", "sum", total, two_sided_p(total, n * len(squares))
    p_shape = float(stats.kstest(squares, stats.chi2(n).cdf).pvalue)
    yield method, "joint", "distribution", float(n), p_shape
    validated = errors.validated(method)
    if len(validated):
        for test, power in (("mean", 1), ("spread", 2)):
            of_flights = np.nanmean(validated**power, axis=1)
            p = _flight_mean_p(of_flights, np.full(3, power - 1.0))
            values = of_flights.mean(axis=0)
            for axis, value, p_axis in zip(AXES, values, p, strict=True):
                yield method, axis, test, float(value), float(p_axis)


def _flight_mean_p(of_flights: Array, expected: Array) -> Array:
    """Return the two-sided p value of the mean over flights, by bootstrap over flights."""
    # Student's statistic beside that of samples drawn with replacement, about the mean of the
    # sample (B. Efron and R. J. Tibshirani, "An Introduction to the Bootstrap", 1993, section 16.4)
    n = len(of_flights)
    mean = of_flights.mean(axis=0)
    observed = (mean - expected) / (of_flights.std(axis=0, ddof=1) / np.sqrt(n))
    counts = _resampled(n)
    centred = of_flights - mean
    means = counts @ centred / n
    squares = counts @ centred**2 / n - means**2
    drawn = means / np.sqrt(squares / (n - 1))
    return (1 + np.sum(np.abs(drawn) >= np.abs(observed), axis=0)) / (len(counts) + 1)


@lru_cache(maxsize=1)
def _resampled(n: int) -> Array:
    """Return how often each of n flights is drawn in each sample, always the same samples."""
    rng = np.random.default_rng(n)
    return rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLED).astype(float)


# --- the page --------------------------------------------------------------------------------

HEADINGS = {
    "mean": ("Mean", "p (mean)"),
    "spread": ("Standard deviation", "p (spread)"),
    "sum": ("Sum of χ²", "p (sum)"),
    "distribution": ("Independent parameters", "p (distribution)"),
}
"""Headings of the value and of the p of a test."""

FORMATS = {
    **{heading: ".3f" for both in HEADINGS.values() for heading in both},
    "Mean": "+.3f",
    "Mean square": ".3f",
    "Sum of χ²": ".1f",
    "Independent parameters": ".0f",
}


def page(errors: Errors) -> str:
    """Return the tests and their outcome as MyST text."""
    parameters = [
        {"Parameter": _parameter(str(name)), **_outcome(errors, MAIN, str(name), "mean", "spread")}
        for name in errors.normalised(MAIN)
    ]
    joint = [
        {
            "Method": TITLES[method],
            "Flights": len(errors.chi_squares(method)[0]),
            **_outcome(errors, method, "joint", "sum", "distribution"),
        }
        for method in errors.methods
    ]
    points = pd.DataFrame(
        [
            {"Method": TITLES[m], "Axis": axis, **_outcome(errors, m, axis, "mean", "spread")}
            for m in errors.methods
            if len(errors.validated(m))
            for axis in AXES
        ]
    ).rename(columns={"Standard deviation": "Mean square"})
    caption = "normalised errors, with p values of mean 0 and standard deviation 1"
    parts = [
        _made(errors),
        _verdict(errors),
        _table(pd.DataFrame(parameters), f"{TITLES[MAIN]}: {caption}", "parameters"),
        _table(pd.DataFrame(joint), "Joint χ² of all parameters of a method", "joint"),
        _table(points, "Normalised differences at validation points", "points"),
    ]
    return "\n\n".join(parts) + "\n"


def _made(errors: Errors) -> str:
    about, seeds = errors.about, errors.parameters["seed"]
    return (
        f"Computed on {about['date']} at {at_commit(about['commit'])}: {seeds.nunique()} flights "
        f"of the design `{about['design']}`, of the heads `{about['heads_design']}`, seeds "
        f"{seeds.min()} to {seeds.max()}; "
        f"{about['processor']}, {about['system']}, Python {about['versions']['python']}, numpy "
        f"{about['versions']['numpy']}."
    )


def _verdict(errors: Errors) -> str:
    """State the joint outcome of all tests, and name the failing ones."""
    tests = errors.tests
    failed = tests[tests["joint_p"] < ALPHA]
    worst = tests.iloc[int(tests["p"].argmin())]
    if failed.empty:
        sentence = (
            f"None of the {len(tests)} tests fails. The smallest p value is that of the "
            f"{worst['test']} of {_label(worst)}: {worst['p']:.2g} by itself, and "
            f"{worst['joint_p']:.2g} after Holm's adjustment"
        )
    else:
        failures = "; ".join(f"{row['test']} of {_label(row)}" for _, row in failed.iterrows())
        sentence = f"{len(failed)} of the {len(tests)} tests fail: {failures}"
    return f"{sentence}. By chance any of them would fail in {100 * ALPHA:g} % of all repetitions."


def _label(test: pd.Series) -> str:
    quantity = str(test["quantity"])
    if quantity == "joint":
        name = "χ²"
    elif quantity in AXES:
        name = f"{quantity} at validation points"
    else:
        name = _parameter(quantity)
    return f"{name} ({inside(TITLES[str(test['method'])])})"


def _parameter(name: str) -> Markup:
    """Return the label of a parameter, after the name of its head if any."""
    head, _, key = name.rpartition(" ")
    return Markup(f"{head} {LABELS[key]}".strip())


def _outcome(errors: Errors, method: str, quantity: str, *tests: str) -> dict[str, float]:
    """Return value and p of tests of a quantity, by `HEADINGS`."""
    rows = errors.tests[
        (errors.tests["method"] == method) & (errors.tests["quantity"] == quantity)
    ].set_index("test")
    pairs = [zip(HEADINGS[test], rows.loc[test, ["value", "p"]], strict=True) for test in tests]
    return {heading: float(value) for pair in pairs for heading, value in pair}


def _table(table: pd.DataFrame, caption: str, name: str) -> str:
    formats = {key: form for key, form in FORMATS.items() if key in table}
    return myst_table(table, caption, name=f"tab-coverage-{name}", formats=formats)


def found(errors: Errors) -> str:
    """State the errors of means and standard deviations that the tests find in 95 % of cases."""
    n, m = int(errors.parameters["seed"].nunique()), len(errors.tests)
    alpha, chi2 = ALPHA / m, stats.chi2(n - 1)
    bias = (stats.t.ppf(1 - alpha / 2, n - 1) + stats.norm.ppf(CONFIDENCE)) / np.sqrt(n)
    low = np.sqrt(chi2.ppf(alpha / 2) / chi2.ppf(CONFIDENCE))
    high = np.sqrt(chi2.ppf(1 - alpha / 2) / chi2.ppf(1 - CONFIDENCE))
    return (
        f"With {n} flights and {m} tests, a bias of {bias:.2g} σ, "
        f"or a σ that is {100 * (1 / low - 1):.0f} % too large or {100 * (1 - 1 / high):.0f} % too "
        f"small, is found in {100 * CONFIDENCE:.0f} % of all repetitions. Half as much "
        "mostly stays hidden."
    )


def normalised_errors(errors: Errors) -> Figure:
    """Draw histograms of the main method's errors over sigma beside the normal distribution."""
    shown = {str(LABELS[str(name)]): z.to_numpy() for name, z in errors.normalised(MAIN).items()}
    points = errors.validated(MAIN)
    shown |= {f"validation, {axis}": points[..., i].ravel() for i, axis in enumerate(AXES)}
    x, bins = np.linspace(-4, 4, 200), np.linspace(-4, 4, 17).tolist()
    n_rows = -(-len(shown) // 6)
    with style.applied():
        fig, grid = style.subplots(n_rows, 6, figsize=(style.WIDTH, 1.45 * n_rows), squeeze=False)
        for ax, (title, z) in zip(grid.flat, shown.items(), strict=False):
            ax.hist(np.clip(z, -4, 4), bins, density=True, color=style.SKY, alpha=0.75)
            ax.plot(x, stats.norm.pdf(x), color=style.INK, lw=1.1)
            ax.set(xlim=(-4, 4), ylim=(0, 0.62), xticks=[-3, 0, 3], yticks=[])
            ax.set_title(title, loc="center", fontsize=style.SMALL, fontweight="normal", pad=3)
        for ax in grid.flat[len(shown) :]:
            ax.set_visible(False)
        fig.supxlabel("error over its standard deviation (1)", fontsize=8.5, color=style.INK)
    return fig


# --- shares within 1, 2 and 3 sigma ----------------------------------------------------------


def shares(errors: Errors) -> str:
    """Return the share of errors within 1, 2 and 3 sigma as MyST text."""
    normal = [f"{100 * special.erf(level / np.sqrt(2)):.1f}" for level in LEVELS]
    rows = [("normal distribution", normal)]
    for name, z in errors.normalised(MAIN).items():
        within = [int(np.sum(np.abs(z) <= level)) for level in LEVELS]
        rows.append((LABELS[str(name)], [percent(binomial(k, len(z))) for k in within]))
    groups = []
    for method in errors.methods:
        wide = errors.normalised(method)
        label = f"all {wide.shape[1]} parameters, {inside(TITLES[method])}"
        groups.append((label, wide.to_numpy()))
    points = errors.validated(MAIN)
    groups += [(f"validation points, {axis}", points[:, :, i]) for i, axis in enumerate(AXES)]
    rows += [(label, [percent(_by_flights(z, level)) for level in LEVELS]) for label, z in groups]
    heads = [f"within {level} σ (%)" for level in LEVELS]
    table = pd.DataFrame(
        [{"Quantity": label, **dict(zip(heads, cells, strict=True))} for label, cells in rows]
    )
    caption = "Share of errors within 1, 2 and 3 σ, in brackets its 95 % interval"
    return _table(table, caption, "shares") + "\n"


def binomial(k: int, n: int) -> Share:
    """Return the share k of n independent cases with its interval, Clopper's and Pearson's."""
    test = stats.binomtest(k, n)
    low, high = test.proportion_ci(CONFIDENCE)
    return float(test.statistic), float(low), float(high)


def percent(share: Share) -> str:
    """Return a share and its interval in percent, without their unit."""
    value, low, high = (f"{100 * x:.1f}" for x in share)
    return f"{value} ({low} to {high})"


def _by_flights(z: Array, level: float) -> Share:
    """Return the share of errors within some sigma, with its interval by bootstrap over flights."""
    of_flights = np.nanmean(np.where(np.isnan(z), np.nan, np.abs(z) <= level), axis=1)
    means = _resampled(len(z)) @ of_flights / len(z)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(of_flights.mean()), float(low), float(high)


# --- what errors leave in the mean of noise and its negative -----------------------------------


GOAL = 0.02
"""Largest bias of a parameter, in its sigma."""

GOAL_ERROR = 0.005
"""Largest allowed standard error of a bias, in sigma."""

PLACES = {"adjusted": "Adjusted point", "measured": "Measured point"}
"""Where distortion is evaluated, the library's own way first."""


def bias_page(pairs: pd.DataFrame) -> str:
    """Return the biases of the single step and the goal as MyST text.

    Parameters
    ----------
    pairs : DataFrame
        Columns seed, distortion_at, parameter, error (the mean of a pair of flights whose noise has
        opposite signs), sigma (of one flight).
    """
    z = (pairs["error"] / pairs["sigma"]).groupby(
        [pairs["distortion_at"], pairs["parameter"]], sort=False
    )
    biases = pd.DataFrame({"bias": z.mean(), "error": z.sem()})
    own = biases.loc["adjusted"]
    largest, least_known = own.iloc[int(own["bias"].abs().argmax())], own["error"].max()
    reached = abs(largest["bias"]) < GOAL and least_known < GOAL_ERROR
    verdict = (
        f"In {pairs['seed'].nunique()} pairs the largest bias of the single step is "
        f"{_bias(largest, digits=4)} σ, of {LABELS[str(largest.name)]}; all are known to "
        f"{least_known:.4f} σ or better. The goal, less than {GOAL:g} σ known to {GOAL_ERROR:g} σ, "
        f"is {'reached' if reached else 'not reached'}."
    )
    table = pd.DataFrame({"Parameter": [LABELS[str(name)] for name in own.index]})
    for where, heading in PLACES.items():
        rows = 1000 * biases.loc[where].loc[own.index]
        table[heading] = [_bias(row, digits=2) for _, row in rows.iterrows()]
    caption = (
        "Bias of the single step in thousandths of σ, distortion at adjusted or at measured points"
    )
    return f"{verdict}\n\n{_table(table, caption, 'bias')}\n"


def _bias(row: pd.Series, *, digits: int) -> str:
    return f"{row['bias']:+z.{digits}f} ± {row['error']:.{digits}f}".replace("-", "−")
