"""Tables and sentences on the quality of the synthetic image (section 4.1)."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from acx4book.chapters.beyond.image_quality.deviations import Deviations, residuals_px, zones
from acx4book.chapters.beyond.image_quality.examined import (
    Examined,
    TargetErrors,
    largest_decentring,
    largest_radial,
    rms_of_coordinates,
)
from acx4book.chapters.beyond.image_quality.known_exposure import KnownExposure
from acx4book.chapters.beyond.image_quality.wrong_heads import FrameErrors
from acx4book.chapters.synthetic_image.tables import WAYS
from acx4book.paper import printed
from acx4book.typesetting.plain_text import Markup
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.expected import Array, Mask
from acx4lib.least_squares.statistical.distributions import chi2_sf

NAMES: Mapping[str, str] = {"true": "true orientation", **WAYS}
"""What the orientations of `wrong_heads.every_refinement` are called."""

ZONE_FORMATS = {"Mean, columns (px)": "+.3f", "Mean, rows (px)": "+.3f"}

SMALL_P = 0.01
"""Probability below which what is common to parts of the frame is not called noise."""

# --- the true orientation --------------------------------------------------------------------


def zone_table(known: KnownExposure, examined: Examined) -> pd.DataFrame:
    """Return the deviations of an image from geometry, by parts of the frame.

    Parameters
    ----------
    known : KnownExposure
    examined : Examined

    Returns
    -------
    DataFrame
        Pixels of the full-size synthetic image; the RMS in those of the picture at hand as well.
    """
    left = _not_geometry(examined)
    every = np.ones(len(left), dtype=bool)
    parts = zones(known.orientation, known.synthetic, examined.found.ideal)
    rows = {"whole frame": every, **parts}
    return pd.DataFrame(
        [_zone_row(name, left[own], known.reduce) for name, own in rows.items() if own.any()]
    )


def _zone_row(name: str, left: Array, reduce: int) -> dict[str, object]:
    length = np.hypot(*left.T)
    rms = rms_of_coordinates(left)
    return {
        "Part": name,
        "Points": len(left),
        "RMS (px)": f"{rms:.3f}",
        "RMS (px of the picture)": f"{rms / reduce:.3f}",
        "99 % (px)": f"{np.quantile(length, 0.99):.2f}",
        "Largest (px)": f"{length.max():.2f}",
        "Mean, columns (px)": left[:, 0].mean(),
        "Mean, rows (px)": left[:, 1].mean(),
    }


def acceptance_sentence(known: KnownExposure, examined: Examined) -> str:
    """Say whether measured points are where geometry puts them, as well as matching can tell."""
    found = examined.found
    left = _not_geometry(examined)
    cells = _cells(known, found.ideal, left)
    means = np.array([d.mean(axis=0) for d in cells])
    noise = np.array([d.var(axis=0) / len(d) for d in cells])
    expected = np.sqrt(noise.mean())
    excess, p = common_px(known, examined)
    chi_square = float(np.sum(means**2 / noise))
    relief = np.hypot(*examined.geometry_px.T)
    return (
        f"Of {len(found)} points, the matching promises {_rms_sigma(found):.3f} px and leaves "
        f"{rms_of_coordinates(left):.3f} px in a coordinate, which is "
        f"{rms_of_coordinates(left) / known.reduce:.3f} px of the pictures at hand. Parallax by "
        f"relief is up to {relief.max():.2f} px and was taken off: the ground is "
        f"{known.height_m:.0f} m below and varies by {known.relief_m:.0f} m. What is common to a "
        f"part of the frame is much smaller: the means of {len(means)} parts have an RMS of "
        f"{rms_of_coordinates(means):.3f} px, where noise alone makes {expected:.3f} px: "
        f"$\\chi^2$ = {chi_square:.1f} with {means.size} degrees of freedom, *p* = {p:.2g}. "
        f"Deviations of neighbours correlate by {_of_neighbours(found.ideal, left):.2f}. "
        + (f"A common error of about {excess:.3f} px is no noise. " if p < SMALL_P else "")
        + f"The mean over all points is {_signed(left.mean(axis=0))} px."
    )


def common_px(known: KnownExposure, examined: Examined) -> tuple[float, float]:
    """Return what the means of parts of the frame have beyond noise, px, and the test's p value."""
    cells = _cells(known, examined.found.ideal, _not_geometry(examined))
    means = np.array([d.mean(axis=0) for d in cells])
    noise = np.array([d.var(axis=0) / len(d) for d in cells])
    excess = np.sqrt(max(float(np.mean(means**2 - noise)), 0.0))
    return float(excess), float(chi2_sf(float(np.sum(means**2 / noise)), means.size))


