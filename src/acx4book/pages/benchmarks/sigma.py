"""The page on the errors from ``make coverage``.

Tests of errors over their standard deviations, and biases.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import special, stats

from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS, TITLES, at_commit, inside, myst_table
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.adjustment import two_sided_p
from acx4lib.least_squares.statistics import holm

# --- Whether standard deviations can be believed, as a page of the book
#
# The errors come from ``make coverage``, in ``data/benchmarks``.


ALPHA = 0.01
"""Probability that any of all tests fails by chance."""

MAIN = "single_step"
"""The method with figures of single parameters."""


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
        rows = self._of(self.parameters, method)
        return _wide(rows.assign(z=rows["error"] / rows["sigma"]), "z")

    def chi_squares(self, method: str) -> tuple[Array, int]:
        """Return the joint chi-square of every flight, and its degrees of freedom."""
        wide = _wide(self._of(self.parameters, method), "decorrelated").dropna(axis=1, how="all")
        return np.sum(wide.to_numpy() ** 2, axis=1), wide.shape[1]

    def validated(self, method: str) -> Array:
        """Return differences over sigma, shape (n_flights, n_points, 3).

        NaN for a point missing in a flight.
        """
        rows = self._of(self.points, method)
        parts = []
        for axis in AXES:
            z = rows.assign(z=rows[f"d_{axis}_m"] / rows[f"sigma_{axis}_m"])
            parts.append(z.pivot_table(index="seed", columns="point", values="z").to_numpy())
        return np.stack(parts, axis=-1) if len(rows) else np.zeros((0, 0, 3))

    def _of(self, table: pd.DataFrame, method: str) -> pd.DataFrame:
        return table[table["method"] == method]

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


# --- tests -----------------------------------------------------------------------------------

Test = tuple[str, str, str, float, float]


def _tests(errors: Errors, method: str) -> Iterator[Test]:
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


# --- the page --------------------------------------------------------------------------------


def page(errors: Errors) -> str:
    """Return the tests and their outcome as MyST text."""
    parts = [
        _made(errors),
        _verdict(errors),
        _table(_parameter_table(errors, MAIN), f"{TITLES[MAIN]}: {_CAPTION}", "parameters"),
        _table(_joint_table(errors), "Joint χ² of all parameters of a method", "joint"),
        _table(_point_table(errors), "Normalised differences at validation points", "points"),
    ]
    for method in errors.methods[1:]:
        caption, name = f"{TITLES[method]}: {_CAPTION}", method.replace("_", "-")
        parts.append(_table(_parameter_table(errors, method), caption, name))
    return "\n\n".join(parts) + "\n"


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


def _point_table(errors: Errors) -> pd.DataFrame:
    """Return mean and mean square of the normalised differences of every axis, with p values."""
    rows = []
    for method in errors.methods:
        if not len(errors.validated(method)):
            continue
        mean, spread = (_of_test(errors, method, test) for test in ("mean", "spread"))
        rows += [
            {
                "Method": TITLES[method],
                "Axis": axis,
                "Mean": mean.loc[axis, "value"],
                "p (mean)": mean.loc[axis, "p"],
                "Mean square": spread.loc[axis, "value"],
                "p (spread)": spread.loc[axis, "p"],
            }
            for axis in AXES
        ]
    return pd.DataFrame(rows)


def _parameter_table(errors: Errors, method: str) -> pd.DataFrame:
    """Return mean and spread of the normalised errors of every parameter, with p values."""
    names = [str(name) for name in errors.normalised(method)]
    mean, spread = (_of_test(errors, method, test).loc[names] for test in ("mean", "spread"))
    return pd.DataFrame(
        {
            "Parameter": [_parameter(name) for name in names],
            "Mean": mean["value"].to_numpy(),
            "p (mean)": mean["p"].to_numpy(),
            "Standard deviation": spread["value"].to_numpy(),
            "p (spread)": spread["p"].to_numpy(),
        }
    )


def _joint_table(errors: Errors) -> pd.DataFrame:
    """Return the sum of the flights' chi-squares of every method, and its p values."""
    rows = []
    for method in errors.methods:
        squares, n = errors.chi_squares(method)
        total, shape = (
            _of_test(errors, method, test).loc["joint"] for test in ("sum", "distribution")
        )
        rows.append(
            {
                "Method": TITLES[method],
                "Flights": len(squares),
                "Independent parameters": n,
                "Degrees of freedom": n * len(squares),
                "Sum of χ²": total["value"],
                "p (sum)": total["p"],
                "p (distribution)": shape["p"],
            }
        )
    return pd.DataFrame(rows)


