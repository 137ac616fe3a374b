"""Tables of chapter 3 that put several values side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from acx4book.typesetting.myst import (
    LABELS,
    UNITS,
    group_label,
    lacking,
    scientific,
    value_and_sigma,
)
from acx4book.typesetting.plain_text import Markup, shown
from acx4book.typesetting.tables import SYMBOLS
from acx4files.results.folder import COMPONENTS
from acx4files.results.tables import unit_of
from acx4lib.attempts import Failed
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.reliability import WEAK
from acx4lib.calibration.determination import (
    CARRIED,
    Absorption,
    Detectable,
    Pair,
    Part,
    effective_heights,
    strong_correlations,
    weakest_combination,
)
from acx4lib.calibration.estimates import GroupTest, parameters
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.design import flying_heights
from acx4lib.expected import Array
from acx4lib.geometry.frames import log, transform
from acx4lib.geometry.parameters import MOUNT
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import propagate, sigmas

NAMES = LABELS | {f"boresight_{axis}": Markup(f"boresight about ${axis}$") for axis in "xyz"}

GROUPS = {
    "image_point": "Image points",
    "control_point": "Control points",
    "gnss": "GNSS positions",
    "attitude": "Attitudes",
    "lever_arm": "Declared lever arm",
    "boresight": "Declared boresight",
    "interior": "Declared interior orientation",
}
"""Names of the kinds of observations."""

PARAMETERS = {
    **{name: LABELS[name] for name in ("k1", "k2", "k3", "p1", "p2", "b1", "b2")},
    **{name: LABELS[f"{name}_mm"] for name in ("f", "xp", "yp")},
    **{f"lever_{axis}": LABELS[f"lever_{axis}_m"] for axis in "xyz"},
    **{f"boresight_{axis}": Markup(f"boresight about ${axis}$") for axis in "xyz"},
}
"""Names of the unknowns that every image shares."""


def beside(outcomes: Mapping[str, Mounting | Failed]) -> pd.DataFrame:
    """Return the parameters of methods side by side; a failed method shows its reason.

    Parameters
    ----------
    outcomes : mapping of str to Mounting or Failed
        By the words that stand above their columns.
    """
    tables = {words: outcome.table() for words, outcome in outcomes.items() if outcome}
    table = pd.concat(tables, axis=1)
    for words, outcome in outcomes.items():
        if isinstance(outcome, Failed):
            table[words, "value"] = lacking(outcome.reason)
    return table


def _formatted(table: pd.DataFrame, formats: Mapping[str, str]) -> pd.DataFrame:
    table.attrs["formats"] = {k: v for k, v in formats.items() if k in table}
    return table


# --- what is determined together -------------------------------------------------------------


def determination(methods: Mapping[str, Mounting]) -> pd.DataFrame:
    """Return condition, weakest combination and strong correlations of methods by their titles."""
    rows = []
    for title, mounting in methods.items():
        several = len(mounting.calibration.cameras) > 1
        label = partial(_label, with_camera=several)
        parts = weakest_combination(mounting.bundle)
        pairs = strong_correlations(mounting.calibration)
        rows.append(
            {
                "Method": title,
                "Condition": _condition(mounting.bundle.solution.condition),
                "Weakest combination": Markup("; ".join(_part(part, label) for part in parts)),
                "Correlations above 0.9": Markup("; ".join(_pair(pair, label) for pair in pairs)),
            }
        )
    return pd.DataFrame(rows)


def _condition(condition: float) -> Markup:
    return Markup(scientific(condition) if condition <= CARRIED else "beyond double precision")


def _part(part: Part, label: Callable[[str], str]) -> str:
    return f"{label(part.unknown)} {100 * part.share:.0f} %"


def _pair(pair: Pair, label: Callable[[str], str]) -> str:
    size = f"{pair.correlation:+.2f}".replace("-", "\N{MINUS SIGN}")
    return f"{label(pair.row)}, {label(pair.column)} {size}"


def _label(name: str, *, with_camera: bool) -> str:
    """Return the label of ``camera/parameter`` or of an unknown of the poses, for readers."""
    camera, _, parameter = name.rpartition("/")
    label = shown(NAMES.get(parameter, parameter))
    return f"{shown(camera)} {label}" if camera and with_camera else label


def joint_tests(found: Mapping[str, Sequence[tuple[GroupTest, float | Failed]]]) -> pd.DataFrame:
    """Return tests of groups of parameters.

    Parameters
    ----------
    found : mapping of str to sequence of (GroupTest, float)
        By the tested hypothesis; with each test the F-ratio of the adjustment that holds the
        group there. Where this has no solution, its cell is empty.
    """
    rows = [
        {
            "Camera": test.camera,
            "Parameters": group_label(test.keys),
            "against": against,
            "largest single t": test.largest,
            "F": test.f_ratio,
            "F, adjusted without them": np.nan if isinstance(nested, Failed) else nested,
            "degrees of freedom": f"{len(test.keys)}; {test.redundancy:,}",
            "p": max(test.p, np.finfo(float).tiny),  # one that is too small to be computed
        }
        for against, tests in found.items()
        for test, nested in tests
    ]
    table = pd.DataFrame(rows)
    if len(table) and len(set(table["Camera"])) == 1:
        table = table.drop(columns="Camera")
    formats = {"largest single t": ".1f", "F": ".2f", "F, adjusted without them": ".2f", "p": ".3f"}
    return _formatted(table, formats)


# --- how well observations control each other ------------------------------------------------


def reliability(bundle: Bundle, found: Sequence[Detectable]) -> pd.DataFrame:
    """Return the reliability of every component of every group of observations.

    Parameters
    ----------
    bundle : Bundle
    found : sequence of Detectable
        Of the bundle.

    Returns
    -------
    DataFrame
        Redundancy numbers; the minimal detectable bias in the unit of the observation; the
        largest effect of such a bias on any parameter of the cameras, in that parameter's sigma,
        and which parameter it is.
    """
    formats = {
        "Redundancy, least": ".2f",
        "Median": ".2f",
        f"Below {WEAK:g} (%)": ".1f",
        "Detectable, median": ".3g",
        "Largest": ".3g",
        "Effect (σ)": ".2f",
    }
    return _formatted(pd.DataFrame([_row(bundle, group) for group in found]), formats)


def _row(bundle: Bundle, group: Detectable) -> dict[str, object]:
    name, _, unit = COMPONENTS[group.kind][group.component].rpartition("_")
    if group.kind in ("lever_arm", "boresight"):
        name = f"{'about' if group.kind == 'boresight' else 'along'} {'xyz'[group.component]}"
    bias = unit_of(group.kind, group.component) * group.bias
    return {
        "Observation": f"{GROUPS[group.kind]}, {name} ({UNITS.get(unit, unit)})",
        "Number": len(bias),
        "Redundancy, least": float(group.redundancy.min()),
        "Median": float(np.median(group.redundancy)),
        f"Below {WEAK:g} (%)": 100 * float(np.mean(group.redundancy < WEAK)),
        "Detectable, median": float(np.median(bias)),
        "Largest": float(bias.max()),
        "Effect (σ)": group.effect,
        "On": _parameter(bundle, group.on),
    }


def _parameter(bundle: Bundle, name: str) -> str:
    """Return the parameter of a camera for readers; the camera's name only where it matters."""
    if not name:
        return ""
    camera, key = name.rsplit("/", 1)
    several = len(bundle.network.block.cameras) > 1
    return Markup(f"{shown(camera)} {PARAMETERS[key]}") if several else PARAMETERS[key]


