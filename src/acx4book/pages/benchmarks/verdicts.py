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
from acx4book.pages.benchmarks.sigma import Share
from acx4book.typesetting.myst import LABELS, at_commit, myst_table
from acx4lib.least_squares.adjustment import two_sided_p
from acx4lib.least_squares.statistics import holm

# --- How often a report is wrong on good flights, and which faults it finds, as a part of
# the page
#
# The reports come from ``make coverage``, a row for every flight.


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
"""Faults, and the format of their size; gross errors have a table of their own."""

GROSS: Mapping[str, str] = {
    "image_point": "an image point",
    "gnss": "a GNSS height",
    "control_point": "the height of a control point",
}

PURPOSES: Mapping[str, str] = {
    "clean": "clean ones",
    "spoilt": "with a fault of the predicted size",
    "third": "with a σ that is a third too small",
}
"""Titles of the flights by purpose."""

STATES: Mapping[str, str] = {
    "holds": "Holds",
    "minor": "Rejected, below the limit",
    "fails": "Fails",
    "untested": "Not tested",
    "note": "Note",
}
"""Headings of the states of a question."""

TEST = "p: "
"""Prefix of the columns with probabilities, before question and name of the test."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Verdicts:
    """Verdicts of the reports on many flights.

    Attributes
    ----------
    flights : DataFrame
        A row for each: purpose (``clean``, ``spoilt``, ``third``), plan, fault, size, status,
        holds; a column for the state of every question, ``found: KIND`` of planted gross errors,
        ``p: QUESTION: TEST`` of clean flights.
    about : mapping
        Date, commit, number of planned flights by purpose.
    """

    flights: pd.DataFrame
    about: Mapping[str, Any]

    def of(self, purpose: str) -> pd.DataFrame:
        """Return the flights of one purpose."""
        return self.flights[self.flights["purpose"] == purpose]

    @property
    def questions(self) -> list[str]:
        """Names of the questions of the reports."""
        states = self.flights.select_dtypes(exclude="number").isin([*STATES])
        return [str(name) for name in states.columns[states.any()]]


def read(folder: Path) -> Verdicts:
    """Read the verdicts of ``make coverage`` from a folder."""
    about, (flights,) = sigma.read_stored(folder, "verdicts", make="coverage")
    return Verdicts(flights=flights.fillna({"fault": ""}), about=about)


def _fails(flights: pd.DataFrame) -> pd.Series:
    """Return a mask of flights with a failing report, or without results."""
    return flights["holds"] != 1


# --- clean flights ---------------------------------------------------------------------------


def good(verdicts: Verdicts) -> str:
    """Return the verdicts on clean flights, as MyST text."""
    return "\n\n".join(
        [
            _made(verdicts),
            _good_verdict(verdicts),
            _table(_good_table(verdicts), "Reports of clean flights, by plan", "clean"),
            _table(_question_table(verdicts), "Answers of reports on clean flights", "questions"),
            _level_verdict(_levels(verdicts)),
            _table(_level_table(_levels(verdicts)), LEVELS, "levels"),
        ]
    )


def _question_table(verdicts: Verdicts) -> pd.DataFrame:
    """Return how often every question has each of its states on clean flights."""
    clean = verdicts.of("clean")
    rows = []
    for question in verdicts.questions:
        asking = clean.loc[clean[question].notna(), "source"].unique()  # states of the code
        states = clean[question].dropna()
        count = {state: int((states == state).sum()) for state in STATES}
        tested = count["holds"] + count["minor"] + count["fails"]
        share = _percent(sigma.binomial(count["fails"], tested)) if tested else None
        rows.append(
            {
                "Question": question,
                "Flights": int(clean["source"].isin(asking).sum()),
                **{STATES[state]: count[state] for state in ("holds", "minor", "fails")},
                "Share of failures": share,
                **{STATES[state]: count[state] for state in ("untested", "note")},
            }
        )
    return pd.DataFrame(rows)


def _levels(verdicts: Verdicts) -> pd.DataFrame:
    """Return how often the p of every single test lies below the level on clean flights."""
    clean = verdicts.of("clean")
    rows = []
    for name in clean.columns[clean.columns.str.startswith(TEST)]:
        question, _, test = str(name).removeprefix(TEST).partition(": ")
        p = clean[name].dropna()
        k = int((p < LEVEL).sum())
        if len(p):
            rows.append((question, test, len(p), k, _too_many_p(k, len(p), LEVEL)))
    table = pd.DataFrame(rows, columns=["question", "test", "n", "k", "p"])
    return table.assign(joint_p=holm(table["p"].to_numpy(dtype=float)))


def _good_table(verdicts: Verdicts) -> pd.DataFrame:
    """Return how many reports of clean flights fail, a row per plan."""
    clean = verdicts.of("clean")
    groups = [*((PLANS[name], clean[clean["plan"] == name]) for name in PLANS), ("all", clean)]
    return pd.DataFrame(
        [
            {
                "Plan": title,
                "Flights": len(flights),
                "Do not hold": int(_fails(flights).sum()),
                "Share": _percent(sigma.binomial(int(_fails(flights).sum()), len(flights))),
                "Not determined": int((flights["status"] != 0).sum()),
            }
            for title, flights in groups
            if len(flights)
        ]
    )


LEVELS = (
    f"Share of clean flights in which a single test has p below {100 * LEVEL:g} %, and its "
    f"{100 * sigma.CONFIDENCE:g} % interval"
)


def _made(verdicts: Verdicts) -> str:
    about, states = verdicts.about, verdicts.flights["source"].nunique()
    flown = [
        f"{len(verdicts.of(purpose)):,} of {about['planned'].get(purpose, 0):,} {name}"
        for purpose, name in PURPOSES.items()
    ]
    return (
        f"Computed on {about['date']} at {at_commit(about['commit'])}, by "
        f"{'one state' if states == 1 else f'{states} states'} of the code. Flights: "
        f"{'; '.join(flown)}."
    )


def _good_verdict(verdicts: Verdicts) -> str:
    """State the share of failing reports of clean flights, and whether it meets the goal."""
    clean = verdicts.of("clean")
    n_failed = int(_fails(clean).sum())
    share = sigma.binomial(n_failed, len(clean))
    reached = share.value <= GOAL
    return (
        f"Of {len(clean):,} clean flights the reports of {n_failed} say that something does not "
        f"hold: {_percent(share)}. A report promises {100 * LEVEL:g} % at most; the goal, no more "
        f"than {100 * GOAL:g} %, is {'reached' if reached else 'not reached'}."
    )


def _too_many_p(k: int, n: int, share: float) -> float:
    """Return the probability of k or more of n independent cases, given the expected share."""
    return float(stats.binomtest(k, n, share, alternative="greater").pvalue)


def _level_verdict(levels: pd.DataFrame) -> str:
    """Name the single tests that fail more often than their level."""
    many = levels[levels["joint_p"] < ALPHA]
    if many.empty:
        sentence = f"None of the {len(levels)} tests fails more often than chance lets it"
    else:
        failures = "; ".join(f"{row.test} ({row.k} of {row.n})" for row in many.itertuples())
        sentence = (
            f"{len(many)} of the {len(levels)} tests fail more often than they say: {failures}"
        )
    return (
        f"{sentence}. By chance any of them would seem to in {100 * ALPHA:g} % of all repetitions "
        "(Holm). Tests that count rejected observations have few values, and fail more rarely."
    )


def _level_table(levels: pd.DataFrame) -> pd.DataFrame:
    """Return the shares of p below the level, a row per test."""
    return pd.DataFrame(
        [
            {
                "Question": row.question,
                "Test": row.test,
                "Flights": row.n,
                f"p < {100 * LEVEL:g} %": _percent(sigma.binomial(int(row.k), int(row.n))),  # type: ignore[arg-type]
            }
            for row in levels.itertuples()
        ]
    )


# --- spoilt flights --------------------------------------------------------------------------


def spoilt(verdicts: Verdicts) -> str:
    """Return the verdicts on flights with a fault, as MyST text."""
    thirds = verdicts.of("third")
    return "\n\n".join(
        [
            _spoilt_verdict(verdicts),
            ":::{dropdown} The faults by plan, and the questions that find them",
            _table(_size_table(verdicts), SIZES, "sizes"),
            _table(_finder_table(verdicts), FINDERS, "finders"),
            _table(_share_table(thirds), THIRDS, "thirds"),
            _table(_gross_table(verdicts), GROSS_CAPTION, "gross"),
            ":::",
        ]
    )


def _size_table(verdicts: Verdicts) -> pd.DataFrame:
    """Return size and share found of every fault, a column per plan."""
    cells: dict[str, dict[str, str]] = {name: {} for name in FAULTS}
    for row in _shares(verdicts).to_dict("records"):
        size = FAULTS[row["fault"]][1].format(row["size"])
        cells[row["fault"]][PLANS[row["plan"]]] = f"{size}: {row['k']} of {row['n']}"
    rows = [{"Fault": FAULTS[name][0], **by_plan} for name, by_plan in cells.items() if by_plan]
    return pd.DataFrame(rows, columns=["Fault", *PLANS.values()])


def _gross_table(verdicts: Verdicts) -> pd.DataFrame:
    """Return how many planted gross errors were taken out, a row per kind and a column per plan."""
    flights = verdicts.of("spoilt")
    flights = flights[flights["fault"] == "gross errors"]
    rows = []
    for kind, title in GROSS.items():
        detected = flights.get(f"found: {kind}", pd.Series(dtype=float)).dropna()
        by_plan = detected.groupby(flights.loc[detected.index, "plan"], sort=False)
        cells = {PLANS[str(p)]: f"{int(of_plan.sum())} of {len(of_plan)}" for p, of_plan in by_plan}
        rows.append({"Gross error": title, **cells})
    return pd.DataFrame(rows, columns=["Gross error", *PLANS.values()])


def _finder_table(verdicts: Verdicts) -> pd.DataFrame:
    """Return which questions fail in the flights with a fault, of all plans together."""
    rows = []
    for fault, (text, _) in FAULTS.items():
        flights = verdicts.of("spoilt")
        flights = flights[flights["fault"] == fault]
        if len(flights):
            count = (flights[verdicts.questions] == "fails").sum().sort_values(ascending=False)
            shares = [
                f"{name} {100 * k / len(flights):.0f} %" for name, k in count[count > 0].items()
            ]
            rows.append(
                {"Fault": text, "Flights": len(flights), "Questions that fail": "; ".join(shares)}
            )
    return pd.DataFrame(rows)


SIZES = "Faults of the size that was predicted, and the share of flights whose report fails"
FINDERS = "Questions that fail in flights with these faults, and in how many of them"
THIRDS = "Share of flights whose report fails where a σ is stated a third too small"
GROSS_CAPTION = "Single gross errors, of the size that the plan says is found in 80 %: taken out"


def _shares(verdicts: Verdicts) -> pd.DataFrame:
    """Count the spoilt flights with a failing report, a row per fault, plan and size."""
    flights = verdicts.of("spoilt")
    groups = flights[flights["fault"].isin(FAULTS)].groupby(["fault", "plan", "size"], sort=False)
    rows = [(*keys, len(rows), int(_fails(rows).sum())) for keys, rows in groups]
    table = pd.DataFrame(rows, columns=["fault", "plan", "size", "n", "k"])
    counts = list(zip(table["k"].tolist(), table["n"].tolist(), strict=True))
    table = table.assign(p=[float(stats.binomtest(k, n, FOUND).pvalue) for k, n in counts])
    as_without = np.array([_too_many_p(k, n, LEVEL) > ALPHA for k, n in counts])
    return table.assign(is_hidden=(table["p"] < ALPHA) & as_without)


def _spoilt_verdict(verdicts: Verdicts) -> str:
    """State how many fault sizes reach the predicted share of detections; name the others."""
    shares = _shares(verdicts)
    hidden, seen = shares[shares["is_hidden"]], shares[~shares["is_hidden"]]
    deviating = seen[holm(seen["p"].to_numpy(dtype=float)) < ALPHA]
    low, high = ("; ".join(_cases(part)) for part in (_under(deviating), _over(deviating)))
    undetected = "; ".join(_cases(hidden))
    sentences = [
        f"{len(seen) - len(_under(deviating))} of {len(seen)} predicted sizes were found in "
        f"{100 * FOUND:g} % of the flights or more, within the bounds of chance."
    ]
    sentences += [f"More rarely found: {low}."] if low else []
    sentences += [f"More often found: {high}."] if high else []
    sentences += [f"Not found, since unknowns take it up: {undetected}."] if undetected else []
    return " ".join(sentences)


def _under(shares: pd.DataFrame) -> pd.DataFrame:
    return shares[shares["k"] < FOUND * shares["n"]]


def _over(shares: pd.DataFrame) -> pd.DataFrame:
    return shares[shares["k"] >= FOUND * shares["n"]]


def _cases(shares: pd.DataFrame) -> Iterator[str]:
    """Yield fault, size, plan and number of detections."""
    for row in shares.to_dict("records"):
        yield f"{_wrong(row)}, {PLANS[row['plan']]} ({row['k']} of {row['n']})"


def _wrong(row: Mapping[Any, Any]) -> str:
    text, form = FAULTS[row["fault"]]
    return f"{text} {form.format(row['size'])}"


def _share_table(flights: pd.DataFrame) -> pd.DataFrame:
    """Return in how many flights the report fails, a row per fault and a column per plan."""
    cells: dict[str, dict[str, str]] = {}
    for (fault, plan), group in flights.groupby(["fault", "plan"], sort=False):
        row = cells.setdefault(str(fault), {})
        row[PLANS[str(plan)]] = f"{int(_fails(group).sum())} of {len(group)}"
    rows = [{"σ of": name.removeprefix("sigma of "), **by_plan} for name, by_plan in cells.items()]
    return pd.DataFrame(rows, columns=["σ of", *PLANS.values()])


# --- text ------------------------------------------------------------------------------------


def _table(table: pd.DataFrame, caption: str, name: str) -> str:
    return myst_table(table, caption, name=f"tab-verdicts-{name}")


def _percent(share: Share) -> str:
    return f"{100 * share.value:.1f} % ({100 * share.low:.1f} to {100 * share.high:.1f} %)"


# --- Errors that change slowly, taken for independent or not, as a part of the page on coverage


CHECKED = "Independent check points"
"""The question of a report on the validation."""

HEADINGS = {"white": "Taken for independent", "correlated": "Weights of their correlation"}


def slow_errors_read(folder: Path) -> pd.DataFrame:
    """Read the errors of flights with slow errors from ``make coverage``.

    Returns
    -------
    DataFrame
        Columns seed, weights (a key of `HEADINGS`), parameter, error, sigma (a priori), and the
        error made independent of those of the other parameters and divided by its sigma.
    """
    _, (errors,) = sigma.read_stored(folder, "slow_errors", make="coverage")
    return errors


def page(errors: pd.DataFrame) -> str:
    """Return verdict and table as MyST text."""
    caption = "RMS of the errors of the single step over their σ, slow errors of the trajectory"
    drawn = myst_table(_slow_table(errors), caption, name="tab-coverage-slow")
    return f"{_verdict(errors)}\n\n{drawn}\n"


def _slow_table(errors: pd.DataFrame) -> pd.DataFrame:
    """Return the RMS of the normalised errors, a row per parameter."""
    columns = {heading: _ratios(errors, weights) for weights, heading in HEADINGS.items()}
    names = columns[HEADINGS["white"]].index
    shown = {
        heading: [f"{value:.2f}" for value in ratios.loc[names]]
        for heading, ratios in columns.items()
    }
    return pd.DataFrame({"Parameter": [LABELS[str(name)] for name in names], **shown})


def _ratios(errors: pd.DataFrame, weights: str) -> pd.Series:
    """Return the RMS of the normalised errors, by parameter."""
    rows = errors[errors["weights"] == weights]
    squares = (rows["error"] / rows["sigma"]) ** 2
    return squares.groupby(rows["parameter"], sort=False).mean() ** 0.5


def read_validated(folder: Path) -> pd.DataFrame:
    """Read the verdicts on flights with slow errors in calibration and validation.

    Returns
    -------
    DataFrame
        A row for each flight: fault, what is declared of the errors; size, the share of σ that
        changes slowly; holds, of the report as a whole; a column with the state of every question.
    """
    _, (flights,) = sigma.read_stored(folder, "slow_validations", make="coverage")
    return flights


def validated(flights: pd.DataFrame) -> str:
    """Return the verdicts on validations with slow errors, as MyST text."""
    counts = {kind: _counts(group) for kind, group in flights.groupby("fault", sort=False)}
    known, n, _ = counts["declared"]
    unknown, m, _ = counts["not declared"]
    sentence = (
        f"With slow errors in calibration and validation, the question of independent check points "
        f"fails in {known} of {n} flights where σ, share and time constant are declared, and in "
        f"{unknown} of {m} where `flight.toml` says nothing of them."
    )
    rows = [
        {
            "Slow errors": str(kind),
            "Flights": n_flights,
            "Independent check points fail": failed,
            "The report does not hold": lost,
        }
        for kind, (failed, n_flights, lost) in counts.items()
    ]
    caption = "Reports of flights whose trajectory's errors change slowly"
    return (
        f"{sentence}\n\n{myst_table(pd.DataFrame(rows), caption, name='tab-coverage-validated')}\n"
    )


def _counts(flights: pd.DataFrame) -> tuple[int, int, int]:
    """Count the flights in which the question fails, all flights, and the failing reports."""
    failed = (flights[CHECKED] == "fails").sum()
    return int(failed), len(flights), int((flights["holds"] != 1).sum())


def _verdict(errors: pd.DataFrame) -> str:
    """State the joint chi-square of all parameters, for both weights."""
    value, n = _chi_square(errors, "correlated")
    white, _ = _chi_square(errors, "white")
    p = two_sided_p(value, n)
    where = "within" if p >= ALPHA else "outside"
    return (
        f"Over {errors['seed'].nunique()} flights the $\\chi^2$ of all parameters together is "
        f"{white:,.0f} at {n:,} degrees of freedom where the errors are taken for independent. "
        f"With the weights of their correlation it is {value:,.0f} ($p$ = {p:.2f}): {where} its "
        f"two-sided bounds of {100 * (1 - ALPHA):.0f} %."
    )


def _chi_square(errors: pd.DataFrame, weights: str) -> tuple[float, int]:
    """Return the sum of squares of the decorrelated normalised errors, and their number."""
    normalised = errors.loc[errors["weights"] == weights, "decorrelated"]
    return float(np.sum(normalised**2)), len(normalised)
