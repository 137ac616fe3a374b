"""Synthetic images against one ideal camera's: their deviations and self-calibrations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from acx4book.chapters.image_quality.deviations import (
    LENS,
    Deviations,
    KnownExposure,
    deviations,
    one_image_block,
    residuals_px,
    seen_ground,
    self_calibrate,
    simulated,
    with_turned_heads,
    with_wrong_interiors,
)
from acx4lib import shown
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.heads import RelativeOrientation, radial_profile
from acx4lib.expected import Array
from acx4lib.geometry.camera import colrow_from_xy, inside, xy_from_colrow
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem, mean_origin
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.response import Response
from acx4lib.tie_points.refinement import frame_differences
from acx4lib.tie_points.search import find_ties
from acx4lib.tie_points.ties import TiePoints
from acx4sim.pictures import pixels_from_ground

STEPS: Mapping[str, tuple[str, ...]] = MappingProxyType({"oriented": (), "calibrated": LENS})
"""Interior parameters that the self-calibration of a synthetic image estimates, by its name."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Examined:
    """A synthetic image: its deviations, px of full size, and its calibrations by `STEPS`."""

    found: Deviations
    fits: dict[str, Bundle]


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class TargetErrors:
    """Radial distortion caused by errors of measurement alone.

    Attributes
    ----------
    n_targets : int
        In the image.
    sigma_px : float
        Of a measured coordinate.
    radial_px : ndarray, shape (n,)
        The largest of each calibration.
    """

    n_targets: int
    sigma_px: float
    radial_px: Array


# --- calibrations with errors ----------------------------------------------------------------


def drawn_calibration(
    truth: RelativeOrientation, *, seed: int | tuple[int, int], angle_deg: float
) -> RelativeOrientation:
    """Return heads whose errors are as large as Table 1's standard deviations.

    Parameters
    ----------
    truth : RelativeOrientation
    seed : int or tuple of int
        Of the errors.
    angle_deg : float
        Standard deviation of the errors of the heads' angles, which Table 1 does not print; the
        first head, to which the others are related, has none.
    """
    rng = np.random.default_rng(seed)
    return with_turned_heads(with_wrong_interiors(truth, rng=rng), rng=rng, sigma_deg=angle_deg)


def measured_ties(known: KnownExposure, orientation: RelativeOrientation) -> TiePoints:
    """Return tie points measured in the heads' pictures, in their full-size pixels."""
    small = reduced_heads(orientation, known.reduce)
    ties = find_ties(known.images, small, reduced_camera(known.synthetic, known.reduce)).ties
    sides = {}
    for side, heads in (("a", ties.head_a), ("b", ties.head_b)):
        colrow = getattr(ties, f"colrow_{side}").copy()
        for k, camera in enumerate(orientation.heads):
            in_head = heads == k
            colrow[in_head] = colrow_from_xy(
                camera, xy_from_colrow(small.heads[k], colrow[in_head])
            )
        sides[f"colrow_{side}"] = colrow
    return replace(ties, **sides, sigma_px=known.reduce * ties.sigma_px)


# --- calibrated by themselves ----------------------------------------------------------------


def self_calibrations(known: KnownExposure, found: Deviations) -> dict[str, Bundle]:
    """Calibrate a synthetic image by points whose ground coordinates are known, by `STEPS`."""
    block = known_block(known, found)
    return {name: self_calibrate(block, free=free) for name, free in STEPS.items()}


def known_block(known: KnownExposure, found: Deviations) -> Block:
    """Return the synthetic image as a block of one image, every point known on the ground."""
    grid, track = GridSystem(crs=known.at.plan.crs), known.at.track
    frame = mean_origin(grid, grid.lonlat_from_grid(track.x_g[:, :2]))
    # under the aircraft the mapping axes are east, north and up
    T_m_b = Pose(R=track.R_enu_b.as_matrix()[0], r=frame.from_grid(track.x_g)[0])
    x_m = frame.from_grid(seen_ground(known, found.ideal))
    return one_image_block(known.synthetic, frame, T_m_b @ known.synthetic.T_b_c, x_m, found)


