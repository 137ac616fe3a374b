"""Tables of the adjustments: tests, groups of observations, gross errors."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.report.adjustment.groups import decisive_qualities
from acx4book.report.material import Material, validated
from acx4book.report.shown import Text, show, table
from acx4book.report.words import heading, listed
from acx4book.typesetting.labels import LABELS, p_value
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.gross_errors.rejections import CRITICAL

UNIT = {"px": "px", "m": "m", "deg": "°"}

SHOWN = 30
"""Number of rejected observations that are listed; all of them are in rejected.csv."""


FROM_SUMMARY = "summary.json: weighted residuals and redundancy of every adjustment"
FROM_RESIDUALS = "residuals.csv: residuals, a priori σ and redundancy numbers of all components"


def section(material: Material) -> Text:
    """Return the section on the adjustments, their groups of observations, and gross errors."""
    limit = f"w-tests with the critical value {CRITICAL:g}, repeated until none exceeds it"
    chance = f"{limit}; expected: the sum of the probabilities that the test rejects a good one"
    return show(
        table(test_table(material), TESTS, name="tab-report-tests", obtained=FROM_SUMMARY),
        weakest_sentence(material),
        table(
            group_table(material), GROUPS, name="tab-report-groups",
            obtained=f"{FROM_RESIDUALS}; p: summary.json, sigma_tests",
        ),
        table(
            reliability_table(material), DETECTED, name="tab-report-reliability",
            obtained=FROM_RESIDUALS,
        ),
        table(rejection_table(material), REJECTIONS, name="tab-report-rejections", obtained=chance),
        rejected_sentence(material),
        table(rejected_table(material), LARGEST, name="tab-report-rejected", obtained=limit),
    )  # fmt: skip


TESTS = "The adjustments, with the χ² test"
GROUPS = "A priori and a posteriori σ by group of observations"
DETECTED = "Reliability by group: redundancy numbers and minimal detectable errors"
REJECTIONS = "Rejected observations, expected and found"
LARGEST = "Rejected observations, the largest first"


def weakest_sentence(material: Material) -> str:
    """Return what the calibration determines worst, from its summary; empty where not known."""
    entry = material.found.summary.get(material.calibration, {})
    weakest = entry.get("weakest")
    if not isinstance(weakest, dict) or not weakest:
        return ""
    parts = [
        f"{shown(_unknown(str(name)))} ({float(share):.2f})" for name, share in weakest.items()
    ]
    return (
        "**Weakest direction.** The unknowns that could change together with the least effect on "
        f"all residuals: {listed(parts)}. In brackets: squares of the components of this "
        "direction, of which all add up to one, with the unknowns scaled alike."
    )


def _unknown(name: str) -> str:
    """Return the title of an unknown by the library's name, ``camera/lever_y_m`` or another."""
    camera, _, parameter = name.rpartition("/")
    if not camera:
        return name
    axis = parameter.removeprefix("boresight_")
    title = LABELS.get(parameter, parameter.replace("_", " "))
    if axis in ("x", "y", "z"):
        title = f"boresight about the camera's {axis}"
    return Markup(f"{shown(title)} of {shown(camera)}")


def test_table(material: Material) -> pd.DataFrame:
    """Return the size and the global test of every adjustment."""
    rows = []
    for name in material.adjustments:
        said = material.found.summary[name]
        r, p = int(str(said["redundancy"])), said["chi_square_p"]
        rows.append(
            {
                "Adjustment": heading(name),
                "Observations": said["n_observations"],
                "Unknowns": said["n_unknowns"],
                "Redundancy": r,
                "σ₀²": said["sigma0_squared"],
                "p": None if p is None else p_value(float(str(p))),
            }
        )
    return pd.DataFrame(rows)


def rejection_table(material: Material) -> pd.DataFrame:
    """Return how many observations every adjustment rejected, and how many chance would reject."""
    rows = [
        {
            "Adjustment": heading(name),
            "Observations": said["n_observations"],
            "Found and rejected": said["n_rejected"],
            "Expected by chance": said.get("expected_rejections"),
            "Tie points left out": said.get("n_left_out", ""),
        }
        for name, said in ((name, material.found.summary[name]) for name in material.adjustments)
    ]
    return pd.DataFrame(rows)


def group_table(material: Material) -> pd.DataFrame:
    """Return a priori and a posteriori sigma of every group of observations."""
    rows = [
        {
            "Adjustment": heading(g.adjustment),
            "Group": f"{g.group} ({UNIT.get(g.unit, g.unit)})",
            "Number": g.n,
            "Redundancy": g.redundancy,
            "A priori σ": _short(g.sigma),
            "A posteriori σ": _short(g.sigma * g.ratio),
            "Ratio": g.ratio,
            "p": "" if np.isnan(g.p) else p_value(g.p),
        }
        for g in decisive_qualities(material)
    ]
    return pd.DataFrame(rows)


def reliability_table(material: Material) -> pd.DataFrame:
    """Return redundancy numbers and minimal detectable errors of every group."""
    rows = [
        {
            "Adjustment": heading(g.adjustment),
            "Group": f"{g.group} ({UNIT.get(g.unit, g.unit)})",
            "Mean redundancy": g.redundancy / g.n,
            "Below 0.1": g.weak,
            "Detectable, median": _short(g.detectable),
            "Detectable, largest": _short(g.detectable_max),
        }
        for g in decisive_qualities(material)
    ]
    return pd.DataFrame(rows)


def _short(value: float) -> float:
    """Return a number rounded to three digits."""
    return float(f"{value:.3g}")


def rejected_table(material: Material) -> pd.DataFrame:
    """Return the observations rejected as gross errors, the largest first."""
    rows = material.found.rejected
    own = [n for n in ("heads/bundle", material.calibration, validated(material)) if n]
    rows = rows[(rows["stage"] + "/" + rows["method"]).isin(own)]
    order = rows["statistic"].abs().sort_values(ascending=False, kind="stable").index
    rows = rows.loc[order[:SHOWN]]
    return pd.DataFrame(
        {
            "Stage": list(rows["stage"]),
            "Observation": [kind.replace("_", " ") for kind in rows["kind"]],
            "Image or exposure": list(rows["image_or_exposure"]),
            "Point": list(rows["point"]),
            f"w (critical {CRITICAL:g})": list(rows["statistic"]),
        }
    )


def rejected_sentence(material: Material) -> str:
    """Return a sentence on the number of rejected observations, and of those in the table."""
    n, n_listed = len(material.found.rejected), len(rejected_table(material))
    if n == 0:
        return "Nothing was rejected."
    return (
        f"The table lists {n_listed} rejected observations of the decisive adjustments; "
        f"rejected.csv has all {n} rows, with those that other methods took over."
    )