def _of_neighbours(colrow: Array, d: Array) -> float:
    """Return the correlation of the deviations of each point and its nearest neighbour."""
    nearest = np.asarray(KDTree(colrow).query(colrow, k=[2])[1])[:, 0]
    return float(np.corrcoef(d.ravel(), d[nearest].ravel())[0, 1])


def _rms_sigma(found: Deviations) -> float:
    return float(np.sqrt(np.mean(found.sigma_px**2)))


def _cells(known: KnownExposure, colrow: Array, d: Array, *, per_side: int = 8) -> list[Array]:
    """Return the vectors of each cell of the frame that has enough of them to be averaged."""
    size = max(known.synthetic.width_px, known.synthetic.height_px) / per_side
    col, row = np.floor(colrow.T / size).astype(int)
    idx = row * per_side + col
    own: list[Mask] = [idx == i for i in np.unique(idx)]
    return [d[one] for one in own if one.sum() >= 10]


def _signed(values: Array) -> str:
    return ", ".join(f"{value:+.3f}" for value in values)


# --- a calibration with errors ---------------------------------------------------------------


def way_table(
    examined: Mapping[str, Examined], geometry: Mapping[str, Mapping[str, float]]
) -> pd.DataFrame:
    """Return what is wrong with the image of every orientation, pixels beside geometry.

    Parameters
    ----------
    examined : mapping of str to Examined
        By the names of `NAMES`.
    geometry : mapping of str to mapping
        As `examined.geometry_errors` returns it.

    Returns
    -------
    DataFrame
        RMS of a coordinate: of the deviations, of what an exterior orientation leaves, of what a
        lens leaves as well; full-size px, geometry in parentheses.
    """
    return pd.DataFrame(
        [
            {
                "Heads": NAMES[name],
                "RMS (px)": _beside(rms_of_coordinates(one.found.d_px), geometry[name]["rms_px"]),
                "Oriented (px)": _beside(left_px(one, "oriented"), geometry[name]["oriented_px"]),
                "Calibrated (px)": _beside(
                    left_px(one, "calibrated"), geometry[name]["calibrated_px"]
                ),
                "Radial (px)": _beside(
                    largest_radial(one.fits["calibrated"]), geometry[name]["radial_px"]
                ),
            }
            for name, one in examined.items()
        ]
    )


def _beside(pixels: float, geometry: float) -> str:
    return f"{pixels:.2f} ({geometry:.2f})"


def left_px(examined: Examined, step: str) -> float:
    """Return the RMS of a coordinate that a bundle of the image leaves, px."""
    return rms_of_coordinates(residuals_px(examined.fits[step]))


def lens_fits(examined: Mapping[str, Examined]) -> dict[str, Bundle]:
    """Return the self-calibrations with a lens of all but the unrefined orientation."""
    return {name: one.fits["calibrated"] for name, one in examined.items() if name != "before"}


def agreement_sentence(examined: Mapping[str, Examined]) -> str:
    """Say how well measured deviations follow the geometry of the wrong orientations."""
    wrong = {name: one for name, one in examined.items() if name != "true"}
    left = {name: rms_of_coordinates(_not_geometry(one)) for name, one in wrong.items()}
    far = max(wrong.values(), key=lambda one: np.hypot(*one.geometry_px.T).max())
    worst, of_true = max(left.values()), rms_of_coordinates(_not_geometry(examined["true"]))
    return (
        f"Pixels agree with the geometry: deviations of up to "
        f"{np.hypot(*far.geometry_px.T).max():.1f} px are measured as {_slope(far):.3f} times "
        f"what they are, and never more than {worst:.3f} px are left in a coordinate, "
        f"where the true orientation leaves {of_true:.3f} px."
    )


