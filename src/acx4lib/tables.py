"""Tables of the mounting and validation stages, beside the paper's where they are comparable."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from acx4lib import accuracy, paper, standards
from acx4lib._typing import Array
from acx4lib.block import Block
from acx4lib.calibration import parameters
from acx4lib.mounting import Mounting
from acx4lib.plain_text import Markup, shown
from acx4lib.report import scientific
from acx4lib.validation import Validation

TITLES = {
    "two_step": "Two-step",
    "two_step_gnss": "Two-step, GNSS positions",
    "single_step": "Single-step",
    "rig": "Rig",
    "given": "As given",
}
"""Names of the methods in headings."""

PRINTED = {"two_step_gnss": "two_step", "single_step": "single_step"}
"""The paper's column that a method is set beside: its two-step sigmas are those of this reading."""

UNITS = {"deg": "°", "um": "µm"}
"""Units as a reader sees them, where results files spell them out."""

UNIT = re.compile(r"[\w/^.-]{1,20}")
"""What a unit looks like; other text, of results that somebody else wrote, is shown as it is."""

_LABELS = {
    "sigma0_squared": "variance of unit weight",
    "f_mm": "$f$",
    "xp_mm": "$x_p$",
    "yp_mm": "$y_p$",
    "k1": "$k_1$",
    "k2": "$k_2$",
    "k3": "$k_3$",
    "p1": "$p_1$",
    "p2": "$p_2$",
    "b1": "$b_1$",
    "lever_x_m": "lever arm $x$",
    "lever_y_m": "lever arm $y$",
    "lever_z_m": "lever arm $z$",
    "boresight_omega_deg": "boresight $\\omega$",
    "boresight_phi_deg": "boresight $\\varphi$",
    "boresight_kappa_deg": "boresight $\\kappa$",
    **{f"gnss_shift_{axis}_m": f"GNSS shift, {axis}" for axis in ("east", "north", "height")},
    "Xc_mm": "$X_c$",
    "Yc_mm": "$Y_c$",
    "Zc_mm": "$Z_c$",
    "omega_deg": "$\\omega_c$",
    "phi_deg": "$\\varphi_c$",
    "kappa_deg": "$\\kappa_c$",
    "width_px": "width",
    "height_px": "height",
    "pixel_um": "pixel",
    "width_mm": "X dimension",
    "height_mm": "Y dimension",
    "n_pairs": "intersection pairs",
    "n_points": "check points",
    "n_success": "successful intersections",
    "success_percent": "successful intersections",
    "n_fail": "failed intersections",
    "fail_percent": "failed intersections",
    "n_within_3_gsd": "points within 3 GSD",
    "within_3_gsd_percent": "points within 3 GSD",
    "gsd_m": "ground pixel",
    **{
        f"{kind}_{axis}_{unit}": f"{title}, {axis}"
        for kind, title in (("mean", "mean"), ("rms", "RMS"))
        for axis in ("east", "north", "height")
        for unit in ("m", "px")
    },
}

LABELS = {name: Markup(label) for name, label in _LABELS.items()}
"""What a reader sees for the names of parameters and statistics."""


def value_and_sigma(value: float, sigma: float) -> Markup:
    """Return a value with its standard deviation, both to two digits of the latter."""
    return Markup(_value_and_sigma(value, sigma))


def _value_and_sigma(value: float, sigma: float) -> str:
    if not np.isfinite(value):
        return ""
    if not (np.isfinite(sigma) and sigma > 0):
        return f"{value:.4g}"
    if abs(value) < 1e-3 and sigma < 1e-3:
        return f"{scientific(value, digits=2)} ± {scientific(sigma, digits=1)}"
    digits = max(0, 1 - int(np.floor(np.log10(sigma))))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def mounting_table(
    methods: Mapping[str, Mounting], *, beside_paper: Sequence[str] = ()
) -> pd.DataFrame:
    """Return Table 3: every parameter of every method, beside the printed ones.

    Parameters
    ----------
    methods : mapping of str to Mounting
    beside_paper : collection of str
        Methods whose printed column is shown too.

    Returns
    -------
    DataFrame
        Camera (where there are several), Parameter with its unit, a column per method and per
        print; ``held`` where a method does not estimate what another does.
    """
    cells: dict[tuple[str, str, str], dict[str, str]] = {}
    for method, mounting in methods.items():
        for p in parameters(mounting.calibration):
            row = cells.setdefault((p.camera, p.name, p.unit), {})
            row[TITLES[method]] = value_and_sigma(p.value, p.sigma)
    rows: list[dict[str, str]] = [{"Camera": "", "Parameter": "a posteriori variance"}]
    rows += [
        {"Camera": camera, "Parameter": with_unit(LABELS[name], unit)}
        for camera, name, unit in cells
    ]
    for method, mounting in methods.items():
        found = [f"{mounting.calibration.sigma0_sq:.3f}"]
        found += [row.get(TITLES[method], "held") for row in cells.values()]
        columns = {TITLES[method]: found}
        if method in beside_paper:
            names = ["sigma0_squared", *(name for _, name, _ in cells)]
            columns[printed_title(method)] = [_printed_cell(method, name) for name in names]
        for title, texts in columns.items():
            for row, text in zip(rows, texts, strict=True):
                row[title] = text
    table = pd.DataFrame(rows)
    return table.drop(columns="Camera") if table["Camera"].nunique() <= 2 else table


