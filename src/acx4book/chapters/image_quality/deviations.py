"""The quality of a synthetic image against known points of the ground (section 4.1).

Points are measured in it by least-squares matching with a picture that one ideal camera took at
the same place; and it is calibrated by itself, as if it were one camera's image, which shows what
part of its errors looks like a lens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import KDTree

from acx4book.paper import printed
from acx4lib import shown
from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.bundle.adjust import Bundle, adjust, free_orientation
from acx4lib.bundle.start import SUSPECT
from acx4lib.calibration.estimates import require_control
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index, Mask, Raster
from acx4lib.geometry.camera import (
    INTERIOR,
    Camera,
    Interior,
    colrow_from_xy,
    xy_from_colrow,
)
from acx4lib.geometry.frames import Pose, exp, opk_from_rotation, rotation_from_opk
from acx4lib.geometry.geodesy import MappingFrame
from acx4lib.model import Model
from acx4lib.synthetic_image.frame import (
    reduced_camera,
    reduced_heads,
)
from acx4lib.synthetic_image.rendering import FEATHER_PX, render, render_plan
from acx4lib.synthetic_image.response import Response
from acx4lib.tie_points.least_squares_matching import correlate, match
from acx4lib.tie_points.matching import best_of_cells, grey, response
from acx4sim.designs import acx4_plan
from acx4sim.optics import Camera as TrueCamera
from acx4sim.pictures import (
    Ground,
    Station,
    Tiles,
    ground_from_pixels,
    head_images,
    landscape,
    picture,
    station,
)

LENS = ("k1", "k2", "k3", "p1", "p2")
"""Lens parameters that the self-calibration of a synthetic image estimates."""

CELL_PX, CORRELATION_PX, MATCHING_PX = 40, 15, 21
"""Side of the cells that give a point each, of the windows of correlation and of matching."""

LEAST_CORRELATION, LARGEST_SIGMA_PX = 0.7, 0.15
"""Of a window with its match in the other picture, and of a matched point."""


# --- measured --------------------------------------------------------------------------------


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
        Of a coordinate, from the matching.
    """

    ideal: Array
    d_px: Array
    sigma_px: Array

    def __len__(self) -> int:
        """Count the points."""
        return len(self.ideal)

    def __getitem__(self, keep: Index | Mask) -> Deviations:
        """Select points."""
        return Deviations(**{field.name: getattr(self, field.name)[keep] for field in fields(self)})


