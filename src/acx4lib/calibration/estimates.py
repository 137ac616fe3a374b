"""Outcome of a calibration: estimates, covariance, joint tests, undetermined parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block
from acx4lib.bundle.observations import strips_of, velocities
from acx4lib.bundle.unknowns import Layout, layout
from acx4lib.design import SAME_HEIGHT, directions, flying_heights, strip_of_exposure
from acx4lib.errors import AdjustmentError, NotConverged
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.camera import parameter_rows as camera_rows
from acx4lib.geometry.frames import Pose, log, opk_jacobian, rotation_from_opk
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM, MOUNT, REPORTED
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation, propagate, sigmas

if TYPE_CHECKING:
    import pandas as pd

    from acx4lib.bundle.adjust import Bundle


KEYS = (*INTERIOR, *MOUNT)
"""The library's names of all parameters of a camera."""

TWO_STEP = ("two_step", "two_step_gnss")
"""Methods that average over images, eqs (12) and (13); the paper's is the second of them."""

METHODS = (*TWO_STEP, "single_step")
"""All methods that calibrate a mounting, in the order of Table 3."""

RIGS = ("rig", "rig_calibration")
"""The rig in the results: of the block heads, and of the calibration block in its heads."""

LIMIT_LEVER_M = 1.0
LIMIT_BORESIGHT_DEG = 0.1
LIMIT_INTERIOR = 0.002
"""Standard deviations above which a lever arm, a boresight angle or f, xp, yp (as a share of f)
count as not determined; a boresight, above that of a single attitude, if this is more."""

LIMIT_SCALE = 0.01
"""Scale error between control and trajectory above which something is wrong, not imprecise."""

SIGMAS_OF_SCALE = 3.0
"""The error must also exceed this multiple of the focal length's standard deviation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Cameras calibrated by one method.

    Attributes
    ----------
    cameras : tuple of Camera
        With estimated interior orientation and mounting.
    layout : Layout
        Which parameters were estimated; it has no poses.
    cov : ndarray, shape (n, n)
        A priori covariance in the library's units: mm, m, and radians about camera axes.
    sigma0_sq : float
        A posteriori variance of unit weight of the method's adjustment.
    open_columns : ndarray, shape (n,)
        Columns that the observations leave open altogether.
    limit_boresight_deg : float
        Standard deviation above which a boresight angle is not determined.
    enlarged : tuple of float
        Factors by which a jackknife enlarged sigma: of interior orientations, and of heads against
        the first one.
    turns : ndarray, shape (3,), or None
        Standard deviation of the turns of an exposure's pictures against each other, about the
        body's axes, radians; None where they share a pose.
    cov_before : ndarray, shape (n, n), or None
        A posteriori covariance due to errors of calibrations before this one, in the units of
        `cov`, which does not have it; None without any, and where `cov` has it already, as in a
        calibration that is read from results.
    """

    cameras: tuple[Camera, ...]
    layout: Layout
    cov: Array
    sigma0_sq: float
    open_columns: Mask
    limit_boresight_deg: float = LIMIT_BORESIGHT_DEG
    enlarged: tuple[float, float] = (1.0, 1.0)
    turns: Array | None = None
    cov_before: Array | None = None

    def __post_init__(self) -> None:
        expected.shape("cov", self.cov, (self.n_columns, self.n_columns))
        expected.positive("sigma0_sq", self.sigma0_sq, zero=True)

    def __repr__(self) -> str:
        """Describe the calibration in one line."""
        cameras = shown.names([camera.name for camera in self.cameras])
        n = shown.count(self.n_columns, "parameter")
        fit = f"σ0² {self.sigma0_sq:.3f}" if self.n_columns else ""
        return shown.line("Calibration", cameras, n, fit)

    def table(self) -> pd.DataFrame:
        """Return estimated and held parameters with their units and sigma.

        Interior parameters held at zero are left out. All mounting parameters are listed if any
        was estimated; otherwise none.
        """
        return shown.parameter_table(parameter_rows(self))

    @property
    def n_columns(self) -> int:
        """Number of estimated parameters."""
        return self.layout.n_columns

    @property
    def total_cov(self) -> Array:
        """Covariance with that of calibrations before, a priori: times `sigma0_sq` a posteriori."""
        if self.cov_before is None:
            return self.cov
        return self.cov + self.cov_before / self.sigma0_sq


