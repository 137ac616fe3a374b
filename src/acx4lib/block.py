"""A photogrammetric block: images, measurements, control and trajectory as plain arrays.

All coordinates are in the mapping frame. Every name is stored once, as text; observations are
flat arrays that refer to the names by indices from zero.

Values are checked when they are made, and a `ValueError` says what is wrong. A part checks its
own values, the block checks the indices into it. A selection from a part is not checked again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.expected import NOT_GIVEN, Array, Index, Mask
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import LocalFrame, MappingFrame
from acx4lib.least_squares.covariance import WHITE, GaussMarkov

if TYPE_CHECKING:
    import pandas as pd


SMALLEST_ANGLE = float(np.radians(2.0))
"""A block leaves out tie points whose rays meet at less than this, unless it says otherwise."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Images:
    """The images of a block.

    Attributes
    ----------
    names, strips : tuple of str
        One each per image; a strip may be empty, as all are by default.
    camera_idx, exposure_idx : ndarray, shape (n_images,)
        Indices of the block's cameras and of the trajectory's exposures; by default the first
        camera, and exposures one after the other.
    """

    names: tuple[str, ...]
    camera_idx: Index = NOT_GIVEN
    exposure_idx: Index = NOT_GIVEN
    strips: tuple[str, ...] = NOT_GIVEN

    def __post_init__(self) -> None:
        n = len(self.names)
        expected.default(self, "camera_idx", lambda: np.zeros(n, dtype=np.intp))
        expected.default(self, "exposure_idx", lambda: np.arange(n))
        expected.default(self, "strips", lambda: ("",) * n)
        expected.shape("camera_idx", self.camera_idx, (n,))
        expected.shape("exposure_idx", self.exposure_idx, (n,))

    def __len__(self) -> int:
        """Count the images."""
        return len(self.names)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class ImagePoints:
    """Image measurements.

    Attributes
    ----------
    image_idx, point_idx : ndarray, shape (n,)
    colrow : ndarray, shape (n, 2)
        Pixels.
    sigma_px : ndarray, shape (n,)
        Positive; infinite where a measurement is not used.
    """

    image_idx: Index
    point_idx: Index
    colrow: Array
    sigma_px: Array

    def __post_init__(self) -> None:
        expected.shape("image_idx", self.image_idx)
        n = len(self.image_idx)
        expected.shape("point_idx", self.point_idx, (n,))
        expected.shape("colrow", self.colrow, (n, 2))
        expected.shape("sigma_px", self.sigma_px, (n,))
        expected.finite("colrow", self.colrow)
        expected.positive("sigma_px", self.sigma_px)

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.image_idx)

    def __getitem__(self, keep: Index | Mask) -> ImagePoints:
        """Select measurements."""
        return expected.part_of(self, keep)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyedPoints:
    """Points with surveyed coordinates: control or check points.

    Attributes
    ----------
    point_idx : ndarray, shape (k,)
        Indices of the block's points, all different.
    x_m : ndarray, shape (k, 3)
        m.
    sigma_m : ndarray, shape (k, 3)
        East, north, height, m; zero means without error, infinite means not known.
    R_g_m : ndarray, shape (k, 3, 3)
        Mapping axes to the grid axes along which sigma is given; the same by default.
    """

    point_idx: Index
    x_m: Array
    sigma_m: Array
    R_g_m: Array = NOT_GIVEN

    def __post_init__(self) -> None:
        expected.shape("point_idx", self.point_idx)
        n = len(self.point_idx)
        expected.default(self, "R_g_m", lambda: np.tile(np.eye(3), (n, 1, 1)))
        expected.shape("x_m", self.x_m, (n, 3))
        expected.shape("R_g_m", self.R_g_m, (n, 3, 3))
        expected.shape("sigma_m", self.sigma_m, (n, 3))
        expected.positive("sigma_m", self.sigma_m, zero=True)

    def __len__(self) -> int:
        """Count the points."""
        return len(self.point_idx)

    def __getitem__(self, keep: Index | Mask) -> SurveyedPoints:
        """Select points."""
        return expected.part_of(self, keep)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Body poses at the exposures, from GNSS and INS.

    Attributes
    ----------
    exposures : tuple of str
    T_m_b : Pose
        n_exposures poses of the IMU's body frame.
    R_g_m : ndarray, shape (n_exposures, 3, 3)
        Mapping axes to the grid axes along which positions' sigma is given; the same by default.
    sigma_position : ndarray, shape (n_exposures, 3)
        East, north, height, m; infinite, the default, where a position is not known. Zero, without
        error, is allowed for georeferencing only, not for an adjustment.
    sigma_attitude : ndarray, shape (n_exposures, 3)
        About the body's x, y, z axes, radians; infinite, the default, where not known.
    time_s : ndarray, shape (n_exposures,), or (1,) where no time is known
        Time from any origin, s; NaN where it is not known.
    slow_positions, slow_attitudes : GaussMarkov
        How the errors of each component are correlated in time; independent by default.
    """

    exposures: tuple[str, ...]
    T_m_b: Pose
    R_g_m: Array = NOT_GIVEN
    sigma_position: Array = NOT_GIVEN
    sigma_attitude: Array = NOT_GIVEN
    time_s: Array = field(default_factory=lambda: np.full(1, np.nan))
    slow_positions: GaussMarkov = WHITE
    slow_attitudes: GaussMarkov = WHITE

    def __post_init__(self) -> None:
        n = len(self.exposures)
        expected.default(self, "R_g_m", lambda: np.tile(np.eye(3), (n, 1, 1)))
        for name in ("sigma_position", "sigma_attitude"):
            expected.default(self, name, lambda: np.full((n, 3), np.inf))
        for name, R in (("T_m_b.R", self.T_m_b.R), ("R_g_m", self.R_g_m)):
            expected.shape(name, R, (n, 3, 3))
            expected.rotations(name, R)
        expected.shape("T_m_b.r", self.T_m_b.r, (n, 3))
        for name in ("sigma_position", "sigma_attitude"):
            expected.shape(name, getattr(self, name), (n, 3))
            expected.positive(name, getattr(self, name), zero=True)
        if np.shape(self.time_s) != (1,):
            expected.shape("time_s", self.time_s, (n,))

    def __len__(self) -> int:
        """Count the exposures."""
        return len(self.exposures)

    @property
    def cov(self) -> Array:
        """Covariances of the poses, shape (n, 6, 6): mapping frame in m, body axes in radians.

        Zero where a position or an attitude is not known, that is, where its sigma is infinite.
        """
        out = np.zeros((len(self), 6, 6))
        variance = np.where(np.isfinite(self.sigma_position), self.sigma_position, 0.0) ** 2
        R_m_g = np.swapaxes(self.R_g_m, -1, -2)
        out[:, :3, :3] = (R_m_g * variance[:, None, :]) @ self.R_g_m
        known = np.where(np.isfinite(self.sigma_attitude), self.sigma_attitude, 0.0)
        out[:, [3, 4, 5], [3, 4, 5]] = known**2
        return out


def unobserved(block: Block) -> bool:
    """Tell whether a block's trajectory holds positions, or attitudes, without any sigma.

    They are start values of an adjustment, and orient nothing by themselves.
    """
    known = block.trajectory
    parts = (known.sigma_position, known.sigma_attitude)
    return not all(np.isfinite(sigma).all(axis=1).any() for sigma in parts)


def no_datum(block: Block) -> str:
    """Return a sentence on what a block lacks to lie anywhere; empty where it lacks nothing."""
    n, observed = len(block.control), np.isfinite(block.trajectory.sigma_position).any()
    if n >= 3 or observed:
        return ""
    return (
        f"{block.name}: {shown.count(n, 'control point')} and no position with sigma leave open "
        "where the block lies, and its scale: add three control points that are not on one line to "
        "control_points.csv, or sigma_east_m, sigma_north_m and sigma_height_m to trajectory.csv"
    )


NO_POINTS = SurveyedPoints(
    point_idx=np.zeros(0, dtype=np.intp), x_m=np.zeros((0, 3)), sigma_m=np.zeros((0, 3))
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """A block of images with all its measurements.

    Attributes
    ----------
    cameras : tuple of Camera
    images : Images
    points : tuple of str
        Names of all points, measured or surveyed.
    image_points : ImagePoints
    trajectory : Trajectory
        By default no pose is known: positions are NaN, and an image is an exposure. A network of
        free orientations then begins with resections.
    control, check : SurveyedPoints
        Points used as control, and points only used for comparison; no point is both.
    frame : MappingFrame
        By default a frame on no map.
    name : str
        ``heads``, ``calibration``, ``validation`` or any other.
    smallest_angle : float
        Radians; tie points whose rays meet at less are left out, as are pairs in a validation.
    """

    cameras: tuple[Camera, ...]
    images: Images
    points: tuple[str, ...]
    image_points: ImagePoints
    trajectory: Trajectory = NOT_GIVEN
    control: SurveyedPoints = NO_POINTS
    check: SurveyedPoints = NO_POINTS
    frame: MappingFrame = field(default_factory=LocalFrame)
    name: str = "calibration"
    smallest_angle: float = SMALLEST_ANGLE

    def __post_init__(self) -> None:
        expected.different("cameras", [camera.name for camera in self.cameras])
        expected.positive("smallest_angle", np.atleast_1d(self.smallest_angle), zero=True)
        expected.default(self, "trajectory", lambda: _no_poses(self.images))
        expected.different("images.names", self.images.names)
        expected.different("points", self.points)
        for name, idx, n in (
            ("images.camera_idx", self.images.camera_idx, len(self.cameras)),
            ("images.exposure_idx", self.images.exposure_idx, len(self.trajectory)),
            ("image_points.image_idx", self.image_points.image_idx, len(self.images)),
            ("image_points.point_idx", self.image_points.point_idx, len(self.points)),
            ("control.point_idx", self.control.point_idx, len(self.points)),
            ("check.point_idx", self.check.point_idx, len(self.points)),
        ):
            expected.places(name, idx, n)
        _check_surveyed(self)

    def __repr__(self) -> str:
        """Summarize the block in one line."""
        numbers = {**block_row(self), "cameras": 0}
        counts = (shown.count(n, noun.removesuffix("s")) for noun, n in numbers.items() if n)
        cameras = shown.names([camera.name for camera in self.cameras], 4)
        return shown.line(f"Block {self.name!r}", cameras, *counts)

    def table(self) -> pd.DataFrame:
        """Return the numbers of cameras, images, points and measurements, one row."""
        return shown.row_table("block", {self.name: block_row(self)})

    @property
    def T_m_b_images(self) -> Pose:
        """The trajectory's body poses, one per image."""
        return self.trajectory.T_m_b[self.images.exposure_idx]

    @property
    def rays(self) -> Index:
        """Number of measurements of every point, shape (n_points,)."""
        return np.bincount(self.image_points.point_idx, minlength=len(self.points))


