"""Four real heads with their own IMU and GPS: a measured flight, stored thinned.

`make reference-results` imports, measures and adjusts the pictures where they are at hand, and
stores what chapter 13 shows: a part of the measurements, the parameters by all of them, and two
small pictures. They are of OpenDroneMap's data set Garfield, which is in the public domain (CC0).
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.reference import data
from acx4book.typesetting import style
from acx4book.typesetting.maps import finish_map
from acx4book.typesetting.matrix import Residuals, field_figure
from acx4book.typesetting.pictures import (
    ALL_LEVELS,
    HALO,
    common_stretch,
    displayed,
    frameless,
    smaller,
)
from acx4files.exchange import flight_folder, pictures
from acx4files.flight import reader
from acx4files.flight.reader import Flight
from acx4files.images.head_images import read_heads
from acx4files.measuring.measure import measure_flight
from acx4files.results import whole_files
from acx4lib import design
from acx4lib.block import Block, select_cameras
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.heads import RelativeOrientation, declared_orientation
from acx4lib.calibration.mounting import Mounting, single_step
from acx4lib.expected import Array, Mask, Raster
from acx4lib.geometry.camera import Camera
from acx4lib.model import Model
from acx4lib.synthetic_image.rendering import render_plan, stack
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import shared_points

FILES = "sequoia-flight"
"""Set of the reference data: 19 exposures of a Parrot Sequoia over Garfield Heights, Ohio."""

FLIGHT = data.FOLDER / "four-heads"
"""Folder of the stored flight, and of the results from all measurements."""

ALL = FLIGHT / "all_measurements.csv"
"""Parameters of the rig by all measurements."""

# --- Thinned: points of many rays that cover every picture evenly

CELLS = (8, 6)
"""Cells of a picture, along columns and rows."""

MOST = 5
"""Points of a full cell: further points, of fewer rays, are left out."""


def thinned(block: Block) -> Mask:
    """Choose points of many rays, in several exposures, that cover every picture evenly.

    Returns
    -------
    ndarray of bool, shape (n,)
        The measurements that stay: points with all their rays, until the cells of most of them
        have enough.
    """
    points, cameras, images = block.image_points, block.cameras, block.images
    size = np.array([[camera.width_px, camera.height_px] for camera in cameras])
    in_cells = (points.colrow + 0.5) / size[images.camera_idx[points.image_idx]] * CELLS
    col, row = np.clip(in_cells.astype(int), 0, np.array(CELLS) - 1).T
    cell = np.ravel_multi_index((points.image_idx, row, col), (len(images), *CELLS[::-1]))
    order = np.argsort(points.point_idx, kind="stable")
    rays = np.split(order, np.flatnonzero(np.diff(points.point_idx[order])) + 1)
    taken, keep = np.zeros(cell.max() + 1, int), np.zeros(len(points), bool)
    for rows in sorted(rays, key=len, reverse=True):
        several = len(np.unique(images.exposure_idx[points.image_idx[rows]])) > 1
        if several and np.mean(taken[cell[rows]] < MOST) > 0.5:
            np.add.at(taken, cell[rows], 1)
            keep[rows] = True
    return keep


def rig(flight: Flight) -> Mounting:
    """Adjust all heads of the flight with the trajectory, as the chapter does."""
    free = ("f", *flight.estimate_heads)
    return single_step(heads_of(flight), Model(free=free, fix=("lever_arm",), gnss=("deviation",)))


def heads_of(flight: Flight) -> Block:
    """Return the block of the heads, in the order of flight.toml's [synthetic]."""
    return select_cameras(flight.block("heads"), flight.head_names)


# --- Stored


APART_S = 10.0
"""Seconds between two exposures of one strip, at most."""

PARTS = {"GRE": "1 Green", "RED": "2 Red", "REG": "3 Red edge", "NIR": "4 NIR"}
"""The camera's names for the pictures of its heads."""


def store() -> None:
    """Measure and adjust the pictures; store the thinned flight, its results and pictures.

    Raises
    ------
    ReferenceDataError
        Where a picture is missing, or is not the indexed one.
    """
    for entry in data.index():
        if entry.file.startswith(f"{FILES}/"):
            data.path(entry.file)
    with tempfile.TemporaryDirectory() as temporary:
        imported = pictures.read_folder(data.folder() / FILES)
        flight_folder.write(imported, Path(temporary) / "flight")
        measure_flight(Path(temporary) / "flight", Path(temporary) / "measured")
        _store_measured(Path(temporary) / "measured")