def parameter_rows(calibration: Calibration, *, only_interior: bool = False) -> Iterator[shown.Row]:
    """Yield the rows of a calibration's table."""
    listed = parameters(calibration)
    mounted = bool(np.any(calibration.layout.mount >= 0)) or not calibration.n_columns
    mounted &= not only_interior
    for camera in calibration.cameras:
        sigma = {p.key: p.sigma for p in listed if p.camera == camera.name}
        yield from camera_rows(camera, sigma, mounted=mounted)


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter as results report it.

    Attributes
    ----------
    camera, name, key, unit : str
        `key` is the library's name; `name` is that of the results and ends in the unit.
    value, sigma : float
        `sigma` a posteriori; infinite where the observations leave it open.
    sigma_before : float
        The part of `sigma` that comes from calibrations before; `sigma` is the root of the sum of
        its square and that of the adjustment's own part.
    """

    camera: str
    name: str
    key: str
    unit: str
    value: float
    sigma: float
    sigma_before: float = 0.0

    @property
    def full_name(self) -> str:
        """The name, preceded by the camera's name if it has a camera."""
        return f"{self.camera}/{self.name}" if self.camera else self.name


def from_bundle(bundle: Bundle) -> Calibration:
    """Return the cameras that a bundle estimated, with their covariance."""
    columns = bundle.network.layout
    n = int(np.sum(columns.interior >= 0) + np.sum(columns.mount >= 0))
    first = np.arange(n)
    return Calibration(
        cameras=bundle.cameras,
        layout=Layout(
            interior=columns.interior, mount=columns.mount, pose=np.zeros((0, 6), dtype=np.intp)
        ),
        cov=bundle.solution.inverse.at(first[:, None], first),
        sigma0_sq=bundle.solution.sigma0_sq,
        open_columns=bundle.solution.undetermined[:n],
        limit_boresight_deg=boresight_limit(bundle.network.block),
    )


def boresight_limit(block: Block) -> float:
    """Return the standard deviation above which a boresight is not determined, degrees.

    A mean that is no better than a single attitude has no value.
    """
    sigma = block.trajectory.sigma_attitude
    known = sigma[np.isfinite(sigma)]
    return max(LIMIT_BORESIGHT_DEG, float(np.degrees(np.median(known))) if len(known) else 0.0)


def given(cameras: Sequence[Camera]) -> Calibration:
    """Return a calibration of cameras as given, without estimates and covariance."""
    return Calibration(
        cameras=tuple(cameras),
        layout=layout(len(cameras), 0, free=()),
        cov=np.zeros((0, 0)),
        sigma0_sq=1.0,
        open_columns=np.zeros(0, dtype=bool),
    )


def parameters(calibration: Calibration) -> list[Parameter]:
    """Return every estimated parameter with its a posteriori standard deviation."""
    sigma = sigmas(reported_covariance(calibration))
    before: Array = np.zeros(calibration.n_columns)
    if calibration.cov_before is not None:
        before = sigmas(propagate(to_reported(calibration), calibration.cov_before))
    # an angle depends on the columns of all turns: it is open where one of these is
    is_open = (np.abs(to_reported(calibration)) > 1e-6) @ calibration.open_columns > 0
    by_column = {}
    for k, camera in enumerate(calibration.cameras):
        values = reported_values(camera)
        columns = np.concatenate([calibration.layout.interior[k], calibration.layout.mount[k]])
        for key, column in zip(KEYS, columns.tolist(), strict=True):
            if column >= 0:
                name, unit = REPORTED[key]
                by_column[column] = Parameter(
                    camera=camera.name,
                    name=name,
                    key=key,
                    unit=unit,
                    value=values[name],
                    sigma=np.inf if is_open[column] else float(sigma[column]),
                    sigma_before=float(before[column]),
                )
    return [by_column[column] for column in sorted(by_column)]


def reported_values(camera: Camera) -> dict[str, float]:
    """Return all parameters of a camera by their names in results, in their units."""
    mounting = np.concatenate([camera.T_b_c.r, np.degrees(camera.T_b_c.opk)])
    values = np.concatenate([camera.interior.to_array(), mounting]).tolist()
    return {REPORTED[key][0]: v for key, v in zip(KEYS, values, strict=True)}


