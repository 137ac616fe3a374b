"""Checks of the paper's first step: the four heads and Table 1."""

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
from acx4book.paper.errata import mounting, validation
from acx4book.paper.errata.mounting import lever_arm_in_interior
from acx4book.paper.errata.validation import implied_sample_sizes
from acx4book.typesetting import style
from acx4book.typesetting.myst import marked
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.determination import Absorption
from acx4lib.expected import Array, Mask
from acx4lib.flight.reader import read_kept
from acx4lib.geometry.camera import correct, distort, distortion
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.geometry.parameters import AXES
from acx4lib.results import agreement, folder
from acx4lib.results.provenance import KEPT

SIGNS = {"xp_mm": "x_p", "yp_mm": "y_p", "omega_deg": "ω", "phi_deg": "φ", "kappa_deg": "κ"}
"""The paper's signs of parameters, by their names in results."""


def _ground_pixels_m(f: float) -> tuple[float, float]:
    """Compute the ground pixels of block 1, high and low, for a focal length in mm."""
    high, low = paper.statement("block_1_high_m"), paper.statement("block_1_low_m")
    pixel = paper.pixel_mm("CAM1")
    return pixel * high / f, pixel * low / f


def focal_lengths_of_heads() -> Array:
    """Compute the heads' focal lengths that Table 3's f and Table 1's Z_c mean, shape (4,), mm.

    The heads were held at one focal length F, and the frame of the synthetic image has camera 1
    at Z_c = F. A head that is longer than F by a factor comes to lie lower by it, and a frame
    with a camera 1 that is longer has a longer f: f_1 = f, f_k = f F / Z_c.
    """
    fixed = paper.statement("head_f_fixed_mm")
    z = np.array([paper.value(1, "Zc_mm", head) for head in paper.HEADS])
    f: Array = paper.value(3, "f_mm", "single_step") * fixed / z
    return f


def _focal_length() -> tuple[str, str, str]:
    """Item 7: two nominal focal lengths."""
    nominal, fixed = paper.statement("head_f_nominal_mm"), paper.statement("head_f_fixed_mm")
    given = np.array([paper.statement(f"block_1_{level}_gsd_m") for level in ("high", "low")])
    texts, missed = [], []
    for f in (nominal, fixed):
        high, low = _ground_pixels_m(f)
        texts.append(f"{100 * high:.1f} and {100 * low:.1f} cm for {f:.0f} mm")
        missed.append(100 * np.abs(np.array([high, low]) - given).max())
    seen = focal_lengths_of_heads()
    return (
        f"lenses of {nominal:.0f} mm nominal (3.1), {fixed:.0f} mm fixed as the nominal value"
        f" (2.1, 4.1); ground pixels of block 1: {100 * given[0]:.0f} and"
        f" {100 * given[1]:.0f} cm (3.2)",
        "ground pixels of the heads: "
        + "; ".join(texts)
        + f". f = {paper.value(3, 'f_mm', 'single_step'):.2f} mm of the synthetic image and Z_c"
        " mean heads of " + ", ".join(f"{f:.2f}" for f in seen) + " mm",
        f"Two nominal values contradict each other. The ground pixels are nearer to {nominal:.0f}"
        f" mm, which misses them by at most {missed[0]:.1f} cm, {fixed:.0f} mm by"
        f" {missed[1]:.1f} cm; but they and the flying heights are rounded. Table 3 speaks for a"
        " longer lens than either: what is wrong with the fixed value comes back in f of the"
        " synthetic image.",
    )


def border_distortion_px() -> Array:
    """Compute k1 r^3 at the corner of each head, shape (4,), px."""
    k1 = np.array([paper.value(1, "k1", head) for head in paper.HEADS])
    px: Array = k1 * np.hypot(*paper.corners("CAM1")[0]) ** 3 / paper.pixel_mm("CAM1")
    return px


def total_distortion_px() -> Array:
    """Compute each head's distortion at its worst corner with all of Table 1, shape (4,), px."""
    dxy = [distortion(paper.interior(1, head), paper.corners(head)) for head in paper.HEADS]
    px: Array = np.linalg.norm(dxy, axis=-1).max(axis=1) / paper.pixel_mm("CAM1")
    return px