def _store_measured(measured: Path) -> None:
    """Store a measured flight, thinned; the parameters from all of it; and its pictures."""
    flight = reader.read(measured)
    FLIGHT.mkdir(exist_ok=True)
    whole_files.copy(measured / "flight.toml", FLIGHT / "flight.toml")
    whole_files.copy(measured / "control_points.csv", FLIGHT / "control_points.csv")
    (FLIGHT / "heads").mkdir(exist_ok=True)
    for name, table in _tables(measured / "heads", thinned(flight.block("heads"))).items():
        _write(table, FLIGHT / "heads" / name)
    estimates = rig(flight).table().reset_index()
    _write(estimates[estimates["sigma"].notna()], ALL)
    _store_pictures(flight)


def _write(table: pd.DataFrame, path: Path) -> None:
    text = table.to_csv(index=False, float_format="%.9g", lineterminator="\n")
    whole_files.write(path, text)


def _tables(block: Path, keep: Mask) -> dict[str, pd.DataFrame]:
    """Return the tables of a block with short names, strips, and the kept measurements."""
    images, points, flown = (
        pd.read_csv(block / f"{name}.csv", dtype=str)
        for name in ("images", "image_points", "trajectory")
    )
    number = {name: name.split("_")[3] for name in flown["exposure"]}
    head = {name: part for part, name in PARTS.items()}
    short = [
        f"{number[e]} {head[c]}" for e, c in zip(images["exposure"], images["camera"], strict=True)
    ]
    strip = 1 + (flown["time_s"].astype(float).diff() > APART_S).cumsum()
    of_exposure = dict(zip(flown["exposure"], strip, strict=True))
    points = points[keep]
    names = {name: f"T{i}" for i, name in enumerate(dict.fromkeys(points["point"]))}
    by_image = dict(zip(images["image"], short, strict=True))
    return {
        "images.csv": pd.DataFrame(
            {
                "image": short,
                "camera": images["camera"],
                "exposure": images["exposure"].map(number),
                "strip": images["exposure"].map(of_exposure),
            }
        ),
        "trajectory.csv": flown.assign(exposure=flown["exposure"].map(number)),
        "image_points.csv": pd.DataFrame(
            {
                "image": points["image"].map(by_image),
                "point": points["point"].map(names),
                **{c: points[c].astype(float).round(3) for c in ("col_px", "row_px", "sigma_px")},
            }
        ),
    }


# --- Figures


REGISTERS = ("as they are", "turned by the factory", "turned by tie points")
"""Orientations of the heads in the three stored composites."""


def photographs(block: Block) -> Figure:
    """Draw the measured points of an exposure over the photographs of two of its heads.

    Parameters
    ----------
    block : Block
        Of the stored flight.
    """
    shown = _unit(cv2.imread(str(PHOTOGRAPHS), cv2.IMREAD_GRAYSCALE))
    points, exposure = block.image_points, block.trajectory.exposures.index(SHOWN)
    names = [camera.name for camera in block.cameras]
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.1))
        for ax, part, name in zip(axes, np.split(shown, 2, axis=1), COMPOSITE[::-2], strict=True):
            k = names.index(name)
            of_head = (block.images.exposure_idx == exposure) & (block.images.camera_idx == k)
            rows = points.image_idx == int(np.flatnonzero(of_head)[0])
            ax.imshow(part, cmap="gray", vmin=0, vmax=1)
            rays = block.rays[points.point_idx[rows]]
            for few, colour, words in (
                (True, style.ORANGE, f"up to {FEW - 1} pictures"),
                (False, style.SKY, "more"),
            ):
                places = (points.colrow[rows][(rays < FEW) == few] + 0.5) / REDUCED - 0.5
                ax.plot(*places.T, "o", ms=3, color=colour, mec=style.BLACK, mew=0.3, label=words)
            frameless(ax)
            style.heading(ax, name, f"{int(rows.sum())} points")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


FEW = 10
"""Rays from which a point is drawn in another colour."""


def registers() -> Figure:
    """Draw three bands of a place over each other, with heads oriented in three ways."""
    shown = _unit(cv2.imread(str(BANDS)))[..., ::-1]
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.3))
        for ax, part, title in zip(axes, np.split(shown, 3, axis=1), REGISTERS, strict=True):
            ax.imshow(part, interpolation="nearest")
            frameless(ax)
            ax.set_title(title)
    return fig


def _unit(pixels: Any) -> Array:
    if pixels is None:
        msg = f"{FLIGHT}: a picture is missing or is none; run `make reference-results`"
        raise data.ReferenceDataError(msg)
    unit: Array = pixels / 255.0
    return unit


