"""Real pictures of cameras with five and ten heads, in flight.

Rigs from their metadata, heads turned by tie points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.spatial.transform import Rotation

from acx4book.reference import data
from acx4book.typesetting import style
from acx4book.typesetting.pictures import HALO
from acx4files.exchange import metadata
from acx4files.exchange import pictures as picture_folder
from acx4files.exchange.lens import FLIP
from acx4files.exchange.metadata import Head, Tags, read
from acx4files.flight.settings import camera_of
from acx4files.images.head_images import read_heads
from acx4lib import shown
from acx4lib.calibration.heads import RelativeOrientation, declared_orientation
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image import rendering
from acx4lib.synthetic_image.response import estimate_response
from acx4lib.tie_points.refinement import FREE, Refined, refine_by_rotations
from acx4lib.tie_points.search import ImageTies, find_ties, strongest_chain
from acx4lib.tie_points.ties import Overlap, overlaps

# --- The heads of one exposure: as their metadata declare them, and turned by tie points


TEN, FIVE = "rededge-dual", "rededge3-flight"
"""Sets of the reference data: ten heads of two rigs, and five of one."""

GREEN = "2 Green"
"""Reference head for the rotations of heads without angles of the factory."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Solved:
    """One exposure of real heads.

    Attributes
    ----------
    heads : tuple of Head
        The reference first.
    tags : tuple of Tags
        Of the picture of each.
    images : tuple of ndarray, shape (rows, cols, 1)
    height_m : float
        Of the metadata: over the sea, and so over ground that lies there.
    factory : RelativeOrientation
        As the metadata declare the heads.
    synthetic : Camera
    found : ImageTies
    fits : dict of str to Refined
        ``rotations``, and ``six`` with the places of the heads.
    """

    heads: tuple[Head, ...]
    tags: tuple[Tags, ...]
    images: tuple[Raster, ...]
    height_m: float
    factory: RelativeOrientation
    synthetic: Camera
    found: ImageTies
    fits: dict[str, Refined]

    @property
    def names(self) -> list[str]:
        """Return the names of the heads."""
        return [head.name for head in self.heads]

    @property
    def pixel_deg(self) -> float:
        """Return the angle of a pixel in the middle of the reference head, degrees."""
        camera = self.factory.heads[0]
        return float(np.degrees(camera.pixel_mm / camera.interior.f))

    def place(self, name: str) -> int:
        """Return the number of a head."""
        return self.names.index(name)

    def reference(self, k: int) -> int:
        """Return the reference head of another head's printed angles."""
        if all(head.reference is None for head in self.heads):
            return self.place(GREEN)
        named = [head.index for head in self.heads]
        reference = self.heads[k].reference
        return 0 if reference is None or self.leads(k) else named.index(reference)

    def leads(self, k: int) -> bool:
        """Tell whether a head is the reference of its rig."""
        return self.heads[k].reference in (None, self.heads[k].index)


@cache
def solved(files: str) -> Solved:
    """Return the heads of a set of the reference data, solved.

    Parameters
    ----------
    files : str
        `TEN` or `FIVE`.

    Raises
    ------
    ReferenceDataError
        Where a picture is missing, or is not the indexed one.
    """
    entries = [entry.file for entry in data.index() if entry.file.startswith(f"{files}/IMG")]
    paths = {path.name: path for path in map(data.path, entries)}
    imported = picture_folder.read_folder(data.folder() / files)
    cameras = {name: camera_of(name, t) for name, t in imported.settings["cameras"].items()}
    names, synthetic = imported.settings["synthetic"]["heads"], cameras[picture_folder.SYNTHETIC]
    factory = declared_orientation([cameras[name] for name in names], synthetic)
    images = imported.tables["heads/images.csv"]
    files_of = dict(zip(images["camera"], images["file"], strict=True))
    pictures = [paths[Path(files_of[name]).name] for name in names]
    tags = tuple(map(read, pictures))
    pixels = read_heads(pictures, factory.heads).images
    measured = find_ties(pixels, factory, synthetic)
    return Solved(
        heads=tuple(map(metadata.head_of, tags)),
        tags=tags,
        images=pixels,
        height_m=float(imported.tables["heads/trajectory.csv"]["height_m"][0]),
        factory=factory,
        synthetic=synthetic,
        found=measured,
        fits={way: refine_by_rotations(factory, measured.ties, free=way) for way in FREE},
    )


