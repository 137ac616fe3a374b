"""Numbers on the quality of the synthetic image (section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import KDTree

from acx4book.chapters.image_quality.deviations import (
    Deviations,
    FrameErrors,
    KnownExposure,
    residuals_px,
    zones,
)
from acx4book.chapters.image_quality.examined import (
    Examined,
    largest_decentring,
    largest_radial,
    rms_of_coordinates,
)
from acx4book.chapters.synthetic_image.tables import WAYS
from acx4book.typesetting import style
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import INTERIOR, Camera, correct_jacobian, xy_from_colrow
from acx4lib.least_squares.statistics import chi2_sf

NAMES: Mapping[str, str] = {"true": "true orientation", **WAYS}
"""Names for readers of the orientations of `deviations.every_refinement`."""

PER_SIDE = 8
"""Cells along the longer side, in which points are taken together."""


# --- the true orientation --------------------------------------------------------------------


def zone_table(known: KnownExposure, examined: Examined) -> pd.DataFrame:
    """Return the deviations of an image from geometry, by parts of the frame.

    Returns
    -------
    DataFrame
        Pixels of the full-size synthetic image; the RMS in those of the picture at hand as well.
    """
    residuals = _not_geometry(examined)
    every = np.ones(len(residuals), dtype=bool)
    parts = zones(known.orientation, known.synthetic, examined.found.ideal)
    rows = {"whole frame": every, **parts}
    table = pd.DataFrame.from_dict(
        {
            name: _zone_row(residuals[within], known.reduce)
            for name, within in rows.items()
            if within.any()
        },
        orient="index",
    ).astype({"Points": int})
    table.index.name = "part"
    table.attrs["formats"] = {
        **dict.fromkeys(("RMS (px)", "RMS (px of the picture)"), ".3f"),
        **dict.fromkeys(("99 % (px)", "Largest (px)"), ".2f"),
        **dict.fromkeys(("Mean, columns (px)", "Mean, rows (px)"), "+.3f"),
    }
    return table


def _zone_row(left: Array, reduce: int) -> dict[str, float]:
    length = np.hypot(*left.T)
    rms = rms_of_coordinates(left)
    return {
        "Points": len(left),
        "RMS (px)": rms,
        "RMS (px of the picture)": rms / reduce,
        "99 % (px)": float(np.quantile(length, 0.99)),
        "Largest (px)": float(length.max()),
        "Mean, columns (px)": float(left[:, 0].mean()),
        "Mean, rows (px)": float(left[:, 1].mean()),
    }


def acceptance(known: KnownExposure, examined: Examined) -> dict[str, object]:
    """Test whether measured points agree with geometry, within the accuracy of matching.

    Returns
    -------
    dict of str to object
        The number ``n`` of points, ``promised`` and ``left``, px in a coordinate; the ``means`` of
        ``parts`` of the frame, RMS, and what ``noise`` alone makes of it; ``chi_square`` with
        ``degrees`` of freedom and ``p``; what the means have ``beyond`` noise; the correlation of
        ``neighbours``; the ``mean`` of all.
    """
    measured, residuals = examined.found, _not_geometry(examined)
    cells = _cells(known, measured.ideal, residuals)
    means = np.array([d.mean(axis=0) for d in cells])
    noise = np.array([d.var(axis=0) / len(d) for d in cells])
    chi_square = float(np.sum(means**2 / noise))
    return {
        "n": len(measured),
        "promised": float(np.sqrt(np.mean(measured.sigma_px**2))),
        "left": rms_of_coordinates(residuals),
        "parts": len(means),
        "means": rms_of_coordinates(means),
        "noise": float(np.sqrt(noise.mean())),
        "chi_square": chi_square,
        "degrees": means.size,
        "p": float(chi2_sf(chi_square, means.size)),
        "beyond": float(np.sqrt(max(float(np.mean(means**2 - noise)), 0.0))),
        "neighbours": _of_neighbours(measured.ideal, residuals),
        "mean": residuals.mean(axis=0),
    }


def _of_neighbours(colrow: Array, d: Array) -> float:
    """Return the correlation of the deviations of each point and its nearest neighbour."""
    nearest = np.asarray(KDTree(colrow).query(colrow, k=[2])[1])[:, 0]
    return float(np.corrcoef(d.ravel(), d[nearest].ravel())[0, 1])


def _cells(known: KnownExposure, colrow: Array, d: Array) -> list[Array]:
    """Return the vectors of each cell of the frame that has enough of them to average."""
    size = max(known.synthetic.width_px, known.synthetic.height_px) / PER_SIDE
    col, row = np.floor(colrow.T / size).astype(int)
    idx = row * PER_SIDE + col
    masks: list[Mask] = [idx == i for i in np.unique(idx)]
    return [d[mask] for mask in masks if mask.sum() >= 10]


# --- a calibration with errors ---------------------------------------------------------------


def way_table(
    examined: Mapping[str, Examined], geometry: Mapping[str, Mapping[str, float]]
) -> pd.DataFrame:
    """Return the errors of the image of every orientation, measured beside geometry.

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
        lens leaves as well; the largest radial distortion that is found. Each as ``measured`` and
        ``by geometry``, full-size px.
    """
    rows = {
        NAMES[name]: {
            ("RMS (px)", "measured"): rms_of_coordinates(image.found.d_px),
            ("RMS (px)", "by geometry"): geometry[name]["rms_px"],
            ("Oriented (px)", "measured"): _left_px(image, "oriented"),
            ("Oriented (px)", "by geometry"): geometry[name]["oriented_px"],
            ("Calibrated (px)", "measured"): _left_px(image, "calibrated"),
            ("Calibrated (px)", "by geometry"): geometry[name]["calibrated_px"],
            ("Radial (px)", "measured"): largest_radial(image.fits["calibrated"]),
            ("Radial (px)", "by geometry"): geometry[name]["radial_px"],
        }
        for name, image in examined.items()
    }
    table = pd.DataFrame(rows).T
    table.index.name = "heads"
    table.attrs["formats"] = {", ".join(column): ".2f" for column in table.columns}
    return table


def _left_px(examined: Examined, step: str) -> float:
    """Return the RMS residual of a coordinate after a bundle of the image, px."""
    return rms_of_coordinates(residuals_px(examined.fits[step]))


def lens_fits(examined: Mapping[str, Examined]) -> dict[str, Bundle]:
    """Return the self-calibrations with a lens of all but the unrefined orientation."""
    return {name: image.fits["calibrated"] for name, image in examined.items() if name != "before"}


def agreement(examined: Mapping[str, Examined]) -> dict[str, float]:
    """Return how well measured deviations follow the geometry of the wrong orientations.

    Returns
    -------
    dict of str to float
        The largest deviation (``far``, px) of any orientation; the ``slope`` of the measured ones
        over those of geometry there, by least squares; the most that is left in a coordinate of
        wrong orientations (``worst``), and of the true one (``of_true``).
    """
    residual_rms = {
        name: rms_of_coordinates(_not_geometry(image)) for name, image in examined.items()
    }
    wrong = [image for name, image in examined.items() if name != "true"]
    far = max(wrong, key=lambda image: np.hypot(*image.geometry_px.T).max())
    by_geometry, measured = far.geometry_px, far.found.d_px
    return {
        "far": float(np.hypot(*by_geometry.T).max()),
        "slope": float(np.sum(by_geometry * measured) / np.sum(by_geometry**2)),
        "worst": max(value for name, value in residual_rms.items() if name != "true"),
        "of_true": residual_rms["true"],
    }


def _not_geometry(image: Examined) -> Array:
    return image.found.d_px - image.geometry_px


def acceptance_fields(examined: Examined) -> dict[str, Deviations]:
    """Return the deviations measured, predicted by geometry, and their difference, by title."""
    measured, geometry = examined.found, examined.geometry_px
    return {
        "Measured": measured,
        "Parallax by relief": replace(measured, d_px=geometry),
        "What is left": replace(measured, d_px=_not_geometry(examined)),
    }


def self_calibration_fields(examined: Mapping[str, Examined]) -> dict[str, Deviations]:
    """Return the residuals after each step, for the paper's refinement and for ours, by title."""
    shown = {"mean shift": ("Mean differences", "Mean"), "rotations": ("Three rotations", "Turned")}
    fields = {}
    for name, (title, short) in shown.items():
        image = examined[name]
        fields[title] = image.found
        for step, words in (("oriented", "then oriented"), ("calibrated", "and with a lens")):
            residuals = residuals_px(image.fits[step])
            fields[f"{short}, {words}"] = replace(image.found, d_px=residuals)
    return fields


