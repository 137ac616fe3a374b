"""Chapter 19, from pictures to a boresight: pixels, tie points, control, and the camera."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import read
from acx4files.measuring.levels import Matched
from acx4files.measuring.measure import Outcome, measure_flight
from acx4files.measuring.pairs import laid_patches, own_patches
from acx4files.measuring.views import View, pixels_of_view, transferred
from acx4lib import shown
from acx4lib.block import Block
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import Mounting, single_step
from acx4lib.expected import Array, Index, Mask
from acx4lib.model import Model
from acx4sim import files
from acx4sim.designs import single_head
from acx4sim.files import SimulatedFlight, photograph
from acx4sim.pictures import Station, ground_from_pixels, pixels_from_ground, station

# --- A flight of which nothing is measured yet: its pictures, its trajectory, its control points


EXPOSURES = ("C1-03", "C1-05", "C2-04", "C2-06", "C3-04", "C4-03", "C4-05", "C5-05")
"""Three strips at the lower height, one of them in the other direction, and two across at the
higher one."""

COVER = "C2-04"
"""Picture drawn by `cover`."""

REDUCE = 7
"""Pictures have 1/7 of the size, so that the page is computed in half a minute."""

STORED = Path(str(resources.files("acx4book.chapters") / "stored"))
"""Folder of the project's stored flights, measured by ``make coverage``."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Whole:
    """A flight and the measurements in its pictures.

    Attributes
    ----------
    simulated : SimulatedFlight
        With the truth.
    outcome : Outcome
        Of the measurement.
    block : Block
        The measured block.
    folder : TemporaryDirectory
        With the pictures, which figures show.
    """

    simulated: SimulatedFlight
    outcome: Outcome
    block: Block
    folder: tempfile.TemporaryDirectory[str]

    def truth(self, mounting: Mounting) -> list[float]:
        """Return the true values of the estimated parameters, in their order."""
        values: dict[str, float] = self.simulated.truth["cameras"]["CAM"]
        return [values[parameter.name] for parameter in parameters(mounting.calibration)]


def written(simulated: SimulatedFlight) -> tempfile.TemporaryDirectory[str]:
    """Write a flight without its image points into ``flight`` in a new folder.

    Parameters
    ----------
    simulated : SimulatedFlight
        With pictures of its block ``calibration``.

    Returns
    -------
    TemporaryDirectory
        Removed when the value is.
    """
    folder = tempfile.TemporaryDirectory()
    flight = Path(folder.name) / "flight"
    files.write(simulated, flight)
    (flight / "calibration" / "image_points.csv").unlink()
    return folder


def measured(seed: int) -> tuple[Whole, Mounting]:
    """Fly, photograph, measure and calibrate, as the notebook does.

    Parameters
    ----------
    seed : int
        Of the flight.
    """
    simulated = photograph(single_head(seed=seed), EXPOSURES, reduce=REDUCE)
    folder = written(simulated)
    (outcome,) = measure_flight(f"{folder.name}/flight", f"{folder.name}/measured")
    flight = read(f"{folder.name}/measured")
    block = flight.block("calibration")
    whole = Whole(simulated=simulated, outcome=outcome, block=block, folder=folder)
    return whole, single_step(block, Model(free=flight.estimate_mounting))


# --- Measurements in pictures against the simulator's exact geometry


@dataclass(frozen=True, kw_only=True, eq=False)
class Errors:
    """Errors of measurements, in pixels of the pictures.

    Attributes
    ----------
    image_idx, point_idx : ndarray, shape (n,)
    off : ndarray, shape (n, 2)
        Along columns and rows.
    sigma : ndarray, shape (n,)
        Standard deviation of `off` predicted by the matching.
    redundancy : int
        Of `off`, both coordinates.
    """

    image_idx: Index
    point_idx: Index
    off: Array
    sigma: Array
    redundancy: int

    @property
    def rms(self) -> float:
        """RMS error of a measurement in one coordinate, px."""
        return float(np.sqrt(np.sum(self.off**2) / self.redundancy))

    def of_points(self, own: Mask) -> Errors:
        """Return the errors of some tie points alone, of each with all its measurements."""
        n_points = len(np.unique(self.point_idx[own]))
        return Errors(
            image_idx=self.image_idx[own],
            point_idx=self.point_idx[own],
            off=self.off[own],
            sigma=self.sigma[own],
            redundancy=2 * (int(np.sum(own)) - n_points),
        )

    @property
    def wrong(self) -> int:
        """Number of measurements with an error of more than a pixel."""
        return int(np.sum(np.hypot(*self.off.T) > 1))