# --- the lever arm that the interior orientation took up ---------------------------------------

PAIRS = (("xp", 0), ("yp", 1), ("f", 2))
"""Interior parameters, and the axis of the camera whose lever arm each takes up."""


SEEN = {
    **dict.fromkeys(("Difference (mm)", "Expected (mm)"), "+.4f"),
    **dict.fromkeys(("Lever arm seen (m)", "Estimated (m)"), "+.4f"),
    "Effective height (m)": ".0f",
    "At the mean height (m)": "+.3f",
    "Seen less estimated (mm)": "+.1f",
    "σ of the difference (mm)": ".1f",
}
"""Formats of the table of `lever_arm_seen`."""


def lever_arm_seen(mountings: Mountings, found: Absorption | None) -> pd.DataFrame:
    """Compare the shift of the two-step interior orientation with the lever arm that causes it.

    Parameters
    ----------
    mountings : Mountings
    found : Absorption or None
        Of them; no rows where the methods cannot be compared.

    Returns
    -------
    DataFrame
        Per camera and axis of the camera: shift of two_step_gnss against single_step, and what
        the estimated lever arm makes of it by least squares (mm); the effective height; the
        lever arm that the shift means at the mean flying height, and by least squares; the one
        that the single step estimates, its sigma, and the sigma of the difference of the last
        two (m).
    """
    if found is None:
        return pd.DataFrame()
    single, gnss = mountings["single_step"], mountings["two_step_gnss"]
    mean_height = float(flying_heights(single.bundle.network.block).mean())
    heights = effective_heights(gnss.calibration, found.by_lever)
    expected = found.by_lever @ found.lever_m
    rows = []
    for k, camera in enumerate(single.calibration.cameras):
        camera_rows = slice(3 * k, 3 * k + 3)
        R_c_b = camera.T_b_c.R.T
        held = gnss.calibration.cameras[k].T_b_c.r
        apparent, estimated = (
            transform(R_c_b, lever[camera_rows] + held)
            for lever in (found.lever_seen_m, found.lever_m)
        )
        sigma_estimated = sigmas(propagate(R_c_b, _cov_lever(single, k)))
        sigma_difference = sigmas(propagate(R_c_b, found.cov_lever_m[camera_rows, camera_rows]))
        for (key, axis), row in zip(PAIRS, (1, 2, 0), strict=True):
            shift = found.shift_mm[camera_rows][row]
            rows.append(
                {
                    "Camera": camera.name,
                    "Parameter": LABELS[f"{key}_mm"],
                    "Difference (mm)": shift,
                    "Expected (mm)": expected[camera_rows][row],
                    "Effective height (m)": heights[k, axis],
                    "At the mean height (m)": -shift * mean_height / camera.interior.f
                    + (R_c_b @ held)[axis],
                    "Lever arm seen (m)": apparent[axis],
                    "Estimated (m)": estimated[axis],
                    "σ of it (m)": sigma_estimated[axis],
                    "Seen less estimated (mm)": 1e3 * (apparent[axis] - estimated[axis]),
                    "σ of the difference (mm)": 1e3 * sigma_difference[axis],
                }
            )
    table = pd.DataFrame(rows)
    several = len(set(table["Camera"])) > 1
    return _formatted(table if several else table.drop(columns="Camera"), SEEN)


