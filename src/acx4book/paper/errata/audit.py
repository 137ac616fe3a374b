"""The findings of the errata, what was checked and found in order, and their figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.paper import absorbed
from acx4book.paper import printed as paper
from acx4book.paper.errata import heads, mounting, validation
from acx4book.paper.errata.mounting import lever_arm_in_interior
from acx4book.paper.errata.validation import implied_sample_sizes
from acx4book.typesetting import style
from acx4book.typesetting.myst import marked
from acx4lib.calibration.absorption import Absorption
from acx4lib.expected import Array
from acx4lib.flight.reader import read_kept
from acx4lib.geometry.camera import distortion
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.geometry.parameters import AXES
from acx4lib.results import agreement, folder
from acx4lib.results.provenance import KEPT

# --- Errata of the paper: 22 findings on how its numbers, units and words go together
#
# Every number of a finding is computed from the transcribed tables (`acx4book.paper.printed`);
# three findings say more with the results of a run.


MISPRINT, CONTRADICTION, OPEN, CONSISTENT = "misprint", "contradiction", "open", "consistent"
"""Kinds of findings. Open is what the paper does not tell or explain."""


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
        What is printed, what follows from the paper's own numbers, and our conclusion.
    """

    number: int
    kind: str
    place: str
    printed: str
    computed: str
    verdict: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """What findings take from a run; without one they say less.

    Attributes
    ----------
    correlations : mapping of str to float
        Largest correlations between interior and exterior orientation of the heads, by names
        such as ``CAM1 xp_mm/omega_deg``; for item 11.
    absorbed : Absorption, optional
        What interior orientation takes up of a lever arm; for item 14.
    predicted_m : ndarray, shape (3,), optional
        RMS in east, north, height that is predicted over all pairs; for item 21.
    """

    correlations: Mapping[str, float] = field(default_factory=dict)
    absorbed: Absorption | None = None
    predicted_m: Array | None = None


Check = Callable[[], tuple[str, str, str]]


def _checks(run: Run) -> dict[int, tuple[str, str, Check]]:
    """Return kind, place and check by number."""
    return {
        1: (MISPRINT, "eq. (2)", _y_equation),
        2: (MISPRINT, "before eq. (14)", _equation_number),
        3: (MISPRINT, "Table 3", mounting.exponents),
        4: (MISPRINT, "Tables 1 and 3", units),
        5: (CONTRADICTION, "Table 4", validation.rms_and_sigma),
        6: (CONTRADICTION, "Table 4", validation.small_errors),
        7: (CONTRADICTION, "2.1, 3.1, Tables 1 and 3", heads.focal_length),
        8: (MISPRINT, "Table 1", heads.missing_digit),
        9: (CONTRADICTION, "4.1, Table 3", mounting.synthetic_distortion),
        10: (CONSISTENT, "4.1, Table 1", heads.border_distortion),
        11: (OPEN, "4.1", partial(heads.correlations, run.correlations)),
        12: (OPEN, "Table 3", mounting.angle_sigmas),
        13: (OPEN, "Tables 1 and 3", mounting.variance_factors),
        14: (CONSISTENT, "Table 3", partial(mounting.lever_arm, run.absorbed)),
        15: (OPEN, "Table 3", mounting.phi_difference),
        16: (OPEN, "Table 1", heads.reference_camera),
        17: (CONSISTENT, "Tables 1 and 2", heads.coverage),
        18: (CONTRADICTION, "abstract, Table 4", validation.headline),
        19: (OPEN, "2.2, 3.2", one_direction),
        20: (OPEN, "4.3", validation.map_scales),
        21: (OPEN, "3.1, Table 4", partial(validation.error_budget, run.predicted_m)),
        22: (MISPRINT, "throughout", _wording),
    }


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
    found = []
    for number, (kind, place, check) in _checks(run).items():
        said = dict(zip(("printed", "computed", "verdict"), check(), strict=True))
        found.append(Finding(number=number, kind=kind, place=place, **said))
    return found


