"""The quality of a synthetic image against known points of the ground (section 4.1).

Points are measured in it by least-squares matching with a picture that one ideal camera took at
the same place; and it is calibrated by itself, as if it were one camera's image, which shows what
part of its errors looks like a lens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy.spatial import KDTree

from acx4lib import expected, shown
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.start.robust import SUSPECT
from acx4lib.bundle.uses import free_orientation
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.calibration.trust.needs import require_control
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.geometry.camera import Camera, inside, xy_from_colrow
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import MappingFrame
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points.harris import best_of_cells, response
from acx4lib.tie_points.least_squares_matching import correlate, match
from acx4lib.tie_points.overlaps import grey

LENS = ("k1", "k2", "k3", "p1", "p2")
"""What the self-calibration of a synthetic image estimates of its lens."""

LEAST_CORRELATION = 0.7
"""Of a window with its place in the other picture."""

BORDER_SHARE = 0.05
"""Share of the synthetic image's longer side that counts as near its border."""

ZONES = ("one head", "several heads", "near the border")

# --- measured --------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Windows:
    """How points are measured.

    Attributes
    ----------
    cell_px : int
        Side of the cells that give one point each.
    correlation_px, matching_px : int
        Odd sides of the windows for correlation and for least-squares matching.
    search_px : int
        Largest shift that is looked for.
    largest_sigma_px : float
        Of a matched point.
    """

    cell_px: int = 40
    correlation_px: int = 15
    matching_px: int = 21
    search_px: int = 4
    largest_sigma_px: float = 0.15


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """Points of an image against their places in an ideal one.

    Attributes
    ----------
    ideal : ndarray, shape (n, 2)
        col, row of the ideal picture, px.
    d_px : ndarray, shape (n, 2)
        Measured less ideal, along columns and rows, px of that picture.
    sigma_px : ndarray, shape (n,)
        Of a coordinate, as the matching says.
    """

    ideal: Array
    d_px: Array
    sigma_px: Array

    def __len__(self) -> int:
        """Count the points."""
        return len(self.ideal)

    def __getitem__(self, keep: Index | Mask) -> Deviations:
        """Select points."""
        return Deviations(**{one.name: getattr(self, one.name)[keep] for one in fields(self)})