def of_ties(whole: Whole) -> Errors:
    """Compare the rays of every tie point with each other, on the exact ground.

    A tie point has no true place of its own. Each of its measurements is followed to the ground
    by the exact camera. The weighted mean of these places is projected back.
    """
    image, point, colrow, sigma = _measurements(whole, control=False)
    stations = _stations(whole)
    ground = np.zeros((len(image), 3))
    camera = whole.simulated.plan.cameras["CAM"]
    for k, exposure in enumerate(stations):
        ground[image == k] = ground_from_pixels(exposure, camera, colrow[image == k])
    code = np.unique(point, return_inverse=True)[1]
    weight = sigma**-2.0
    total = np.bincount(code, weight)
    mean = np.stack([np.bincount(code, weight * x) / total for x in ground.T], axis=1)[code]
    factor = np.sqrt(np.maximum(1 - weight / total[code], 1e-6))
    n = 2 * (len(code) - len(total))
    return _against(whole, image, point, (colrow, sigma * factor, mean), n)


def of_control(whole: Whole) -> Errors:
    """Compare the measurements of control points with their true projections."""
    image, point, colrow, sigma = _measurements(whole, control=True)
    truth = whole.simulated.truth["control_points"]
    ground = np.array([truth[whole.block.points[p]] for p in point])
    return _against(whole, image, point, (colrow, sigma, ground), 2 * len(point))


def same_height(whole: Whole, errors: Errors) -> Mask:
    """Mark the measurements of points that are seen from one flying height only, shape (n,)."""
    low = np.array([whole.block.images.strips[i] in ("1", "2", "3") for i in errors.image_idx])
    n = np.bincount(errors.point_idx)
    n_low = np.bincount(errors.point_idx, low)
    alike: Mask = ((n_low == 0) | (n_low == n))[errors.point_idx]
    return alike


def _measurements(whole: Whole, *, control: bool) -> tuple[Index, Index, Array, Array]:
    points, surveyed = whole.block.image_points, whole.block.control.point_idx
    rows = np.isin(points.point_idx, surveyed) == control
    return (
        points.image_idx[rows],
        points.point_idx[rows],
        points.colrow[rows],
        points.sigma_px[rows],
    )


def _stations(whole: Whole) -> list[Station]:
    plan, seed = whole.simulated.plan, whole.simulated.seed
    names = (whole.block.trajectory.exposures[i] for i in whole.block.images.exposure_idx)
    return [station(plan, f"calibration/{name}", seed=seed) for name in names]


def _against(
    whole: Whole,
    image: Index,
    point: Index,
    measurements: tuple[Array, Array, Array],
    redundancy: int,
) -> Errors:
    colrow, sigma, ground = measurements
    off, camera = np.zeros((len(image), 2)), whole.simulated.plan.cameras["CAM"]
    for k, exposure in enumerate(_stations(whole)):
        rows = image == k
        off[rows] = colrow[rows] - pixels_from_ground(exposure, camera, ground[rows])
    return Errors(
        image_idx=image,
        point_idx=point,
        off=off / REDUCE,
        sigma=sigma / REDUCE,
        redundancy=redundancy,
    )


# --- Figures of the chapter: a place in several pictures, and points over a picture


SIDE = 49
"""Side of the patches, px."""

CHOSEN = ("C1-05", "C2-04", "C4-03", "C5-05")
"""The first picture gives the geometry; the others are of an opposite and two crossing strips."""

NAMES = ("the first", "opposite", "across, higher", "across, back")

SHOWN = 4
"""Every n-th pixel of a picture is shown."""


def patches(outcome: Outcome) -> Figure:
    """Draw a place in four pictures: in their own pixels, and resampled to the first picture.

    Parameters
    ----------
    outcome : Outcome
        Of measuring the chapter's flight, whose pictures must still exist.
    """
    views = [_view(outcome, name) for name in CHOSEN]
    corner = _shared_corner(outcome.matched, views)
    surface = outcome.matched.surface
    with style.applied():
        fig, axes = style.subplots(2, len(views), figsize=(style.WIDTH, 3.7))
        for k, view in enumerate(views):
            place = np.rint(transferred(views[0], view, surface, corner.astype(float))).astype(int)
            as_it_is = own_patches(view, place, SIDE).grey
            laid = laid_patches(views[0], view, surface, corner, SIDE).grey if k else as_it_is
            for ax, image in zip(axes[:, k], (as_it_is, laid), strict=True):
                ax.imshow(image, cmap="gray", interpolation="nearest")
                style.bare(ax)
                ax.set(xticks=[], yticks=[])
            axes[0, k].set_title(f"{view.name}\n{NAMES[k]}")
    return fig


def _view(outcome: Outcome, name: str) -> View:
    return next(view for view in outcome.matched.views if view.name == name)