def residuals(found: Mapping[str, Bundle], head: str) -> Figure:
    """Draw the mean residuals of a head, a panel for each adjustment of all heads.

    Parameters
    ----------
    found : mapping of str to Bundle
        By their titles.
    head : str
    """
    fields = {}
    for words, bundle in found.items():
        points, images = bundle.network.image_points, bundle.network.block.images
        k = [camera.name for camera in bundle.cameras].index(head)
        in_head = images.camera_idx[points.image_idx] == k
        fields[f"{head}, {words}"] = Residuals(
            camera=bundle.cameras[k],
            colrow=points.colrow[in_head],
            v=bundle.solution.group("image_point").v[in_head],
            sigma_px=points.sigma_px[in_head],
        )
    return field_figure(fields)


DISTANCES = (0, 10, 20, 40, 80, 160, 320, 640, 1600)
"""Limits of the classes of distances between two points of a picture, px."""


def alike(found: Bundle) -> Array:
    """Return the correlation of residuals of two points of a picture, by `DISTANCES`.

    They are mean products of normalised residuals of all pairs, over their mean square.
    """
    points, group = found.network.image_points, found.solution.group("image_point")
    v = group.v / group.sigma
    n = len(DISTANCES) - 1
    product, pairs = np.zeros(n), np.zeros(n)
    for image in np.unique(points.image_idx):
        rows = np.flatnonzero(points.image_idx == image)
        a, b = (rows[idx] for idx in np.triu_indices(len(rows), 1))
        apart = np.linalg.norm(points.colrow[a] - points.colrow[b], axis=1)
        bins = np.digitize(apart, DISTANCES[1:-1])
        product += np.bincount(bins, np.mean(v[a] * v[b], axis=1), n)
        pairs += np.bincount(bins, minlength=n)
    return product / pairs / np.mean(v**2)


def by_distance(found: Mapping[str, Array]) -> Figure:
    """Draw the correlations of `alike`, by their titles, over the distance."""
    middle = np.sqrt(np.maximum(DISTANCES[:-1], 5) * np.array(DISTANCES[1:]))
    with style.applied():
        fig, ax = style.subplots(figsize=(0.75 * style.WIDTH, 2.6))
        for (words, values), marker in zip(found.items(), "os^D", strict=False):
            ax.plot(middle, values, marker=marker, ms=4, label=words)
        ax.axhline(0, color=style.SOFT, lw=1)
        ax.set_xscale("log")
        ax.set_xlabel("distance of two points of a picture (px)")
        ax.set_ylabel("correlation of residuals")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=3)
    return fig


ZERO = 30.0
"""Degrees of deviation from the middle of the plot to its circle of zero."""


def compass(found: Bundle) -> Figure:
    """Draw the errors of recorded headings over the heading, and the estimated deviation.

    Parameters
    ----------
    found : Bundle
        With a deviation among its unknowns.
    """
    network, deviation = found.network, found.state.deviation
    by_heading = network.observed.by_heading[network.first_poses]
    off = np.degrees(trajectory_errors.headings(found)[1] + by_heading @ deviation)
    around = np.linspace(0, 2 * np.pi, 181)
    line = np.degrees(np.stack([np.sin(around), np.cos(around)], axis=1) @ deviation)
    rings = range(-20, 21, 10)
    with style.applied():
        fig = style.figure(figsize=(0.75 * style.WIDTH, 0.75 * style.WIDTH))
        ax: Any = fig.add_subplot(projection="polar")
        ax.set_theta_zero_location("N")
        ax.set_theta_direction(-1)
        ax.plot(around, np.full(len(around), ZERO), color=style.SOFT, lw=1)
        ax.plot(around, ZERO + line, color=style.BLUE, label="deviation, first harmonic")
        marker_style = {
            "ls": "",
            "marker": "o",
            "color": style.ORANGE,
            "mec": style.BLACK,
            "mew": 0.4,
        }
        ax.plot(np.arctan2(*by_heading.T), ZERO + off, ms=5, label="one exposure", **marker_style)
        ax.set_ylim(0, 2 * ZERO - 5)
        ax.set_rgrids([ZERO + ring for ring in rings], [_signed(ring) for ring in rings])
        ax.set_rlabel_position(135)
        ax.set_thetagrids([0, 90, 180, 270], ["N", "E", "S", "W"])
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


def _signed(degrees: int) -> str:
    return f"{degrees:+d}°".replace("-", "\N{MINUS SIGN}") if degrees else "0°"