def _border_distortion() -> tuple[str, str, str]:
    """Item 10: the distortion at the border of the heads."""
    radial, total = border_distortion_px(), total_distortion_px()
    return (
        f"at most about {paper.statement('head_border_distortion_px'):.0f} px at the border of"
        " each image",
        "k1 r³ at the corner: "
        + ", ".join(f"{value:.1f}" for value in radial)
        + " px; with decentring, at the worst corner: "
        + ", ".join(f"{value:.1f}" for value in total)
        + " px",
        "Consistent; it confirms the negative exponents of Table 1.",
    )


def _missing_digit() -> tuple[str, str, str]:
    """Item 8: a principal point without its first digit."""
    cam3, cam4 = (paper.value(1, "xp_mm", head) for head in ("CAM3", "CAM4"))
    pixel = paper.pixel_mm("CAM3")
    return (
        f"x_p of CAM3 is {paper.printed(1, 'xp_mm', 'CAM3')} mm",
        f"{cam3:.4f} mm are {cam3 / pixel:.0f} px; CAM4 has {cam4:.4f} mm, {cam4 / pixel:.0f} px",
        "A leading 0 is missing and the size is plausible; whether a minus sign is missing too"
        " cannot be told from the text.",
    )


def correlations(largest: Mapping[str, float] | None) -> tuple[str, str, str]:
    """Item 11: correlations of interior with exterior orientation.

    Parameters
    ----------
    largest : mapping or None
        Largest absolute correlations of a run by the names of their pairs; None if not computed.
    """
    claim = paper.statement("max_correlation")
    printed = f"correlations between IOP and EOP below {100 * claim:.0f} %"
    if not largest:
        return printed, "not computed: needs the results of a run", "Open without a run."
    pairs = sorted(largest.items(), key=lambda pair: -abs(pair[1]))[:4]
    holds = abs(pairs[0][1]) < claim
    verdict = (
        "Holds in our run."
        if holds
        else "Cannot be the maximum for such a block; a mean or a median over all pairs may be"
        " meant, or exterior orientation that was constrained in a way the text does not tell."
    )
    return (
        printed,
        "largest: " + ", ".join(f"{v:.2f} ({_signs(name)})" for name, v in pairs),
        verdict,
    )


def _signs(pair: str) -> str:
    """Return the names of two parameters of a head as the paper writes them."""
    for name, sign in SIGNS.items():
        pair = pair.replace(name, sign)
    return shown(pair)


def _mean_phi_deg() -> float:
    """Compute the mean phi of the four heads: the tilt of their common plane, degrees."""
    return float(np.mean([paper.value(1, "phi_deg", head) for head in paper.HEADS]))


def _reference_camera() -> tuple[str, str, str]:
    """Item 16: the reference camera is not aligned with itself."""
    phi = [paper.value(1, "phi_deg", head) for head in paper.HEADS]
    omega = paper.value(1, "omega_deg", "CAM1")
    boresight = paper.value(3, "boresight_phi_deg", "single_step")
    return (
        f"CAM1 is the reference camera, with ω = {omega:.2f}°, φ = {phi[0]:.2f}°",
        "φ of the four: "
        + ", ".join(f"{value:.1f}" for value in phi)
        + f"°, in the mean {_mean_phi_deg():.2f}°; boresight φ of the synthetic image"
        f" {boresight:.2f}°; sum {_mean_phi_deg() + boresight:.2f}°",
        "The angles are relative to the plane of the synthetic image, and CAM1 gives the scale"
        " only. That plane is tilted against the mean of the heads by about the boresight: the"
        " heads are nearly level with the IMU, the synthetic image is not.",
    )


def footprint(head: str) -> Array:
    """Project the corners of a head to the synthetic image plane with all of Table 1.

    Parameters
    ----------
    head : str
        One of `printed.HEADS`.

    Returns
    -------
    ndarray, shape (4, 2)
        mm. The angles of Table 1 are those of eq. (6) from the synthetic axes to the head's.
    """
    interior = paper.interior(1, head)
    ideal = correct(interior, paper.corners(head))
    rays = np.column_stack([ideal, np.full(4, -interior.f)]) @ rotation_from_opk(paper.opk(head)).T
    r_s_h = paper.centre_mm(head)
    xy: Array = r_s_h[:2] - rays[:, :2] * (r_s_h[2] / rays[:, 2])[:, None]
    return xy