def with_reported(camera: Camera, values: Mapping[str, float]) -> Camera:
    """Return a camera with other values of some parameters, by their names in results."""
    reported = reported_values(camera)
    changed = np.array([values.get(name, reported[name]) for name in reported])
    interior, lever, angles = np.split(changed, [len(INTERIOR), len(INTERIOR) + 3])
    return replace(
        camera,
        interior=Interior.from_array(interior),
        T_b_c=Pose(R=rotation_from_opk(np.radians(angles)), r=lever),
    )


def to_reported(calibration: Calibration) -> Array:
    """Return d(reported parameters) / d(columns): boresight angles in degrees.

    Returns
    -------
    ndarray, shape (n, n)
    """
    J = np.eye(calibration.n_columns)
    for k, camera in enumerate(calibration.cameras):
        columns = calibration.layout.mount[k, 3:]
        if np.all(columns >= 0):
            J[np.ix_(columns, columns)] = np.degrees(opk_jacobian(camera.T_b_c.opk))
    return J


def reported_covariance(calibration: Calibration) -> Array:
    """Return the a posteriori covariance of the reported parameters, shape (n, n).

    It includes the errors of calibrations before.
    """
    return calibration.sigma0_sq * propagate(to_reported(calibration), calibration.total_cov)


def is_determined(calibration: Calibration) -> Mask:
    """Tell for every reported parameter whether the data determine it, shape (n,)."""
    f = {camera.name: camera.interior.f for camera in calibration.cameras}
    limits = dict.fromkeys(LEVER_ARM, LIMIT_LEVER_M)
    limits |= dict.fromkeys(BORESIGHT, calibration.limit_boresight_deg)
    listed = parameters(calibration)
    of_f = [LIMIT_INTERIOR * f[p.camera] if p.key in ("f", "xp", "yp") else np.inf for p in listed]
    limit = np.array([limits.get(p.key, of) for p, of in zip(listed, of_f, strict=True)])
    sigma = np.array([p.sigma for p in listed])
    return (sigma <= limit) & np.isfinite(sigma)


def undetermined(calibration: Calibration) -> list[Parameter]:
    """Return the reported parameters that the data do not determine."""
    listed = zip(parameters(calibration), is_determined(calibration), strict=True)
    return [p for p, determined in listed if not determined]


# --- The flight geometry that determines a parameter, and the part that a flight lacks


ENOUGH = "more images or measurements of what is there already, or it held"
"""Advice for a parameter where the flight already has the geometry."""

_HILLS = "two flying heights (hills or tilted images in a bundle on control points alone)"
_CONTROL = ("control points", "control")
_OPPOSITE = ("strips flown in opposite directions", "opposite")
_SIDES = ("measurements on all sides of the images", "sides")
_CORNERS = ("measurements in the corners of the images, or k3 held", "corners")
_TIED = ("control points or strips flown in opposite directions", "control opposite")
_HEIGHTS = ("two flying heights", "heights")
_HEIGHTS_OR_LEVER = ("two flying heights, or the lever arm held", "heights")
_CROSSWISE = ("strips flown crosswise", "crosswise")

NEEDS: Mapping[str, tuple[tuple[str, str], ...]] = {
    "f": ((_HILLS, "heights"), ("control points or accurate GNSS heights", "control")),
    "xp": (_HEIGHTS_OR_LEVER,),
    "yp": (_HEIGHTS_OR_LEVER,),
    "k1": (("measurements from the middle to the corners of the images", "corners"),),
    "k2": (_CORNERS,),
    "k3": (_CORNERS,),
    "p1": (_SIDES, _OPPOSITE),
    "p2": (_SIDES, _OPPOSITE),
    "b1": (_SIDES, _CROSSWISE),
    "b2": (_SIDES, _CROSSWISE),
    "lever_x": (_HEIGHTS, _TIED),
    "lever_y": (_HEIGHTS, _TIED),
    "lever_z": (_CONTROL, ("two flying heights or f held", "heights")),
    "boresight_x": (_OPPOSITE, _CONTROL),
    "boresight_y": (_OPPOSITE, _CONTROL),
    "boresight_z": (("tie points over overlapping strips, or control points", "overlap control"),),
    "shift": (
        _CONTROL,
        ("strips flown in opposite directions or the lever arm held", "opposite"),
    ),
    "drift": (("control points along the strip", ""),),
    "delay": (("strips flown at different speeds, or the lever arm held", "speeds"), _TIED),
    "deviation": (_OPPOSITE, ("strips across the others", "crosswise")),
}
"""Conditions that determine each parameter, by its name in the library, each with the features of
a flight any of which is enough, as `features` returns them."""