def here(files: str, *, folder: str = "") -> Solved | None:
    """Return the heads of a set; None where its pictures are not on this machine.

    Parameters
    ----------
    files : str
        `TEN` or `FIVE`.
    folder : str
        Folder of the reference data; if empty, the usual one.
    """
    with data.at(folder):
        return solved(files) if data.is_here(files) else None


def turned_deg(orientation: RelativeOrientation, k: int, reference: int) -> Array:
    """Return three rotations from the reference to a head, degrees; y down, z ahead.

    The vector of the rotation of a ray of the reference head into head `k`, as the independent
    trial has it.
    """
    R = rotation_from_opk(orientation.opk)
    flip = np.diag([*FLIP, -1.0])
    turned = flip @ R[k].T @ R[reference] @ flip
    return np.asarray(Rotation.from_matrix(turned).as_rotvec(degrees=True))


# --- The interpretations of `RigRelatives`, distinguished by pixels


READINGS: Mapping[str, tuple[str, bool]] = {
    "Rx(a) Ry(b) Rz(c), head to reference": ("XYZ", False),
    "Rz(c) Ry(b) Rx(a), head to reference": ("xyz", False),
    "Rx(a) Ry(b) Rz(c), reference to head": ("XYZ", True),
    "Rz(c) Ry(b) Rx(a), reference to head": ("xyz", True),
}
"""By meaning: the order of the three rotations, as in SciPy, and whether transposed."""


def relatives(files: str) -> pd.DataFrame:
    """Return the misfits at the ties of a head and its reference, a row for every interpretation.

    Returns
    -------
    DataFrame
        Reading; median misfit of all pairs, the least and the largest of a pair, px.
    """
    rig = solved(files)
    rows = []
    for reading, (order, transposed) in READINGS.items():
        medians = _misfits(rig, read_as(rig, order, transposed=transposed))
        rows.append(
            {
                "reading": reading,
                "median_px": float(np.median(medians)),
                "least_px": float(np.min(medians)),
                "largest_px": float(np.max(medians)),
            }
        )
    return pd.DataFrame(rows)


def read_as(found: Solved, order: str, *, transposed: bool) -> RelativeOrientation:
    """Return the heads with their angles in one of the interpretations."""
    flip = np.diag([*FLIP, -1.0])
    angles = [head.relatives_deg or (0.0, 0.0, 0.0) for head in found.heads]
    turned = np.stack(
        [flip @ Rotation.from_euler(order, a, degrees=True).as_matrix() @ flip for a in angles]
    )
    R = np.swapaxes(turned, 1, 2) if transposed else turned
    return replace(found.factory, opk=opk_from_rotation(R))


def _misfits(rig: Solved, orientation: RelativeOrientation) -> Array:
    """Return the median misfits of heads to the references of their rigs, px."""
    ties = rig.found.ties[~rig.fits["rotations"].rejected]
    referenced = [(k, rig.reference(k)) for k in range(len(rig.heads)) if not rig.leads(k)]
    wanted = {(min(pair), max(pair)) for pair in referenced}
    return np.array(
        [
            np.median(np.hypot(*overlap.d.T)) / rig.synthetic.pixel_mm
            for overlap in overlaps(ties, orientation)
            if (overlap.head_a, overlap.head_b) in wanted
        ]
    )


# --- The heads' rotations, beside those of the factory and of an independent trial


XYZ = ("x", "y", "z")


def rotations(files: str) -> pd.DataFrame:
    """Return a row for every head but the first.

    Returns
    -------
    DataFrame
        Head and reference; rotations, degrees; sigma of them by the loops of pairs, and the largest
        of the refinement, which counts how blocks of the frame differ; less the factory's, NaN
        without; less the trial's.
    """
    rig = solved(files)
    loops = _pair_sigma_deg(rig) * np.sqrt(2 / len(rig.heads))
    rows = []
    for k, name in enumerate(rig.names):
        reference = rig.reference(k)
        if k == reference:
            continue
        ours = turned_deg(rig.fits["rotations"].orientation, k, reference)
        rows.append(
            {
                "head": name,
                "reference": rig.names[reference],
                **_three("deg", ours),
                **_three("sigma_deg", loops),
                "blocks_sigma_deg": _blocks_sigma_deg(rig, k),
                **_three("minus_factory_deg", ours - _factory(rig, k, reference)),
                **_three("minus_trial_deg", ours - np.array(TRIAL[files][name])),
            }
        )
    return pd.DataFrame(rows)