def _not_geometry(one: Examined) -> Array:
    return one.found.d_px - one.geometry_px


def _slope(one: Examined) -> float:
    """Return measured deviations over those of geometry, by least squares."""
    return float(np.sum(one.geometry_px * one.found.d_px) / np.sum(one.geometry_px**2))


def acceptance_fields(examined: Examined) -> dict[str, Deviations]:
    """Return deviations as measured, as geometry has them, and what is between, by title."""
    found, geometry = examined.found, examined.geometry_px
    return {
        "Measured": found,
        "Parallax by relief": replace(found, d_px=geometry),
        "What is left": replace(found, d_px=_not_geometry(examined)),
    }


def self_calibration_fields(examined: Mapping[str, Examined]) -> dict[str, Deviations]:
    """Return what is left step by step for the paper's refinement and for ours, by title."""
    shown = {"mean shift": ("Mean differences", "Mean"), "rotations": ("Three rotations", "Turned")}
    fields = {}
    for name, (title, short) in shown.items():
        one = examined[name]
        fields[title] = one.found
        for step, words in (("oriented", "then oriented"), ("calibrated", "and with a lens")):
            left = residuals_px(one.fits[step])
            fields[f"{short}, {words}"] = replace(one.found, d_px=left)
    return fields


def self_calibration_sentence(examined: Examined) -> str:
    """Say what the self-calibration of a perfect image finds, and what it cannot tell apart."""
    lens, interior = examined.fits["calibrated"], examined.fits["interior"]
    values = {p.name: p for p in parameters(from_bundle(lens))}
    t = max(abs(values[name].value) / values[name].sigma for name in ("p1", "p2"))
    f = next(p for p in parameters(from_bundle(interior)) if p.name == "f_mm")
    held = lens.cameras[0].interior.f
    return (
        "In the image of the true orientation it finds a radial distortion of "
        f"{largest_radial(lens):.2f} px at most and a decentring of "
        f"{largest_decentring(lens):.2f} px in the corner ($p_1$, $p_2$ up to {t:.1f} "
        "standard deviations), and leaves the residuals as they "
        f"were: {left_px(examined, 'oriented'):.3f} and {left_px(examined, 'calibrated'):.3f} px. "
        f"Only relief tells $f$ from the flying height in one image: freed, it becomes "
        f"{f.value:.3f} ± {f.sigma:.3f} mm instead of {held:g} mm, because the lenses "
        "of the heads are not in one place, and takes nothing more off the residuals."
    )


# --- beside the paper ------------------------------------------------------------------------


def paper_sentence(examined: Mapping[str, Examined], known: KnownExposure) -> str:
    """Say what the paper found, and what ours is with the paper's refinement and with ours."""
    um, px = printed.statement("synthetic_quality_um"), printed.statement("synthetic_quality_px")
    border = printed.statement("synthetic_border_distortion_px")
    pixel_um = 1000 * known.synthetic.pixel_mm
    found = [
        f"{pixel_um * left_px(one, 'oriented'):.1f} µm ({left_px(one, 'oriented'):.2f} px) and "
        f"{largest_radial(one.fits['calibrated']):.1f} px {words}"
        for one, words in (
            (examined["mean shift"], "after the paper's mean differences"),
            (examined["rotations"], "after three rotations of each head"),
        )
    ]
    return (
        f"The paper states residuals of about {um:g} µm ({px:g} px) and a radial distortion "
        f"close to {border:g} px at the border, not significant in its decentring. Here residuals "
        f"and radial distortion are {found[0]}, and {found[1]}; the noise of matching at "
        f"this size, {left_px(examined['true'], 'oriented'):.2f} px, is part of the former."
    )