def errata(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return what is misprinted, contradictory or open: a table of the findings, kind by kind."""
    kinds = (CONTRADICTION, OPEN, MISPRINT)
    wrong = [finding for finding in findings if finding.kind in kinds]
    return table(sorted(wrong, key=lambda finding: kinds.index(finding.kind)))


def consistent(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return the findings that the paper's numbers agree, as a table."""
    return table([finding for finding in findings if finding.kind == CONSISTENT])


def table(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return findings as a table: number, kind, place, paper, computed, verdict."""
    columns = [*Finding.__dataclass_fields__]
    found = pd.DataFrame([asdict(finding) for finding in findings], columns=columns)
    return marked(found.rename(columns={"printed": "paper"}))


def agreements() -> pd.DataFrame:
    """Return the checks that agree: place, paper, computed."""
    rows = [check() for check in CHECKS]
    return marked(pd.DataFrame(rows, columns=["place", "paper", "computed"]))


def answer(findings: Sequence[Finding]) -> str:
    """Return sentences on how many findings of each kind there are, and where numbers disagree."""
    n = Counter(finding.kind for finding in findings)
    against = dict.fromkeys(f.place for f in findings if f.kind == CONTRADICTION)
    return (
        f"Mostly. Of {len(findings)} findings {n[CONTRADICTION]} are contradictions between "
        f"printed numbers (sections and tables: {'; '.join(against)}). {n[OPEN]} questions are "
        f"open, {n[MISPRINT]} findings are misprints, and {n[CONSISTENT]} that looked like errors "
        f"are consistent. {len(CHECKS)} further checks find nothing wrong."
    )


def read_run(results_path: str | Path) -> Run:
    """Read what findings take from a run.

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
    found = agreement.read(results_path, flight)
    if not paper.applies(flight):
        return Run(correlations=_largest_correlations(found))
    return Run(
        correlations=_largest_correlations(found),
        absorbed=absorbed.of_run(flight, found),
        predicted_m=_predicted(found),
    )


def _largest_correlations(found: folder.Results) -> dict[str, float]:
    """Return the optional objects ``largest_correlations`` of ``heads/bundle/...``."""
    stage = "heads/bundle/"
    return {
        f"{name.removeprefix(stage)} {pair}": float(correlation)
        for name, entry in found.summary.items()
        if name.startswith(stage) and isinstance(pairs := entry.get("largest_correlations"), dict)
        for pair, correlation in pairs.items()
    }


def _predicted(found: folder.Results) -> Array | None:
    """Return the RMS that is predicted over all pairs of the single step; None without any."""
    if "validation/single_step" not in found.summary:
        return None
    pairs = folder.rows(found, "validation", "validation/single_step")
    sigma = pairs[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy(dtype=float)
    return np.sqrt(np.mean(sigma**2, axis=0)) if len(sigma) else None


# --- Checks of the paper that agree; the audit lists these too


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


def megapixels() -> Agreement:
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
    given = [f"{100 * s(f'{name}_gsd_m'):.0f}" for name in names]
    scale = paper.pixel_mm("SYN") / paper.value(3, "f_mm", "single_step")
    return (
        "3.2, 4.3",
        f"ground pixels {given[0]} and {given[1]} cm in block 2, {given[2]} cm in block 3",
        ", ".join(f"{100 * scale * s(f'{name}_m'):.1f}" for name in names)
        + " cm, by the pixels of the synthetic image",
    )


def residuals() -> Agreement:
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


def rotation() -> Agreement:
    """Test that eq. (6) is a rotation, at Table 1's angles."""
    rotations = rotation_from_opk(np.array([paper.opk(head) for head in paper.HEADS]))
    error = np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max()
    proper = bool(np.all(np.linalg.det(rotations) > 0))
    kind = "a proper rotation" if proper and error < 1e-12 else "no proper rotation"
    return "eq. (6)", "rotation matrix of ω, φ, κ", f"{kind} at Table 1's angles"


CHECKS = (
    _images_of_blocks,
    megapixels,
    _synthetic_size,
    _synthetic_ground_pixels,
    residuals,
    _share_of_small_errors,
    rotation,
)


# --- Misprints of the paper: equations, exponents, units, wording
#
# In all modules of `errata`, a function that returns three strings (printed, computed, verdict) is
# one item of `acx4book.paper.errata.audit`. The other functions compute the numbers of the items.


def radial_mix_up_px() -> float:
    """Compute the largest shift of y at the heads' corners if eq. (2) is used as printed, px."""
    heads = [paper.interior(1, head) for head in paper.HEADS]
    radial = [replace(head, p1=0.0, p2=0.0) for head in heads]
    dxy = np.array([distortion(head, paper.corners("CAM1")) for head in radial])
    return float(np.abs(dxy[..., 0] - dxy[..., 1]).max() / paper.pixel_mm("CAM1"))


def _y_equation() -> tuple[str, str, str]:
    """Item 1: eq. (2) adds the radial distortion of x."""
    return (
        "y_a − y_p = −f·Dy/Dz + Δk_x + Δp_y",
        f"as printed it would move y by up to {radial_mix_up_px():.0f} px at the corners of the"
        " heads (Table 1)",
        "Misprint: Δk_y is meant. Eq. (8) defines it and no other equation uses it.",
    )


def _equation_number() -> tuple[str, str, str]:
    """Item 2: the single-step model is cited by a number that no equation has."""
    cited, last = paper.statement("equation_cited"), paper.statement("equation_last")
    return (
        f"the single-step model is called equation ({cited:.0f})",
        f"the last equation is ({last:.0f})",
        f"Misprint: eq. ({last:.0f}) is meant.",
    )


def units() -> tuple[str, str, str]:
    """Item 4: the decentring coefficients have another unit."""
    rows = [
        (number, row)
        for number in (1, 3)
        for row in paper.table(number).itertuples()
        if str(row.unit).startswith("mm") and str(row.unit) != str(row.unit_printed)
    ]
    names = sorted({str(row.parameter) for _, row in rows})
    tables = sorted({number for number, _ in rows})
    units_printed = sorted({str(row.unit_printed) for _, row in rows})
    return (
        f"{', '.join(names)} in {', '.join(units_printed)}"
        f" (Tables {' and '.join(map(str, tables))})",
        "in eqs (9)-(10) p is multiplied by a square of lengths and gives a length: mm⁻¹;"
        " k1 (mm⁻²), k2 (mm⁻⁴) and k3 (mm⁻⁶) are right",
        "Misprint: the unit is mm⁻¹.",
    )


def one_direction() -> tuple[str, str, str]:
    """Item 19: the first block lacks the opposite directions that section 2.2 asks for."""
    directions = paper.statement("block_1_low_directions")
    heads = [paper.sigma(1, name, c) for name in ("xp_mm", "yp_mm") for c in paper.HEADS]
    single = [paper.sigma(3, name, "single_step") for name in ("xp_mm", "yp_mm")]
    return (
        "strips in opposite directions are needed (2.2); the low strips of block 1 were flown in"
        f" {directions:.0f} direction (3.2)",
        f"standard deviations of x_p, y_p: {min(heads):.4f} to {max(heads):.4f} mm in block 1,"
        f" {min(single):.4f} to {max(single):.4f} mm in block 2 with opposite directions",
        "Admitted in the text (the mounting of the heads forced it). That one direction leaves x_p"
        " and y_p hard to tell from φ and ω is not discussed.",
    )


def images_per_point() -> float:
    """Compute the number of images per check point from the number of pairs."""
    pairs = paper.value(4, "n_pairs", "two_step") / paper.value(4, "n_points", "two_step")
    return float((1 + np.sqrt(1 + 8 * pairs)) / 2)


def _wording() -> tuple[str, str, str]:
    """Item 22: headings, names, and pairs that are no sample."""
    n_pairs = paper.value(4, "n_pairs", "two_step")
    n_points = paper.value(4, "n_points", "two_step")
    first, last = paper.statement("first_heading"), paper.statement("last_heading")
    return (
        f"sections “II” to “V”, but headings {first:.0f} to {last:.0f}; “Table I” and “Table 1”;"
        f" “qui-square”; “Mitshita”; “Applinix”; {n_pairs:.0f} pairs for {n_points:.0f} points",
        f"{n_pairs / n_points:.1f} pairs per point are {images_per_point():.1f} images per point"
        " if every two of them were intersected",
        "Editorial, but for two things: pairs that share images and points are no independent"
        " sample, and the frame of the adjustment (map grid or local Cartesian) is never named.",
    )


# --- Figures of two of the findings


LABELS = {"two_step": "two-step", "single_step": "single-step"}
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
    sizes = implied_sample_sizes()
    n_points = paper.value(4, "n_points", "two_step")
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.7))
        for i, (method, rows) in enumerate(sizes.groupby("method", sort=False)):
            height = np.arange(len(rows)) + 0.16 * (2 * i - 1)
            ax.hlines(
                height, rows["n_low"], rows["n_high"], color=style.colour(i), lw=6, alpha=0.35
            )
            ax.plot(rows["n"], height, "o", ms=5, color=style.colour(i), label=LABELS[str(method)])
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
        seen = table["sum_effective_m"] - table["lever_m"]
        bars["at the effective heights"] = (seen, style.ORANGE)
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