def _three(name: str, values: Array) -> dict[str, float]:
    return {f"{axis}_{name}": float(v) for axis, v in zip(XYZ, values, strict=True)}


def _factory(rig: Solved, k: int, reference: int) -> Array:
    """Return the factory's rotations; NaN where it has none between the two."""
    known = bool(rig.heads[k].relatives_deg) and not rig.leads(k)
    return turned_deg(rig.factory, k, reference) if known else np.full(3, np.nan)


def _blocks_sigma_deg(rig: Solved, k: int) -> float:
    sigma = sigmas(rig.fits["rotations"].orientation.cov).reshape(-1, 6)[k, 3:]
    return float(np.degrees(sigma.max()))


# --- Which pairs of heads tie, and how well they fit when all heads are turned together


def pairs(files: str) -> pd.DataFrame:
    """Return a row for every pair of heads.

    Returns
    -------
    DataFrame
        Heads; corners with texture, those that found a partner, their share; mean and rms
        difference after the refinement, px; whether the pair is of the strongest chain.
    """
    rig = solved(files)
    chain = {(overlap.head_a, overlap.head_b) for overlap in strongest_chain(rig.found.overlaps)}
    differences = {(overlap.head_a, overlap.head_b): overlap for overlap in _differences(rig)}
    rows = []
    for overlap in rig.found.overlaps:
        pair = overlap.head_a, overlap.head_b
        d = (
            differences[pair].d / rig.synthetic.pixel_mm
            if pair in differences
            else np.full((1, 2), np.nan)
        )
        rows.append(
            {
                "head": rig.names[pair[0]],
                "other": rig.names[pair[1]],
                "textured": overlap.n_textured,
                "ties": overlap.n_ties,
                "share": overlap.n_ties / max(overlap.n_textured, 1),
                "mean_px": float(np.hypot(*d.mean(axis=0))),
                "rms_px": float(np.sqrt(np.mean(d**2))),
                "chain": pair in chain,
            }
        )
    return pd.DataFrame(rows)


def _differences(rig: Solved) -> list[Overlap]:
    """Return the differences of all pairs after the refinement by rotations."""
    fit = rig.fits["rotations"]
    return overlaps(rig.found.ties[~fit.rejected], fit.orientation)


def _pair_sigma_deg(rig: Solved) -> Array:
    """Return sigma of the rotation of one pair about x, y and z, degrees, from closed loops.

    Every pair of heads is turned once more by itself. The size of these rotations shows how much
    the pairs contradict each other; neighbouring ties share errors, which their number hides.
    """
    f = rig.factory.heads[0].interior.f
    turns = np.array([_turn(overlap, f) for overlap in _differences(rig)])
    redundancy = max(len(turns) - len(rig.heads) + 1, 1)
    return np.asarray(np.degrees(np.sqrt(np.sum(turns**2, axis=0) / redundancy)))


def _turn(overlap: Overlap, f: float) -> Array:
    """Return the rotation of rays (x, y, -f) that removes the differences of a pair, radians."""
    x, y = overlap.xy.T
    zero = np.zeros(len(x))
    by_x = np.stack([x * y / f, -f - x * x / f, -y])
    by_y = np.stack([f + y * y / f, -x * y / f, x + zero])
    A = np.concatenate([by_x.T, by_y.T])
    return np.asarray(np.linalg.lstsq(A, overlap.d.T.ravel(), rcond=None)[0])


# --- Parallax in the rotations: the heads stand apart, and the ground is near


BASES_M = (0.02, 0.03)
"""Usual distances of lenses in such a camera."""


