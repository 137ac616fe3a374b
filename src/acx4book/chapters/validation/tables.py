"""Tables of the validation stage, beside the paper's where they are comparable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import TITLES
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4lib.flight.design import ground_sample_m
from acx4lib.flight.reader import Flight
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy, error_sources, standards
from acx4lib.georeferencing.validation import Validation
from acx4lib.least_squares.covariance import correlation, sigmas

PRINTED = {"two_step_gnss": "two_step", "single_step": "single_step"}
"""The paper's column that a method is set beside: its two-step sigmas are those of this reading."""


def table_4(flight: Flight, validations: Sequence[Validation]) -> pd.DataFrame:
    """Return Table 4: pairs, means, scatter and RMS of every method, beside the printed ones.

    Parameters
    ----------
    flight : Flight
        The paper's columns are shown where it has the paper's cameras.
    validations : sequence of Validation
    """
    columns: dict[str, dict[str, str]] = {}
    for validation in validations:
        columns[TITLES[validation.method]] = _validation_cells(validation)
        if validation.method in PRINTED and printed.applies(flight):
            column = PRINTED[validation.method]
            columns[f"Printed: {TITLES[column].lower()}"] = _printed_validation(column)
    table = pd.DataFrame(columns)
    table.insert(0, "Quantity", table.index)
    return table.reset_index(drop=True)


def _validation_cells(validation: Validation) -> dict[str, str]:
    gsd_m = ground_sample_m(validation.block)
    pairs = accuracy.from_differences(validation.pairs.d)
    points = validation.points
    norm = np.linalg.norm(points.d, axis=1)
    cells = {
        "Intersection pairs": f"{len(validation.pairs)}",
        "Pairs that failed": f"{validation.n_failed}",
        "Check points": f"{len(points)}",
    }
    for axis, name in enumerate(AXES):
        cells[Markup(f"Mean ± scatter, {name} (m)")] = Markup(
            f"{pairs.mean[axis]:+.2f} ± {pairs.std[axis]:.2f}"
        )
    for axis, name in enumerate(AXES):
        cells[f"RMS, {name} (m [px])"] = f"{pairs.rms[axis]:.2f} [{pairs.rms[axis] / gsd_m:.1f}]"
    within = int(np.sum(norm <= 3 * gsd_m))
    share = 100 * within / max(len(points), 1)
    cells["Points within 3 GSD in XYZ"] = f"{within} [{share:.1f} %]"
    predicted = np.sqrt(np.mean(validation.pairs.sigma**2, axis=0))
    for axis, name in enumerate(AXES):
        cells[f"RMS predicted, {name} (m)"] = f"{predicted[axis]:.2f}"
    return cells


def _printed_validation(column: str) -> dict[str, str]:
    def said(name: str) -> Markup:
        return printed.shown(4, name, column)

    cells: dict[str, str] = {
        "Intersection pairs": said("n_pairs"),
        "Pairs that failed": said("n_fail"),
        "Check points": said("n_points"),
    }
    for name in AXES:
        cells[Markup(f"Mean ± scatter, {name} (m)")] = said(f"mean_{name}_m")
        cells[f"RMS, {name} (m [px])"] = f"{said(f'rms_{name}_m')} [{said(f'rms_{name}_px')}]"
        cells[f"RMS predicted, {name} (m)"] = "not given"
    within, share = said("n_within_3_gsd"), said("within_3_gsd_percent")
    cells["Points within 3 GSD in XYZ"] = f"{within} [{share} %]"
    return cells


TOGETHER = ("Method", "Points", "Degrees of freedom", "χ²", "p", "χ² as if independent")


def together(validations: Sequence[Validation]) -> pd.DataFrame:
    """Return the joint test of all differences of a method, with their full covariance."""
    rows = [
        (
            *(TITLES[found.method], len(found.points), found.joint_dof),
            *(found.joint_chi_square, found.joint_chi_square_p),
            float(np.sum((found.points.d / found.points.sigma) ** 2)),
        )
        for found in validations
    ]
    return pd.DataFrame(rows, columns=list(TOGETHER))


NORMALISED = ("Method", "Axis", "RMS of d / σ", "counts as", "95 % limits", "prediction")


def normalised(validations: Sequence[Validation]) -> pd.DataFrame:
    """Return the RMS of the points' differences in predicted sigmas, and what chance allows."""
    rows = []
    for validation, axis, cov in _axes(validations):
        z = validation.points.d[:, axis] / validation.points.sigma[:, axis]
        rms, n = np.sqrt(np.mean(z**2)), accuracy.effective_number(correlation(cov))
        low, high = accuracy.rms_limits(n)
        verdict = "too small" if rms > high else "too large" if rms < low else "holds"
        limits = f"{low:.2f} to {high:.2f}"
        rows.append((TITLES[validation.method], AXES[axis], rms, n, limits, verdict))
    return pd.DataFrame(rows, columns=list(NORMALISED))


def _axes(validations: Sequence[Validation]) -> Iterator[tuple[Validation, int, Array]]:
    """Yield every validation with points, axis by axis, and the points' covariance there."""
    for validation in validations:
        if len(validation.points):
            among = error_sources.axis_covariances(validation.points.sources)
            yield from ((validation, axis, cov) for axis, cov in enumerate(among))


BIAS = (
    *("Method", "Axis", "Points", "Mean (m)", "σ of the mean (m)", "mean / σ", "critical"),
    *("bias", "RMS (m)", "RMS, 95 % limits (m)"),
)


def bias(validations: Sequence[Validation]) -> pd.DataFrame:
    """Return the tests of the means, one difference per point, with the verdicts."""
    rows = []
    for validation, axis, cov in _axes(validations):
        said = accuracy.from_differences(validation.points.d)
        test = accuracy.bias_test(np.array(said.mean), validation.mean_cov)
        low, high = accuracy.rms_interval(said.rms[axis], accuracy.effective_number(cov))
        rows.append(
            {
                "Method": TITLES[validation.method],
                "Axis": AXES[axis],
                "Points": said.n,
                "Mean (m)": said.mean[axis],
                "σ of the mean (m)": sigmas(validation.mean_cov)[axis],
                "mean / σ": test.statistic[axis],
                "critical": test.critical,
                "bias": "none seen" if test.accepted[axis] else "significant",
                "RMS (m)": said.rms[axis],
                "RMS, 95 % limits (m)": f"{low:.2f} to {high:.2f}",
            }
        )
    return pd.DataFrame(rows, columns=list(BIAS))


def classes(validations: Sequence[Validation], scales: Sequence[int]) -> pd.DataFrame:
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
