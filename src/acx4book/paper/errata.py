"""Errata of the paper: 22 findings on the agreement of its numbers, units and words.

The text of the findings is in ``errata.md``. Every number in it is computed here from the
transcribed tables (`acx4book.paper.printed`); three findings say more with the results of a run.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy import stats

from acx4book.paper import printed as paper
from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS, TITLES, marked, say, sections
from acx4book.typesetting.plain_text import Markup, shown
from acx4files.flight.reader import Flight, read_kept
from acx4files.results import folder
from acx4files.results.provenance import KEPT
from acx4files.results.read_back import mounted_block
from acx4files.stages import mounting
from acx4lib.calibration.determination import Absorption, absorption
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import Interior, correct, distort, distortion
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.geometry.parameters import AXES, BORESIGHT_ANGLES
from acx4lib.georeferencing import accuracy
from acx4lib.georeferencing.accuracy import Accuracy, Triple, from_summary, triple
from acx4lib.least_squares.covariance import sigmas

TEXT = Path(__file__).with_suffix(".md")
"""The findings: number, kind, place; printed and computed values, our conclusion."""

MISPRINT, CONTRADICTION, OPEN, CONSISTENT = "misprint", "contradiction", "open", "consistent"
"""Kinds of findings. Open: the paper does not state or explain it."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One finding on the paper.

    Attributes
    ----------
    number : int
        1 to 22.
    kind : str
        `MISPRINT`, `CONTRADICTION`, `OPEN` or `CONSISTENT`.
    place : str
        Place in the paper.
    printed, computed, verdict : str
        Printed values, values from the paper's own numbers, and our conclusion.
    """

    number: int
    kind: str
    place: str
    printed: str
    computed: str
    verdict: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Numbers of a run that findings use; empty without a run.

    Attributes
    ----------
    correlations : mapping of str to float
        Largest correlations between interior and exterior orientation of the heads, by names
        such as ``CAM1 xp_mm/omega_deg``; for item 11.
    held_f : mapping of str to float
        v'Pv that the held focal length costs, by the heads whose images reject it; for item 7.
    absorbed : Absorption, optional
        The part of a lever arm that the interior orientation takes up; for item 14.
    predicted_m : ndarray, shape (3,), optional
        RMS in east, north, height that is predicted over all pairs; for item 21.
    """

    correlations: Mapping[str, float] = field(default_factory=dict)
    held_f: Mapping[str, float] = field(default_factory=dict)
    absorbed: Absorption | None = None
    predicted_m: Array | None = None


def audit(run: Run = Run()) -> list[Finding]:
    """Check the paper against itself.

    Parameters
    ----------
    run : Run
        As `read_run` returns it; by default there is none.

    Returns
    -------
    list of Finding
        In the order of their numbers.
    """
    return [_finding(heading, text, run) for heading, text in sections(TEXT).items()]


def _finding(heading: str, text: str, run: Run) -> Finding:
    number, kind, place = re.fullmatch(r"(\d+) (\w+): (.*)", heading).groups()  # type: ignore[union-attr] # of our own text
    values = numbers(int(number), run)
    printed, computed, verdict = (say(part, **values).text for part in text.split("\n\n"))
    return Finding(
        number=int(number),
        kind=kind,
        place=place,
        printed=printed,
        computed=computed,
        verdict=verdict,
    )