def parallax(files: str) -> pd.DataFrame:
    """Return a row for every head that the factory oriented.

    Returns
    -------
    DataFrame
        Head and reference; how far the rotations lie from the factory's, as px along columns and
        rows in the middle of the image: `x_px`, `y_px` of rotations alone, `x_left_px`, `y_left_px`
        with the places of the heads free; the place relative to the reference that is then found,
        mm: `base_x_mm` along columns, `base_y_mm` against rows; height, m, and focal length, px.
    """
    rig = solved(files)
    rows = []
    for k in range(len(rig.heads)):
        if rig.leads(k):
            continue
        reference = rig.reference(k)
        turns = [_shift_px(rig, way, k, reference) for way in ("rotations", "six")]
        xyz = rig.fits["six"].orientation.xyz_mm
        base = 1000 * (xyz[k] - xyz[reference]) * rig.height_m / rig.factory.xyz_mm[0, 2]
        rows.append(
            {
                "head": rig.names[k],
                "reference": rig.names[reference],
                "x_px": turns[0][0],
                "y_px": turns[0][1],
                "x_left_px": turns[1][0],
                "y_left_px": turns[1][1],
                "base_x_mm": float(base[0]),
                "base_y_mm": float(base[1]),
                "height_m": rig.height_m,
                "f_px": float(1 / np.radians(rig.pixel_deg)),
            }
        )
    return pd.DataFrame(rows)


def _shift_px(rig: Solved, way: str, k: int, reference: int) -> tuple[float, float]:
    """Return the shift of a head's image against the factory's angles, px."""
    ours = turned_deg(rig.fits[way].orientation, k, reference)
    x, y, _ = (ours - turned_deg(rig.factory, k, reference)) / rig.pixel_deg
    # about y the image moves along columns, about x against rows
    return float(y), -float(x)


def predicted_px(base_m: float, *, height_m: float, f_px: float) -> float:
    """Return the shift between two heads that a base makes at a distance, px.

    Parameters
    ----------
    base_m, height_m : float
    f_px : float
        Focal length, px.
    """
    return f_px * base_m / height_m


# --- Falloff of heads with similar bands against each other: seen, and as the factory states it


PAIRS = (
    ("1 Blue", "6 Blue-444"),
    ("2 Green", "7 Green-531"),
    ("3 Red", "8 Red-650"),
    ("4 NIR", "10 Red edge-740"),
)
"""Heads of the two rigs whose bands are most alike."""

RINGS = np.arange(0.0, 801.0, 100.0)
"""Radii between which the ratios are averaged, px from the middle of the image."""

SEED = 4
_BLUR = 9


def vignetting(files: str) -> pd.DataFrame:
    """Return a row for every ring of every pair.

    Returns
    -------
    DataFrame
        Heads; radius, px; the first head's grey value over the second's, less that of the middle,
        in per cent: seen at the tie points, as the factory states it, and as the library's response
        of the heads has it.
    """
    rig = solved(files)
    return pd.concat([_pair(rig, *names) for names in PAIRS], ignore_index=True)


def _pair(rig: Solved, name: str, other: str) -> pd.DataFrame:
    k, m = sorted((rig.place(name), rig.place(other)))
    ties = rig.found.ties[~rig.fits["rotations"].rejected]
    ties = ties[(ties.head_a == k) & (ties.head_b == m)]
    observed = np.log(_grey(rig, k, ties.colrow_a) / _grey(rig, m, ties.colrow_b))
    stated = np.log(
        _vignetting_factory(rig, k, ties.colrow_a) / _vignetting_factory(rig, m, ties.colrow_b)
    )
    middle = 0.5 * (np.array([rig.synthetic.width_px, rig.synthetic.height_px]) - 1)
    radius = np.hypot(*(ties.colrow_a - middle).T)
    fitted = _response(rig, k, m, radius / np.hypot(*(middle + 0.5)))
    ring = np.digitize(radius, RINGS)
    rows = [
        {
            "head": rig.names[k],
            "other": rig.names[m],
            "radius_px": float(np.median(radius[ring == i])),
            "seen": 100 * float(np.median(observed[ring == i])),
            "factory": 100 * float(np.median(stated[ring == i])),
            "library": 100 * float(np.median(fitted[ring == i])),
        }
        for i in range(1, len(RINGS))
        if (ring == i).sum() >= 20
    ]
    table = pd.DataFrame(rows)
    for column in ("seen", "factory", "library"):
        table[column] -= table[column].iloc[0]
    return table


def _light(rig: Solved, k: int) -> Raster:
    """Return a head's image above its dark level."""
    dark = metadata.dark_level(rig.tags[k]) or 0.0
    return np.clip(rig.images[k].astype(np.int32) - round(dark), 1, None).astype(np.uint16)


