"""Tables of the results for the report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4book.report.estimates import STRONG, Estimate, estimates, joint_tests, strong_pairs
from acx4book.report.groups import PROBABILITY, decisive_qualities, ratio_limits
from acx4book.report.material import Material, validated
from acx4book.report.stability import Drift
from acx4book.report.verdict.finding import Finding
from acx4book.report.words import heading, pair_text, parameter_title
from acx4book.typesetting.labels import group_label, p_value, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.calibration.estimates import METHODS
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy
from acx4lib.results import folder

UNIT = {"px": "px", "m": "m", "deg": "°"}
SHOWN = 30
"""Number of rejected observations that are listed; all of them are in rejected.csv."""

LIMITS = f"{100 * PROBABILITY:g} % limits"
"""Column with the limits that chance leaves, the same that the verdict uses."""

STATES = {"holds": "✓ holds", "fails": "✗ fails", "note": "• note"}


def verdict_table(found: Sequence[Finding]) -> pd.DataFrame:
    """Return the table of findings; those that fail come first."""
    order = sorted(found, key=lambda f: f.state != "fails")
    rows = [(f.question, STATES[f.state], f.answer) for f in order]
    return pd.DataFrame(rows, columns=["Question", "Result", "Explanation"])


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


def parameter_table(material: Material) -> pd.DataFrame:
    """Return the parameters of the calibration with sigma, test and strongest correlation."""
    if not material.calibration:
        return pd.DataFrame()
    found = estimates(material, material.calibration)
    several = len({p.camera for p in found}) > 1
    rows = [
        {
            **({"Camera": p.camera} if several else {}),
            "Parameter": with_unit(parameter_title(p.parameter), p.unit),
            "Value and σ": value_and_sigma(p.value, p.sigma),
            "Against": f"{p.reference:g}",
            "t": p.t,
            "Significant": "yes" if p.significant else "no",
            "Strongest correlation": _strongest(p),
        }
        for p in found
    ]
    return pd.DataFrame(rows)


def _strongest(p: Estimate) -> Markup:
    if not p.strongest:
        return Markup("–")
    return Markup(f"{p.rho:+.2f} with {shown(parameter_title(p.strongest))}")


def joint_table(material: Material) -> pd.DataFrame:
    """Return the tests of several parameters of the calibration at once."""
    found = joint_tests(material, material.calibration) if material.calibration else []
    several = len({test.camera for test in found}) > 1
    rows = [
        {
            **({"Camera": test.camera} if several else {}),
            "Parameters": group_label(test.keys),
            "Largest single t": test.largest,
            "F": test.f_ratio,
            "Degrees of freedom": f"{len(test.keys)}; {test.redundancy:,}",
            "p": p_value(test.p),
        }
        for test in found
    ]
    return pd.DataFrame(rows)


def correlation_sentence(material: Material) -> str:
    """Return a sentence on parameters that can hardly be separated."""
    if not material.calibration:
        return ""
    pairs = strong_pairs(material, material.calibration)
    if not pairs:
        return f"No correlation exceeds {STRONG:g}."
    return f"Correlations above {STRONG:g}: " + ", ".join(pair_text(pair) for pair in pairs) + "."


def method_table(material: Material) -> pd.DataFrame:
    """Return the parameters of all methods of the mounting stage side by side."""
    names = [f"mounting/{m}" for m in METHODS if f"mounting/{m}" in material.adjustments]
    names.sort(key=lambda name: name != material.calibration)
    if len(names) < 2:
        return pd.DataFrame()
    return _side_by_side(
        {heading(name): folder.rows(material.found, "parameters", name) for name in names}
    )


def head_table(material: Material, stage_method: str) -> pd.DataFrame:
    """Return the parameters of every head, a column per head; empty without heads."""
    if not folder.has(material.found, stage_method):
        return pd.DataFrame()
    rows = folder.rows(material.found, "parameters", stage_method)
    heads = rows.groupby("camera", sort=False)
    return _side_by_side({str(name): own.assign(camera="") for name, own in heads})


def _side_by_side(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return parameters with sigma, a column per table; a parameter without a row is held."""
    several = len({name for table in tables.values() for name in table["camera"] if name}) > 1
    cells: dict[str, dict[str, str]] = {}
    for column, table in tables.items():
        for _, row in table.iterrows():
            label = with_unit(parameter_title(str(row["parameter"])), str(row["unit"]))
            if several and row["camera"]:
                label = Markup(f"{shown(row['camera'])} {label}")
            text = value_and_sigma(float(row["value"]), float(row["sigma"]))
            cells.setdefault(label, {})[column] = text
    rows = [
        [label, *(texts.get(column, "held") for column in tables)] for label, texts in cells.items()
    ]
    return pd.DataFrame(rows, columns=["Parameter", *tables])  # a camera may have this name too