def errata(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return the misprints, contradictions and open questions as a table, kind by kind."""
    kinds = (CONTRADICTION, OPEN, MISPRINT)
    wrong = [finding for finding in findings if finding.kind in kinds]
    return _table(sorted(wrong, key=lambda finding: kinds.index(finding.kind)))


def consistent(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return the findings that the paper's numbers agree, as a table."""
    return _table([finding for finding in findings if finding.kind == CONSISTENT])


def _table(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return findings as a table: number, kind, place, paper, computed, verdict."""
    columns = [*Finding.__dataclass_fields__]
    table = pd.DataFrame([asdict(finding) for finding in findings], columns=columns)
    return marked(table.rename(columns={"printed": "paper"}))


def answer(findings: Sequence[Finding]) -> str:
    """Return sentences on the number of findings of each kind, and the places that disagree."""
    n = Counter(finding.kind for finding in findings)
    against = dict.fromkeys(f.place for f in findings if f.kind == CONTRADICTION)
    return (
        f"Mostly. Of {len(findings)} findings {n[CONTRADICTION]} are contradictions between "
        f"printed numbers (sections and tables: {'; '.join(against)}). {n[OPEN]} questions are "
        f"open, {n[MISPRINT]} findings are misprints, and {n[CONSISTENT]} that looked like errors "
        f"are consistent. {len(CHECKS)} further checks find nothing wrong."
    )


# --- numbers of a run for the findings


def read_run(results_path: str | Path) -> Run:
    """Read the numbers of a run that findings use.

    Parameters
    ----------
    results_path : path
        Results folder; '' for none.

    Raises
    ------
    FlightError
        Where there is no such folder.
    """
    if not str(results_path):
        return Run()
    kept = Path(results_path) / KEPT
    if not kept.is_dir():
        return Run(correlations=_largest_correlations(folder.read(results_path)))
    flight = read_kept(kept)
    stored = folder.read(results_path)
    if not paper.applies(flight):
        return Run(correlations=_largest_correlations(stored))
    return Run(
        correlations=_largest_correlations(stored),
        held_f=rejected_focal_lengths(stored),
        absorbed=absorbed_of_run(flight, stored),
        predicted_m=_predicted(stored),
    )


def absorbed_of_run(flight: Flight, found: folder.Results) -> Absorption | None:
    """Adjust a run's calibration block by the methods of Table 3 and compare them.

    Parameters
    ----------
    flight : Flight
        Of the study's design.
    found : Results
        With the measurements transferred into synthetic images, where heads made them.

    Returns
    -------
    Absorption or None
        None where the mounting was not calibrated, or the methods cannot be compared.

    Raises
    ------
    AdjustmentError
        Where no method has an outcome.
    """
    if "mounting/single_step" not in found.summary:
        return None
    block = mounted_block(flight, "calibration", found)
    return absorption(mounting.calibrate(flight, block))


def _largest_correlations(stored: folder.Results) -> dict[str, float]:
    """Return the optional objects ``largest_correlations`` of ``heads/bundle/...``."""
    stage = "heads/bundle/"
    return {
        f"{name.removeprefix(stage)} {pair}": float(correlation)
        for name, entry in stored.summary.items()
        if name.startswith(stage) and isinstance(pairs := entry.get("largest_correlations"), dict)
        for pair, correlation in pairs.items()
    }


def rejected_focal_lengths(stored: folder.Results) -> dict[str, float]:
    """Return what holding the focal length costs in v'Pv, by the heads whose images reject it.

    Parameters
    ----------
    stored : Results
        With the stage heads.
    """
    summary: Mapping[str, Mapping[str, Any]] = stored.summary
    costs = {}
    for key, entry in summary.items():
        head, name = key.rpartition("/")[2], f"{key.rpartition('/')[2]}/f_mm"
        if key.startswith("heads/bundle/") and name in entry.get("held_rejected", ()):
            costs[head] = float(entry["held"][name]["cost"])
    return costs


def _predicted(stored: folder.Results) -> Array | None:
    """Return the predicted RMS over all pairs of the single step, (3,), m; None without pairs."""
    if "validation/single_step" not in stored.summary:
        return None
    pairs = folder.rows(stored, "validation", "validation/single_step")
    sigma = pairs[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy(dtype=float)
    return np.sqrt(np.mean(sigma**2, axis=0)) if len(sigma) else None


# --- the numbers of the findings, by their names in the text


Values = dict[str, Any]


def _whole(value: float) -> int:
    """Return a number that the paper prints without decimals."""
    return round(value)


def _radial_mix_up_px() -> float:
    """Compute the largest shift of y at the heads' corners if eq. (2) is used as printed, px."""
    heads = [paper.interior(1, head) for head in paper.HEADS]
    radial = [replace(head, p1=0.0, p2=0.0) for head in heads]
    dxy = np.array([distortion(head, paper.corners("CAM1")) for head in radial])
    return float(np.abs(dxy[..., 0] - dxy[..., 1]).max() / paper.pixel_mm("CAM1"))


def _equations() -> Values:
    """Item 2: the single-step model is cited by a number that no equation has."""
    cited, last = paper.statement("equation_cited"), paper.statement("equation_last")
    return {"cited": _whole(cited), "last": _whole(last)}


def _exponents() -> Values:
    """Item 3: the exponents of Table 3 lost their minus signs."""
    cells = [paper.printed(3, name, "two_step") for name in ("k1", "k2", "k3")]
    k1, _, k3 = (_literal(cell) for cell in cells)
    r = _corner_radius()
    return {
        "coefficients": Markup(", ".join(cell.split(" ")[0] for cell in cells)),
        "of_head": Markup(paper.printed(1, "k1", "CAM1").split(" ")[0]),
        "negative_um": 1e3 * _radial_mm(paper.interior(3, "two_step"), r),
        "k1_m": 1e-3 * k1 * r**3,
        "k3_m": 1e-3 * k3 * r**7,
    }


def _literal(as_printed: str) -> float:
    """Return a printed coefficient with the sign of its exponent as printed."""
    match = re.match(r"(-?[\d.]+)\^(-?\d+)", as_printed)
    if match is None:
        msg = f"not a printed power of ten: {as_printed!r}"
        raise ValueError(msg)
    return float(match[1]) * 10.0 ** int(match[2])


def _units() -> Values:
    """Item 4: the decentring coefficients have another unit."""
    rows = [
        (number, row)
        for number in (1, 3)
        for row in paper.table(number).itertuples()
        if str(row.unit).startswith("mm") and str(row.unit) != str(row.unit_printed)
    ]
    units = sorted({str(row.unit_printed) for _, row in rows})
    return {
        "names": ", ".join(sorted({str(row.parameter) for _, row in rows})),
        "units": Markup(", ".join(units)),
        "tables": " and ".join(map(str, sorted({number for number, _ in rows}))),
    }


ROUNDING_M = 0.005
"""Half a unit of Table 4's last digit."""


def _printed_accuracy(method: str) -> Accuracy:
    """Return the accuracy in a column of Table 4."""
    return from_summary(
        int(paper.value(4, "n_points", method)),
        mean=triple([paper.value(4, f"mean_{axis}_m", method) for axis in AXES]),
        std=triple([paper.sigma(4, f"mean_{axis}_m", method) for axis in AXES]),
        rms=triple([paper.value(4, f"rms_{axis}_m", method) for axis in AXES]),
    )


def _least_rms(accuracy: Accuracy) -> Triple:
    """Compute the RMS that belongs to a mean and a standard deviation (n - 1), m."""
    mean, std = np.array(accuracy.mean), np.array(accuracy.std)
    return triple(np.sqrt(mean**2 + (1 - 1 / accuracy.n) * std**2))


def _implied_sample_sizes() -> pd.DataFrame:
    """Compute for every axis of Table 4 the number of errors that its three numbers imply."""
    rows = []
    for method in paper.METHODS:
        printed = _printed_accuracy(method)
        for axis, mean, std, rms in zip(AXES, printed.mean, printed.std, printed.rms, strict=True):
            near, far = abs(mean) - ROUNDING_M, abs(mean) + ROUNDING_M
            rows.append(
                {
                    "method": method,
                    "axis": axis,
                    "n": _sample_size(mean, std, rms),
                    "n_low": _sample_size(far, std + ROUNDING_M, rms - ROUNDING_M),
                    "n_high": _sample_size(near, std - ROUNDING_M, rms + ROUNDING_M),
                }
            )
    return pd.DataFrame(rows)


def _sample_size(mean: float, std: float, rms: float) -> float:
    """Compute the number of errors with the given mean, standard deviation and RMS."""
    # rms² = mean² + (1 - 1/n) std²: infinite where the RMS is at its upper limit
    rest = 1 - (rms**2 - mean**2) / std**2
    return 1 / rest if rest > 0 else np.inf


def _matching_sizes(largest: int) -> list[int]:
    """Return the numbers of errors for which every printed RMS comes out to its last digit."""
    columns = [_printed_accuracy(method) for method in paper.METHODS]
    return [
        n
        for n in range(2, largest + 1)
        if all(np.allclose(np.round(_least_rms(replace(c, n=n)), 2), c.rms) for c in columns)
    ]


def _rms_and_sigma() -> Values:
    """Item 5: RMS smaller than the standard deviation."""
    printed, sizes = _printed_accuracy("two_step"), _implied_sample_sizes()
    return {
        **{name: getattr(printed, name)[0] for name in ("mean", "std", "rms")},
        "n": printed.n,
        "least": _least_rms(printed),
        "sizes": sizes["n"],
        "least_sizes": sizes["n_low"],
        "largest_sizes": sizes["n_high"],
        "n_axes": len(sizes),
        "matching": ", ".join(map(str, _matching_sizes(printed.n))),
    }


def _within_probability(rms: float, *, axes: int = 3) -> float:
    """Compute the share of normal errors below the counted limit (3 ground pixels)."""
    return float(stats.chi2.cdf((_limit_m() / rms) ** 2, axes))


def _limit_m() -> float:
    return paper.statement("within_factor") * paper.value(4, "gsd_m", "two_step")


def _small_errors() -> Values:
    """Item 6: too many small discrepancies."""
    rms = paper.value(4, "rms_east_m", "two_step")
    n = paper.value(4, "n_points", "two_step")
    share, in_plan, on_axis = (100 * _within_probability(rms, axes=axes) for axes in (3, 2, 1))
    return {
        "count": _whole(paper.value(4, "n_within_3_gsd", "two_step")),
        "n": _whole(n),
        "limit": _limit_m(),
        "rms": rms,
        "expected": n * share / 100,
        "share": share,
        "in_plan": in_plan,
        "on_axis": on_axis,
        "p": _count_probability(rms),
        "needed": _rms_of_count(),
    }


def _count_probability(rms: float) -> float:
    """Compute the probability of the printed count, or a larger one, for normal errors."""
    count = paper.value(4, "n_within_3_gsd", "two_step")
    n = paper.value(4, "n_points", "two_step")
    return float(stats.binom.sf(count - 1, n, _within_probability(rms)))


def _rms_of_count() -> float:
    """Compute the RMS per axis of normal errors with the printed share, m."""
    share = paper.value(4, "within_3_gsd_percent", "two_step") / 100
    return float(_limit_m() / np.sqrt(stats.chi2.ppf(share, 3)))


def _ground_pixels_m(f: float) -> tuple[float, float]:
    """Compute the ground pixels of block 1, high and low, for a focal length in mm."""
    high, low = paper.statement("block_1_high_m"), paper.statement("block_1_low_m")
    pixel = paper.pixel_mm("CAM1")
    return pixel * high / f, pixel * low / f


def _focal_lengths_of_heads() -> Array:
    """Compute the heads' focal lengths that Table 3's f and Table 1's Z_c mean, shape (4,), mm."""
    fixed = paper.statement("head_f_fixed_mm")
    z = np.array([paper.value(1, "Zc_mm", head) for head in paper.HEADS])
    f: Array = paper.value(3, "f_mm", "single_step") * fixed / z
    return f


def _focal_length(run: Run) -> Values:
    """Item 7: two nominal focal lengths, and what the images of a run say of the fixed one."""
    nominal, fixed = paper.statement("head_f_nominal_mm"), paper.statement("head_f_fixed_mm")
    printed_cm = 100 * np.array([paper.statement(f"block_1_{k}_gsd_m") for k in ("high", "low")])
    pixels = {_whole(f): 100 * np.array(_ground_pixels_m(f)) for f in (nominal, fixed)}
    return {
        "nominal": _whole(nominal),
        "fixed": _whole(fixed),
        "given": printed_cm,
        "pixels": list(pixels.items()),
        "synthetic": paper.value(3, "f_mm", "single_step"),
        "heads": _focal_lengths_of_heads(),
        "costs": list(run.held_f.values()),
        "missed": [np.abs(computed - printed_cm).max() for computed in pixels.values()],
    }


def _missing_digit() -> Values:
    """Item 8: a principal point without its first digit."""
    pixel = paper.pixel_mm("CAM3")
    mm = {name: paper.value(1, "xp_mm", name.upper()) for name in ("cam3", "cam4")}
    printed = Markup(paper.printed(1, "xp_mm", "CAM3"))
    return {
        "printed": printed,
        **{name: (Markup(f"{x:.4f}"), Markup(f"{x / pixel:.0f}")) for name, x in mm.items()},
    }


def _corner_radius() -> float:
    """Return the distance of the synthetic image's corners from its middle, mm."""
    return float(np.hypot(*paper.corners("SYN")[0]))


def _radial_mm(interior: Interior, r: float) -> float:
    """Compute the radial distortion at a distance from the principal point, mm."""
    radial = replace(interior, xp=0.0, yp=0.0, p1=0.0, p2=0.0)
    return float(distortion(radial, np.array([r, 0.0]))[0])


def _decentring_px(interior: Interior) -> tuple[float, float]:
    """Compute the decentring distortion at the worst corner, px."""
    only = Interior(f=interior.f, p1=interior.p1, p2=interior.p2)
    dxy = distortion(only, paper.corners("SYN")) / paper.pixel_mm("SYN")
    return float(np.abs(dxy).max()), float(np.hypot(*dxy.T).max())


def _significance(parameter: str, method: str) -> float:
    """Return a value of Table 3 divided by its standard deviation."""
    return abs(paper.value(3, parameter, method)) / paper.sigma(3, parameter, method)


def _synthetic_distortion() -> Values:
    """Item 9: distortion that is left in the synthetic image."""
    return {
        "border": _whole(paper.statement("synthetic_border_distortion_px")),
        "edge": float(paper.corners("SYN")[0, 1]),
        "single": _left_in_image("single_step"),
        "two": _left_in_image("two_step"),
    }


def _left_in_image(method: str) -> dict[str, float]:
    """Return significance and distortion, px, by the coefficients of a column of Table 3."""
    interior = paper.interior(3, method)
    edge, corner = float(paper.corners("SYN")[0, 1]), _corner_radius()
    edge_px, corner_px = (_radial_mm(interior, r) / paper.pixel_mm("SYN") for r in (edge, corner))
    component, length = _decentring_px(interior)
    return {
        **{name: _significance(name, method) for name in ("p1", "p2")},
        "component": component,
        "length": length,
        "edge_px": edge_px,
        "corner_px": corner_px,
    }


def _border_distortion_px() -> Array:
    """Compute k1 r^3 at the corner of each head, shape (4,), px."""
    k1 = np.array([paper.value(1, "k1", head) for head in paper.HEADS])
    px: Array = k1 * np.hypot(*paper.corners("CAM1")[0]) ** 3 / paper.pixel_mm("CAM1")
    return px


def _total_distortion_px() -> Array:
    """Compute each head's distortion at its worst corner with all of Table 1, shape (4,), px."""
    dxy = [distortion(paper.interior(1, head), paper.corners(head)) for head in paper.HEADS]
    px: Array = np.linalg.norm(dxy, axis=-1).max(axis=1) / paper.pixel_mm("CAM1")
    return px


def _border_distortion() -> Values:
    """Item 10: the distortion at the border of the heads."""
    border = _whole(paper.statement("head_border_distortion_px"))
    return {"border": border, "radial": _border_distortion_px(), "total": _total_distortion_px()}


def _correlations(run: Run) -> Values:
    """Item 11: correlations of interior with exterior orientation, the largest of a run."""
    claim = paper.statement("max_correlation")
    pairs = sorted(run.correlations.items(), key=lambda pair: -abs(pair[1]))[:4]
    return {
        "claim": 100 * claim,
        "pairs": Markup(", ".join(f"{v:.2f} ({_signs(name)})" for name, v in pairs)),
        "holds": all(abs(v) < claim for _, v in pairs),
    }


SIGNS = {"xp_mm": "x_p", "yp_mm": "y_p", "omega_deg": "ω", "phi_deg": "φ", "kappa_deg": "κ"}
"""The paper's signs of parameters, by their names in results."""


def _signs(pair: str) -> str:
    """Return the names of two parameters of a head as the paper writes them."""
    for name, sign in SIGNS.items():
        pair = pair.replace(name, sign)
    return shown(pair)


def _boresight_sigmas() -> list[list[float]]:
    """Return the standard deviations of the boresight's angles by both methods, degrees."""
    return [[paper.sigma(3, name, m) for name in BORESIGHT_ANGLES] for m in paper.METHODS]


def _scatter_ratios() -> tuple[float, float, float]:
    """Compute ratios of boresight standard deviations: two-step over single-step."""
    two, single = _boresight_sigmas()
    omega, phi, kappa = (a / b for a, b in zip(two, single, strict=True))
    return omega, phi, kappa


def _angle_sigmas() -> Values:
    """Item 12: two kinds of standard deviations of the boresight."""
    n = paper.statement("block_2_images")
    values = {"n": _whole(n), "root": np.sqrt(n), "ratios": _scatter_ratios()}
    return values | dict(zip(("two_step", "single_step"), _boresight_sigmas(), strict=True))


def _variance_factors() -> Values:
    """Item 13: a posteriori variances in different units of weight."""
    two, single = (paper.value(3, "sigma0_squared", method) for method in paper.METHODS)
    heads = np.array([paper.value(1, "sigma0_squared", head) for head in paper.HEADS])
    return {
        "two_step": two,
        "single_step": single,
        "heads": heads,
        "of_heads": np.sqrt(heads),
        "root": np.sqrt(single),
        "root_px": np.sqrt(single) / paper.pixel_mm("SYN"),
        "too_large": 1 / np.sqrt(heads).mean(),
    }


LEVER_ARM = {"f_mm": "lever_z_m", "xp_mm": "lever_x_m", "yp_mm": "lever_y_m"}
"""The component of the lever arm that an interior parameter absorbs at one flying height."""

ARM = tuple(f"lever_{axis}_m" for axis in "xyz")

ROUNDING_MM = 0.00005
"""Half a unit of the last digit that Table 3 prints of f, x_p, y_p."""


def lever_arm_in_interior(absorbed: Absorption | None = None) -> pd.DataFrame:
    """Compare the two methods' interior orientation with the lever arm.

    At one flying height H a lever arm (x, y, z) has the effect of (-x, -y) f/H in the principal
    point and of -z f/H in the focal length, because body and image axes are nearly parallel. Over
    two heights the effect follows by least squares.

    Parameters
    ----------
    absorbed : Absorption, optional
        From a run of the study's flight.

    Returns
    -------
    DataFrame
        By interior parameter: shift_mm (two-step minus single-step), shift_in_sigma (of the
        single-step), at_ground_m (shift at the mean flying height), lever (name), lever_m, sum_m
        (zero if the shift is the lever arm with opposite sign). With a run also expected_mm (the
        shift that the printed lever arm causes), height_m (from which this component alone would
        cause it), sum_effective_m (the sum at that height), sigma_mm (of shift less expected, as
        the methods share their measurements).
    """
    table = pd.DataFrame([_at_mean_height(*pair) for pair in LEVER_ARM.items()])
    table = table.set_index("parameter")
    if absorbed is None:
        return table
    f = paper.value(3, "f_mm", "single_step")
    printed_arm = [paper.value(3, name, "single_step") for name in ARM]
    table["expected_mm"] = absorbed.by_lever @ printed_arm
    table["height_m"] = -f * table["lever_m"] / table["expected_mm"]
    table["sum_effective_m"] = table["shift_mm"] * table["height_m"] / f + table["lever_m"]
    table["sigma_mm"] = sigmas(absorbed.cov_mm)
    return table


def _at_mean_height(name: str, lever: str) -> dict[str, object]:
    two, single = (paper.value(3, name, method) for method in paper.METHODS)
    at_ground = _mean_height() / paper.value(3, "f_mm", "single_step") * (two - single)
    lever_m = paper.value(3, lever, "single_step")
    return {
        "parameter": name,
        "shift_mm": two - single,
        "shift_in_sigma": abs(two - single) / paper.sigma(3, name, "single_step"),
        "at_ground_m": at_ground,
        "lever": lever,
        "lever_m": lever_m,
        "sum_m": at_ground + lever_m,
    }


def _mean_height() -> float:
    """Return the mean of the two flying heights of block 2, m."""
    return (paper.statement("block_2_low_m") + paper.statement("block_2_high_m")) / 2


def lever_arm_table(absorbed: Absorption | None = None) -> pd.DataFrame:
    """Return the comparison of `lever_arm_in_interior` as a table for readers."""
    comparison = lever_arm_in_interior(absorbed)
    columns = {
        "Difference (mm)": (comparison["shift_mm"], "+.4f"),
        "Lever arm (m)": (comparison["lever_m"], "+.3f"),
        "At the mean height (m)": (comparison["at_ground_m"], "+.3f"),
        "Sum (mm)": (1e3 * comparison["sum_m"], "+.0f"),
    }
    if absorbed is not None:
        columns |= {
            "Expected (mm)": (comparison["expected_mm"], "+.4f"),
            "Effective height (m)": (comparison["height_m"], ".0f"),
            "Sum at that height (mm)": (1e3 * comparison["sum_effective_m"], "+.0f"),
        }
    names = [(LABELS[name], LABELS[lever]) for name, lever in LEVER_ARM.items()]
    return pd.DataFrame(
        {
            "Parameter": [name for name, _ in names],
            "Component": [lever for _, lever in names],
            **{
                title: [f"{value:{spec}}".replace("-", "\N{MINUS SIGN}") for value in values]
                for title, (values, spec) in columns.items()
            },
        }
    )


def _absorbed_lever_arm(run: Run) -> Values:
    """Item 14: the interior orientation has absorbed the lever arm."""
    table = lever_arm_in_interior(run.absorbed)
    values = {
        "shifts": _listed(table["shift_mm"], "+.4f"),
        "in_sigma": _listed(table["shift_in_sigma"], ".0f"),
        "lever": _listed(table["lever_m"], "+.3f"),
        "height": _mean_height(),
        "at_ground": _listed(table["at_ground_m"], "+.3f"),
        "sums": _listed(1e3 * table["sum_m"], "+.0f"),
        "heights": "",
    }
    if run.absorbed is None:
        return values
    return values | {
        "heights": _listed(table["height_m"], ".0f"),
        "effective": _listed(1e3 * table["sum_effective_m"], "+.0f"),
        "off_um": 1e3 * (table["shift_mm"] - table["expected_mm"]).abs().max(),
        "rounding_um": 1e3 * ROUNDING_MM * np.sqrt(2 / 3),
        "sigma_um": 1e3 * table["sigma_mm"].max(),
    }


def _listed(values: Iterable[float], spec: str) -> Markup:
    return Markup(", ".join(f"{value:{spec}}" for value in values))


def _phi_difference() -> Values:
    """Item 15: the boresight φ of the two methods."""
    two, single = (paper.value(3, "boresight_phi_deg", method) for method in paper.METHODS)
    sigma_two, sigma_one = (paper.sigma(3, "boresight_phi_deg", m) for m in paper.METHODS)
    combined = np.hypot(sigma_two / np.sqrt(paper.statement("block_2_images")), sigma_one)
    difference = abs(two - single)
    height, f = paper.statement("block_3_m"), paper.value(3, "f_mm", "single_step")
    shift = abs(float(lever_arm_in_interior()["shift_mm"]["xp_mm"]))
    tangent = np.tan(np.radians(difference))
    return {
        "two_step": _listed([two], ".5f"),
        "single_step": _listed([single], ".5f"),
        "difference": difference,
        "in_sigma": difference / sigma_one,
        "in_both": difference / combined,
        "ground_cm": 100 * height * tangent,
        "height": _whole(height),
        "image_um": 1e3 * f * tangent,
        "shift_um": 1e3 * shift,
        "share": 100 * f * tangent / shift,
    }


def _reference_camera() -> Values:
    """Item 16: the reference camera is not aligned with itself."""
    phi = [paper.value(1, "phi_deg", head) for head in paper.HEADS]
    mean = float(np.mean(phi))  # the tilt of the common plane of the heads
    boresight = paper.value(3, "boresight_phi_deg", "single_step")
    degrees = {"omega": paper.value(1, "omega_deg", "CAM1"), "phi": phi[0], "mean": mean}
    degrees |= {"boresight": boresight, "sum": mean + boresight}
    two_digits = {name: _listed([value], ".2f") for name, value in degrees.items()}
    return {"of_heads": _listed(phi, ".1f"), **two_digits}


def _uncovered() -> tuple[float, float]:
    """Compute the share of the synthetic image that no head sees."""
    half = paper.corners("SYN")[0]
    x, y = (np.linspace(-side, side, 121) for side in half)
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rotations = [(head, rotation_from_opk(paper.opk(head))) for head in paper.HEADS]
    as_read = np.any([_sees(head, xy, R) for head, R in rotations], axis=0)
    transposed = np.any([_sees(head, xy, R.T) for head, R in rotations], axis=0)
    return float(1 - as_read.mean()), float(1 - transposed.mean())


def _sees(head: str, xy: Array, R_s_h: Array) -> Mask:
    """Mark the points of the synthetic image on the sensor of a head with given axes."""
    interior = paper.interior(1, head)
    x_h = (np.column_stack([xy, np.zeros(len(xy))]) - paper.centre_mm(head)) @ R_s_h
    ideal = -interior.f * x_h[:, :2] / x_h[:, 2:]
    half = paper.corners(head)[0]
    near = np.all(np.abs(ideal) < 1.1 * half, axis=1) & (x_h[:, 2] < 0)
    measured = distort(interior, np.where(near[:, None], ideal, 0.0))
    on_sensor: Mask = near & np.all(np.abs(measured) <= half, axis=1)
    return on_sensor


def _coverage() -> Values:
    """Item 17: do the heads cover the synthetic image, and why is its pixel smaller."""
    feet = np.concatenate([_footprint(head) for head in paper.HEADS])
    x, y = ((low, high) for low, high in zip(feet.min(axis=0), feet.max(axis=0), strict=True))
    as_read, transposed = _uncovered()
    return {
        "size": 2 * paper.corners("SYN")[0],
        "synthetic_um": paper.value(2, "pixel_um", "SYN"),
        "head_um": paper.statement("head_pixel_um"),
        **{name: Markup(f"{a:.1f} to {b:.1f}") for name, (a, b) in (("x", x), ("y", y))},
        "as_read": 100 * as_read,
        "transposed": 100 * transposed,
    }


def _footprint(head: str) -> Array:
    """Project the corners of a head to the synthetic image plane with all of Table 1."""
    # the angles of Table 1 are those of eq. (6), from the synthetic axes to the head's
    interior = paper.interior(1, head)
    ideal = correct(interior, paper.corners(head))
    rays = np.column_stack([ideal, np.full(4, -interior.f)]) @ rotation_from_opk(paper.opk(head)).T
    r_s_h = paper.centre_mm(head)
    xy: Array = r_s_h[:2] - rays[:, :2] * (r_s_h[2] / rays[:, 2])[:, None]
    return xy


def _headline() -> Values:
    """Item 18: the accuracy of the abstract."""
    cells = [(axis, method) for axis in AXES for method in paper.METHODS]
    return {
        "claim_cm": 100 * paper.statement("accuracy_m"),
        "claim_px": _whole(paper.statement("accuracy_px")),
        "rms": [paper.value(4, f"rms_{axis}_m", m) for axis, m in cells],
        "px": [paper.value(4, f"rms_{axis}_px", m) for axis, m in cells],
        "std": [paper.sigma(4, f"mean_{axis}_m", m) for axis, m in cells],
    }


def _one_direction() -> Values:
    """Item 19: the first block lacks the opposite directions that section 2.2 asks for."""
    names = ("xp_mm", "yp_mm")
    return {
        "directions": _whole(paper.statement("block_1_low_directions")),
        "heads": [paper.sigma(1, name, head) for name in names for head in paper.HEADS],
        "single_step": [paper.sigma(3, name, "single_step") for name in names],
    }


def _map_scale_classes(scales: Sequence[int] = (1000, 2000, 5000, 10000)) -> pd.DataFrame:
    """Classify Table 4 under PEC-PCD."""
    rows = [
        {"method": method, **accuracy.pec_pcd(_printed_accuracy(method), scale)}
        for scale in scales
        for method in paper.METHODS
    ]
    return pd.DataFrame(rows)[["scale", "method", "plan", "plan_by_axis", "height"]]


def map_scale_table() -> pd.DataFrame:
    """Return the classes of `_map_scale_classes` as a table for readers."""
    classes = _map_scale_classes()
    classes["scale"] = [f"1:{scale}" for scale in classes["scale"]]
    classes["method"] = [TITLES[method] for method in classes["method"]]
    classes.columns = pd.Index(["Scale", "Method", "Plan", "Plan, each axis alone", "Height"])
    return classes


def _map_scales() -> Values:
    """Item 20: map scales without an accuracy class."""
    small, large = (int(paper.statement(f"{size}_scale")) for size in ("smallest", "largest"))
    texts = [
        f"1:{scale} {' or '.join(group['plan'].unique())} in plan,"
        f" {' or '.join(group['height'].unique())} in height"
        for scale, group in _map_scale_classes((large, small)).groupby("scale")
    ]
    printed = _printed_accuracy("two_step")
    sigma = from_summary(printed.n, mean=printed.mean, std=printed.std, rms=printed.std)
    by_std = accuracy.pec_pcd(sigma, large)["height"]
    return {
        "small": small,
        "large": large,
        "classes": Markup("; ".join(texts)),
        "by_std": by_std,
    }


def _attitude_budget_m(side: str) -> tuple[float, float, float]:
    """Compute the errors that the attitude noise alone causes in block 3."""
    flying_height, f = paper.statement("block_3_m"), paper.value(3, "f_mm", "single_step")
    plan = flying_height * np.tan(np.radians(paper.statement("roll_pitch_deg")))
    advance = 1 - paper.statement("block_3_forward_overlap") / 100
    ratio = advance * paper.value(2, side, "SYN") / f
    return float(plan), float(ratio), float(np.sqrt(2) * plan / ratio)


def _error_budget(run: Run) -> Values:
    """Item 21: errors predicted from the accuracy of the trajectory, and those of a run."""
    sides = ("width_mm", "height_mm")
    budgets = {side: _attitude_budget_m(side) for side in sides}
    plan = budgets["width_mm"][0]
    east, up = (paper.value(4, f"rms_{axis}_m", "two_step") for axis in ("east", "height"))
    gnss = np.array([paper.statement("gnss_best_m"), paper.statement("gnss_worst_m")])
    with_positions = np.hypot(plan, gnss)
    values: Values = {
        f"by_{side.removesuffix('_mm')}": {
            "m": height,
            "mm": paper.value(2, side, "SYN"),
            "ratio": ratio,
        }
        for side, (_, ratio, height) in budgets.items()
    }
    values |= {
        "gnss": gnss,
        "roll_pitch": paper.statement("roll_pitch_deg"),
        "heading": paper.statement("heading_deg"),
        "height": _whole(paper.statement("block_3_m")),
        "plan": plan,
        "with_positions": with_positions,
        "up": up,
        "east": east,
        "times": east / plan,
        "times_worst": east / with_positions[1],
        "predicted": run.predicted_m,
    }
    if run.predicted_m is not None:
        values["times_predicted"] = east / (np.hypot(*run.predicted_m[:2]) / np.sqrt(2))
    return values


def _images_per_point() -> float:
    """Compute the number of images per check point from the number of pairs."""
    pairs = paper.value(4, "n_pairs", "two_step") / paper.value(4, "n_points", "two_step")
    return float((1 + np.sqrt(1 + 8 * pairs)) / 2)


def _wording() -> Values:
    """Item 22: headings, names, and pairs that are no sample."""
    pairs, points = (paper.value(4, f"n_{name}", "two_step") for name in ("pairs", "points"))
    return {
        **{name: _whole(paper.statement(f"{name}_heading")) for name in ("first", "last")},
        "n_pairs": _whole(pairs),
        "n_points": _whole(points),
        "per_point": pairs / points,
        "images": _images_per_point(),
    }


def numbers(number: int, run: Run = Run()) -> Values:
    """Return the computed values of a finding, given by its number, by their names in the text."""
    return _NUMBERS[number](run)


_NUMBERS: Mapping[int, Callable[[Run], Values]] = {
    1: lambda _: {"moved_px": _radial_mix_up_px()},
    2: lambda _: _equations(),
    3: lambda _: _exponents(),
    4: lambda _: _units(),
    5: lambda _: _rms_and_sigma(),
    6: lambda _: _small_errors(),
    7: _focal_length,
    8: lambda _: _missing_digit(),
    9: lambda _: _synthetic_distortion(),
    10: lambda _: _border_distortion(),
    11: _correlations,
    12: lambda _: _angle_sigmas(),
    13: lambda _: _variance_factors(),
    14: _absorbed_lever_arm,
    15: lambda _: _phi_difference(),
    16: lambda _: _reference_camera(),
    17: lambda _: _coverage(),
    18: lambda _: _headline(),
    19: lambda _: _one_direction(),
    20: lambda _: _map_scales(),
    21: _error_budget,
    22: lambda _: _wording(),
}
"""Computed values of each finding, from the numbers of a run."""


# --- further checks of the paper, which agree


Agreement = tuple[str, str, str]
"""Place in the paper, printed value, computed value."""


def _images_of_blocks() -> Agreement:
    """Count the images of blocks 1 and 2 by their strips."""
    s = paper.statement
    counts = [
        sum(
            s(f"{block}_{level}_strips") * s(f"{block}_{level}_images") for level in ("high", "low")
        )
        for block in ("block_1", "block_2")
    ]
    return (
        "3.2",
        f"{s('block_1_images'):.0f} and {s('block_2_images'):.0f} images",
        f"strips times images: {counts[0]:.0f} and {counts[1]:.0f}",
    )


def _megapixels() -> Agreement:
    """Multiply the sides of a head's image."""
    width, height = paper.statement("head_width_px"), paper.statement("head_height_px")
    return (
        "3.1",
        f"{paper.statement('head_megapixels'):.1f} megapixels",
        f"{width:.0f} × {height:.0f} = {width * height / 1e6:.1f} million",
    )


def _synthetic_size() -> Agreement:
    """Multiply the pixels of the synthetic image by their size."""
    width, height = 2 * paper.corners("SYN")[0]
    printed = [paper.value(2, name, "SYN") for name in ("width_mm", "height_mm")]
    return (
        "Table 2",
        f"{printed[0]:.2f} × {printed[1]:.2f} mm",
        f"{width:.2f} × {height:.2f} mm from the pixels",
    )


def _synthetic_ground_pixels() -> Agreement:
    """Compute the ground pixels of blocks 2 and 3."""
    s = paper.statement
    names = ("block_2_low", "block_2_high", "block_3")
    printed_cm = [f"{100 * s(f'{name}_gsd_m'):.0f}" for name in names]
    scale = paper.pixel_mm("SYN") / paper.value(3, "f_mm", "single_step")
    return (
        "3.2, 4.3",
        f"ground pixels {printed_cm[0]} and {printed_cm[1]} cm in block 2, {printed_cm[2]} cm in "
        "block 3",
        ", ".join(f"{100 * scale * s(f'{name}_m'):.1f}" for name in names)
        + " cm, by the pixels of the synthetic image",
    )


def _residuals() -> Agreement:
    """Express the synthetic image's residuals in its pixels."""
    um = paper.statement("synthetic_quality_um")
    return (
        "4.1",
        f"residuals of {um:.0f} µm, {paper.statement('synthetic_quality_px'):.1f} pixel",
        f"{1e-3 * um / paper.pixel_mm('SYN'):.2f} pixel of the synthetic image,"
        f" {1e-3 * um / paper.pixel_mm('CAM1'):.2f} of a head",
    )


def _share_of_small_errors() -> Agreement:
    """Divide the counted discrepancies by the points."""
    count, n = (paper.value(4, name, "two_step") for name in ("n_within_3_gsd", "n_points"))
    return (
        "Table 4",
        f"{paper.value(4, 'within_3_gsd_percent', 'two_step'):.2f} %",
        f"{count:.0f} of {n:.0f} = {100 * count / n:.2f} %",
    )


def _rotation() -> Agreement:
    """Test that eq. (6) is a rotation, at Table 1's angles."""
    rotations = rotation_from_opk(np.array([paper.opk(head) for head in paper.HEADS]))
    error = np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max()
    proper = bool(np.all(np.linalg.det(rotations) > 0))
    kind = "a proper rotation" if proper and error < 1e-12 else "no proper rotation"
    return "eq. (6)", "rotation matrix of ω, φ, κ", f"{kind} at Table 1's angles"


CHECKS = (
    _images_of_blocks,
    _megapixels,
    _synthetic_size,
    _synthetic_ground_pixels,
    _residuals,
    _share_of_small_errors,
    _rotation,
)


def agreements() -> pd.DataFrame:
    """Return the checks that agree: place, paper, computed."""
    rows = [check() for check in CHECKS]
    return marked(pd.DataFrame(rows, columns=["place", "paper", "computed"]))


# --- figures of two of the findings


METHOD_LABELS = {"two_step": "two-step", "single_step": "single-step"}
INTERIOR_LABELS = {
    "f_mm": "$f$, lever arm $z$",
    "xp_mm": "$x_p$, lever arm $x$",
    "yp_mm": "$y_p$, lever arm $y$",
}


def sample_sizes() -> Figure:
    """Draw the numbers of errors that Table 4's mean, deviation and RMS belong to (item 5).

    Returns
    -------
    Figure
        Bars: numbers that rounding allows. Line: the number of points given by the paper.
    """
    sizes = _implied_sample_sizes()
    n_points = paper.value(4, "n_points", "two_step")
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.7))
        for i, (method, rows) in enumerate(sizes.groupby("method", sort=False)):
            height = np.arange(len(rows)) + 0.16 * (2 * i - 1)
            ax.hlines(
                height, rows["n_low"], rows["n_high"], color=style.colour(i), lw=6, alpha=0.35
            )
            ax.plot(
                rows["n"],
                height,
                "o",
                ms=5,
                color=style.colour(i),
                label=METHOD_LABELS[str(method)],
            )
        ax.axvline(
            n_points, color=style.INK, lw=1, linestyle="--", label="points in the paper's Table 4"
        )
        ax.set(xscale="log", xlim=(2, 60), xlabel="number of errors n")
        ax.set_xticks([2, 3, 4, 5, 10, 20, int(n_points)], minor=False)
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.xaxis.set_minor_formatter("")
        ax.set(ylim=(2.5, -0.5))
        ax.set_yticks(range(3), AXES)
        fig.legend(loc="outside lower center", ncols=3)
    return fig