def _grey(rig: Solved, k: int, colrow: Array) -> Array:
    """Return grey values above darkness, means over small windows."""
    blurred = cv2.blur(_light(rig, k)[..., 0].astype(np.float32), (_BLUR, _BLUR))
    col, row = np.rint(colrow).astype(int).T
    return np.asarray(blurred[row, col], float)


def _vignetting_factory(rig: Solved, k: int, colrow: Array) -> Array:
    stated = metadata.vignetting(rig.tags[k], colrow)
    return np.ones(len(colrow)) if stated is None else stated


def _response(rig: Solved, k: int, m: int, radius: Array) -> Array:
    """Return the logarithm of the ratio by the library's response, from grey values alone."""
    fit, two = rig.fits["rotations"].orientation, [k, m]
    pair = replace(
        fit,
        heads=tuple(fit.heads[i] for i in two),
        xyz_mm=fit.xyz_mm[two],
        opk=fit.opk[two],
        cov_joint=np.zeros((32, 32)),
    )
    images = [_light(rig, i) for i in two]
    rng = np.random.default_rng(SEED)
    response = estimate_response(images, pair, rig.synthetic, rng=rng).response
    (_, a_1, b_1), (_, a_2, b_2) = response.coefficients[:, 0]
    q = radius**2
    return np.asarray((a_1 - a_2) * q + (b_1 - b_2) * q**2)


# --- Results of an independent trial from the same pictures: SIFT, MAGSAC, three rotations a head
#
# Rotations about x, y and z from the reference head to the other, degrees; inliers; rms, px.


TRIAL: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    TEN: {
        "1 Blue": (-0.106, -0.154, -0.131),
        "3 Red": (0.225, 0.169, -0.016),
        "4 NIR": (0.047, -0.472, -0.132),
        "5 Red edge": (-0.120, -0.127, 0.018),
        "6 Blue-444": (-0.197, -0.345, -0.064),
        "7 Green-531": (-0.456, 0.108, 0.150),
        "8 Red-650": (-0.034, 0.069, 0.004),
        "9 Red edge-705": (-0.032, -0.236, -0.228),
        "10 Red edge-740": (-0.137, -0.254, -0.264),
    },
    FIVE: {
        "1 Blue": (0.086, 0.154, 0.185),
        "3 Red": (0.026, 0.039, 0.074),
        "4 NIR": (-0.149, 0.134, 0.455),
        "5 Red edge": (-0.150, 0.110, -0.122),
    },
}


# --- Figures of the chapter: tie points by band, parallax, falloff, and a stack


COMPOSITES = {
    "red, green, blue": ("3 Red", "2 Green", "1 Blue"),
    "infrared, red, green": ("4 NIR", "3 Red", "2 Green"),
}
WINDOW = np.s_[200:680, 320:960]
SHADES = LinearSegmentedColormap.from_list("shades", ["#f3f6f9", style.SKY, style.BLUE])
LEVELS = 24
"""Grey values of a band in the picture; more can hardly be seen, and make it large."""


def shares(table: pd.DataFrame) -> Figure:
    """Draw for every pair of heads the share of corners that found their partner.

    Parameters
    ----------
    table : DataFrame
        As `pairs.pairs` returns it.

    Returns
    -------
    Figure
        A cell for each pair, below the diagonal; those of the strongest chain have a frame.
    """
    names = list(dict.fromkeys([*table["head"], *table["other"]]))
    n, place = len(names), {name: k for k, name in enumerate(names)}
    values = np.full((n, n), np.nan)
    pairs: list[Any] = table.to_dict("records")
    for pair in pairs:
        values[place[pair["other"]], place[pair["head"]]] = 100 * pair["share"]
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 0.42 * n + 1.2))
        style.bare(ax)
        ax.imshow(values, cmap=SHADES, vmin=0, vmax=100, aspect="auto")
        labels = [style.plain(name) for name in names]
        ax.set_xticks(range(n - 1), labels[:-1], rotation=35, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(1, n), labels[1:])
        ax.set(ylim=(n - 0.5, 0.5), xlim=(-0.5, n - 1.5))
        for pair in pairs:
            cell = place[pair["head"]], place[pair["other"]]
            _cell(ax, *cell, 100 * pair["share"], chained=pair["chain"])
    return fig


