"""Verdicts of reports on good and spoilt flights, and trajectory errors that change slowly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from acx4book.pages.benchmarks import sigma
from acx4book.typesetting.myst import LABELS, at_commit, myst_table
from acx4lib.least_squares.adjustment import two_sided_p
from acx4lib.least_squares.statistics import holm

GOAL = 0.07
"""Goal: largest share of clean flights with a failing report."""

LEVEL = 0.05
"""Level of every single test, and of a report as a whole."""

FOUND = 0.8
"""Share of the spoilt flights in which a fault of the predicted size should be found."""

ALPHA = 0.01
"""Probability that any share of a table lies outside its bounds by chance."""

PLANS: Mapping[str, str] = {
    "two-heights-crossing": "two heights",
    "one-height": "one height",
    "flat": "flat ground",
    "oblique-heads": "oblique heads",
    "no-control": "no control",
}
"""Names of the plans in headings."""

FAULTS: Mapping[str, tuple[str, str]] = {
    "step": ("the camera turns on its mount, by", "{:.2g}°"),
    "sigma of image points": ("true σ of image points over the stated one", "{:.3g}"),
    "sigma of GNSS": ("true σ of GNSS positions over the stated one", "{:.3g}"),
    "sigma of attitudes": ("true σ of attitudes over the stated one", "{:.3g}"),
    "delay": ("positions of the calibration late by", "{:.2g} s"),
    "delay in both": ("positions of calibration and validation late by", "{:.2g} s"),
    "lever arm": ("declared lever arm wrong in height by", "{:.2g} m"),
    "datum in plan": ("surveyed points shifted east by", "{:.2g} m"),
    "datum in height": ("surveyed points shifted in height by", "{:.2g} m"),
}
"""Faults, and the format of their size."""

GROSS: Mapping[str, str] = {
    "image_point": "an image point",
    "gnss": "a GNSS height",
    "control_point": "the height of a control point",
}
"""Single gross errors, of the size that the plan says is found in 80 %."""

PURPOSES: Mapping[str, str] = {
    "clean": "clean ones",
    "spoilt": "with a fault of the predicted size",
    "third": "with a σ that is a third too small",
}
"""Titles of the flights by purpose."""

TEST = "p: "
"""Prefix of the columns with probabilities, before question and name of the test."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Verdicts:
    """Verdicts of the reports on many flights.

    Attributes
    ----------
    flights : DataFrame
        A row for each: purpose (``clean``, ``spoilt``, ``third``), plan, fault, size, status,
        holds; ``found: KIND`` of planted gross errors, ``p: QUESTION: TEST`` of clean flights.
    about : mapping
        Date, commit, number of planned flights by purpose.
    """

    flights: pd.DataFrame
    about: Mapping[str, Any]

    def of(self, purpose: str) -> pd.DataFrame:
        """Return the flights of one purpose."""
        return self.flights[self.flights["purpose"] == purpose]


def read(folder: Path) -> Verdicts:
    """Read the verdicts of ``make coverage`` from a folder."""
    about, (flights,) = sigma.read_stored(folder, "verdicts", make="coverage")
    return Verdicts(flights=flights.fillna({"fault": ""}), about=about)


def _failed(flights: pd.DataFrame) -> int:
    """Count the flights with a failing report, or without results."""
    return int((flights["holds"] != 1).sum())


# --- clean flights ---------------------------------------------------------------------------


def good(verdicts: Verdicts) -> str:
    """Return the verdicts on clean flights, as MyST text."""
    clean, about = verdicts.of("clean"), verdicts.about
    states = verdicts.flights["source"].nunique()
    flown = "; ".join(
        f"{len(verdicts.of(purpose)):,} of {about['planned'].get(purpose, 0):,} {name}"
        for purpose, name in PURPOSES.items()
    )
    share = sigma.binomial(_failed(clean), len(clean))
    groups = [*((title, clean[clean["plan"] == name]) for name, title in PLANS.items())]
    rows = [
        {
            "Plan": title,
            "Flights": len(flights),
            "Do not hold": _failed(flights),
            "Share (%)": sigma.percent(sigma.binomial(_failed(flights), len(flights))),
            "Not determined": int((flights["status"] != 0).sum()),
        }
        for title, flights in (*groups, ("all", clean))
        if len(flights)
    ]
    return "\n\n".join(
        [
            f"Computed on {about['date']} at {at_commit(about['commit'])}, by "
            f"{'one state' if states == 1 else f'{states} states'} of the code. Flights: {flown}.",
            f"Of {len(clean):,} clean flights the reports of {_failed(clean)} say that something "
            f"does not hold: {sigma.percent(share)} %. A report promises {100 * LEVEL:g} % at most;"
            f" the goal, no more than {100 * GOAL:g} %, is "
            f"{'reached' if share[0] <= GOAL else 'not reached'}.",
            _table(pd.DataFrame(rows), "Reports of clean flights, by plan", "verdicts-clean"),
            _levels(clean),
        ]
    )


