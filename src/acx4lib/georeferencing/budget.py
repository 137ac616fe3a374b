"""The error budget: the variance of a ground point, split by its sources.

The error of a point is a sum: errors of its image points and of the survey it is compared with,
of the trajectory at each of its exposures, and of the calibration. Independent sources add their
variances. The estimates of a calibration are correlated, so the variance also has terms with two
groups of parameters. Such a term is a source by itself here; it may be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from acx4lib.block import Block, ImagePoints, Images, Trajectory
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import Calibration, to_reported
from acx4lib.calibration.held import Held
from acx4lib.calibration.mounting import Mounting
from acx4lib.design import flying_heights
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, correct, inside, xy_from_colrow
from acx4lib.geometry.collinearity import as_seen, pinhole, project, rays, to_camera
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.intersection import largest_angles
from acx4lib.georeferencing import direct
from acx4lib.georeferencing.accuracy import Triple, triple
from acx4lib.georeferencing.direct import Georeferenced
from acx4lib.georeferencing.error_sources import ErrorSources, turned

TRAJECTORY = {"GNSS": (0, 1, 2), "roll": (3,), "pitch": (4,), "heading": (5,)}
"""Columns of a body pose, by source: position, and small turns about the body's axes."""

CALIBRATED = ("boresight", "lever arm", "interior orientation")
"""Groups of calibrated parameters."""

PAIRS = tuple(combinations_with_replacement(range(len(CALIBRATED)), 2))
"""Each group with itself, and with each later one."""

CALIBRATION = tuple(" with ".join(dict.fromkeys((CALIBRATED[a], CALIBRATED[b]))) for a, b in PAIRS)
"""Sources of the calibration: its groups, and their correlations."""

SOURCES = ("image points", "survey", *TRAJECTORY, *CALIBRATION)
"""All sources, in the order of `Budget.variance`."""

GROUPS = {
    "image and survey": SOURCES[:2],
    "trajectory": tuple(TRAJECTORY),
    "calibration": CALIBRATION,
}
"""The sources in three groups, which are independent of one another."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Budget:
    """Predicted variances of n points, by their sources.

    Attributes
    ----------
    variance : ndarray, shape (n, 3, n_sources)
        m^2, along the axes of the points' errors, in the order of `SOURCES`; the sum over the last
        axis is the variance of the point.
    """

    variance: Array

    def __len__(self) -> int:
        """Count the points."""
        return len(self.variance)

    @property
    def sigma(self) -> Array:
        """Standard deviation of every point, shape (n, 3), m."""
        return np.sqrt(self.variance.sum(axis=-1))

    @property
    def mean(self) -> Array:
        """Mean variance of the points, shape (3, n_sources), m^2.

        NaN are left out: points that are not determined.
        """
        known = self.variance[np.isfinite(self.variance).all(axis=(1, 2))]
        return known.mean(axis=0) if len(known) else np.full((3, len(SOURCES)), np.nan)

    @property
    def rms(self) -> Array:
        """Predicted RMS of the points' errors, shape (3,), m."""
        return np.sqrt(self.mean.sum(axis=-1))


def of(sources: ErrorSources, layout: Layout) -> Budget:
    """Split the variances of points by their sources.

    Valid where positions are independent of attitudes, and the three angles of one another, as
    `Trajectory.cov` has them. Errors that exposures share belong to the source that they are of.

    Parameters
    ----------
    sources : ErrorSources
        Of points, differences or pairs, along any axes.
    layout : Layout
        Columns of the calibration, `Georeferenced.layout`.

    Returns
    -------
    Budget
        Its sum is the diagonal of `sources.cov`, to rounding.

    Notes
    -----
    With x = A a + B b and the covariance C of a and b, var(x) = A C_aa A^T + B C_bb B^T +
    2 A C_ab B^T; the last is the part of their correlations.
    """
    variance = np.zeros((len(sources), 3, len(SOURCES)))
    variance[:, :, 0] = np.diagonal(sources.image, axis1=1, axis2=2)
    variance[:, :, 1] = np.diagonal(sources.survey, axis1=1, axis2=2)
    cov = sources.cov_body[sources.exposure]
    point, i, j = sources.neighbours
    first, second, between = sources.by_body[i], sources.by_body[j], sources.between(i, j)
    for s, columns in enumerate(TRAJECTORY.values(), start=2):
        chosen = np.array(columns)
        by_exposure = _product(sources.by_body, cov, chosen, chosen)
        np.add.at(variance[:, :, s], sources.point, by_exposure)
        shared = (first[:, :, chosen] @ between[:, chosen[:, None], chosen]) * second[:, :, chosen]
        np.add.at(variance[:, :, s], point, 2 * shared.sum(axis=-1))
    groups = (layout.mount[:, 3:], layout.mount[:, :3], layout.interior)
    columns_of = [np.unique(group[group >= 0]) for group in groups]
    J, C = sources.by_parameters, sources.cov_parameters
    for s, (a, b) in enumerate(PAIRS, start=2 + len(TRAJECTORY)):
        part = _product(J, C, columns_of[a], columns_of[b])
        variance[:, :, s] = part if a == b else 2 * part
    return Budget(variance=variance)


