"""How long an adjustment takes beside other solvers, as a page of the book.

The numbers are those of ``make bench``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.myst import at_commit, myst_table, scientific

OURS = "ours"
CERES = {"automatic": "Ceres, automatic", "analytic": "Ceres, by hand"}
"""Kinds of derivatives that the image equations of Ceres have."""

SWEEP = "sweep-"
"""How the names of problems begin that differ in their number of tie points only."""


FREE = "free-"
"""How the names of problems begin that pycolmap can state, too: it has no lever arms."""

PYCOLMAP = {
    "pycolmap_tuned": "pycolmap, tuned",
    "pycolmap_covariance": "with covariances",
    "pycolmap_default": "by default",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Benchmark:
    """The results of a benchmark.

    Attributes
    ----------
    runs : DataFrame
        ``adjustment.csv``: a row for each run of a solver on a problem.
    about : dict
        ``adjustment.json``: date, machine, versions, and how far answers agree.
    """

    runs: pd.DataFrame
    about: Mapping[str, Any]

    @property
    def medians(self) -> pd.DataFrame:
        """Medians of all runs, a row for each problem and solver, in the file's order."""
        numbers = ["wall_s", "cpu_s", "peak_mb", "growth_mb", "steps", "cost"]
        numbers += [name for name in ("first_wall_s", "first_cpu_s") if name in self.runs]
        size = ["images", "points", "image_points", "observations", "unknowns"]
        groups = self.runs.groupby(["problem", "solver"], sort=False)
        return groups.agg(
            {**dict.fromkeys(size, "first"), **dict.fromkeys(numbers, "median"), "converged": "all"}
        )

    @property
    def sweep(self) -> pd.DataFrame:
        """The medians of the problems that differ in their number of tie points only."""
        names = self.medians.index.get_level_values("problem")
        return self.medians[names.str.startswith(SWEEP)]

    def of(self, problem: str) -> dict[str, dict[str, Any]]:
        """Return the medians of one problem by solver."""
        own = self.medians.xs(problem, level="problem")
        return {str(solver): dict(row) for solver, row in own.iterrows()}

    @property
    def problems(self) -> list[str]:
        """Names of the problems of calibration, those of the sweep left out."""
        names = dict.fromkeys(self.runs["problem"])
        return [name for name in names if not name.startswith((SWEEP, FREE))]


def read(folder: Path) -> Benchmark:
    """Read what ``make bench`` left in a folder."""
    about, (runs,) = stored.read(folder, "adjustment")
    return Benchmark(runs=runs, about=about)