def _cell(ax: Axes, col: int, row: int, share: float, *, chained: bool) -> None:
    ax.text(
        *(col, row, f"{share:.0f}"),
        ha="center",
        va="center",
        fontsize=style.SMALL,
        color="white" if share > 55 else style.BLACK,
        fontweight="bold" if chained else "normal",
    )
    if chained:
        x, y = np.array([-1, 1, 1, -1, -1]) * 0.46, np.array([-1, -1, 1, 1, -1]) * 0.44
        ax.plot(col + x, row + y, color=style.ORANGE, lw=2)


def shifts(table: pd.DataFrame) -> Figure:
    """Draw the shifts of heads against the factory's angles, with and without parallax.

    Parameters
    ----------
    table : DataFrame
        As `parallax` returns it.

    Returns
    -------
    Figure
        A line for each head, from rotations alone to rotations with the places free; circles: what
        the parallax of usual bases makes.
    """
    height, f = table["height_m"].iloc[0], table["f_px"].iloc[0]
    with style.applied():
        fig, ax = style.subplots(figsize=(0.75 * style.WIDTH, 0.7 * style.WIDTH))
        for base in BASES_M:
            radius = predicted_px(base, height_m=height, f_px=f)
            ax.add_patch(Circle((0, 0), radius, fill=False, color=style.SOFT, lw=1, ls="--"))
            ax.annotate(
                f"{1000 * base:.0f} mm",
                (0, radius),
                ha="center",
                va="bottom",
                fontsize=style.SMALL,
                color=style.SOFT,
            )
        heads: list[Any] = table.to_dict("records")
        for head in heads:
            x, y = ([head[f"{axis}_px"], head[f"{axis}_left_px"]] for axis in "xy")
            ax.plot(x, y, color=style.EDGE, lw=1.2)
            ax.annotate(
                style.plain(head["head"]),
                (x[0], y[0]),
                xytext=(5, 4),
                textcoords="offset points",
                fontsize=style.SMALL,
                path_effects=HALO,
            )
        ax.plot(table["x_px"], table["y_px"], "o", color=style.BRICK, label="rotations alone")
        ax.plot(table["x_left_px"], table["y_left_px"], "s", color=style.BLUE, label="places free")
        ax.axhline(0, color=style.GRID, lw=1, zorder=0)
        ax.axvline(0, color=style.GRID, lw=1, zorder=0)
        ax.set(xlabel="along columns (px)", ylabel="along rows (px)", aspect="equal")
        ax.set(xlim=(-1.9, 1.9), ylim=(1.9, -1.9))
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


def falloffs(table: pd.DataFrame) -> Figure:
    """Draw the falloff of similar heads against each other: seen, stated, and fitted.

    Parameters
    ----------
    table : DataFrame
        As `vignetting` returns it.

    Returns
    -------
    Figure
        A panel for each pair.
    """
    groups = list(table.groupby(["head", "other"], sort=False))
    with style.applied():
        fig, axes = style.subplots(2, 2, figsize=(style.WIDTH, 4.6), sharex=True, sharey=True)
        for ax, (names, group) in zip(axes.flat, groups, strict=True):
            ax.plot(
                group["radius_px"], group["seen"], "o", color=style.INK, ms=4, label="tie points"
            )
            for name, colour in (("factory", style.ORANGE), ("library", style.BLUE)):
                ax.plot(group["radius_px"], group[name], color=colour, label=name)
            ax.set_title(" over ".join(style.plain(str(name)) for name in names))
        for ax in axes[1]:
            ax.set_xlabel("radius (px)")
        for ax in axes[:, 0]:
            ax.set_ylabel("ratio (%)")
        style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0], ncols=3)
    return fig


def stack(*, folder: str = "") -> Figure | None:
    """Draw a part of the five heads' stack in two composites; None without the pictures.

    Parameters
    ----------
    folder : str
        Of the reference data; the usual one if empty.
    """
    rig = here(FIVE, folder=folder)
    if rig is None:
        return None
    plan = rendering.render_plan(rig.fits["rotations"].orientation, rig.synthetic)
    bands = rendering.stack(plan, rig.images, 0, plan.height_px)
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9))
        for ax, (title, names) in zip(axes, COMPOSITES.items(), strict=True):
            picked = [_shown(bands[..., rig.place(name)][WINDOW]) for name in names]
            ax.imshow(np.stack(picked, axis=-1), interpolation="nearest")
            ax.set_title(title)
            ax.set(xticks=[], yticks=[])
            style.bare(ax)
    return fig