def _no_poses(images: Images) -> Trajectory:
    """Return a trajectory of unknown poses, its exposures named by their first images."""
    number, first = np.unique(images.exposure_idx, return_index=True)
    names = [f"exposure {k}" for k in range(int(number.max(initial=-1)) + 1)]
    for k, image in zip(number.tolist(), first.tolist(), strict=True):
        names[k] = images.names[image]
    n = len(names)
    unknown = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.full((n, 3), np.nan))
    return Trajectory(exposures=tuple(names), T_m_b=unknown)


def block_row(block: Block) -> dict[str, int]:
    """Count the cameras, images, exposures, points and measurements of a block."""
    return {
        "cameras": len(block.cameras),
        "images": len(block.images),
        "exposures": len(block.trajectory),
        "points": len(block.points),
        "control points": len(block.control),
        "check points": len(block.check),
        "measurements": len(block.image_points),
    }


def _check_surveyed(block: Block) -> None:
    """Raise where a surveyed point occurs twice."""
    control, check = block.control.point_idx.tolist(), block.check.point_idx.tolist()
    expected.different("control.point_idx", control, "points")
    expected.different("check.point_idx", check, "points")
    if both := sorted({*control} & {*check}):
        name = block.points[both[0]]
        msg = f"control and check: expected different points, got point {name!r} in both"
        raise ValueError(msg)