def sees(head: str, xy: Array, R_s_h: Array) -> Mask:
    """Tell which points of the synthetic image lie on the sensor of a head with given axes.

    Parameters
    ----------
    head : str
    xy : ndarray, shape (n, 2)
        Synthetic image coordinates, mm.
    R_s_h : ndarray, shape (3, 3)

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    interior = paper.interior(1, head)
    x_h = (np.column_stack([xy, np.zeros(len(xy))]) - paper.centre_mm(head)) @ R_s_h
    ideal = -interior.f * x_h[:, :2] / x_h[:, 2:]
    half = paper.corners(head)[0]
    near = np.all(np.abs(ideal) < 1.1 * half, axis=1) & (x_h[:, 2] < 0)
    measured = distort(interior, np.where(near[:, None], ideal, 0.0))
    on_sensor: Mask = near & np.all(np.abs(measured) <= half, axis=1)
    return on_sensor


def uncovered() -> tuple[float, float]:
    """Compute the share of the synthetic image that no head sees.

    Returns
    -------
    as_read, transposed : float
        With the angles of Table 1 from the synthetic axes to the head's, and in the other
        direction.
    """
    half = paper.corners("SYN")[0]
    x, y = (np.linspace(-side, side, 121) for side in half)
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rotations = [(head, rotation_from_opk(paper.opk(head))) for head in paper.HEADS]
    as_read = np.any([sees(head, xy, R) for head, R in rotations], axis=0)
    transposed = np.any([sees(head, xy, R.T) for head, R in rotations], axis=0)
    return float(1 - as_read.mean()), float(1 - transposed.mean())


def _coverage() -> tuple[str, str, str]:
    """Item 17: do the heads cover the synthetic image, and why is its pixel smaller."""
    feet = np.concatenate([footprint(head) for head in paper.HEADS])
    low, high = feet.min(axis=0), feet.max(axis=0)
    as_read, transposed = uncovered()
    width, height = 2 * paper.corners("SYN")[0]
    um, syn_um = paper.statement("head_pixel_um"), paper.value(2, "pixel_um", "SYN")
    return (
        f"synthetic image of {width:.2f} × {height:.2f} mm with {syn_um:g} µm pixels, heads with"
        f" {um:g} µm pixels",
        f"the heads reach x {low[0]:.1f} to {high[0]:.1f} mm, y {low[1]:.1f} to {high[1]:.1f} mm;"
        f" uncovered {100 * as_read:.0f} %, with transposed rotations {100 * transposed:.0f} %",
        "Consistent, and it tells which way Table 1's angles turn. Why the synthetic pixel is"
        " smaller than the heads' (slight oversampling) is not said.",
    )


# --- The findings of the errata, what was checked and found in order, and their figures


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
        4: (MISPRINT, "Tables 1 and 3", _units),
        5: (CONTRADICTION, "Table 4", validation.rms_and_sigma),
        6: (CONTRADICTION, "Table 4", validation.small_errors),
        7: (CONTRADICTION, "2.1, 3.1, Tables 1 and 3", _focal_length),
        8: (MISPRINT, "Table 1", _missing_digit),
        9: (CONTRADICTION, "4.1, Table 3", mounting.synthetic_distortion),
        10: (CONSISTENT, "4.1, Table 1", _border_distortion),
        11: (OPEN, "4.1", partial(correlations, run.correlations)),
        12: (OPEN, "Table 3", mounting.angle_sigmas),
        13: (OPEN, "Tables 1 and 3", mounting.variance_factors),
        14: (CONSISTENT, "Table 3", partial(mounting.lever_arm, run.absorbed)),
        15: (OPEN, "Table 3", mounting.phi_difference),
        16: (OPEN, "Table 1", _reference_camera),
        17: (CONSISTENT, "Tables 1 and 2", _coverage),
        18: (CONTRADICTION, "abstract, Table 4", validation.headline),
        19: (OPEN, "2.2, 3.2", _one_direction),
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
    return _table(sorted(wrong, key=lambda finding: kinds.index(finding.kind)))


def consistent(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return the findings that the paper's numbers agree, as a table."""
    return _table([finding for finding in findings if finding.kind == CONSISTENT])


def _table(findings: Sequence[Finding]) -> pd.DataFrame:
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
    given = [f"{100 * s(f'{name}_gsd_m'):.0f}" for name in names]
    scale = paper.pixel_mm("SYN") / paper.value(3, "f_mm", "single_step")
    return (
        "3.2, 4.3",
        f"ground pixels {given[0]} and {given[1]} cm in block 2, {given[2]} cm in block 3",
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


def _units() -> tuple[str, str, str]:
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


def _one_direction() -> tuple[str, str, str]:
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