def self_calibration(examined: Examined) -> dict[str, float]:
    """Return distortion, residuals and focal length of the self-calibration of an image.

    Returns
    -------
    dict of str to float
        The largest ``radial`` distortion and ``decentring``, px, and ``t`` of the latter; what the
        exterior orientation and the lens leave (``oriented``, ``calibrated``, px); ``f`` where it
        is freed, its ``sigma``, and the one that was ``held``, mm.
    """
    lens, interior = examined.fits["calibrated"], examined.fits["interior"]
    values = {p.name: p for p in parameters(from_bundle(lens))}
    f = next(p for p in parameters(from_bundle(interior)) if p.name == "f_mm")
    return {
        "radial": largest_radial(lens),
        "decentring": largest_decentring(lens),
        "t": max(abs(values[name].value) / values[name].sigma for name in ("p1", "p2")),
        "oriented": _left_px(examined, "oriented"),
        "calibrated": _left_px(examined, "calibrated"),
        "f": f.value,
        "sigma": f.sigma,
        "held": lens.cameras[0].interior.f,
    }


# --- many calibrations -----------------------------------------------------------------------


def draw_table(draws: pd.DataFrame, columns: Mapping[str, str]) -> pd.DataFrame:
    """Return errors of the synthetic image by drawn calibrations: medians and 95 % quantiles.

    Parameters
    ----------
    draws : DataFrame
        As `examined.drawn_errors` returns it.
    columns : mapping of str to str
        Titles by its columns.
    """
    by_way = draws.groupby("refinement", sort=False)[list(columns)]
    by_statistic = {"median": by_way.median(), "95 %": by_way.quantile(0.95)}
    table = pd.DataFrame(
        {
            (title, statistic): by_statistic[statistic][key]
            for key, title in columns.items()
            for statistic in by_statistic
        }
    ).rename(index=NAMES)
    table.index.name = "heads"
    table.attrs["formats"] = {", ".join(column): ".2f" for column in table.columns}
    return table