def with_unit(label: str, unit: str) -> Markup:
    """Return a label with its unit in brackets; a number without a unit has none."""
    text = shown(label)
    if unit in ("", "1"):
        return Markup(text)
    known = UNITS.get(unit, unit) if UNIT.fullmatch(unit) else shown(unit)
    return Markup(f"{text} ({known})")


def printed_title(method: str) -> str:
    """Return the heading of the paper's column beside a method."""
    return f"Printed: {TITLES[PRINTED[method]].lower()}"


def _printed_cell(method: str, name: str) -> str:
    column = PRINTED[method]
    if name not in set(paper.table(3)["parameter"]):
        return ""
    value, sigma = paper.value(3, name, column), paper.sigma(3, name, column)
    if name == "sigma0_squared":
        return f"{value:.3g}"
    return value_and_sigma(value, sigma) if np.isfinite(value) else "ND"


def validation_table(
    validations: Sequence[Validation], *, gsd_m: float, beside_paper: bool
) -> pd.DataFrame:
    """Return Table 4: pairs, means, scatter and RMS of every method, beside the printed ones.

    Parameters
    ----------
    validations : sequence of Validation
    gsd_m : float
        Ground pixel, for the RMS in pixels.
    beside_paper : bool
        Show the printed columns too.
    """
    columns: dict[str, dict[str, str]] = {}
    for validation in validations:
        columns[TITLES[validation.method]] = _validation_cells(validation, gsd_m)
        if beside_paper and validation.method in PRINTED:
            column = PRINTED[validation.method]
            columns[printed_title(validation.method)] = _printed_validation(column)
    table = pd.DataFrame(columns)
    table.insert(0, "Quantity", table.index)
    return table.reset_index(drop=True)


def _validation_cells(validation: Validation, gsd_m: float) -> dict[str, str]:
    pairs = accuracy.from_differences(validation.pairs.d)
    points = validation.points
    norm = np.linalg.norm(points.d, axis=1)
    cells = {
        "Intersection pairs": f"{len(validation.pairs)}",
        "Pairs that failed": f"{validation.n_failed}",
        "Check points": f"{len(points)}",
    }
    for axis, name in enumerate(("east", "north", "height")):
        cells[Markup(f"Mean ± scatter, {name} (m)")] = Markup(
            f"{pairs.mean[axis]:+.2f} ± {pairs.std[axis]:.2f}"
        )
    for axis, name in enumerate(("east", "north", "height")):
        cells[f"RMS, {name} (m [px])"] = f"{pairs.rms[axis]:.2f} [{pairs.rms[axis] / gsd_m:.1f}]"
    within = int(np.sum(norm <= 3 * gsd_m))
    share = 100 * within / max(len(points), 1)
    cells["Points within 3 GSD in XYZ"] = f"{within} [{share:.1f} %]"
    predicted = np.sqrt(np.mean(validation.pairs.sigma**2, axis=0))
    for axis, name in enumerate(("east", "north", "height")):
        cells[f"RMS predicted, {name} (m)"] = f"{predicted[axis]:.2f}"
    return cells


def _printed_validation(column: str) -> dict[str, str]:
    def number(name: str) -> float:
        return paper.value(4, name, column)

    cells = {
        "Intersection pairs": f"{number('n_pairs'):.0f}",
        "Pairs that failed": f"{number('n_fail'):.0f}",
        "Check points": f"{number('n_points'):.0f}",
    }
    for name in ("east", "north", "height"):
        scatter = paper.sigma(4, f"mean_{name}_m", column)
        cells[Markup(f"Mean ± scatter, {name} (m)")] = Markup(
            f"{number(f'mean_{name}_m'):+.2f} ± {scatter:.2f}"
        )
        cells[f"RMS, {name} (m [px])"] = (
            f"{number(f'rms_{name}_m'):.2f} [{number(f'rms_{name}_px'):.1f}]"
        )
        cells[f"RMS predicted, {name} (m)"] = "not given"
    within, share = number("n_within_3_gsd"), number("within_3_gsd_percent")
    cells["Points within 3 GSD in XYZ"] = f"{within:.0f} [{share:.1f} %]"
    return cells