def _levels(clean: pd.DataFrame) -> str:
    """Name the single tests whose p lies below their level more often than chance lets it."""
    rows = []
    for name in clean.columns[clean.columns.str.startswith(TEST)]:
        p = clean[name].dropna()
        if len(p):
            k = int((p < LEVEL).sum())
            rows.append((str(name).removeprefix(TEST), k, len(p), _too_many_p(k, len(p), LEVEL)))
    joint = holm(np.array([p for *_, p in rows]))
    many = [row for row, p in zip(rows, joint, strict=True) if p < ALPHA]
    sentence = f"None of the {len(rows)} tests fails more often than chance lets it"
    if many:
        failures = "; ".join(f"{name} ({k} of {n})" for name, k, n, _ in many)
        sentence = f"{len(many)} of the {len(rows)} tests fail more often than they say: {failures}"
    worst, k, n, _ = max(rows, key=lambda row: row[1] / row[2]) if rows else ("none", 0, 1, 1)
    return (
        f"{sentence}. By chance any of them would seem to in {100 * ALPHA:g} % of all repetitions "
        f"(Holm). Most often, in {sigma.percent(sigma.binomial(k, n))} % of its flights, the p of "
        f"*{worst}* lies below {100 * LEVEL:g} %."
    )


def _too_many_p(k: int, n: int, share: float) -> float:
    """Return the probability of k or more of n independent cases, given the expected share."""
    return float(stats.binomtest(k, n, share, alternative="greater").pvalue)


# --- spoilt flights --------------------------------------------------------------------------


def spoilt(verdicts: Verdicts) -> str:
    """Return the verdicts on flights with a fault, as MyST text."""
    caption = "Faults of the size that was predicted, and the flights whose report fails"
    table = _table(_fault_table(verdicts), caption, "verdicts-faults")
    title = ":::{dropdown} The faults by plan"
    return "\n\n".join([_spoilt_verdict(_sizes(verdicts)), title, table, ":::"])


def _sizes(verdicts: Verdicts) -> pd.DataFrame:
    """Count the spoilt flights with a failing report, a row per fault, plan and size."""
    flights = verdicts.of("spoilt")
    groups = flights[flights["fault"].isin(FAULTS)].groupby(["fault", "plan", "size"], sort=False)
    rows = [(*keys, len(rows), _failed(rows)) for keys, rows in groups]
    return pd.DataFrame(rows, columns=["fault", "plan", "size", "n", "k"])


def _fault_table(verdicts: Verdicts) -> pd.DataFrame:
    """Return size and number found of every fault, a column per plan."""
    cells: dict[str, dict[str, str]] = {}

    def add(fault: str, plan: str, text: str) -> None:
        cells.setdefault(fault, {})[PLANS[plan]] = text

    sizes = _sizes(verdicts).sort_values(
        "fault", key=lambda f: f.map([*FAULTS].index), kind="stable"
    )
    for row in sizes.to_dict("records"):
        text, form = FAULTS[row["fault"]]
        add(text, row["plan"], f"{form.format(row['size'])}: {row['k']} of {row['n']}")
    for (fault, plan), rows in verdicts.of("third").groupby(["fault", "plan"], sort=False):
        stated = f"{str(fault).replace('sigma', 'σ')}, stated a third too small"
        add(stated, str(plan), f"{_failed(rows)} of {len(rows)}")
    gross = verdicts.of("spoilt")
    for kind, title in GROSS.items():
        taken = gross[gross.get(f"found: {kind}", pd.Series(index=gross.index)).notna()]
        for plan, rows in taken.groupby("plan", sort=False):
            n = int(rows[f"found: {kind}"].sum())
            add(f"a gross error of {title}", str(plan), f"{n} of {len(rows)} taken out")
    table = [{"Fault": fault, **by_plan} for fault, by_plan in cells.items()]
    return pd.DataFrame(table, columns=["Fault", *PLANS.values()])


def _spoilt_verdict(sizes: pd.DataFrame) -> str:
    """State how many fault sizes reach the predicted share of detections; name the others."""
    counts = list(zip(sizes["k"].tolist(), sizes["n"].tolist(), strict=True))
    p = np.array([float(stats.binomtest(k, n, FOUND).pvalue) for k, n in counts])
    as_without = np.array([_too_many_p(k, n, LEVEL) > ALPHA for k, n in counts])
    hidden = (p < ALPHA) & as_without
    seen, p_seen = sizes[~hidden], holm(p[~hidden])
    rarely = seen["k"] < FOUND * seen["n"]
    low, high = seen[(p_seen < ALPHA) & rarely], seen[(p_seen < ALPHA) & ~rarely]
    sentences = [
        f"{len(seen) - len(low)} of {len(seen)} predicted sizes were found in "
        f"{100 * FOUND:g} % of the flights or more, within the bounds of chance."
    ]
    for title, part in (
        ("More rarely found", low),
        ("More often found", high),
        ("Not found, since unknowns take it up", sizes[hidden]),
    ):
        if len(part):
            sentences.append(f"{title}: {'; '.join(_cases(part))}.")
    return " ".join(sentences)