def _product(J: Array, cov: Array, a: Index, b: Index) -> Array:
    """Return the diagonal of J_a cov_ab J_b^T over leading axes, shape (n, 3)."""
    right = J[:, :, b] @ np.swapaxes(cov[..., a[:, None], b], -1, -2)
    return np.sum(J[:, :, a] * right, axis=-1)


def shares(variance: Array) -> dict[str, Array]:
    """Return the share of each group of sources in a variance.

    Parameters
    ----------
    variance : ndarray, shape (..., n_sources)

    Returns
    -------
    dict of str to ndarray, shape (...)
        By the names of `GROUPS`; they add up to one.
    """
    total = variance.sum(axis=-1)
    return {
        name: variance[..., [SOURCES.index(source) for source in sources]].sum(axis=-1) / total
        for name, sources in GROUPS.items()
    }


def predict(
    block: Block,
    georeferenced: Georeferenced,
    x_m: Array,
    *,
    sigma_px: float,
    sigma_survey_m: Sequence[float] = (0.0, 0.0, 0.0),
) -> Budget:
    """Predict the errors of points that are intersected from all images showing them.

    It needs no measurements; image points are projections of the points.

    Parameters
    ----------
    block : Block
        Its images; its own points are not used.
    georeferenced : Georeferenced
        The block's poses, as `direct.georeference` returns them.
    x_m : ndarray, shape (n, 3)
        Mapping frame, m.
    sigma_px : float
        Standard deviation of every image point.
    sigma_survey_m : sequence of float
        Of the coordinates with which a point is compared: east, north, height.

    Returns
    -------
    Budget
        Along east, north and height; NaN for points whose rays from fewer than two images meet at
        the block's smallest angle.
    """
    points, sources = _sources_at(block, georeferenced, x_m, sigma_px, sigma_survey_m)
    variance = np.full((len(x_m), 3, len(SOURCES)), np.nan)
    variance[points] = of(sources, georeferenced.layout).variance
    return Budget(variance=variance)


def _sources_at(
    block: Block,
    georeferenced: Georeferenced,
    x_m: Array,
    sigma_px: float,
    sigma_survey_m: Sequence[float],
) -> tuple[Index, ErrorSources]:
    """Return the points that are predicted, and the sources of their errors; as `predict`."""
    image_idx, point_idx, colrow = shown(block, georeferenced, x_m)
    towards = x_m[point_idx] - georeferenced.T_m_c.r[image_idx]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    known = largest_angles(towards, point_idx, len(x_m)) >= block.smallest_angle
    rows = np.flatnonzero(known[point_idx])
    points, group = np.unique(point_idx[rows], return_inverse=True)
    measured = direct.Rays(
        image_idx=image_idx[rows],
        group=group,
        colrow=colrow[rows],
        sigma_px=np.full(len(rows), sigma_px),
    )
    met = direct.intersect_rays(block, georeferenced, measured)
    sources = turned(met.sources, block.frame.grid_axes(x_m[points]))
    surveyed = np.tile(np.diag(np.square(sigma_survey_m)), (len(points), 1, 1))
    return points, replace(sources, survey=surveyed)


def shown(block: Block, georeferenced: Georeferenced, x_m: Array) -> tuple[Index, Index, Array]:
    """Return all projections of points into images: image, point and pixel of each.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    x_m : ndarray, shape (n, 3)
        Mapping frame, m.

    Returns
    -------
    image_idx, point_idx : ndarray, shape (k,)
        Sorted by point.
    colrow : ndarray, shape (k, 2)
    """
    rows: list[tuple[Index, Index, Array]] = []
    limits = [_limits(camera) for camera in georeferenced.cameras]
    for i, k in enumerate(block.images.camera_idx):
        camera, T_m_c = georeferenced.cameras[k], georeferenced.T_m_c[i : i + 1]
        seen_at = as_seen(T_m_c.r, x_m, refraction=georeferenced.refraction)
        ideal = pinhole(camera.interior.f, to_camera(T_m_c, seen_at))
        near = np.flatnonzero(np.all(np.abs(ideal) <= limits[k], axis=1))
        pixels = project(camera, T_m_c, seen_at[near])
        within = inside(camera, pixels)
        rows.append((np.full(int(within.sum()), i), near[within], pixels[within]))
    image, point, colrow = (np.concatenate(part) for part in zip(*rows, strict=True))
    order = np.argsort(point, kind="stable")
    return image[order], point[order], colrow[order]


