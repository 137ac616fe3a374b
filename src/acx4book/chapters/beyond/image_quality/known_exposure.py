"""A synthetic image whose every pixel is known: simulated heads, and one ideal camera beside them.

The ideal camera stands in the middle of the heads and takes the synthetic image's format at once,
without distortion, response or noise. What differs is the synthetic image's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4book.chapters.beyond.image_quality.deviations import (
    Deviations,
    KnownGround,
    Windows,
    consistent,
    measure,
)
from acx4book.paper import printed
from acx4lib import shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import INTERIOR, Camera, Interior, colrow_from_xy, xy_from_colrow
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem, mean_origin
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads, synthetic_from_head
from acx4lib.synthetic_image.rendering import FEATHER_PX, render, render_plan
from acx4lib.synthetic_image.response import Response
from acx4sim.designs import acx4_plan
from acx4sim.optics.lens import Camera as TrueCamera
from acx4sim.pictures.ground_rays import Station, ground_from_pixels, pixels_from_ground, station
from acx4sim.pictures.photography import landscape
from acx4sim.pictures.pictures import Ground, Tiles, head_images, picture

NODES_PX = 16
"""Full-size pixels between the exact nodes of the map, so that a reduced image shows no other."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class KnownExposure:
    """One exposure of which all is known.

    Attributes
    ----------
    at : simulate.Station
    images : tuple of ndarray, shape (rows, cols, 3)
        Of the heads, with response and noise.
    ideal : ndarray, shape (rows, cols, 3)
        What the ideal camera sees.
    orientation : RelativeOrientation
        The true one, as ground at the mean flying height sees it; full size, no covariance.
    synthetic : Camera
        The ideal camera, full size; its mounting is the middle of the heads.
    reduce : int
        The pictures have 1/reduce of the size.
    height_m : float
        Flying height over the mean ground.
    relief_m : float
        Root mean square of the ground's heights about their mean.
    """

    at: Station
    images: tuple[Raster, ...]
    ideal: Raster
    orientation: RelativeOrientation
    synthetic: Camera
    reduce: int
    height_m: float
    relief_m: float


# --- the exposure ----------------------------------------------------------------------------


def known_exposure(
    exposure: str = "H3-04", *, reduce: int, seed: int = 1, ground: Ground | None = None
) -> KnownExposure:
    """Simulate the heads' pictures of one exposure and the one that an ideal camera takes.

    Parameters
    ----------
    exposure : str
        Of the simulated flight.
    reduce : int
        The pictures have 1/reduce of the size.
    seed : int
        Of the flight, its landscape, responses and noise.
    ground : Ground, optional
        What lies there; the simulator's landscape by default.
    """
    plan = acx4_plan()
    at = station(plan, exposure, seed=seed)
    ground = Tiles(ground=ground or landscape(at, seed=seed))
    taken = head_images(at, ground, reduce=reduce, seed=seed)
    synthetic = _ideal_camera(at)
    ideal = picture(at, simulated(synthetic), ground, reduce=reduce)
    over_frame = np.asarray(nodes(synthetic, 40), dtype=np.float64)
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
        relief_m=float(heights.std()),
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
            width_px=one.width_px,
            height_px=one.height_px,
            pixel_mm=one.pixel_um / 1000,
            interior=Interior(
                f=one.f_mm, xp=one.xp_mm, yp=one.yp_mm, k1=one.k1, p1=one.p1, p2=one.p2
            ),
        )
        for name, one in zip(at.plan.heads, truth, strict=True)
    )
    f = synthetic.interior.f
    bases_m = np.array([one.lever_m for one in truth]) - synthetic.T_b_c.r
    n = len(heads) * (6 + len(INTERIOR))
    return RelativeOrientation(
        heads=heads,
        xyz_mm=f / height_m * bases_m + [0.0, 0.0, f],
        opk=np.radians([one.boresight_deg for one in truth]),
        cov_joint=np.zeros((n, n)),
        n_exposures=1,
    )


def nodes(camera: Camera, n: int) -> Array:
    """Return a grid over an image, n nodes along its longer side, shape (m, 2), px."""
    size = np.array([camera.width_px, camera.height_px])
    n_cols, n_rows = np.maximum(np.rint(n * size / size.max()).astype(int), 2)
    cols = np.linspace(-0.5, size[0] - 0.5, n_cols)
    rows = np.linspace(-0.5, size[1] - 0.5, n_rows)
    return np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)