def target_sentence(targets: TargetErrors, draws: pd.DataFrame) -> str:
    """Say what radial distortion errors of measurement invent, beside the paper's reading."""
    border = printed.statement("synthetic_border_distortion_px")
    low, high = np.quantile(targets.radial_px, (0.5, 0.95))
    more = float(np.mean(targets.radial_px >= border))
    shifted = draws.loc[draws["refinement"] == "mean shift", "radial_px"]
    return (
        f"The paper attributes its {border:g} px to the measurement of image points. That alone "
        f"could be: the {targets.n_targets} targets in this one image, each measured with "
        f"{targets.sigma_px:g} px, invent a radial distortion of {low:.1f} px in half of "
        f"{len(targets.radial_px)} trials and of more than {high:.1f} px in one of twenty, where "
        f"there is none; it reaches {border:g} px in {100 * more:.0f} % of them, and shrinks by √n "
        "with n images. The drawn calibrations reach it, after mean differences, in "
        f"{100 * float(np.mean(shifted >= border)):.0f} % of draws."
    )


def draw_table(draws: pd.DataFrame) -> pd.DataFrame:
    """Return what drawn calibrations do to the synthetic image: medians, and 95 % in parentheses.

    Parameters
    ----------
    draws : DataFrame
        As `examined.drawn_errors` returns it.
    """
    shown = {
        "rms_px": "RMS (px)",
        "oriented_px": "Oriented (px)",
        "calibrated_px": "Calibrated (px)",
        "interior_px": Markup("And $f$, $x_p$, $y_p$ (px)"),
        "radial_px": "Radial (px)",
    }
    rows = []
    for name, own in draws.groupby("refinement", sort=False):
        middle, high = own[list(shown)].median(), own[list(shown)].quantile(0.95)
        cells = {title: f"{middle[key]:.2f} ({high[key]:.2f})" for key, title in shown.items()}
        rows.append({"Heads": NAMES[str(name)], **cells})
    return pd.DataFrame(rows)


def draw_sentence(draws: pd.DataFrame) -> str:
    """Say which part of the errors a later adjustment takes up, and what nothing takes up."""
    middle = draws.groupby("refinement")[["rms_px", "oriented_px", "calibrated_px"]].median()
    shift, turn = (middle.loc[name].to_dict() for name in ("mean shift", "rotations"))
    return (
        f"By the medians of {draws['draw'].nunique()} draws, an exterior orientation, and with it "
        f"a boresight, takes up {_share(shift, 'rms_px', 'oriented_px')} of the squared errors "
        f"after mean differences, and {_share(turn, 'rms_px', 'oriented_px')} after three "
        f"rotations. Of the rest a lens takes up {_share(shift, 'oriented_px', 'calibrated_px')} "
        f"and {_share(turn, 'oriented_px', 'calibrated_px')}; {shift['calibrated_px']:.2f} and "
        f"{turn['calibrated_px']:.2f} px stay in a coordinate, because they change from head to "
        "head, as no lens does."
    )


def _share(medians: Mapping[Hashable, float], before: str, after: str) -> str:
    """Return by how much squared errors shrink from one step to another, in words."""
    return f"{100 * (1 - (medians[after] / medians[before]) ** 2):.0f} %"


def repaired(found: Mapping[str, Mapping[str, FrameErrors]]) -> pd.DataFrame:
    """Return what the ways to refine make of wrong heads, as `wrong_heads.repaired` returns it."""
    names = WAYS | {"before": "nothing"}
    return pd.DataFrame(
        [
            {"Errors": errors, "Refined by": names[way], **_in_pixels(one)}
            for errors, ways in found.items()
            for way, one in ways.items()
        ]
    )


def _in_pixels(found: FrameErrors) -> dict[str, str]:
    return {
        "Overlaps, RMS (px)": f"{np.median(found.overlap_rms_px):.3f}",
        "at most (px)": f"{np.median(found.overlap_largest_px):.3f}",
        "Frame, RMS (px)": f"{np.median(found.frame_rms_px):.3f}",
        "at most in the frame (px)": f"{np.median(found.frame_largest_px):.3f}",
    }