def needed(key: str, present: frozenset[str] = frozenset()) -> str:
    """Return the conditions for a parameter that a flight does not meet, for a message.

    Parameters
    ----------
    key : str
        The library's name of the parameter.
    present : frozenset of str
        Features of the flight; by default, none.
    """
    return ", and ".join(_lacking(key, present)) or ENOUGH


def _lacking(key: str, present: frozenset[str]) -> list[str]:
    return [text for text, features in NEEDS[key] if not present.intersection(features.split())]


@contextmanager
def saying_what_lacks(block: Block, keys: Sequence[str]) -> Iterator[None]:
    """Add the missing flight geometry and a cure to the message of a failed adjustment.

    Parameters
    ----------
    block : Block
        The block that is adjusted.
    keys : sequence of str
        The library's names of the parameters that are estimated.
    """
    try:
        yield
    except NotConverged as error:
        n, present = len(np.unique(block.images.exposure_idx)), features(block)
        lacking = [text for key in keys for text in _lacking(key, present)]
        wanted = "; ".join(dict.fromkeys(lacking)) or "more images or measurements"
        msg = (
            f"{error}; {shown.count(n, 'exposure')} may be too little for what is estimated. It "
            f"would need: {wanted}. Or estimate less: estimate and fix in flight.toml"
        )
        raise NotConverged(msg) from error


def features(block: Block) -> frozenset[str]:
    """Return the features of a block's geometry that determine parameters.

    Any of ``heights``, ``control``, ``opposite``, ``crosswise``, ``speeds``, ``corners``,
    ``sides`` and ``overlap``.
    """
    way, height = directions(block), flying_heights(block)
    turns = way @ way.T
    points, n_cameras = block.image_points, len(block.cameras)
    camera = block.images.camera_idx[points.image_idx]
    size = np.array([[camera.width_px, camera.height_px] for camera in block.cameras])
    half = (size[camera] - 1) / 2
    place = (points.colrow - half) / half
    side = np.hstack([place > 0.5, place < -0.5])
    corner = np.hypot(*place.T) / np.sqrt(2) > 0.85  # of half the image diagonal
    flags = {
        "heights": height.min() < (1 - SAME_HEIGHT) * height.max(),
        "control": _has_control(block),
        "opposite": np.any(turns < -0.9),
        "crosswise": np.any(np.abs(turns) < 0.3),
        "overlap": _has_overlap(block),
        "speeds": _has_speeds(block),
        "corners": all(corner[camera == k].any() for k in range(n_cameras)),
        "sides": all(side[camera == k].any(axis=0).all() for k in range(n_cameras)),
    }
    return frozenset(name for name, present in flags.items() if present)


def _has_control(block: Block) -> bool:
    try:
        require_control(block)
    except AdjustmentError:
        return False
    return True


def require_control(block: Block) -> None:
    """Raise unless images show three control points that do not lie on one line.

    Raises
    ------
    AdjustmentError
        Without them, exterior orientations that no trajectory observes have no datum.
    """
    beyond = 300_000.0  # m from the others, that no point of a block can have
    rays = block.rays[block.control.point_idx]
    usable = np.isfinite(block.control.sigma_m).all(axis=1) & (rays > 0)
    x_m, spread = block.control.x_m[usable], np.zeros(3)
    if len(x_m):  # seen from an absurdly far point, all others seem to lie in one place
        x_m = x_m[np.abs(x_m - np.median(x_m, axis=0)).max(axis=1) < beyond]
        spread = np.linalg.svd(x_m - x_m.mean(axis=0), compute_uv=False)
    if len(x_m) < 3 or spread[1] < 1e-3 * max(spread[0], 1.0):
        needed = "three that do not lie on one line are needed"
        msg = f"{len(x_m)} control points in images do not orient the block: {needed}"
        raise AdjustmentError(msg)