def measure(image: np.ndarray, ideal: np.ndarray, *, search_px: int = 4) -> Deviations:
    """Measure one corner of each cell of an ideal picture in another image of the same camera.

    Parameters
    ----------
    image, ideal : ndarray, shape (rows, cols, bands)
    search_px : int
        Largest shift that is looked for.

    Returns
    -------
    Deviations
        Points without a match, or with a poor one, are left out.
    """
    a, b = grey(ideal), grey(image)
    margin = MATCHING_PX // 2 + search_px + 4  # and the spline's reach
    allowed = np.zeros(a.shape, dtype=bool)
    allowed[margin:-margin, margin:-margin] = True
    corners, _ = best_of_cells(response(a), allowed, CELL_PX)
    near, coefficient = correlate(
        a, b, corners, corners.astype(float), half=CORRELATION_PX // 2, search=search_px
    )
    alike = np.isfinite(near[:, 0]) & (coefficient >= LEAST_CORRELATION)
    matches = match(a, b, corners[alike], near[alike], half=MATCHING_PX // 2)
    sigma = np.sqrt(np.mean(matches.sigma_px**2, axis=1))
    good = np.isfinite(matches.colrow[:, 0]) & (sigma <= LARGEST_SIGMA_PX)
    places = corners[alike][good].astype(float)
    return Deviations(ideal=places, d_px=matches.colrow[good] - places, sigma_px=sigma[good])


def consistent(found: Deviations) -> Mask:
    """Mark the points that agree with their neighbours, shape (n,).

    False where a point is off the median of the nine nearest by more than `start.SUSPECT` spreads.
    """
    if len(found) == 0:
        return np.zeros(0, dtype=bool)
    _, near = KDTree(found.ideal).query(found.ideal, k=min(9, len(found)))
    near = near.reshape(len(found), -1)
    off = np.hypot(*(found.d_px - np.median(found.d_px[near], axis=1)).T)
    # the length of a plane normal vector has its median at 1.18 sigma
    keep: Mask = off <= SUSPECT * np.median(off) / 1.177
    return keep


# --- calibrated by itself --------------------------------------------------------------------


def one_image_block(
    camera: Camera, frame: MappingFrame, T_m_c: Pose, x_m: Array, found: Deviations
) -> Block:
    """Return the block of one image whose points are all known on the ground.

    Parameters
    ----------
    camera : Camera
    frame : MappingFrame
    T_m_c : Pose
        Of the camera, one pose, approximate.
    x_m : ndarray, shape (n, 3)
        Ground points, error-free, m.
    found : Deviations
        Of the points, which are measured at ideal + d_px.
    """
    n = len(x_m)
    return Block(
        frame=frame,
        cameras=(camera,),
        images=Images(names=(camera.name,)),
        points=tuple(f"P{i}" for i in range(n)),
        image_points=ImagePoints(
            image_idx=np.zeros(n, dtype=np.intp),
            point_idx=np.arange(n),
            colrow=found.ideal + found.d_px,
            sigma_px=found.sigma_px,
        ),
        control=SurveyedPoints(point_idx=np.arange(n), x_m=x_m, sigma_m=np.zeros((n, 3))),
        trajectory=Trajectory(exposures=("1",), T_m_b=Pose(R=T_m_c.R[None], r=T_m_c.r[None])),
    )


def self_calibrate(block: Block, *, free: Sequence[str]) -> Bundle:
    """Adjust a block of known points, exterior orientations free.

    Of one image over ground without relief, f and the flying height, and the principal point and
    the place, cannot be told apart; `free`, names of `camera.INTERIOR`, should then have none of
    f, xp and yp.

    Raises
    ------
    AdjustmentError
        Where fewer than three points off one line are measured, or nothing converges.
    """
    require_control(block)
    return adjust(free_orientation(block, Model(free=free)))


def residuals_px(fit: Bundle) -> Array:
    """Return the residuals of an adjustment, measured less estimated, col and row, (n, 2), px."""
    return -fit.solution.group("image_point").v


# --- heads with errors ------------------------------------------------------------------------


def with_turned_heads(
    truth: RelativeOrientation, *, rng: np.random.Generator, sigma_deg: float
) -> RelativeOrientation:
    """Return the heads with random rotations about all axes of all but the first."""
    turns = np.radians(sigma_deg) * rng.normal(size=(len(truth.heads), 3))
    turns[0] = 0.0
    R_s_h = rotation_from_opk(truth.opk) @ exp(turns)
    return replace(truth, opk=opk_from_rotation(R_s_h))


def with_wrong_interiors(
    truth: RelativeOrientation, *, rng: np.random.Generator
) -> RelativeOrientation:
    """Return the heads with random errors of their interiors, with Table 1's sigma.

    Parameters
    ----------
    truth : RelativeOrientation
        Its heads have the names of the paper's.
    rng : numpy.random.Generator
    """
    heads = []
    for head in truth.heads:
        drawn = np.append(rng.normal(size=len(INTERIOR) - 1), 0.0)  # the paper has no b2
        values = head.interior.to_array() + _printed_sigma(head.name) * drawn
        heads.append(head.with_interior(Interior.from_array(values)))
    return replace(truth, heads=tuple(heads))


def _printed_sigma(head: str) -> Array:
    """Return Table 1's sigma of a head's interior, zero where it has none, shape (10,)."""
    names = {name: f"{name}_mm" if name in ("f", "xp", "yp") else name for name in INTERIOR}
    listed = set(printed.table(1)["parameter"])
    sigma = [printed.sigma(1, key, head) if key in listed else 0.0 for key in names.values()]
    return np.nan_to_num(np.array(sigma))


# --- A synthetic image whose every pixel is known: simulated heads, and one ideal camera
# beside them
#
# The ideal camera stands in the middle of the heads and takes the synthetic image's format at
# once, without distortion, response or noise. What differs is the synthetic image's own.


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class KnownExposure:
    """One simulated exposure with its truth.

    Attributes
    ----------
    at : simulate.Station
    images : tuple of ndarray, shape (rows, cols, 3)
        Of the heads, with response and noise.
    ideal : ndarray, shape (rows, cols, 3)
        Picture of the ideal camera.
    orientation : RelativeOrientation
        The true one, as ground at the mean flying height sees it; full size, no covariance.
    synthetic : Camera
        The ideal camera, full size; its mounting is the middle of the heads.
    reduce : int
        The pictures have 1/reduce of the size.
    height_m : float
        Flying height over the mean ground.
    """

    at: Station
    images: tuple[Raster, ...]
    ideal: Raster
    orientation: RelativeOrientation
    synthetic: Camera
    reduce: int
    height_m: float


# --- the exposure ----------------------------------------------------------------------------


def known_exposure(
    exposure: str = "H3-04", *, reduce: int, seed: int = 1, ground: Ground | None = None
) -> KnownExposure:
    """Simulate the heads' pictures of one exposure, and the picture of an ideal camera.

    Parameters
    ----------
    exposure : str
        Of the simulated flight.
    reduce : int
        The pictures have 1/reduce of the size.
    seed : int
        Of the flight, its landscape, responses and noise.
    ground : Ground, optional
        The terrain; the simulator's landscape by default.
    """
    plan = acx4_plan()
    at = station(plan, exposure, seed=seed)
    ground = Tiles(ground=ground or landscape(at, seed=seed))
    taken = head_images(at, ground, reduce=reduce, seed=seed)
    synthetic = _ideal_camera(at)
    ideal = picture(at, simulated(synthetic), ground, reduce=reduce)
    cols = np.linspace(-0.5, synthetic.width_px - 0.5, 30)
    rows = np.linspace(-0.5, synthetic.height_px - 0.5, 40)
    over_frame = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)
    heights = ground_from_pixels(at, simulated(synthetic), over_frame)[:, 2]
    height_m = float(at.track.x_g[0, 2] - heights.mean())
    return KnownExposure(
        at=at,
        images=tuple(taken[name] for name in plan.heads),
        ideal=ideal,
        orientation=_true_orientation(at, synthetic, height_m),
        synthetic=synthetic,
        reduce=reduce,
        height_m=height_m,
    )