def strips(found: Bundle) -> Figure:
    """Draw the strips over the tie points as a map, with adjusted and recorded positions.

    Parameters
    ----------
    found : Bundle
        Of the whole flight.
    """
    block, state, first = found.network.block, found.state, found.network.first_poses
    names = np.array(design.strip_of_exposure(block))
    points = np.unique(found.network.image_points.point_idx)
    ground, flown, recorded = (
        block.frame.to_grid(x_m)[:, :2] / 1000
        for x_m in (state.x_m[points], state.T_m_b.r[first], block.trajectory.T_m_b.r)
    )
    with style.applied():
        fig, ax = style.subplots(figsize=(0.75 * style.WIDTH, 5.6))
        ax.plot(*ground[::DRAWN].T, ".", ms=2, color=style.SKY, label="tie points")
        ax.plot(*recorded.T, "+", ms=6, color=style.BRICK, label="recorded positions")
        for name in dict.fromkeys(names):
            strip = flown[names == name]
            ax.plot(*strip.T, "o-", ms=3, lw=1, color=style.INK, label="strips, adjusted")
            ax.annotate(
                name, strip[0], xytext=(6, 4), textcoords="offset points", path_effects=HALO
            )
        finish_map(ax, np.concatenate([ground, flown]), room=(0.05, 0.08))
        handles, labels = ax.get_legend_handles_labels()
        style.legend_below(fig, list(dict(zip(labels, handles, strict=True)).values()), ncols=3)
    return fig


DRAWN = 8
"""Every n-th tie point is on the map."""


# --- Small pictures


SHOWN = "0126"
"""Exposure in the figures."""

PHOTOGRAPHS, BANDS = FLIGHT / "photographs.webp", FLIGHT / "bands.webp"

REDUCED = 4
"""Factor of reduction of the stored photographs."""

WINDOW = (590, 730, 830, 1000)
"""Part of the stack in the figures: rows and columns, px."""

COMPOSITE = ("4 NIR", "2 Red", "1 Green")
"""Bands drawn as red, green and blue."""

QUALITY = 60
"""Quality of WebP, of 100."""


def _store_pictures(measured: Flight) -> None:
    """Store the photographs of an exposure, and its bands in three registers beside each other."""
    flight = reader.read(FLIGHT)
    block = heads_of(flight)
    synthetic = flight.cameras[pictures.SYNTHETIC]
    images = measured.block("heads").images
    files = zip(images.names, measured.image_files["heads"], strict=True)
    shown = {name: path for name, path in files if path and f"_{SHOWN}_" in name}
    paths = [
        next(path for name, path in shown.items() if name.endswith(head))
        for head in measured.head_names
    ]
    pixels = read_heads(paths, block.cameras).images
    by_name = dict(zip(measured.head_names, pixels, strict=True))
    small = [_stretched(smaller(by_name[name], REDUCED)) for name in COMPOSITE[::-2]]
    _webp(PHOTOGRAPHS, np.hstack(small))
    registers = [
        _window(orientation, synthetic, pixels) for orientation in _registers(block, synthetic)
    ]
    bands = np.moveaxis(np.hstack(registers), -1, 0)
    _webp(BANDS, np.stack([_stretched(band[..., None]) for band in bands], axis=-1))


def _stretched(band: Array | Raster) -> Array:
    """Return a band for a screen, shape (rows, cols), 0 to 1."""
    return displayed(band, common_stretch([band]), levels=ALL_LEVELS)[..., 0]


def _registers(block: Block, synthetic: Camera) -> Sequence[RelativeOrientation]:
    """Return the heads as if all were the first one, as declared, and turned by tie points."""
    factory = declared_orientation(block.cameras, synthetic)
    first = factory.heads[0]
    alike = replace(
        factory,
        heads=tuple(head.with_interior(first.interior) for head in factory.heads),
        opk=np.tile(factory.opk[0], (len(factory.heads), 1)),
    )
    turned = refine_by_rotations(factory, shared_points(block, factory)).orientation
    return alike, factory, turned


def _window(
    orientation: RelativeOrientation, synthetic: Camera, pixels: Sequence[Raster]
) -> Raster:
    top, bottom, left, right = WINDOW
    bands = stack(render_plan(orientation, synthetic), pixels, top, bottom)
    names = [head.name for head in orientation.heads]
    return bands[:, left:right, [names.index(name) for name in COMPOSITE]]


def _webp(path: Path, unit: Array) -> None:
    pixels = np.rint(255 * unit[..., ::-1] if unit.ndim == 3 else 255 * unit).astype(np.uint8)
    content = cv2.imencode(".webp", pixels, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1]
    whole_files.write(path, content.tobytes())
