"""A regular mapping flight, for predictions: which points it sees, and how well it gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.flight.block import Block, ImagePoints, Images, Trajectory
from acx4lib.flight.design import flying_heights
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.georeferencing import budget, direct
from acx4lib.georeferencing.accuracy import Triple, triple
from acx4lib.georeferencing.budget import Budget
from acx4lib.georeferencing.error_sources import ErrorSources


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

    def __post_init__(self) -> None:
        expected.positive_number("height_m", self.height_m)
        expected.positive_number("sigma_px", self.sigma_px)
        for name in ("sigma_position_m", "sigma_attitude", "sigma_survey_m"):
            expected.three(name, getattr(self, name))
            expected.not_negative(name, np.asarray(getattr(self, name)))
        for name in ("forward", "side"):
            if not 0 <= getattr(self, name) < 1:
                given = getattr(self, name)
                raise ValueError(f"{name}: expected an overlap from 0 to less than 1, got {given}")


def spacing(camera: Camera, flight: MappingFlight) -> tuple[float, float]:
    """Return the base in a strip and the distance of strips, m.

    Valid for a camera that looks down; its sides may be turned by about quarter turns.
    """
    corners = _on_ground(camera, _level(np.zeros((1, 2)), flight), _corners(camera))
    by_place = np.sort(corners[:, :2], axis=0)
    length, width = by_place[2:].mean(axis=0) - by_place[:2].mean(axis=0)
    return float((1 - flight.forward) * length), float((1 - flight.side) * width)


def fly(camera: Camera, flight: MappingFlight) -> Block:
    """Return the block in which all neighbours of one image are: the image at its middle.

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
    base, apart = spacing(camera, flight)
    n_along, n_aside = (int(np.ceil(1 / (1 - share))) for share in (flight.forward, flight.side))
    places = [
        (i * base, j * apart)
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
    """Return poses of a level body; it flies back west where told."""
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
    camera = _only_camera(calibration)
    expected.whole("n", n)
    base, apart = spacing(camera, flight)
    middle = (np.arange(n) + 0.5) / n - 0.5
    x, y = (part.ravel() for part in np.meshgrid(base * middle, apart * middle))
    return _predicted(calibration, flight, np.column_stack([x, y, np.zeros(n * n)]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Format:
    """Predicted errors of the ground points that one image of a mapping flight shows.

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
    camera = _only_camera(calibration)
    expected.whole("n", n, least=2)
    size = np.array([camera.width_px, camera.height_px])
    columns, rows = np.maximum(np.round(n * size / size.max()).astype(int), 2)
    col, row = np.meshgrid(np.linspace(0, size[0] - 1, columns), np.linspace(0, size[1] - 1, rows))
    colrow = np.stack([col, row], axis=-1)
    ground = _on_ground(camera, _level(np.zeros((1, 2)), flight), colrow.reshape(-1, 2))
    return Format(colrow=colrow, budget=_predicted(calibration, flight, ground))


def at_corners(calibration: Calibration, camera: Camera, flight: MappingFlight) -> ErrorSources:
    """Return the sources of the errors of the ground under the four corners of an image's format.

    Parameters
    ----------
    calibration : Calibration
        Of this camera and of others.
    camera : Camera
    flight : MappingFlight
        Of this camera.
    """
    block = fly(camera, flight)
    last = np.array([camera.width_px - 1.0, camera.height_px - 1.0])
    corners = last * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    ground = _on_ground(camera, _level(np.zeros((1, 2)), flight), corners)
    _, sources = budget.sources_at(
        block,
        direct.georeference(block, calibration),
        ground,
        sigma_px=flight.sigma_px,
        sigma_survey_m=np.array(flight.sigma_survey_m),
    )
    return sources


def like(block: Block, camera: Camera) -> MappingFlight | None:
    """Return a mapping flight of a camera like a block; None where something of it is not known.

    It has the median height of the block, its accuracies, and the usual overlaps.
    """
    pixel = np.array([one.pixel_mm for one in block.cameras])
    points = block.image_points
    sigma_mm = points.sigma_px * pixel[block.images.camera_idx[points.image_idx]]
    height_m = float(np.median(flying_heights(block)))
    position, attitude = (
        _rms(block.trajectory.sigma_position),
        _rms(block.trajectory.sigma_attitude),
    )
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


def _only_camera(calibration: Calibration) -> Camera:
    if len(calibration.cameras) != 1:
        raise ValueError(f"calibration: expected one camera, got {len(calibration.cameras)}")
    return calibration.cameras[0]


def _predicted(calibration: Calibration, flight: MappingFlight, x_m: Array) -> Budget:
    block = fly(calibration.cameras[0], flight)
    return budget.predict(
        block,
        direct.georeference(block, calibration),
        x_m,
        sigma_px=flight.sigma_px,
        sigma_survey_m=np.array(flight.sigma_survey_m),
    )


def looks_down(camera: Camera) -> bool:
    """Tell whether a camera on a level body shows ground with all of its format."""
    T_m_c = Pose(R=np.eye(3)[None], r=np.zeros((1, 3))) @ camera.T_b_c
    return bool(np.all(rays(camera, T_m_c, _corners(camera))[:, 2] < 0))


def _on_ground(camera: Camera, T_m_b: Pose, colrow: Array) -> Array:
    """Return where pixels of the camera on one body show the height zero, shape (n, 3), m."""
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