_CAPTION = "normalised errors, with p values of mean 0 and standard deviation 1"
_FORMATS = {
    "Mean": "+.3f",
    "p (mean)": ".3f",
    "Standard deviation": ".3f",
    "Mean square": ".3f",
    "p (spread)": ".3f",
    "Sum of χ²": ".1f",
    "p (sum)": ".3f",
    "p (distribution)": ".3f",
}


def _table(table: pd.DataFrame, caption: str, name: str) -> str:
    formats = {key: f for key, f in _FORMATS.items() if key in table}
    return myst_table(table, caption, name=f"tab-coverage-{name}", formats=formats)


def _made(errors: Errors) -> str:
    about, seeds = errors.about, errors.parameters["seed"]
    return (
        f"Computed on {about['date']} at {at_commit(about['commit'])}: {seeds.nunique()} flights "
        f"of the design `{about['design']}`, of the heads `{about['heads_design']}`, seeds "
        f"{seeds.min()} to {seeds.max()}; "
        f"{about['processor']}, {about['system']}, Python {about['versions']['python']}, numpy "
        f"{about['versions']['numpy']}."
    )


def found(errors: Errors) -> str:
    """State the smallest detectable errors of means and standard deviations."""
    n, m = int(errors.parameters["seed"].nunique()), len(errors.tests)
    low, high = _found_scales(n, ALPHA / m)
    return (
        f"With {n} flights and {m} tests, a bias of {_found_bias(n, ALPHA / m):.2g} σ, "
        f"or a σ that is {100 * (1 / low - 1):.0f} % too large or {100 * (1 - 1 / high):.0f} % too "
        f"small, is found in {100 * CONFIDENCE:.0f} % of all repetitions. Half as much "
        "mostly stays hidden."
    )


def _found_scales(n: int, alpha: float) -> tuple[float, float]:
    """Return the detectable scatters below and above one, at 95 % power of chi-square."""
    chi2 = stats.chi2(n - 1)
    below = chi2.ppf(alpha / 2) / chi2.ppf(CONFIDENCE)
    above = chi2.ppf(1 - alpha / 2) / chi2.ppf(1 - CONFIDENCE)
    return float(np.sqrt(below)), float(np.sqrt(above))


def _found_bias(n: int, alpha: float) -> float:
    """Return the detectable mean of n normalised errors, at 95 % power of Student's test."""
    critical = stats.t.ppf(1 - alpha / 2, n - 1)
    return float((critical + stats.norm.ppf(CONFIDENCE)) / np.sqrt(n))


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


def _of_test(errors: Errors, method: str, test: str) -> pd.DataFrame:
    tests = errors.tests
    rows = tests[(tests["method"] == method) & (tests["test"] == test)]
    return rows.set_index("quantity")[["value", "p"]]


def shares(errors: Errors) -> str:
    """Return the share of errors within 1, 2 and 3 sigma as MyST text."""
    caption = "Share of errors within 1, 2 and 3 σ, in brackets its 95 % interval"
    return _table(_share_table(errors), caption, "shares") + "\n"


def _share_table(errors: Errors) -> pd.DataFrame:
    """Return the share of errors within 1, 2 and 3 sigma, percent with intervals."""
    expected = [_percent(float(special.erf(level / np.sqrt(2)))) for level in LEVELS]
    rows = [_row("normal distribution", expected)]
    for name, z in errors.normalised(MAIN).items():
        shares_of_levels = [binomial(int(np.sum(np.abs(z) <= level)), len(z)) for level in LEVELS]
        rows.append(_row(LABELS[str(name)], map(_with_interval, shares_of_levels)))
    for label, grouped in _grouped(errors):
        shares_of_levels = [_share_within_by_flights(grouped, level) for level in LEVELS]
        rows.append(_row(label, map(_with_interval, shares_of_levels)))
    return pd.DataFrame(rows)


def _share_within_by_flights(z: Array, level: float) -> Share:
    """Return the share of errors within some sigma, with its interval by bootstrap over flights."""
    of_flights = np.nanmean(np.where(np.isnan(z), np.nan, np.abs(z) <= level), axis=1)
    means = _resampled(len(z)) @ of_flights / len(z)
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail])
    return Share(value=float(of_flights.mean()), low=float(low), high=float(high))