def page(benchmark: Benchmark) -> str:
    """Return the measured seconds and megabytes as MyST text."""
    parts = [
        _machine(benchmark.about),
        _table(
            *_seconds(benchmark, "cpu_s"),
            "CPU time of all threads together, in seconds; ratios of Ceres to acx4lib",
            "cpu",
        ),
        _table(
            *_seconds(benchmark, "wall_s"),
            "Time that passed, in seconds; ratios of Ceres to acx4lib",
            "wall",
        ),
        _table(*_memory(benchmark), "Peak memory of the process, in MB", "memory"),
        _covariance(benchmark),
        _first_call(benchmark),
        _pycolmap(benchmark),
        _scipy(benchmark),
        _agreement(benchmark.about),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def growth(benchmark: Benchmark) -> str:
    """Say with which power of the number of points the time grows; a sentence, or nothing."""
    sweep = benchmark.sweep
    ours = sweep[sweep.index.get_level_values("solver") == OURS].sort_values("points")
    upper = ours.iloc[len(ours) // 2 :]
    if len(upper) < 2:
        return ""
    power, _ = np.polyfit(np.log(upper["points"]), np.log(upper["cpu_s"]), 1)
    return (
        f"From {upper['points'].iloc[0]:,} to {upper['points'].iloc[-1]:,} points our time grows "
        f"with the power {power:.2f} of their number.\n"
    )


def _table(table: pd.DataFrame, formats: dict[str, str], caption: str, name: str) -> str:
    return myst_table(table, caption, name=f"tab-speed-{name}", formats=formats)


def _best(benchmark: Benchmark, key: str) -> dict[str, pd.DataFrame]:
    """Return medians by problem of ours, and of the best way of each kind of Ceres."""
    medians = benchmark.medians.sort_values(key)
    solver = medians.index.get_level_values("solver")
    out = {}
    for who in (OURS, *CERES):
        own = medians[solver.str.startswith(who if who == OURS else f"ceres_{who}_")]
        fastest = own.groupby("problem").first()
        out[who] = fastest.reindex([p for p in benchmark.problems if p in fastest.index])
    return out


def _seconds(benchmark: Benchmark, key: str) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return a row for each problem: ours, Ceres, how many times as long this takes; formats."""
    best = _best(benchmark, key)
    ours = best[OURS]
    table, formats = _sizes(ours)
    table["acx4lib"] = ours[key]
    formats["acx4lib"] = ".3f"
    for kind, label in CERES.items():
        table[label] = _of(best[kind], key, ours)
        ratio = label.replace("Ceres", "Ratio")
        table[ratio] = table[label] / ours[key]
        formats |= {label: ".3f", ratio: ".1f"}
    return table, formats


def _memory(benchmark: Benchmark) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return a row for each problem: peaks, and what of ours is not Python with its libraries."""
    best = _best(benchmark, "peak_mb")
    ours, theirs = best[OURS], CERES["automatic"]
    table, formats = _sizes(ours)
    table["acx4lib"] = ours["peak_mb"]
    table["beyond Python and its libraries"] = ours["growth_mb"]
    table[theirs] = _of(best["automatic"], "peak_mb", ours)
    table["Share of Ceres"] = ours["peak_mb"] / table[theirs]
    formats |= dict.fromkeys(("acx4lib", "beyond Python and its libraries", theirs), ".0f")
    return table, formats | {"Share of Ceres": ".2f"}


def _sizes(ours: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return the size of every problem, and the formats of its columns."""
    names = {"images": "Images", "points": "Points", "observations": "Observations"}
    table = ours[list(names)].rename(columns=names)
    return table.astype(int), dict.fromkeys(names.values(), ",d")


def _of(theirs: pd.DataFrame, key: str, ours: pd.DataFrame) -> pd.Series:
    """Return a column for our problems, NaN where there is no result."""
    return theirs.reindex(index=ours.index, columns=[key])[key].astype(float)


def _machine(about: Mapping[str, Any]) -> str:
    versions = about["versions"]
    text = (
        f"Measured on {about['date']} at {at_commit(about['commit'])}: {about['processor']}, "
        f"{about['cores']} cores, {about['memory_gb']:g} GB of memory, {about['system']}, "
        f"Python {versions['python']}, numpy {versions['numpy']}, numba {versions['numba']}."
    )
    if "ceres" not in versions:
        return f"{text} Ceres was not there."
    return (
        f"{text} Ceres {versions['ceres']} of the system, its cost functions compiled by "
        f"`{versions['compiler']}` with `{about['flags']}`; BLAS `{versions['blas of ceres']}`."
    )


def _covariance(benchmark: Benchmark) -> str:
    """Say what the covariance matrix of the calibration alone costs Ceres."""
    sentences = []
    for problem in benchmark.problems:
        of_problem = benchmark.of(problem)
        if "ceres_covariance" in of_problem:
            found, ours = of_problem["ceres_covariance"], of_problem[OURS]
            sentences.append(
                f"with {ours['points']:,} points {found['cpu_s']:.2f} s and "
                f"{found['peak_mb']:.0f} MB"
            )
    if not sentences:
        return ""
    return (
        "The times of Ceres are without covariances. The covariance matrix of the 14 parameters of "
        f"the calibration alone, by `ceres::Covariance`, takes {'; '.join(sentences)}."
    )


def _first_call(benchmark: Benchmark) -> str:
    """Say what the first adjustment of a process takes; nothing where it was not measured."""
    medians = benchmark.medians
    ours = medians[medians.index.get_level_values("solver") == OURS].droplevel("solver")
    ours = ours.reindex(benchmark.problems)
    if "first_cpu_s" not in ours or ours["first_cpu_s"].isna().all():
        return ""
    smallest = ours.sort_values("observations").iloc[:2]
    times = " and ".join(
        f"{row['first_cpu_s']:.2f} s of CPU time instead of {row['cpu_s']:.2f} s with "
        f"{row['points']:,.0f} points"
        for _, row in smallest.iterrows()
    )
    return (
        "Compiled code is loaded with its modules, as that of an extension module is. The first "
        f"adjustment of a process takes {times}."
    )


def _pycolmap(benchmark: Benchmark) -> str:
    """Return a table of the problems that pycolmap adjusts, too; nothing where it has not."""
    medians = benchmark.medians
    medians = medians[medians.index.get_level_values("problem").str.startswith(FREE)]
    solver = medians.index.get_level_values("solver")
    if not solver.str.startswith("pycolmap").any():
        return ""
    of = {name: medians[solver == name].droplevel("solver") for name in (OURS, *PYCOLMAP)}
    table, formats = _sizes(of[OURS])
    table["acx4lib, with covariances"] = of[OURS]["cpu_s"]
    formats["acx4lib, with covariances"] = ".3f"
    for name, label in PYCOLMAP.items():
        table[label] = _of(of[name], "cpu_s", of[OURS])
        table[f"Ratio, {label}"] = table[label] / of[OURS]["cpu_s"]
        formats |= {label: ".3f", f"Ratio, {label}": ".1f"}
    apart = max((of[n]["cost"] / of[OURS]["cost"] - 1).abs().max() for n in PYCOLMAP)
    text = (
        f"pycolmap {benchmark.about['versions'].get('pycolmap', '')}, with the Ceres of its own, "
        "adjusts free poses with observed positions. The blocks below have no lens distortion, no "
        "control and no lever arm, so that both have the same equations. The time begins with the "
        "same arrays, and what each makes of them before it adjusts is part of it. Costs agree to "
        f"{scientific(apart)}."
    )
    caption = "CPU time beside pycolmap, in seconds; ratios of pycolmap to acx4lib"
    return f"{text}\n\n{_table(table, formats, caption, 'pycolmap')}"


def _scipy(benchmark: Benchmark) -> str:
    """Say what scipy takes, where it was asked."""
    sentences = []
    for problem in benchmark.problems:
        of_problem = benchmark.of(problem)
        if "scipy" not in of_problem:
            continue
        found, ours = of_problem["scipy"], of_problem[OURS]
        times = found["cpu_s"] / ours["cpu_s"]
        off = found["cost"] / ours["cost"] - 1
        end = (
            ""
            if found["converged"]
            else (f" and then has not converged: its cost is still {scientific(off)} too large")
        )
        sentences.append(
            f"`scipy.optimize.least_squares` (trust region reflective, sparse analytic Jacobian, "
            f"lsmr) takes {found['cpu_s']:.1f} s of CPU time on {ours['points']:,} points, "
            f"{times:.0f} times ours, for {found['steps']:.0f} evaluations{end}."
        )
    return " ".join(sentences)


def _agreement(about: Mapping[str, Any]) -> str:
    """Say how far the answers of Ceres and ours lie apart."""
    rows = pd.DataFrame(about["agreement"])
    if rows.empty:
        return ""
    timed, cost = (rows[key].abs().max() for key in ("cost_timed", "cost"))
    text = (
        f"All solve the same problem. Stopped where the cost changes by less than "
        f"{scientific(about['ceres_tolerance'])} of itself, as it was timed, Ceres ends at a cost "
        f"that is at most {scientific(timed)} from ours. When it goes on to "
        f"{scientific(about['ceres_exact_tolerance'])}, costs agree to {scientific(cost)} and the "
        f"14 parameters to {scientific(rows['parameters_sigma'].max())} of their standard "
        "deviations"
    )
    if "sigma" not in rows:
        return f"{text}."
    return f"{text}; these, where Ceres computes them, agree to {scientific(rows['sigma'].max())}."