def _has_speeds(block: Block) -> bool:
    """Tell whether strips are flown at different ground speeds; false without times."""
    try:
        speed = np.linalg.norm(velocities(block), axis=1)
    except AdjustmentError:
        return False
    strip = strips_of(block).idx
    usual = [float(np.median(speed[strip == k])) for k in range(strip.max() + 1)]
    return min(usual) < 0.9 * max(usual)


def _has_overlap(block: Block) -> bool:
    """Tell whether images of two strips share points."""
    names = strip_of_exposure(block)
    number = {name: i for i, name in enumerate(dict.fromkeys(names))}
    strip = np.array([number[name] for name in names])[block.images.exposure_idx]
    points = block.image_points
    measured_strip = strip[points.image_idx]
    point_strip = np.zeros(len(block.points), dtype=np.intp)
    point_strip[points.point_idx] = measured_strip  # any of the strips that see a point
    return bool(np.any(point_strip[points.point_idx] != measured_strip))


# --- joint tests of several parameters --------------------------------------------------------
#
# A single test compares a parameter with a value while the others are free. Where k1, k2 and k3
# correlate by -0.99, each of them may be near zero if the other two take over its part. So none
# seems significant, although together they are. A joint test compares all of them at once.


GROUPS = (("k1", "k2", "k3"), ("p1", "p2"), LEVER_ARM, BORESIGHT)
"""Parameters that are tested together."""


@dataclass(frozen=True, kw_only=True)
class GroupTest:
    """Several parameters of one camera, tested together against given values.

    Attributes
    ----------
    camera : str
    keys : tuple of str
        The library's names of the parameters.
    largest : float
        The largest of their single test statistics, absolute.
    f_ratio : float
        d^T C^-1 d / k of the k differences, C their a posteriori covariance.
    redundancy : int
        Of the adjustment from which sigma0 comes.
    """

    camera: str
    keys: tuple[str, ...]
    largest: float
    f_ratio: float
    redundancy: int

    @property
    def p(self) -> float:
        """Probability of such an F-ratio or a larger one, where the given values are right."""
        return statistics.f_sf(self.f_ratio, len(self.keys), max(self.redundancy, 1))


def undistorted(camera: Camera) -> Camera:
    """Return a camera to test against: it has no distortion, and keeps its mounting."""
    interior = camera.interior
    return camera.with_interior(Interior(f=interior.f, xp=interior.xp, yp=interior.yp))


def group_tests(
    calibration: Calibration, against: Sequence[Camera], *, redundancy: int
) -> list[GroupTest]:
    """Test every group of parameters of every camera, where two or more of it are estimated.

    Parameters
    ----------
    calibration : Calibration
    against : sequence of Camera
        With the values to test against, in the order of the calibration's cameras.
    redundancy : int
        Of the calibration's adjustment.
    """
    tests = []
    for k, (camera, other) in enumerate(zip(calibration.cameras, against, strict=True)):
        differences = difference(camera, other)
        for group in GROUPS:
            indices, columns = estimated_columns(calibration.layout, k, group)
            if len(indices) < 2 or calibration.open_columns[columns].any():
                continue
            cov = calibration.sigma0_sq * calibration.cov[np.ix_(columns, columns)]
            z = differences[indices] / sigmas(cov)
            tests.append(
                GroupTest(
                    camera=camera.name,
                    keys=tuple(KEYS[i] for i in indices),
                    largest=float(np.abs(z).max()),
                    f_ratio=float(z @ np.linalg.solve(correlation(cov), z)) / len(indices),
                    redundancy=redundancy,
                )
            )
    return tests


def estimated_columns(columns: Layout, k: int, keys: Sequence[str]) -> tuple[Index, Index]:
    """Return the indices into `KEYS` and the columns of the estimated ones of named parameters."""
    all_columns = np.concatenate([columns.interior[k], columns.mount[k]])
    indices = np.flatnonzero(np.isin(KEYS, keys) & (all_columns >= 0))
    return indices, all_columns[indices]


def difference(camera: Camera, other: Camera) -> Array:
    """Return all parameters less another camera's, in the order of `KEYS`.

    The boresight's are about the other camera's axes, radians.
    """
    return np.concatenate(
        [
            camera.interior.to_array() - other.interior.to_array(),
            camera.T_b_c.r - other.T_b_c.r,
            log(other.T_b_c.R.T @ camera.T_b_c.R),
        ]
    )