def _ideal_camera(at: Station) -> Camera:
    """Return the camera of Table 2 in the middle of the heads."""
    levers = np.array([at.plan.cameras[name].lever_m for name in at.plan.heads])
    return Camera(
        name="ideal",
        width_px=int(printed.value(2, "width_px", "SYN")),
        height_px=int(printed.value(2, "height_px", "SYN")),
        pixel_mm=printed.pixel_mm("SYN"),
        interior=Interior(f=printed.value(2, "f_mm", "SYN")),
        T_b_c=Pose(R=np.eye(3), r=levers.mean(axis=0)),
    )


def simulated(camera: Camera) -> TrueCamera:
    """Return the simulator's own camera with the values of ours."""
    x, y, z = camera.T_b_c.r.tolist()
    return TrueCamera(
        width_px=camera.width_px,
        height_px=camera.height_px,
        pixel_um=1000 * camera.pixel_mm,
        f_mm=camera.interior.f,
        lever_m=(x, y, z),
    )


def _true_orientation(at: Station, synthetic: Camera, height_m: float) -> RelativeOrientation:
    """Return the heads' true lenses and rotations, their places as seen from `height_m`."""
    truth = [at.plan.cameras[name] for name in at.plan.heads]
    heads = tuple(
        Camera(
            name=name,
            width_px=camera.width_px,
            height_px=camera.height_px,
            pixel_mm=camera.pixel_um / 1000,
            interior=Interior(
                f=camera.f_mm,
                xp=camera.xp_mm,
                yp=camera.yp_mm,
                k1=camera.k1,
                p1=camera.p1,
                p2=camera.p2,
            ),
        )
        for name, camera in zip(at.plan.heads, truth, strict=True)
    )
    f = synthetic.interior.f
    bases_m = np.array([camera.lever_m for camera in truth]) - synthetic.T_b_c.r
    n = len(heads) * (6 + len(INTERIOR))
    return RelativeOrientation(
        heads=heads,
        xyz_mm=f / height_m * bases_m + [0.0, 0.0, f],
        opk=np.radians([camera.boresight_deg for camera in truth]),
        cov_joint=np.zeros((n, n)),
        n_exposures=1,
    )


def seen_ground(known: KnownExposure, colrow: Array) -> Array:
    """Return the ground that the ideal camera sees, east, north, height (m), shape (n, 3)."""
    places = np.asarray(colrow, dtype=np.float64)
    return ground_from_pixels(known.at, simulated(known.synthetic), places)


# --- rendered and measured -------------------------------------------------------------------


def deviations(
    known: KnownExposure,
    orientation: RelativeOrientation,
    response: Response,
    *,
    search_px: int = 4,
) -> Deviations:
    """Render an exposure by an orientation, and measure the image against the ideal picture.

    Returns
    -------
    Deviations
        In pixels of the full-size image; points that disagree with their neighbours are left out.
    """
    small = reduced_camera(known.synthetic, known.reduce)
    plan = render_plan(
        reduced_heads(orientation, known.reduce),
        small,
        response=response,
        feather_px=FEATHER_PX / known.reduce,
    )
    points = measure(render(plan, known.images), known.ideal, search_px=search_px)
    points = points[consistent(points)]
    return Deviations(
        ideal=colrow_from_xy(known.synthetic, xy_from_colrow(small, points.ideal)),
        d_px=known.reduce * points.d_px,
        sigma_px=known.reduce * points.sigma_px,
    )