def frame_deviations(orientation: RelativeOrientation, known: KnownExposure) -> Deviations:
    """Return the deviations of the frame's nodes by an orientation from those by the true one.

    Exact, over a plane at the mean flying height, without pixels.

    Returns
    -------
    Deviations
        px of the full-size image; sigma is one pixel.
    """
    camera = known.synthetic
    differences = frame_differences(orientation, known.orientation, camera, spacing_px=600)
    d_px = differences.d_px * [1.0, -1.0]  # y goes up, rows go down
    return Deviations(
        ideal=colrow_from_xy(camera, differences.xy) - d_px,
        d_px=d_px,
        sigma_px=np.ones(len(d_px)),
    )


def examine_all(
    known: KnownExposure,
    orientations: Mapping[str, RelativeOrientation],
    response: Response,
) -> dict[str, Examined]:
    """Render an exposure by orientations, measure the images, and calibrate each by itself."""
    images = {}
    for name, orientation in orientations.items():
        off = frame_deviations(orientation, known).d_px / known.reduce
        search_px = 2 + int(np.ceil(np.abs(off).max()))
        found = deviations(known, orientation, response, search_px=search_px)
        images[name] = Examined(found=found, fits=self_calibrations(known, found))
    return images


def geometry_errors(
    known: KnownExposure, orientations: Mapping[str, RelativeOrientation]
) -> dict[str, dict[str, float]]:
    """Return `errors_of` the `frame_deviations` of every orientation."""
    return {
        name: errors_of(frame_deviations(heads, known), known)
        for name, heads in orientations.items()
    }


def errors_of(found: Deviations, known: KnownExposure) -> dict[str, float]:
    """Return deviations, their residuals after self-calibration, and the distortion found, px."""
    fits = self_calibrations(known, found)
    residual_rms = {
        f"{name}_px": rms_of_coordinates(residuals_px(fit)) for name, fit in fits.items()
    }
    return {
        "rms_px": rms_of_coordinates(found.d_px),
        "largest_px": float(np.hypot(*found.d_px.T).max()),
        **residual_rms,
        "radial_px": largest_radial(fits["calibrated"]),
    }


def border_distortion_of_targets(
    known: KnownExposure, n: int, *, sigma_px: float, seed: int
) -> TargetErrors:
    """Calibrate a perfect image by its signalised targets, measured with errors.

    Parameters
    ----------
    known : KnownExposure
    n : int
        Times to measure them.
    sigma_px : float
        Of a coordinate.
    seed : int
    """
    camera = known.synthetic
    colrow = pixels_from_ground(known.at, simulated(camera), known.at.marks_g)
    colrow = colrow[inside(camera, np.nan_to_num(colrow, nan=-1e9))]
    rng = np.random.default_rng(seed)
    radial = []
    for _ in range(n):
        noise = sigma_px * rng.standard_normal(colrow.shape)
        targets = Deviations(ideal=colrow, d_px=noise, sigma_px=np.full(len(colrow), sigma_px))
        radial.append(largest_radial(self_calibrate(known_block(known, targets), free=LENS)))
    return TargetErrors(n_targets=len(colrow), sigma_px=sigma_px, radial_px=np.array(radial))


def rms_of_coordinates(d: Array) -> float:
    """Return the root mean square of the coordinates of plane vectors."""
    return float(np.sqrt(np.mean(d**2)))


def largest_radial(fit: Bundle) -> float:
    """Return the largest radial distortion between the middle and the corner of an image, px."""
    _, px, _ = radial_profile(fit)
    return float(np.abs(px).max())


def lens_fits(examined: Mapping[str, Examined]) -> dict[str, Bundle]:
    """Return the self-calibrations with a lens of all but the unrefined orientation."""
    return {name: image.fits["calibrated"] for name, image in examined.items() if name != "before"}
