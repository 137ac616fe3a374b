"""Tables of the adjustments: tests, groups of observations, gross errors."""

from __future__ import annotations

import pandas as pd

from acx4book.report.adjustment.groups import PROBABILITY, decisive_qualities, ratio_limits
from acx4book.report.material import Material, validated
from acx4book.report.words import heading
from acx4lib.bundle.gross_errors.rejections import CRITICAL

UNIT = {"px": "px", "m": "m", "deg": "°"}

SHOWN = 30
"""Number of rejected observations that are listed; all of them are in rejected.csv."""

LIMITS = f"{100 * PROBABILITY:g} % limits"
"""Column with the limits that chance leaves, the same that the verdict uses."""


def test_table(material: Material) -> pd.DataFrame:
    """Return the size and the global test of every adjustment."""
    rows = []
    for name in material.adjustments:
        said = material.found.summary[name]
        r = int(str(said["redundancy"]))
        low, high = ratio_limits(r)
        rows.append(
            {
                "Adjustment": heading(name),
                "Observations": said["n_observations"],
                "Unknowns": said["n_unknowns"],
                "Redundancy": r,
                "σ₀²": said["sigma0_squared"],
                LIMITS: f"{low**2:.3f} to {high**2:.3f}",
                "p": said["chi_square_p"],
                "Rejected": said["n_rejected"],
                "Points left out": said.get("n_left_out", ""),
            }
        )
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
            LIMITS: "{:.2f} to {:.2f}".format(*ratio_limits(g.redundancy)),
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
    n, shown = len(material.found.rejected), len(rejected_table(material))
    if n == 0:
        return "Nothing was rejected."
    return (
        f"The table lists {shown} rejected observations of the decisive adjustments; rejected.csv "
        f"has all {n} rows, with those that other methods took over."
    )