def _limits(camera: Camera) -> Array:
    """Return the largest distances of ideal image points from the principal point, and 5 %, mm.

    Points beyond lie outside the format: their distorted place is not computed.
    """
    col, row = (np.array([0.0, 0.5, 1.0]) * n - 0.5 for n in (camera.width_px, camera.height_px))
    border = np.stack(np.meshgrid(col, row), axis=-1).reshape(-1, 2)
    ideal = correct(camera.interior, xy_from_colrow(camera, border))
    return 1.05 * np.abs(ideal).max(axis=0)


# --- A regular mapping flight, for predictions of ground points and their errors


@dataclass(frozen=True, kw_only=True)
class MappingFlight:
    """Parallel strips over flat ground, flown there and back, with a level aircraft.

    Attributes
    ----------
    height_m : float
        Above ground.
    forward, side : float
        Overlaps, 0 to 1.
    sigma_position_m : tuple of three floats
        Of GNSS: east, north, height.
    sigma_attitude : tuple of three floats
        Roll, pitch, heading, radians.
    sigma_px : float
        Of an image point.
    sigma_survey_m : tuple of three floats
        Of the coordinates with which a point is compared; zero for the point's own error.
    """

    height_m: float
    forward: float = 0.6
    side: float = 0.3
    sigma_position_m: Triple
    sigma_attitude: Triple
    sigma_px: float
    sigma_survey_m: Triple = (0.0, 0.0, 0.0)


def spacing(camera: Camera, flight: MappingFlight) -> tuple[float, float]:
    """Return the base in a strip and the distance of strips, m.

    Valid for a camera that looks down; its sides may be turned by about quarter turns.
    """
    corners = _on_ground(camera, _level(np.zeros((1, 2)), flight), _corners(camera))
    by_place = np.sort(corners[:, :2], axis=0)
    length, width = by_place[2:].mean(axis=0) - by_place[:2].mean(axis=0)
    return float((1 - flight.forward) * length), float((1 - flight.side) * width)


def fly(camera: Camera, flight: MappingFlight) -> Block:
    """Return a block of an image, in its middle, and all overlapping neighbours.

    Parameters
    ----------
    camera : Camera
        With the mounting of the body, which flies east and back west.
    flight : MappingFlight

    Returns
    -------
    Block
        In a local frame whose ground has height zero below the middle image; no points.
    """
    base, strip_distance = spacing(camera, flight)
    n_along, n_aside = (int(np.ceil(1 / (1 - share))) for share in (flight.forward, flight.side))
    places = [
        (i * base, j * strip_distance)
        for j in range(-n_aside, n_aside + 1)
        for i in range(-n_along, n_along + 1)
    ]
    strips = np.repeat(np.arange(-n_aside, n_aside + 1), 2 * n_along + 1)
    T_m_b = _level(np.array(places), flight, back=strips % 2 == 1)
    n = len(places)
    nothing = np.zeros(0, dtype=np.intp)
    return Block(
        cameras=(camera,),
        images=Images(names=tuple(f"{i}" for i in range(n)), strips=tuple(map(str, strips))),
        points=(),
        image_points=ImagePoints(
            image_idx=nothing, point_idx=nothing, colrow=np.zeros((0, 2)), sigma_px=np.zeros(0)
        ),
        trajectory=Trajectory(
            exposures=tuple(f"{i}" for i in range(n)),
            T_m_b=T_m_b,
            sigma_position=np.tile(flight.sigma_position_m, (n, 1)),
            sigma_attitude=np.tile(flight.sigma_attitude, (n, 1)),
        ),
        name="mapping",
    )


def _level(places: Array, flight: MappingFlight, back: Array | None = None) -> Pose:
    """Return poses of a level body; it flies west where `back` is true."""
    n = len(places)
    turn = np.zeros((n, 3))
    turn[:, 2] = np.pi * (np.zeros(n) if back is None else back)
    r = np.column_stack([places, np.full(n, flight.height_m)])
    return Pose(R=rotation_from_opk(turn), r=r)