def _cov_lever(single: Mounting, k: int) -> Array:
    """Return the a posteriori covariance of a camera's lever arm; zero where it is held."""
    calibration = single.calibration
    columns = calibration.layout.mount[k, :3]
    if np.any(columns < 0):
        return np.zeros((3, 3))
    return calibration.sigma0_sq * calibration.total_cov[np.ix_(columns, columns)]


# --- the same adjustment with something else ---------------------------------------------------


def variants(methods: Mapping[str, Mounting | Failed]) -> pd.DataFrame:
    """Return several adjustments, a row each, by their titles.

    Returns
    -------
    DataFrame
        Images, variance of unit weight, and of f, the principal point and the lever arm
        ``value`` and ``sigma``. A variant with the same numbers as the first is left out,
        such as one height of a block that has no other.
    """
    rows: dict[str, dict[tuple[str, str], object]] = {}
    for title, outcome in methods.items():
        row: dict[tuple[str, str], object] = {("images", ""): None}
        if isinstance(outcome, Mounting):
            row[("images", "")] = len(outcome.bundle.network.block.images)
            row[("variance of unit weight", "")] = outcome.bundle.solution.sigma0_sq
            estimates = outcome.table()
            keys, columns = estimates.index.tolist(), (estimates["value"], estimates["sigma"])
            for key, value, sigma in zip(keys, *columns, strict=True):
                *camera, name, unit = key
                if name in ("f", "xp", "yp") or name.startswith("lever"):
                    prefix = "".join(f"{shown(part)} " for part in camera)
                    heading = Markup(f"{prefix}{SYMBOLS[name]} ({unit})")
                    row[(heading, "value")] = value
                    row[(heading, "sigma")] = sigma
        rows[title] = row
    first = next(iter(rows.values()))
    rows = {title: row for title, row in rows.items() if row is first or not _alike(row, first)}
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index.name = "variant"
    return table