def lever_arm(absorbed: Absorption | None = None) -> Figure:
    """Draw the differences in interior orientation beside the lever arm (item 14).

    Parameters
    ----------
    absorbed : Absorption, optional
        From a run of the study's flight.

    Returns
    -------
    Figure
        Two-step minus single-step at the mean flying height and, with a run, at the effective
        heights; and the single-step's lever arm with its sign changed.
    """
    table = lever_arm_in_interior(absorbed)
    bars = {"at the mean flying height": (table["at_ground_m"], style.SOFT)}
    if absorbed is not None:
        shift_m = table["sum_effective_m"] - table["lever_m"]
        bars["at the effective heights"] = (shift_m, style.ORANGE)
    bars["lever arm of the single step, sign changed"] = (-table["lever_m"], style.BLUE)
    place, width = np.arange(len(table)), 0.8 / len(bars)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.9))
        for i, (label, (values, colour)) in enumerate(bars.items()):
            offset = (i - (len(bars) - 1) / 2) * width
            ax.barh(place + offset, values, 0.9 * width, color=colour, label=label)
        ax.axvline(0.0, color=style.INK, linewidth=0.8)
        ax.set(xlabel="metres", xlim=(-0.5, 0.5))
        ax.set_yticks(place, [INTERIOR_LABELS[name] for name in table.index])
        ax.grid(visible=False, axis="y")
        ax.invert_yaxis()
        fig.legend(loc="outside lower center", ncols=len(bars))
    return fig