def over_ground(calibration: Calibration, flight: MappingFlight, *, n: int = 32) -> Budget:
    """Predict the errors of points that lie evenly on the ground of a mapping flight.

    Valid away from the flight's borders; its `rms` is to be expected at check points.

    Parameters
    ----------
    calibration : Calibration
        Of one camera.
    flight : MappingFlight
    n : int
        Points in each direction of the part of the ground that repeats. The borders of images cut
        it; with so many points their mean is within one percent of that of all ground.

    Returns
    -------
    Budget
        East is along the strips.
    """
    (camera,) = calibration.cameras
    base, strip_distance = spacing(camera, flight)
    middle = (np.arange(n) + 0.5) / n - 0.5
    x, y = (part.ravel() for part in np.meshgrid(base * middle, strip_distance * middle))
    return _predicted(calibration, flight, np.column_stack([x, y, np.zeros(n * n)]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Format:
    """Predicted errors of the ground points of an image of a mapping flight.

    Attributes
    ----------
    colrow : ndarray, shape (rows, columns, 2)
        A grid of its pixels, from edge to edge.
    budget : Budget
        Of their ground points, row after row; NaN where no other image shows the point.
    """

    colrow: Array
    budget: Budget

    @property
    def variance(self) -> Array:
        """Variances, shape (rows, columns, 3, n_sources), m^2: along the strip, across, height."""
        return self.budget.variance.reshape(*self.colrow.shape[:2], *self.budget.variance.shape[1:])

    @property
    def sigma(self) -> Array:
        """Standard deviations, shape (rows, columns, 3), m."""
        return np.sqrt(self.variance.sum(axis=-1))


def over_format(calibration: Calibration, flight: MappingFlight, *, n: int = 41) -> Format:
    """Predict the errors of ground points all over the format of an image of a mapping flight.

    Every point is intersected from all images that show it. Where another image begins or ends to
    show it, its error steps.

    Parameters
    ----------
    calibration : Calibration
        Of one camera.
    flight : MappingFlight
    n : int
        Pixels along the longer side of the format.
    """
    (camera,) = calibration.cameras
    size = np.array([camera.width_px, camera.height_px])
    columns, rows = np.maximum(np.round(n * size / size.max()).astype(int), 2)
    col, row = np.meshgrid(np.linspace(0, size[0] - 1, columns), np.linspace(0, size[1] - 1, rows))
    colrow = np.stack([col, row], axis=-1)
    ground = _on_ground(camera, _level(np.zeros((1, 2)), flight), colrow.reshape(-1, 2))
    return Format(colrow=colrow, budget=_predicted(calibration, flight, ground))


def like(block: Block, camera: Camera) -> MappingFlight | None:
    """Return a mapping flight of a camera like a block; None if a property is not known.

    It has the median height of the block, its accuracies, and the usual overlaps.
    """
    points, trajectory = block.image_points, block.trajectory
    pixel = np.array([of.pixel_mm for of in block.cameras])
    sigma_mm = points.sigma_px * pixel[block.images.camera_idx[points.image_idx]]
    height_m = float(np.median(flying_heights(block)))
    position, attitude = _rms(trajectory.sigma_position), _rms(trajectory.sigma_attitude)
    sigma_px = float(_rms(sigma_mm[np.isfinite(sigma_mm)])) / camera.pixel_mm
    if not (np.isfinite([height_m, sigma_px, *position, *attitude]).all() and height_m > 0):
        return None
    return MappingFlight(
        height_m=height_m,
        sigma_position_m=triple(position),
        sigma_attitude=triple(attitude),
        sigma_px=sigma_px,
    )


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=0)) if len(values) else np.array(np.nan)


def _predicted(calibration: Calibration, flight: MappingFlight, x_m: Array) -> Budget:
    block = fly(calibration.cameras[0], flight)
    return predict(
        block,
        direct.georeference(block, calibration),
        x_m,
        sigma_px=flight.sigma_px,
        sigma_survey_m=flight.sigma_survey_m,
    )


def looks_down(camera: Camera) -> bool:
    """Tell whether the whole format of a camera on a level body shows ground."""
    T_m_c = Pose(R=np.eye(3)[None], r=np.zeros((1, 3))) @ camera.T_b_c
    return bool(np.all(rays(camera, T_m_c, _corners(camera))[:, 2] < 0))


def _on_ground(camera: Camera, T_m_b: Pose, colrow: Array) -> Array:
    """Return the points of height zero that pixels of a camera show, shape (n, 3), m."""
    if not looks_down(camera):
        msg = f"camera {camera.name}: expected one that looks down with all of its format"
        raise ValueError(msg)
    T_m_c = T_m_b @ camera.T_b_c
    towards = rays(camera, T_m_c, colrow)
    return T_m_c.r - (T_m_c.r[:, 2:] / towards[:, 2:]) * towards