def seen_ground(known: KnownExposure, colrow: Array) -> Array:
    """Return the ground that the ideal camera sees, east, north, height (m), shape (n, 3)."""
    places = np.asarray(colrow, dtype=np.float64)
    return ground_from_pixels(known.at, simulated(known.synthetic), places)


def known_ground(known: KnownExposure, colrow: Array) -> KnownGround:
    """Return that ground in a mapping frame under the aircraft, and the true camera over it."""
    grid, track = GridSystem(crs=known.at.plan.crs), known.at.track
    frame = mean_origin(grid, grid.lonlat_from_grid(track.x_g[:, :2]))
    # under the aircraft the mapping axes are east, north and up
    T_m_b = Pose(R=track.R_enu_b.as_matrix()[0], r=frame.from_grid(track.x_g)[0])
    return KnownGround(
        frame=frame,
        T_m_c=T_m_b @ known.synthetic.T_b_c,
        x_m=frame.from_grid(seen_ground(known, colrow)),
    )


# --- rendered and measured -------------------------------------------------------------------


def render_known(
    known: KnownExposure,
    orientation: RelativeOrientation,
    response: Response | None,
    *,
    feather_px: float = FEATHER_PX,
) -> Raster:
    """Render the synthetic image of a known exposure.

    Parameters
    ----------
    known : KnownExposure
    orientation : RelativeOrientation
        Full size.
    response : Response or None
        None leaves grey values as the heads took them.
    feather_px : float
        At full size; 0 is a hard seam.
    """
    plan = render_plan(
        reduced_heads(orientation, known.reduce),
        reduced_camera(known.synthetic, known.reduce),
        response=response,
        feather_px=feather_px / known.reduce,
        step_px=max(NODES_PX // known.reduce, 4),
    )
    return render(plan, known.images)


def deviations(
    known: KnownExposure,
    orientation: RelativeOrientation,
    response: Response,
    *,
    windows: Windows | None = None,
) -> Deviations:
    """Render an exposure by an orientation, and measure the image against the ideal picture.

    Returns
    -------
    Deviations
        In pixels of the full-size image; points that stand out from those around are left out.
    """
    image = render_known(known, orientation, response)
    found = measure(image, known.ideal, windows=windows)
    found = found[consistent(found)]
    small = reduced_camera(known.synthetic, known.reduce)
    return Deviations(
        ideal=colrow_from_xy(known.synthetic, xy_from_colrow(small, found.ideal)),
        d_px=known.reduce * found.d_px,
        sigma_px=known.reduce * found.sigma_px,
    )


def predicted(known: KnownExposure, orientation: RelativeOrientation, colrow: Array) -> Array:
    """Return where geometry alone puts known points in a synthetic image, less their ideal places.

    Ground points are seen by the simulated heads, and put into the synthetic image through the
    given orientation; where heads are blended, so are they.

    Parameters
    ----------
    known : KnownExposure
    orientation : RelativeOrientation
        Full size, with errors or without.
    colrow : ndarray, shape (n, 2)
        Ideal places, px of the full-size image.

    Returns
    -------
    ndarray, shape (n, 2)
        col, row, px of the full-size image.
    """
    x_g = np.asarray(seen_ground(known, colrow), dtype=np.float64)
    places, depth = [], []
    for k, camera in enumerate(orientation.heads):
        seen = pixels_from_ground(known.at, known.at.plan.cameras[camera.name], x_g)
        places.append(synthetic_from_head(orientation, k, seen))
        depth.append(border_depth(camera, seen))
    weight = _blend(np.stack(depth))
    blended = np.einsum("kn,kni->ni", weight, np.nan_to_num(np.stack(places)))
    return colrow_from_xy(known.synthetic, blended) - colrow


def border_depth(camera: Camera, colrow: Array) -> Array:
    """Return how far inside its border a head has a pixel, px; negative outside."""
    size = np.array([camera.width_px, camera.height_px])
    inner = np.min(np.minimum(colrow + 0.5, size - 0.5 - colrow), axis=1)
    return np.nan_to_num(inner, nan=-1.0)


def _blend(depth: Array) -> Array:
    """Return the weights of heads, shape (n_heads, n), as the renderer blends them."""
    ahead = depth.max(axis=0) - FEATHER_PX
    weight = np.maximum(np.minimum(depth, depth - ahead), 0.0)
    return weight / np.maximum(weight.sum(axis=0), np.finfo(float).tiny)