def _alike(row: Mapping[tuple[str, str], Any], other: Mapping[tuple[str, str], Any]) -> bool:
    """Tell whether two adjustments have the same numbers, within a hundredth of their sigma."""
    if row.keys() != other.keys() or None in (*row.values(), *other.values()):
        return False
    return np.allclose([*row.values()], [*other.values()], rtol=1e-3, atol=1e-6, equal_nan=True)


def chi_square_seen(found: Absorption | None) -> dict[str, float]:
    """Test the lever arm taken up by the interior orientation against the estimated one.

    Returns
    -------
    dict of str to float
        ``chi_square``, its ``degrees`` of freedom and ``p``; empty where attitudes add nothing to
        compare.
    """
    if found is None or np.linalg.eigvalsh(found.cov_lever_m).min() <= 1e-12:
        return {}
    off = found.lever_seen_m - found.lever_m
    chi_square, n = float(off @ np.linalg.solve(found.cov_lever_m, off)), len(off)
    return {"chi_square": chi_square, "degrees": n, "p": statistics.chi2_sf(chi_square, n)}


def taken_up(mountings: Mountings, found: Absorption | None) -> dict[str, object]:
    """Return the shift of the first camera's interior orientation, for a sentence.

    Returns
    -------
    dict of str to object
        ``shifts``, pairs of a label and mm; ``rest_um``, their largest difference from those
        expected by least squares; and whether the lever arm ``matters``: the estimated one differs
        from the one held by more than three of its standard deviations.
    """
    if found is None:
        return {"shifts": [], "rest_um": np.nan, "matters": False}
    shift = found.shift_mm[:3]
    sigma = np.sqrt(np.diag(_cov_lever(mountings["single_step"], 0)))
    off = np.abs(found.lever_m[:3])
    return {
        "shifts": list(zip([LABELS[f"{n}_mm"] for n in ("f", "xp", "yp")], shift, strict=True)),
        "rest_um": 1e3 * np.abs(shift - (found.by_lever @ found.lever_m)[:3]).max(),
        "matters": bool(np.any(off > 3 * sigma)),
    }


# --- image by image --------------------------------------------------------------------------


def mountings(single: Mounting) -> dict[str, tuple[list[Markup], list[Markup]]]:
    """Return the estimated lever arm and boresight of every camera; nothing where held."""
    texts: dict[str, tuple[list[Markup], list[Markup]]] = {
        camera.name: ([], []) for camera in single.calibration.cameras
    }
    for parameter in parameters(single.calibration):
        if parameter.sigma > 0 and parameter.key in MOUNT:
            text = value_and_sigma(parameter.value, parameter.sigma).replace("-", "\N{MINUS SIGN}")
            texts[parameter.camera][parameter.key in MOUNT[3:]].append(Markup(text))
    return texts


def scatter(mounting: Mounting | Failed) -> pd.DataFrame:
    """Return the scatter of the boresights of single images, and the precision of their mean.

    Parameters
    ----------
    mounting : Mounting or Failed
        Of a two-step method; no rows where it was left out.
    """
    names = [f"boresight {letter}" for letter in "ωφκ"]
    index = pd.MultiIndex.from_product([names, ["°"]], names=["parameter", "unit"])
    if isinstance(mounting, Failed) or mounting.per_image is None or mounting.averaged is None:
        return pd.DataFrame(index=index[:0])
    block, calibration = mounting.bundle.network.block, mounting.calibration
    R = np.stack([camera.T_b_c.R for camera in calibration.cameras])[block.images.camera_idx]
    turns = np.degrees(log(mounting.per_image.R @ np.swapaxes(R, 1, 2)))[mounting.averaged]
    spread = np.std(turns, axis=0, ddof=1) if len(turns) > 1 else np.full(3, np.nan)
    table = pd.DataFrame(
        {"scatter of the images": spread, "scatter / √n": spread / np.sqrt(len(turns))}, index=index
    )
    if len(calibration.cameras) == 1:
        table["σ of the mean"] = mounting.table()["sigma"].reindex(index)
    return _formatted(table, dict.fromkeys(map(str, table.columns), ".4f"))