def _cases(sizes: pd.DataFrame) -> Iterator[str]:
    """Yield fault, size, plan and number of detections."""
    for row in sizes.to_dict("records"):
        text, form = FAULTS[row["fault"]]
        size, plan = form.format(row["size"]), PLANS[row["plan"]]
        yield f"{text} {size}, {plan} ({row['k']} of {row['n']})"


def _table(table: pd.DataFrame, caption: str, name: str) -> str:
    return myst_table(table, caption, name=f"tab-{name}")


# --- values that are held ------------------------------------------------------------------------


def held(flights: pd.DataFrame) -> str:
    """State the verdicts on flights whose adjustments hold a wrong focal length.

    Parameters
    ----------
    flights : DataFrame
        A row for each flight: plan (``single-head`` or ``acx4``), size, mm, by which the focal
        length of the mounting is off, holds, and the held values that are rejected.
    """
    one, four = (flights[flights["plan"] == name] for name in ("single-head", "acx4"))
    first = one["rejected"].str.split().str[0] == "CAM/f_mm"
    named = four["rejected"].str.count("/f_mm")
    return (
        f"Flights of the design *single-head* hold a focal length that is wrong by "
        f"{one['size'].iloc[0]:g} mm. {_failed(one)} of {len(one)} reports do not hold, and "
        f"{int(first.sum())} name the focal length first. The heads of *acx4* hold those of the "
        f"paper, which only the lens and the heads' orientation take up: "
        f"{len(four) - _failed(four)} of {len(four)} reports hold; {int((named == 4).sum())} name "
        f"all four focal lengths, the others {int(named.min())} at least.\n"
    )


# --- errors that change slowly, taken for independent or not ------------------------------------


CHECKED = "Independent check points"
"""The question of a report on the validation."""

HEADINGS = {"white": "Taken for independent", "correlated": "Weights of their correlation"}


def slow_errors(errors: pd.DataFrame) -> str:
    """Return verdict and table of flights with slow errors as MyST text.

    Parameters
    ----------
    errors : DataFrame
        Columns seed, weights (a key of `HEADINGS`), parameter, error, sigma (a priori), and the
        error made independent of those of the other parameters and divided by its sigma.
    """
    of = {key: rows["decorrelated"].to_numpy() for key, rows in errors.groupby("weights")}
    white, value = (float(np.sum(of[key] ** 2)) for key in HEADINGS)
    n = len(of["correlated"])
    p = two_sided_p(value, n)
    verdict = (
        f"Over {errors['seed'].nunique()} flights the $\\chi^2$ of all parameters together is "
        f"{white:,.0f} at {n:,} degrees of freedom where the errors are taken for independent. "
        f"With the weights of their correlation it is {value:,.0f} ($p$ = {p:.2f}): "
        f"{'within' if p >= ALPHA else 'outside'} its two-sided bounds of "
        f"{100 * (1 - ALPHA):.0f} %."
    )
    ratios = ((errors["error"] / errors["sigma"]) ** 2).groupby(
        [errors["weights"], errors["parameter"]], sort=False
    )
    rms = ratios.mean() ** 0.5
    table = pd.DataFrame({"Parameter": [LABELS[str(name)] for name in rms.loc["white"].index]})
    for weights, heading in HEADINGS.items():
        table[heading] = rms.loc[weights].loc[rms.loc["white"].index].to_numpy()
    caption = "RMS of the errors of the single step over their σ, slow errors of the trajectory"
    formats = dict.fromkeys(HEADINGS.values(), ".2f")
    return f"{verdict}\n\n{myst_table(table, caption, name='tab-coverage-slow', formats=formats)}\n"


def validated(flights: pd.DataFrame) -> str:
    """State the verdicts on validations with slow errors.

    Parameters
    ----------
    flights : DataFrame
        A row for each flight: fault, what is declared of the errors (all, nothing, nothing in the
        validation alone, in this order); a column with the state of every question.
    """
    counts = [
        f"{int((rows[CHECKED] == 'fails').sum())} of {len(rows)}"
        for _, rows in flights.groupby("fault", sort=False)
    ]
    return (
        "With slow errors in calibration and validation, the question of independent check points "
        f"fails in {counts[0]} flights where σ, share and time constant are declared, and in "
        f"{counts[1]} where `flight.toml` says nothing of them; in {counts[2]} where it says "
        "nothing of those of the validation alone.\n"
    )