def drift_table(tested: Sequence[Drift]) -> pd.DataFrame:
    """Return the tests of the boresight over time."""
    rows = [
        {
            "Axis of the body": d.axis,
            "Change, first to last (°)": value_and_sigma(d.change_deg, d.sigma_deg),
            "p of the drift": d.p,
            "p of the strips": d.p_strips,
        }
        for d in tested
    ]
    return pd.DataFrame(rows)


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


# --- check points ----------------------------------------------------------------------------


def check_table(material: Material) -> pd.DataFrame:
    """Return statistics of the differences at check points, by method and axis."""
    rows = []
    found = material.found.check_points
    for (stage, method), own in found.groupby(["stage", "method"], sort=False):
        d = own[["d_east_m", "d_north_m", "d_height_m"]].to_numpy()
        sigma = own[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy()
        said = accuracy.from_differences(d)
        mean_sigma = _mean_sigma(material, f"{stage}/{method}")
        for i, axis in enumerate(AXES):
            rows.append(
                {
                    "Differences": heading(f"{stage}/{method}"),
                    "Axis": axis,
                    "Points": said.n,
                    "Mean (m)": said.mean[i],
                    "Std (m)": said.std[i],
                    "RMS (m)": said.rms[i],
                    "Predicted (m)": float(np.sqrt(np.mean(sigma[:, i] ** 2))),
                    "Mean / σ": said.mean[i] / mean_sigma[i],
                }
            )
    return pd.DataFrame(rows)


def _mean_sigma(material: Material, stage_method: str) -> Array:
    """Return the sigma of the mean differences with all correlations; NaN where not known."""
    points = material.found.summary.get(stage_method, {}).get("points")
    found = points.get("mean_sigma") if isinstance(points, dict) else None
    return np.array([np.nan] * 3 if found is None else found, dtype=float)


def class_table(material: Material) -> pd.DataFrame:
    """Return the accuracy classes that the validation reaches."""
    entry = material.found.summary.get(validated(material), {})
    points = entry.get("points")
    classes = points.get("classes", {}) if isinstance(points, dict) else {}
    rows: list[tuple[str, str]] = []
    for name, one in classes.get("pec_pcd", {}).items():
        rows.append((f"PEC-PCD {name}, plan / height", f"{one['plan']} / {one['height']}"))
    if "nssda" in classes:
        rows.append(("NSSDA", classes["nssda"]["statement"]))
    if "asprs_2014" in classes:
        one = classes["asprs_2014"]
        rows.append(
            ("ASPRS 2014, horizontal / vertical", f"{one['horizontal']} / {one['vertical']}")
        )
    if "asprs_2023" in classes:
        one = classes["asprs_2023"]
        text = f"{one['horizontal']} / {one['vertical']} / {one['three_d']}"
        rows.append(("ASPRS 2023, horizontal / vertical / 3D", text))
    rows.sort(key=lambda row: _scale(row[0]))
    return pd.DataFrame(rows, columns=["Standard", "Reached"])


def _scale(standard: str) -> int:
    """Return the denominator of a row's map scale, for sorting; other rows come last."""
    digits = standard.partition("1:")[2].partition(",")[0]
    return int(digits) if standard.startswith("PEC") and digits.isdigit() else 10**9