def _grouped(errors: Errors) -> Iterator[tuple[str, Array]]:
    """Yield titles of groups, and their normalised errors, a row per flight."""
    for method in errors.methods:
        z = errors.normalised(method).to_numpy()
        yield f"all {z.shape[1]} parameters, {inside(TITLES[method])}", z
    for i, axis in enumerate(AXES):
        yield f"validation points, {axis}", errors.validated(MAIN)[:, :, i]


def _row(label: str, cells: Iterable[str]) -> dict[str, str]:
    heads = (f"within {level} σ (%)" for level in LEVELS)
    return {"Quantity": label} | dict(zip(heads, cells, strict=True))


def _with_interval(share: Share) -> str:
    return f"{_percent(share.value)} ({_percent(share.low)} to {_percent(share.high)})"


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


# --- Whether standard deviations keep what they promise: statistics of errors over many flights
#
# Normalised errors, errors over their a priori sigma, should be standard normal. Flights are
# independent of each other; errors within one flight are not.


LEVELS = (1, 2, 3)
"""Multiples of sigma at which coverage is counted."""

CONFIDENCE = 0.95
"""Confidence of the intervals of a coverage."""

RESAMPLED = 20_000
"""Samples of a bootstrap: its p values are multiples of 1 / 20 001."""


@dataclass(frozen=True, kw_only=True)
class Share:
    """A share with its confidence interval."""

    value: float
    low: float
    high: float


def binomial(k: int, n: int) -> Share:
    """Return the share k of n independent cases with its interval, Clopper's and Pearson's."""
    test = stats.binomtest(k, n)
    low, high = test.proportion_ci(CONFIDENCE)
    return Share(value=float(test.statistic), low=float(low), high=float(high))


@lru_cache(maxsize=1)
def _resampled(n: int) -> Array:
    """Return how often each of n flights is drawn in each sample, always the same samples."""
    rng = np.random.default_rng(n)
    return rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLED).astype(float)


# --- Figures of errors over their standard deviations, from many flights


COLUMNS = 6
LIMIT = 4.0

MINT = "#a9dccb"