def repaired(found: Mapping[str, Mapping[str, FrameErrors]]) -> pd.DataFrame:
    """Return the errors of `deviations.repaired` before and after every refinement, as a table."""
    names = WAYS | {"before": "nothing"}
    rows = {
        (errors, names[way]): {
            "Overlaps, RMS (px)": np.median(draws.overlap_rms_px),
            "at most (px)": np.median(draws.overlap_largest_px),
            "Frame, RMS (px)": np.median(draws.frame_rms_px),
            "at most in the frame (px)": np.median(draws.frame_largest_px),
        }
        for errors, ways in found.items()
        for way, draws in ways.items()
    }
    index = pd.MultiIndex.from_tuples(rows, names=["errors", "refined by"])
    table = pd.DataFrame(list(rows.values()), index=index)
    table.attrs["formats"] = dict.fromkeys(table, ".3f")
    return table


# --- The part of the synthetic image's seams that one camera with smooth distortion takes up
#
# Chapter 12 stored the residuals of a single step over the synthetic image, of measurements
# without noise, at two flying heights (``make chain``). All effects of one camera are
# fitted to them.


STORED = Path(str(resources.files("acx4book.chapters") / "stored"))

RADIAL = ("f", "xp", "yp", "k1", "k2", "k3")
BROWN = (*RADIAL, "p1", "p2")

