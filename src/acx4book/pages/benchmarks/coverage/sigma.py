"""Whether standard deviations can be believed, as a page of the book.

The errors are those of ``make coverage``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.pages.benchmarks.coverage import sigma_tests
from acx4book.pages.benchmarks.coverage.sigma_tests import LEVELS, Share
from acx4book.typesetting.labels import LABELS, TITLES, inside
from acx4book.typesetting.myst import at_commit, myst_table
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES

ALPHA = 0.01
"""Probability that any of all tests fails by chance."""

MAIN = "single_step"
"""The method whose errors are shown one by one."""


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
        own = self._of(self.parameters, method)
        return _wide(own.assign(z=own["error"] / own["sigma"]), "z")

    def chi_squares(self, method: str) -> tuple[Array, int]:
        """Return the joint chi-square of every flight, and its degrees of freedom."""
        wide = _wide(self._of(self.parameters, method), "decorrelated").dropna(axis=1, how="all")
        return np.sum(wide.to_numpy() ** 2, axis=1), wide.shape[1]

    def validated(self, method: str) -> Array:
        """Return differences over sigma, shape (n_flights, n_points, 3).

        NaN for a point that a flight does not have.
        """
        own = self._of(self.points, method)
        parts = []
        for axis in AXES:
            z = own.assign(z=own[f"d_{axis}_m"] / own[f"sigma_{axis}_m"])
            parts.append(z.pivot_table(index="seed", columns="point", values="z").to_numpy())
        return np.stack(parts, axis=-1) if len(own) else np.zeros((0, 0, 3))

    def _of(self, table: pd.DataFrame, method: str) -> pd.DataFrame:
        return table[table["method"] == method]

    @cached_property
    def tests(self) -> pd.DataFrame:
        """Every test: method, quantity, what is tested, its value, p, and p by Holm over all."""
        rows = [row for method in self.methods for row in _tests(self, method)]
        table = pd.DataFrame(rows, columns=["method", "quantity", "test", "value", "p"])
        return table.assign(joint_p=sigma_tests.holm(table["p"].to_numpy()))


def _wide(rows: pd.DataFrame, values: str) -> pd.DataFrame:
    names = list(dict.fromkeys(rows["parameter"]))
    return rows.pivot_table(index="seed", columns="parameter", values=values, dropna=False)[names]


def read(folder: Path) -> Errors:
    """Read what ``make coverage`` left in a folder."""
    about, (parameters, points, heads) = stored.read(
        folder, "coverage", "parameters", "points", "heads", make="coverage"
    )
    return Errors(parameters=pd.concat([parameters, heads]), points=points, about=about)


# --- tests -----------------------------------------------------------------------------------

Test = tuple[str, str, str, float, float]


def _tests(errors: Errors, method: str) -> Iterator[Test]:
    """Yield method, quantity, name of the test, value and p."""
    for name, z in errors.normalised(method).items():
        yield method, str(name), "mean", float(z.mean()), sigma_tests.mean_p(z.to_numpy())
        yield method, str(name), "spread", float(z.std()), sigma_tests.spread_p(z.to_numpy())
    squares, n = errors.chi_squares(method)
    yield method, "joint", "sum", float(squares.sum()), sigma_tests.sum_p(squares, n)
    yield method, "joint", "distribution", float(n), sigma_tests.distribution_p(squares, n)
    validated = errors.validated(method)
    if len(validated):
        for test, power in (("mean", 1), ("spread", 2)):
            of_flights = np.nanmean(validated**power, axis=1)
            p = sigma_tests.flight_mean_p(of_flights, np.full(3, power - 1.0))
            values = of_flights.mean(axis=0)
            for axis, value, p_axis in zip(AXES, values, p, strict=True):
                yield method, axis, test, float(value), float(p_axis)


# --- the page --------------------------------------------------------------------------------


def page(errors: Errors) -> str:
    """Return the tests and their outcome as MyST text."""
    parts = [
        _made(errors),
        verdict(errors),
        _table(parameter_table(errors, MAIN), f"{TITLES[MAIN]}: {_CAPTION}", "parameters"),
        _table(joint_table(errors), "Joint χ² of all parameters of a method", "joint"),
        _table(point_table(errors), "Normalised differences at validation points", "points"),
    ]
    for method in errors.methods[1:]:
        caption, name = f"{TITLES[method]}: {_CAPTION}", method.replace("_", "-")
        parts.append(_table(parameter_table(errors, method), caption, name))
    return "\n\n".join(parts) + "\n"


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


def verdict(errors: Errors) -> str:
    """Say whether all tests together pass, and which do not."""
    tests = errors.tests
    failed = tests[tests["joint_p"] < ALPHA]
    worst = tests.iloc[int(tests["p"].argmin())]
    if failed.empty:
        said = (
            f"None of the {len(tests)} tests fails. The smallest p value is that of the "
            f"{worst['test']} of {_label(worst)}: {worst['p']:.2g} by itself, and "
            f"{worst['joint_p']:.2g} after Holm's adjustment"
        )
    else:
        each = "; ".join(f"{row['test']} of {_label(row)}" for _, row in failed.iterrows())
        said = f"{len(failed)} of the {len(tests)} tests fail: {each}"
    return f"{said}. By chance any of them would fail in {100 * ALPHA:g} % of all repetitions."


def found(errors: Errors) -> str:
    """Say which errors of means and of standard deviations the tests would find."""
    n, m = int(errors.parameters["seed"].nunique()), len(errors.tests)
    low, high = sigma_tests.found_scales(n, ALPHA / m)
    return (
        f"With {n} flights and {m} tests, a bias of {sigma_tests.found_bias(n, ALPHA / m):.2g} σ, "
        f"or a σ that is {100 * (1 / low - 1):.0f} % too large or {100 * (1 - 1 / high):.0f} % too "
        f"small, is found in {100 * sigma_tests.CONFIDENCE:.0f} % of all repetitions. Half as much "
        "mostly stays hidden."
    )


def _label(test: pd.Series) -> str:
    quantity = str(test["quantity"])
    if quantity == "joint":
        what = "χ²"
    elif quantity in AXES:
        what = f"{quantity} at validation points"
    else:
        what = _parameter(quantity)
    return f"{what} ({inside(TITLES[str(test['method'])])})"


def _parameter(name: str) -> Markup:
    """Return the label of a parameter, with its head where it has one."""
    head, _, key = name.rpartition(" ")
    return Markup(f"{head} {LABELS[key]}".strip())


def _of_test(errors: Errors, method: str, test: str) -> pd.DataFrame:
    tests = errors.tests
    own = tests[(tests["method"] == method) & (tests["test"] == test)]
    return own.set_index("quantity")[["value", "p"]]


def parameter_table(errors: Errors, method: str) -> pd.DataFrame:
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


def joint_table(errors: Errors) -> pd.DataFrame:
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


def point_table(errors: Errors) -> pd.DataFrame:
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


def shares(errors: Errors) -> str:
    """Return the share of errors within 1, 2 and 3 sigma as MyST text."""
    caption = "Share of errors within 1, 2 and 3 σ, in brackets its 95 % interval"
    return _table(share_table(errors), caption, "shares") + "\n"


def share_table(errors: Errors) -> pd.DataFrame:
    """Return the share of errors within 1, 2 and 3 sigma, percent with intervals."""
    expected = [_percent(sigma_tests.nominal(level)) for level in LEVELS]
    rows = [_row("normal distribution", expected)]
    for name, z in errors.normalised(MAIN).items():
        each = [sigma_tests.share_within(z.to_numpy(), level) for level in LEVELS]
        rows.append(_row(LABELS[str(name)], map(_with_interval, each)))
    for label, grouped in _grouped(errors):
        each = [sigma_tests.share_within_by_flights(grouped, level) for level in LEVELS]
        rows.append(_row(label, map(_with_interval, each)))
    return pd.DataFrame(rows)


def _grouped(errors: Errors) -> Iterator[tuple[str, Array]]:
    """Yield what is counted together, and its normalised errors, a row per flight."""
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