def measure(image: np.ndarray, ideal: np.ndarray, *, windows: Windows | None = None) -> Deviations:
    """Measure one corner of each cell of an ideal picture in another image of the same camera.

    Parameters
    ----------
    image, ideal : ndarray, shape (rows, cols, bands)
    windows : Windows, optional

    Returns
    -------
    Deviations
        Points that are found nowhere, or badly, are left out.
    """
    if image.shape[:2] != ideal.shape[:2]:
        msg = f"the two pictures have {image.shape[:2]} and {ideal.shape[:2]} rows and columns"
        raise ValueError(msg)
    windows = windows or Windows()
    a, b = grey(ideal), grey(image)
    at = _corners(a, windows)
    near, coefficient = correlate(
        a, b, at, at.astype(float), half=windows.correlation_px // 2, search=windows.search_px
    )
    alike = np.isfinite(near[:, 0]) & (coefficient >= LEAST_CORRELATION)
    found = match(a, b, at[alike], near[alike], half=windows.matching_px // 2)
    sigma = np.sqrt(np.mean(found.sigma_px**2, axis=1))
    good = np.isfinite(found.colrow[:, 0]) & (sigma <= windows.largest_sigma_px)
    places = at[alike][good].astype(float)
    return Deviations(ideal=places, d_px=found.colrow[good] - places, sigma_px=sigma[good])


def _corners(grey_ideal: Array, windows: Windows) -> Index:
    margin = windows.matching_px // 2 + windows.search_px + 4  # and the spline's reach
    allowed = np.zeros(grey_ideal.shape, dtype=bool)
    allowed[margin:-margin, margin:-margin] = True
    at, _ = best_of_cells(response(grey_ideal), allowed, windows.cell_px)
    return at


def consistent(found: Deviations, *, neighbours: int = 9) -> Mask:
    """Tell which points agree with those around them, shape (n,).

    Parameters
    ----------
    found : Deviations
    neighbours : int
        How many of the nearest are asked for their median.

    Returns
    -------
    ndarray of bool
        False where a point stands out by more than `robust.SUSPECT` spreads of all points.
    """
    expected.whole("neighbours", neighbours)
    if len(found) == 0:
        return np.zeros(0, dtype=bool)
    _, near = KDTree(found.ideal).query(found.ideal, k=min(neighbours, len(found)))
    near = near.reshape(len(found), -1)
    off = np.hypot(*(found.d_px - np.median(found.d_px[near], axis=1)).T)
    # the length of a plane normal vector has its median at 1.18 sigma
    keep: Mask = off <= SUSPECT * np.median(off) / 1.177
    return keep


def zones(orientation: RelativeOrientation, synthetic: Camera, colrow: Array) -> dict[str, Mask]:
    """Tell which points lie where one head sees, or several, or near the border.

    Parameters
    ----------
    orientation : RelativeOrientation
    synthetic : Camera
    colrow : ndarray, shape (n, 2)
        px of the synthetic camera.

    Returns
    -------
    dict of str to ndarray of bool
        By `ZONES`; the last one lies across the others.
    """
    xy = xy_from_colrow(synthetic, colrow)
    seen = [
        inside(camera, head_from_synthetic(orientation, k, xy))
        for k, camera in enumerate(orientation.heads)
    ]
    count = np.sum(seen, axis=0)
    size = np.array([synthetic.width_px, synthetic.height_px])
    from_border = np.min(np.minimum(colrow + 0.5, size - 0.5 - colrow), axis=1)
    near = from_border <= BORDER_SHARE * size.max()
    return dict(zip(ZONES, (count == 1, count > 1, near), strict=True))


# --- calibrated by itself --------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownGround:
    """Ground points with their coordinates, and where the camera was that saw them.

    Attributes
    ----------
    frame : MappingFrame
    T_m_c : Pose
        Of the camera, one pose, approximate.
    x_m : ndarray, shape (n, 3)
        Error-free, m.
    """

    frame: MappingFrame
    T_m_c: Pose
    x_m: Array


def one_image_block(camera: Camera, ground: KnownGround, colrow: Array, sigma_px: Array) -> Block:
    """Return the block of one image whose points are all known on the ground.

    Parameters
    ----------
    camera : Camera
    ground : KnownGround
    colrow : ndarray, shape (n, 2)
        Measured, px.
    sigma_px : ndarray, shape (n,)
    """
    n = len(ground.x_m)
    known = SurveyedPoints(
        point_idx=np.arange(n),
        x_m=ground.x_m,
        sigma_m=np.zeros((n, 3)),
    )
    return Block(
        frame=ground.frame,
        cameras=(camera,),
        images=Images(names=(camera.name,)),
        points=tuple(f"P{i}" for i in range(n)),
        image_points=ImagePoints(
            image_idx=np.zeros(n, dtype=np.intp),
            point_idx=np.arange(n),
            colrow=colrow,
            sigma_px=sigma_px,
        ),
        control=known,
        trajectory=Trajectory(
            exposures=("1",),
            T_m_b=Pose(R=ground.T_m_c.R[None], r=ground.T_m_c.r[None]),
        ),
    )


def self_calibrate(block: Block, *, free: Sequence[str]) -> Bundle:
    """Adjust a block of known points, exterior orientations free.

    Of one image over ground without relief, f and the flying height, and the principal point and
    the place, cannot be told apart; `free` should then have none of f, xp and yp.

    Parameters
    ----------
    block : Block
    free : sequence of str
        Interior parameters, names of `camera.INTERIOR`; the others are held.

    Raises
    ------
    AdjustmentError
        Where fewer than three points off one line are measured, or nothing converges.
    """
    require_control(block)
    return adjust(free_orientation(block, free=free))


def residuals_px(fit: Bundle) -> Array:
    """Return what an adjustment leaves, measured less estimated, col and row, shape (n, 2), px."""
    return -fit.solution.group("image_point").v