def _shown(band: Raster) -> Raster:
    """Return a band in 8 bit, stretched between its percentiles."""
    low, high = np.percentile(band, [1, 99])
    unit = np.clip((band - low) / (high - low), 0, 1) ** (1 / 1.6)
    return (np.rint(unit * LEVELS) * (255 / LEVELS)).astype(np.uint8)


# --- Tables of the chapter, with headings for readers, and numbers that its sentences need


ROUNDED_DEG = 0.001
"""Unit of the last digit of the trial's angles."""


# --- tables ----------------------------------------------------------------------------------


def rotation_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the heads' rotations and their sigma."""
    values = {f"{axis} (°)": table[f"{axis}_deg"] for axis in "xyz"}
    sigmas = {f"σ {axis} (°)": table[f"{axis}_sigma_deg"] for axis in "xyz"}
    formats = {**dict.fromkeys(values, ".3f"), **dict.fromkeys(sigmas, ".4f")}
    return _of_heads(table, {**values, **sigmas}, formats)


def beside(table: pd.DataFrame) -> pd.DataFrame:
    """Return the heads' rotations less those of the factory, and of the trial."""
    columns = {
        f"{whose} {axis} (°)": table[f"{axis}_minus_{whose}_deg"]
        for whose in ("factory", "trial")
        if not table[f"x_minus_{whose}_deg"].isna().all()
        for axis in "xyz"
    }
    return _of_heads(table, columns, dict.fromkeys(columns, "+z.3f"))


def readings(table: pd.DataFrame) -> pd.DataFrame:
    """Return the interpretations of the factory's angles with their misfits."""
    names = {
        "median_px": "median (px)",
        "least_px": "of the best head (px)",
        "largest_px": "of the worst head (px)",
    }
    shown = table.rename(columns=names)
    shown.attrs["formats"] = dict.fromkeys(names.values(), ".2f")
    return shown


def places(table: pd.DataFrame) -> pd.DataFrame:
    """Return shifts with and without free places of the heads, and these places, as a table."""
    names = {
        "x_px": "columns (px)",
        "y_px": "rows (px)",
        "x_left_px": "columns, places free (px)",
        "y_left_px": "rows, places free (px)",
        "base_x_mm": "base along columns (mm)",
        "base_y_mm": "base against rows (mm)",
    }
    columns = {title: table[key] for key, title in names.items()}
    formats = {title: "+.2f" if "px" in title else "+.0f" for title in columns}
    return _of_heads(table, columns, formats)


def _of_heads(
    table: pd.DataFrame, columns: dict[str, pd.Series], formats: dict[str, str]
) -> pd.DataFrame:
    shown = pd.DataFrame({"head": table["head"], "to": table["reference"], **columns})
    shown.attrs["formats"] = formats
    return shown


# --- numbers ---------------------------------------------------------------------------------


def less(table: pd.DataFrame, axes: str, whose: str) -> Array:
    """Return the rotations less those of others, degrees, shape (n, axes)."""
    return table.filter(regex=f"[{axes}]_minus_{whose}").to_numpy(dtype=float)


def rms(values: Array) -> float:
    """Return the root mean square of values, without NaN."""
    return float(np.sqrt(np.nanmean(np.asarray(values, dtype=float) ** 2)))


def left_px(pairs: pd.DataFrame) -> float:
    """Return the RMS of all tie points in a coordinate, px."""
    return float(np.sqrt(np.average(pairs["rms_px"] ** 2, weights=pairs["ties"])))


def chi_square(table: pd.DataFrame) -> tuple[float, int]:
    """Return χ² of the rotations less the trial's, and its degrees of freedom.

    By σ of the loops, and by the trial's rounding.
    """
    trial = less(table, "xyz", "trial")
    sigma = table.filter(regex="[xyz]_sigma").to_numpy(dtype=float)
    return float(np.sum(trial**2 / (sigma**2 + ROUNDED_DEG**2 / 12))), trial.size