BIAS = (
    *("Method", "Axis", "Points", "Mean (m)", "RMS (m)"),
    *("RMS, 95 % limits (m)", "t", "critical", "bias"),
)


def test_table(validations: Sequence[Validation]) -> pd.DataFrame:
    """Return Student's t of the means, one difference per point, with the verdicts."""
    rows = []
    for validation in validations:
        said = accuracy.from_differences(validation.points.d)
        test = accuracy.mean_test(said)
        for axis, name in enumerate(("east", "north", "height")):
            interval = accuracy.rms_interval(said.rms[axis], said.n)
            rows.append(
                {
                    "Method": TITLES[validation.method],
                    "Axis": name,
                    "Points": said.n,
                    "Mean (m)": said.mean[axis],
                    "RMS (m)": said.rms[axis],
                    "RMS, 95 % limits (m)": f"{interval[0]:.2f} to {interval[1]:.2f}",
                    "t": test.statistic[axis],
                    "critical": test.critical,
                    "bias": "none seen" if test.accepted[axis] else "significant",
                }
            )
    return pd.DataFrame(rows, columns=list(BIAS))


def class_table(validations: Sequence[Validation], scales: Sequence[int]) -> pd.DataFrame:
    """Return the accuracy classes that every method reaches under each standard.

    Parameters
    ----------
    validations : sequence of Validation
    scales : sequence of int
        Denominators of the map scales of PEC-PCD.
    """
    columns: dict[str, dict[str, str]] = {}
    for validation in validations:
        said = accuracy.from_differences(validation.points.d)
        survey = validation.block.check.sigma_m[validation.points.point_idx]
        sigma = accuracy.triple(np.sqrt(np.mean(survey**2, axis=0)))
        cells: dict[str, str] = {}
        for scale in scales:
            reached = standards.pec_pcd(said, scale)
            cells[f"PEC-PCD 1:{scale}, plan / height"] = f"{reached.plan} / {reached.height}"
        cells["NSSDA"] = standards.nssda(said).statement
        old = standards.asprs_2014(said, survey_sigma=sigma)
        new = standards.asprs_2023(said, survey_sigma=sigma)
        cells["ASPRS 2014, horizontal / vertical"] = f"{old.horizontal} / {old.vertical}"
        cells["ASPRS 2023, horizontal / vertical / 3D"] = (
            f"{new.horizontal} / {new.vertical} / {new.three_d}"
        )
        columns[TITLES[validation.method]] = cells
    table = pd.DataFrame(columns)
    table.insert(0, "Standard", table.index)
    return table.reset_index(drop=True)


def variant_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the variants of a calibration with each value and sigma in one cell."""
    names = {"variant": "Variant", "images": "Images", "sigma0_squared": "Variance of unit weight"}
    out = table[list(names)].rename(columns=names)
    variance = out["Variance of unit weight"]
    out["Variance of unit weight"] = [f"{v:.3f}" if np.isfinite(v) else "" for v in variance]
    for name in ("f_mm", "xp_mm", "yp_mm", "lever_x_m", "lever_y_m", "lever_z_m"):
        if name in table:
            out[Markup(f"{LABELS[name]} ({name.rpartition('_')[2]})")] = [
                value_and_sigma(v, s)
                for v, s in zip(table[name], table[f"sigma_{name}"], strict=True)
            ]
    return out


def adjustment_table(methods: Mapping[str, Mounting]) -> pd.DataFrame:
    """Return size, redundancy and global test of the adjustment behind every method."""
    rows = []
    for method, mounting in methods.items():
        solution, bundle = mounting.bundle.solution, mounting.bundle
        rows.append(
            {
                "Method": TITLES[method],
                "Observations": solution.n_observations,
                "Unknowns": solution.n_unknowns,
                "Redundancy": solution.redundancy,
                "Variance of unit weight": solution.sigma0_sq,
                "p of χ²": solution.chi_square_p,
                "Iterations": solution.iterations,
                "Rejected": len(bundle.rejected),
                "Left out": sum(bundle.network.left_out.values()),
            }
        )
    return pd.DataFrame(rows)


def attitude_sigma_deg(block: Block) -> Array:
    """Return the median standard deviation of roll, pitch and heading, degrees, shape (3,)."""
    return np.degrees(np.median(block.trajectory.sigma_attitude, axis=0))
