"""A model of COLMAP as its files have it, text or binary."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.colmap import lens
from acx4lib.exchange.safe.opened import Opened
from acx4lib.expected import Array, Index
from acx4lib.flight.problems import PIXELS, quoted
from acx4lib.geometry.frames import Pose

Wrong = Callable[[str, str], FlightError]
"""From what is wrong and what was expected to the error that names the place."""

NO_POINTS = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
"""Numbers and coordinates of no points."""

LARGEST = 1e8
"""Largest coordinate, in pixels as in units of the model."""

UNMATCHED = -1
"""Number of the point of a measurement that belongs to none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """A camera.

    Attributes
    ----------
    model : str
        One of `lens.MODELS`.
    width, height : int
        px.
    parameters : tuple of float
    """

    model: str
    width: int
    height: int
    parameters: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Image:
    """An image.

    Attributes
    ----------
    number : int
    name : str
    camera : int
    pose : Pose
        The world in the camera's axes, y down, z ahead.
    xy : ndarray, shape (n, 2)
        Measurements, from the outer corner of the top-left pixel.
    points : ndarray, shape (n,)
        Their points, or `UNMATCHED`.
    wrong : callable
    """

    number: int
    name: str
    camera: int
    pose: Pose
    xy: Array
    points: Index
    wrong: Wrong


@dataclass(frozen=True, kw_only=True, eq=False)
class Rig:
    """A rig of cameras.

    Attributes
    ----------
    reference : int
        The camera whose axes are the rig's.
    others : mapping of int to Pose or None
        The rig in each other camera's axes; None where it is not known.
    """

    reference: int
    others: Mapping[int, Pose | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A model: cameras, images, points, rigs and frames.

    Attributes
    ----------
    sources : tuple of Opened
    cameras : mapping of int to Camera
    images : tuple of Image
    point_ids : ndarray, shape (m,)
    points : ndarray, shape (m, 3)
    rigs : tuple of Rig
    frames : mapping of int to int
        The frame of each image.
    """

    sources: tuple[Opened, ...]
    cameras: Mapping[int, Camera]
    images: tuple[Image, ...]
    point_ids: Index
    points: Array
    rigs: tuple[Rig, ...] = ()
    frames: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Encoding:
    """A way to write a model to files, and what reads each of these.

    Attributes
    ----------
    ending : str
    cameras, images, points, rigs, frames : callable
    """

    ending: str
    cameras: Callable[[Opened], Mapping[int, Camera]]
    images: Callable[[Opened], Iterable[Image]]
    points: Callable[[Opened], tuple[Index, Array]]
    rigs: Callable[[Opened], Iterable[Rig]]
    frames: Callable[[Opened], Mapping[int, int]]

    def read(self, files: Mapping[str, Opened]) -> Model:
        """Return a model from its files, by their names without endings.

        All but ``cameras`` may be absent; FlightError if one is wrong.
        """
        ids, places = self.points(files["points3D"]) if "points3D" in files else NO_POINTS
        return Model(
            sources=tuple(files.values()),
            cameras=self.cameras(files["cameras"]),
            images=tuple(self.images(files["images"])) if "images" in files else (),
            point_ids=ids,
            points=places,
            rigs=tuple(self.rigs(files["rigs"])) if "rigs" in files else (),
            frames=self.frames(files["frames"]) if "frames" in files else {},
        )


def camera(name: str, width: float, height: float, parameters: Array, wrong: Wrong) -> Camera:
    """Return a camera after checks."""
    if name not in lens.MODELS:
        known = ", ".join(lens.MODELS)
        raise wrong(f"lens model {quoted(name)}", f"must be one of {known}")
    if width not in PIXELS or height not in PIXELS:
        raise wrong(f"{width} x {height} px", f"width and height {PIXELS}")
    wanted = lens.MODELS[name].names
    if len(parameters) != len(wanted):
        raise wrong(f"{name} has {len(parameters)} parameters", f"must be {', '.join(wanted)}")
    require_size(parameters, wrong)
    if (parameters[: lens.MODELS[name].first - 2] <= 0).any():
        raise wrong(f"{name} {parameters.tolist()}", "focal lengths must be positive")
    return Camera(
        model=name, width=int(width), height=int(height), parameters=tuple(parameters.tolist())
    )


def require_size(values: Array, wrong: Wrong) -> None:
    """Raise where coordinates are not finite, or larger than any is."""
    fits = np.abs(values) <= LARGEST
    if not fits.all():
        raise wrong(
            f"coordinate {values[~fits][0]:g}", f"must be between -{LARGEST:g} and {LARGEST:g}"
        )


def pose(values: Array, wrong: Wrong) -> Pose:
    """Return a pose from qw, qx, qy, qz, tx, ty, tz."""
    require_size(values, wrong)
    size = float(np.linalg.norm(values[:4]))
    if not 0.5 < size < 2:
        raise wrong(f"quaternion of length {size:g}", "must be a quaternion of length 1")
    w, x, y, z = values[:4] / size
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return Pose(R=R, r=np.asarray(values[4:7], dtype=float))