def normalised_errors(parameters: pd.DataFrame, points: pd.DataFrame) -> Figure:
    """Draw histograms of errors over sigma beside their theoretical distributions.

    Parameters
    ----------
    parameters : DataFrame
        Of one method: seed, parameter, error, sigma, decorrelated.
    points : DataFrame
        Of the same method: d_east_m, sigma_east_m, and so on.
    """
    names = list(dict.fromkeys(parameters["parameter"]))
    n_rows = -(-(len(names) + 1 + len(AXES)) // COLUMNS)
    with style.applied():
        fig, grid = style.subplots(n_rows, COLUMNS, figsize=(style.WIDTH, 1.45 * n_rows))
        axes = list(grid.ravel())
        for name in names:
            rows = parameters[parameters["parameter"] == name]
            _against_normal(
                axes.pop(0), rows["error"] / rows["sigma"], LABELS[name], (style.SKY, style.BLUE)
            )
        squares = (parameters["decorrelated"] ** 2).groupby(parameters["seed"]).sum()
        _against_chi_square(axes.pop(0), squares.to_numpy(), len(names))
        for axis in AXES:
            z = points[f"d_{axis}_m"] / points[f"sigma_{axis}_m"]
            _against_normal(axes.pop(0), z, f"validation, {axis}", (MINT, style.TEAL))
        for ax in axes:
            ax.set_visible(False)
        fig.supxlabel("error over its standard deviation (1)", fontsize=8.5, color=style.INK)
    return fig


def _against_normal(ax: Axes, z: pd.Series, title: str, tints: tuple[str, str]) -> None:
    bins = np.linspace(-LIMIT, LIMIT, 17)
    x = np.linspace(-LIMIT, LIMIT, 200)
    _histogram(ax, np.clip(z.to_numpy(), -LIMIT, LIMIT), bins, tints)
    ax.plot(x, stats.norm.pdf(x), color=style.INK, lw=1.1)
    ax.set(xlim=(-LIMIT, LIMIT), ylim=(0, 0.62), xticks=[-3, 0, 3])
    _titled(ax, title, f"{z.mean():+.2f} ± {z.std():.2f}".replace("-", "−"))


def _against_chi_square(ax: Axes, squares: Array, dof: int) -> None:
    top = float(stats.chi2.ppf(0.9999, dof))
    x = np.linspace(0, top, 200)
    _histogram(ax, np.clip(squares, 0, top), np.linspace(0, top, 17), (style.SKY, style.BLUE))
    density = stats.chi2.pdf(x, dof)
    ax.plot(x, density, color=style.INK, lw=1.1)
    ax.set(xlim=(0, top), ylim=(0, 1.55 * density.max()), xticks=[0, dof, 2 * dof])
    _titled(ax, f"all {dof}: χ²", f"mean {squares.mean():.1f}")


def _histogram(ax: Axes, values: Array, bins: Array, tints: tuple[str, str]) -> None:
    fill, edge = tints
    ax.hist(values, bins.tolist(), density=True, color=fill, alpha=0.75)
    ax.hist(values, bins.tolist(), density=True, histtype="step", color=edge, lw=0.8)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.grid(visible=False)


def _titled(ax: Axes, title: str, note: str) -> None:
    ax.set_title(title, loc="center", fontsize=style.SMALL, fontweight="normal", pad=3)
    ax.annotate(
        note,
        xy=(0.5, 1),
        xytext=(0, -2),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=style.SMALL,
        color=style.SOFT,
    )


# --- What errors leave in the mean of noise and its negative, as a part of the page on coverage


GOAL = 0.02
"""Largest bias of a parameter, in its sigma."""

GOAL_ERROR = 0.005
"""Largest allowed standard error of a bias, in sigma."""

OWN = "adjusted"
"""Where the library evaluates distortion by default."""

HEADINGS = {"adjusted": "Adjusted point", "measured": "Measured point"}


def bias_read(folder: Path) -> pd.DataFrame:
    """Read the errors of pairs of flights from ``make coverage``.

    Returns
    -------
    DataFrame
        Columns seed, distortion_at, parameter, error (the mean of a pair), sigma (of one flight).
    """
    _, (pairs,) = read_stored(folder, "coverage", "bias", make="coverage")
    return pairs


def _biases(pairs: pd.DataFrame, distortion_at: str) -> pd.DataFrame:
    """Return bias and standard error over sigma, a row per parameter."""
    rows = pairs[pairs["distortion_at"] == distortion_at]
    z = (rows["error"] / rows["sigma"]).groupby(rows["parameter"], sort=False)
    return pd.DataFrame({"bias": z.mean(), "error": z.sem()})


def bias_page(pairs: pd.DataFrame) -> str:
    """Return the biases of the single step and the goal as MyST text."""
    caption = (
        "Bias of the single step in thousandths of σ, distortion at adjusted or at measured points"
    )
    drawn = myst_table(_bias_table(pairs), caption, name="tab-coverage-bias")
    return f"{_bias_verdict(pairs)}\n\n{drawn}\n"


def _bias_verdict(pairs: pd.DataFrame) -> str:
    """State the largest bias, and whether the goal is reached."""
    biases = _biases(pairs, OWN)
    largest, least_known = biases.iloc[int(biases["bias"].abs().argmax())], biases["error"].max()
    reached = abs(largest["bias"]) < GOAL and least_known < GOAL_ERROR
    return (
        f"In {pairs['seed'].nunique()} pairs the largest bias of the single step is "
        f"{_shown(largest, digits=4)} σ, of {LABELS[str(largest.name)]}; all are known to "
        f"{least_known:.4f} σ or better. The goal, less than {GOAL:g} σ known to {GOAL_ERROR:g} σ, "
        f"is {'reached' if reached else 'not reached'}."
    )


def _bias_table(pairs: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the bias of every parameter, 1/1000 sigma, by the place of the distortion."""
    biases = {heading: 1000 * _biases(pairs, where) for where, heading in HEADINGS.items()}
    names = biases[HEADINGS[OWN]].index
    columns = {
        heading: [_shown(row, digits=2) for _, row in table.iterrows()]
        for heading, table in biases.items()
    }
    return pd.DataFrame({"Parameter": [LABELS[str(name)] for name in names], **columns})


def _shown(row: pd.Series, *, digits: int) -> str:
    return f"{row['bias']:+z.{digits}f} ± {row['error']:.{digits}f}".replace("-", "−")


# --- results of long runs in ``data/benchmarks``: tables, and a file about the machine -------


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