def _shared_corner(matched: Matched, views: list[View]) -> Index:
    """Return the corner of the first view that was found in most of the others, (1, 2)."""
    number = {view.name: k for k, view in enumerate(matched.views)}
    wanted = [number[view.name] for view in views]
    rays = matched.rays
    first = rays.view == wanted[0]
    candidates = np.flatnonzero(first & np.all(rays.colrow == np.rint(rays.colrow), axis=1))
    in_views = np.isin(rays.view, wanted)
    count = np.bincount(rays.point, in_views)[rays.point[candidates]]
    best = candidates[int(np.argmax(count))]
    return np.rint(rays.colrow[best]).astype(np.intp)[None]


def cover(outcome: Outcome, block: Block) -> Figure:
    """Draw the tie points and the control points of a picture over it.

    Parameters
    ----------
    outcome : Outcome
    block : Block
        As it was measured.
    """
    view = _view(outcome, COVER)
    small = pixels_of_view(view)[::SHOWN, ::SHOWN].mean(axis=2)
    points = block.image_points
    in_picture = points.image_idx == block.images.names.index(COVER)
    rays = block.rays[points.point_idx[in_picture]]
    colrow = points.colrow[in_picture] / REDUCE / SHOWN
    control = np.isin(points.point_idx[in_picture], block.control.point_idx)
    with style.applied():
        fig, ax = style.subplots(figsize=(0.8 * style.WIDTH, 4.4))
        ax.imshow(small, cmap="gray", vmin=0, vmax=2.2 * np.median(small))
        for least, most, colour, words in (
            (2, 2, style.ORANGE, "2 rays"),
            (3, 4, style.TEAL, "3 or 4"),
            (5, 99, style.BLUE, "5 and more"),
        ):
            some = ~control & (rays >= least) & (rays <= most)
            ax.plot(*colrow[some].T, "o", ms=3.5, color=colour, mec="white", mew=0.4, label=words)
        ax.plot(*colrow[control].T, "^", ms=7, color=style.BRICK, mec="white", label="control")
        style.bare(ax)
        ax.set(xticks=[], yticks=[])
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=4)
    return fig


def sizes(ties: Errors, alike: Mask) -> Figure:
    """Draw the sizes of the tie points' errors, for one flying height and for both.

    Parameters
    ----------
    ties : Errors
    alike : ndarray of bool, shape (n,)
        Measurements of points that are seen from one flying height only.
    """
    length = np.hypot(*ties.off.T)
    with style.applied():
        fig, ax = style.subplots(figsize=(0.8 * style.WIDTH, 3.0))
        for chosen, colour, words in (
            (alike, style.TEAL, "seen from one height"),
            (~alike, style.BLUE, "seen from both heights"),
        ):
            lengths = np.sort(length[chosen])
            share = np.arange(1, len(lengths) + 1) / max(len(lengths), 1)
            ax.plot(lengths, share, color=colour, label=words)
        ax.set(xscale="log", xlim=(1e-3, 2), ylim=(0, 1), ylabel="share of the measurements")
        ax.set_xlabel("error, at most (px)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


# --- Tables of the chapter: the pictures, and the camera beside its truth


def pictures(block: Block) -> pd.DataFrame:
    """Return a row for every picture, with its measurements."""
    points, rays = block.image_points, block.rays
    control = np.isin(points.point_idx, block.control.point_idx)
    surveyed = np.median(block.control.x_m[:, 2])
    rows = []
    for k, (name, strip) in enumerate(zip(block.images.names, block.images.strips, strict=True)):
        in_picture = points.image_idx == k
        pose = block.T_m_b_images[k : k + 1]
        nose = pose.R[0] @ [1.0, 0, 0]
        tie = in_picture & ~control
        rows.append(
            {
                "picture": name,
                "strip": strip,
                "heading (°)": float(np.degrees(np.arctan2(nose[0], nose[1])) % 360),
                "height (m)": float(pose.r[0, 2] - surveyed),
                "tie points": int(tie.sum()),
                "of 3 rays and more": int(np.sum(rays[points.point_idx[tie]] >= 3)),
                "control points": int(np.sum(in_picture & control)),
            }
        )
    table = pd.DataFrame(rows)
    table.attrs["formats"] = {"heading (°)": ".0f", "height (m)": ".0f"}
    return table


def camera(mounting: Mounting, truth: Sequence[float]) -> pd.DataFrame:
    """Return the estimated parameters with their standard deviations, beside the truth.

    Parameters
    ----------
    mounting : Mounting
    truth : sequence of float
        As `whole.Whole.truth` returns it.
    """
    table = mounting.table()
    table["truth"] = [_exact(value) for value in truth]
    table["difference / σ"] = (table["value"] - np.array(truth)) / table["sigma"]
    table.attrs["formats"] = {"difference / σ": "+.1f"}
    return table


def _exact(value: float) -> Markup:
    """Return a value that is exact, with all its digits."""
    text = scientific(value, digits=1) if abs(value) < 1e-3 else f"{value:.6g}"
    return Markup(text.replace("-", "\N{MINUS SIGN}"))