def select_cameras(block: Block, names: Sequence[str]) -> Block:
    """Select the images of some cameras; exposures and points stay as they are.

    Parameters
    ----------
    block : Block
    names : sequence of str
        Names of the cameras, in their new order.

    Raises
    ------
    ValueError
        Where the block has no such camera, or it is named twice.
    """
    expected.different("names", names)
    known = [camera.name for camera in block.cameras]
    if unknown := [name for name in names if name not in known]:
        msg = f"block {block.name!r} has no camera {unknown[0]!r}, only {', '.join(known)}"
        raise ValueError(msg)
    taken = [known.index(name) for name in names]
    renumbered = np.full(len(known), -1)
    renumbered[taken] = np.arange(len(taken))
    selected = select_images(block, renumbered[block.images.camera_idx] >= 0)
    images = replace(selected.images, camera_idx=renumbered[selected.images.camera_idx])
    return replace(selected, cameras=tuple(block.cameras[k] for k in taken), images=images)


def select_images(block: Block, keep: Mask) -> Block:
    """Select some images of a block; exposures and points stay as they are.

    Parameters
    ----------
    block : Block
    keep : ndarray of bool, shape (n_images,)

    Raises
    ------
    ValueError
        Where `keep` has another length.
    """
    expected.shape("keep", keep, (len(block.images),))
    kept = np.flatnonzero(keep)
    renumbered = np.full(len(block.images), -1)
    renumbered[kept] = np.arange(len(kept))
    points = block.image_points[renumbered[block.image_points.image_idx] >= 0]
    return replace(
        block,
        images=Images(
            names=tuple(block.images.names[i] for i in kept),
            camera_idx=block.images.camera_idx[kept],
            exposure_idx=block.images.exposure_idx[kept],
            strips=tuple(block.images.strips[i] for i in kept),
        ),
        image_points=replace(points, image_idx=renumbered[points.image_idx]),
    )


# --- The synthetic images of a block that is measured in heads: one for each exposure, by
# its name


def synthetic_images(block: Block, synthetic: Camera) -> Block:
    """Return a block's synthetic images, without measurements.

    Parameters
    ----------
    block : Block
        Measured in heads.
    synthetic : Camera
        The only camera of the result.

    Returns
    -------
    Block
        Images are in the order of the exposures' first images, and have their strips. Points,
        control and trajectory are those of `block`.
    """
    first = first_images(block)
    exposures = np.argsort(first, kind="stable")[: int(np.sum(first < len(block.images)))]
    return replace(
        block,
        cameras=(synthetic,),
        images=Images(
            names=tuple(block.trajectory.exposures[i] for i in exposures),
            camera_idx=np.zeros(len(exposures), dtype=np.intp),
            exposure_idx=exposures,
            strips=tuple(block.images.strips[i] for i in first[exposures]),
        ),
        image_points=block.image_points[np.zeros(0, dtype=np.intp)],
    )


def first_images(block: Block) -> Index:
    """Return the first image of every exposure, shape (n_exposures,); n_images for none."""
    first = np.full(len(block.trajectory), len(block.images))
    np.minimum.at(first, block.images.exposure_idx, np.arange(len(block.images)))
    return first