def _corners(camera: Camera) -> Array:
    """Return the outer corners of the format, pixels, shape (4, 2)."""
    right, low = camera.width_px - 0.5, camera.height_px - 0.5
    return np.array([[-0.5, -0.5], [right, -0.5], [right, low], [-0.5, low]])


# --- What single parameters and held values mean for the ground ------------------------------


def parameter_shares(sources: ErrorSources, calibration: Calibration) -> Array | None:
    """Return the relative decrease of ground point variances if a parameter becomes known.

    Parameters
    ----------
    sources : ErrorSources
        Of points, with the covariance of the calibration.
    calibration : Calibration

    Returns
    -------
    ndarray, shape (3, n), or None
        Along the axes of the points, for every reported parameter; None without points. Shares of
        correlated parameters do not add up to that of all.

    Notes
    -----
    A parameter with the variance c and the covariances C e with all of them has (J C e)^2 / c of
    the variance of a point with the derivatives J: the remainder is the variance given the
    parameter. J_e^2 c would also count the part that another parameter compensates.
    """
    if len(sources) == 0:
        return None
    total = np.diagonal(sources.cov, axis1=1, axis2=2).mean(axis=0)
    T = to_reported(calibration)
    C = sources.cov_parameters @ T.T
    variance = np.diagonal(T @ C)
    by_each = np.mean((sources.by_parameters @ C) ** 2, axis=0)
    return by_each / np.where(variance > 0, variance, np.inf) / total[:, None]


def shares_at_corners(calibration: Calibration, block: Block) -> Array | None:
    """Return `parameter_shares` of the ground under the corners of the format, over all cameras.

    The images are those of a regular mapping flight at the height of a block, with the accuracies
    of this block; a share is the largest over the cameras. None where no camera looks down, or
    something is not known.
    """
    shares = [
        parameter_shares(sources, calibration) for sources in _corners_like(calibration, block)
    ]
    known = [of_camera for of_camera in shares if of_camera is not None]
    return np.max(known, axis=0) if known else None


def displacement(mounting: Mounting, held: Held) -> tuple[Array, Array] | None:
    """Return how far the ground moves where held values that the data reject are freed together.

    The ground under the corners of the format of all cameras, by direct georeferencing in a
    regular mapping flight like that of the block. The calibration moves by the linear step.

    Parameters
    ----------
    mounting : Mounting
        Of the single step or a rig.
    held : Held
        Its held values, tested.

    Returns
    -------
    d, sigma : ndarray, shape (n, 3), or None
        Displacement and predicted standard deviation, m: along the strip, across it, height. None
        where nothing is rejected, no camera looks down or no such flight can be predicted.
    """
    if not held.rejected:
        return None
    n, columns, before = len(held.names), held.network.layout, mounting.calibration
    cov = np.zeros((n + before.n_columns,) * 2)
    cov[n:, n:] = before.total_cov
    extended = replace(  # the held parameters come first, without sigma
        before,
        layout=replace(
            before.layout,
            interior=columns.interior,
            mount=columns.mount,
            shift=np.where(columns.shift < n, columns.shift, -1),
        ),
        cov=cov,
        cov_before=None,
        open_columns=np.append(np.zeros(n, dtype=bool), before.open_columns),
    )
    dx = held.change(held.rejected)[: extended.n_columns]
    corners = _corners_like(extended, mounting.bundle.network.block)
    moved = [
        (sources.by_parameters @ dx, of(sources, extended.layout).sigma) for sources in corners
    ]
    if not moved:
        return None
    d, sigma = (np.concatenate(part) for part in zip(*moved, strict=True))
    return d, sigma


def _corners_like(calibration: Calibration, block: Block) -> list[ErrorSources]:
    """Return the sources of the errors of the ground under the four corners of every format.

    In a mapping flight like a block; without cameras that do not look down.
    """
    out = []
    for camera in calibration.cameras:
        flight = like(block, camera)
        if flight is None or not looks_down(camera):
            continue
        flown = fly(camera, flight)
        last = np.array([camera.width_px - 1.0, camera.height_px - 1.0])
        corners = last * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        ground = _on_ground(camera, _level(np.zeros((1, 2)), flight), corners)
        posed = direct.georeference(flown, calibration)
        out.append(_sources_at(flown, posed, ground, flight.sigma_px, flight.sigma_survey_m)[1])
    return out