WAVES = ((1, 0), (0, 1), (1, 1), (1, -1))
"""Whole waves along both sides of the image: a Fourier series of the first order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """Residuals over the synthetic image, at two flying heights.

    Attributes
    ----------
    camera : Camera
        The synthetic one.
    colrow, d_px : ndarray, shape (n, 2)
        Places and residuals, px.
    head : ndarray of str, shape (n,)
        From which a pixel is taken.
    height_m : ndarray, shape (n,)
        Flying height above the ground.
    """

    camera: Camera
    colrow: Array
    d_px: Array
    head: np.ndarray
    height_m: Array


def pattern(camera: Camera) -> Pattern:
    """Return the stored residuals of chapter 12.

    Parameters
    ----------
    camera : Camera
        The synthetic one.
    """
    table = pd.read_csv(STORED / "closed_chain_pattern.csv")
    return Pattern(
        camera=camera,
        colrow=table[["col_px", "row_px"]].to_numpy(),
        d_px=table[["d_col_px", "d_row_px"]].to_numpy(),
        head=table["head"].to_numpy(),
        height_m=table["height_m"].to_numpy(dtype=float),
    )


def effects(pattern: Pattern, free: tuple[str, ...]) -> Array:
    """Return the effects of interior orientation, boresight and lever arm, px per unit.

    Parameters
    ----------
    pattern : Pattern
    free : tuple of str
        Interior parameters, the columns before three of the boresight and three of the lever arm.

    Returns
    -------
    A : ndarray, shape (n, 2, len(free) + 6)
        The effect of the lever arm is in proportion to 1 / H.
    """
    camera = pattern.camera
    xy, f = xy_from_colrow(camera, pattern.colrow), camera.interior.f
    interior = correct_jacobian(camera.interior, xy)
    interior[:, :, 0] = xy / f
    by_interior = interior[:, :, [INTERIOR.index(name) for name in free]]
    (x, y), one, zero = xy.T, np.ones(len(xy)), np.zeros(len(xy))
    boresight = [[f + x * x / f, x * y / f, -y], [x * y / f, f + y * y / f, x]]
    lever = [[f * one, zero, x], [zero, f * one, y]]
    turned, moved = (np.moveaxis(np.array(part), 2, 0) for part in (boresight, lever))
    mm = np.concatenate([by_interior, turned, moved / pattern.height_m[:, None, None]], axis=2)
    return mm / np.array([camera.pixel_mm, -camera.pixel_mm])[:, None]


def waves(pattern: Pattern) -> Array:
    """Return sixteen terms of a Fourier series over the image, shape (n, 2, 16).

    Notes
    -----
    After Tang, Fritsch and Cramer [1]_: cos and sin of m u + n v, in x and in y, where u and v
    go from -pi to pi over the image. The constant term is left to the principal point.

    References
    ----------
    .. [1] R. Tang, D. Fritsch and M. Cramer, "New rigorous and flexible Fourier self-calibration
       models for airborne camera calibration", ISPRS Journal 71, 2012.
    """
    camera = pattern.camera
    size = np.array([camera.width_px, camera.height_px])
    phase = 2 * np.pi * (pattern.colrow / size - 0.5) @ np.array(WAVES).T
    terms = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    none = np.zeros_like(terms)
    return np.stack([np.hstack([terms, none]), np.hstack([none, terms])], axis=1)


def left(d_px: Array, A: Array) -> Array:
    """Return the residuals of vectors after a fit by least squares, shape (n, 2).

    Parameters
    ----------
    d_px : ndarray, shape (n, 2)
    A : ndarray, shape (n, 2, k)
        Effect of each unknown; columns may depend on each other.
    """
    rows = A.reshape(-1, A.shape[2])
    rows = rows / np.linalg.norm(rows, axis=0)
    coefficients = np.linalg.lstsq(rows, d_px.ravel(), rcond=1e-9)[0]
    return d_px - (rows @ coefficients).reshape(d_px.shape)


def left_by_heads(pattern: Pattern, A: Array) -> Array:
    """Return the residuals where each head has unknowns of its own."""
    out = np.empty_like(pattern.d_px)
    for name in np.unique(pattern.head):
        in_head = pattern.head == name
        out[in_head] = left(pattern.d_px[in_head], A[in_head])
    return out


def left_table(pattern: Pattern, fields: dict[str, Array]) -> pd.DataFrame:
    """Return the RMS residual of a coordinate, by fitted model and flying height, px."""
    return pd.DataFrame(
        {
            f"From {h:.0f} m (px)": [
                np.sqrt(np.mean(d[pattern.height_m == h] ** 2)) for d in fields.values()
            ]
            for h in np.unique(pattern.height_m)
        },
        index=pd.Index(fields, name="Fitted"),
    )


def left_figure(pattern: Pattern, fields: dict[str, Array]) -> Figure:
    """Draw residuals at the lower flying height, in the colours of the heads, to one scale."""
    low = pattern.height_m == pattern.height_m.min()
    lower = {title: d[low] for title, d in fields.items()}
    key = style.round_length(max(float(np.hypot(*d.T).max()) for d in lower.values()))
    names, head = np.unique(pattern.head[low], return_inverse=True)
    with style.applied():
        fig, axes = style.subplots(1, len(lower), figsize=(style.WIDTH, 3.9), sharey=True)
        for ax, (title, d) in zip(axes, lower.items(), strict=True):
            _draw(ax, pattern.camera, pattern.colrow[low], d / key, head)
            style.heading(ax, title[:1].upper() + title[1:], f"rms {np.sqrt(np.mean(d**2)):.2f} px")
        axes[0].set_ylabel("row (px)")
        handles = [Line2D([], [], color=style.colour(k), label=n) for k, n in enumerate(names)]
        arrows = Line2D([], [], ls="", label=f"distance of arrows: {key:g} px")
        style.legend_below(fig, [*handles, arrows])
    return fig


def _draw(ax: Axes, camera: Camera, colrow: Array, in_key: Array, head: np.ndarray) -> None:
    """Draw every second node in rows and columns."""
    column, row = (np.unique(x, return_inverse=True)[1] for x in colrow.T)
    some = (column % 2 == 0) & (row % 2 == 0)
    gap = 2 * float(np.min(np.diff(np.unique(colrow[:, 0]))))
    ax.quiver(
        *colrow[some].T,
        *(gap * in_key[some]).T,
        color=[style.colour(k) for k in head[some]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.007,
        zorder=3,
    )
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal")
    ax.set(xlabel="column (px)", xticks=[0, 5000, 10000])
