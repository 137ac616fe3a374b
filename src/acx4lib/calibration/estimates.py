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
        n = self.layout.n_columns
        if self.cov_before is not None:
            expected.shape("cov_before", self.cov_before, (n, n))
        expected.shape("cov", self.cov, (n, n))
        expected.positive("sigma0_sq", self.sigma0_sq, zero=True)

    def __repr__(self) -> str:
        """Describe the calibration in one line."""
        cameras = shown.names([camera.name for camera in self.cameras])
        return shown.line("Calibration", cameras, *_size(self))

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


def _size(calibration: Calibration) -> tuple[str, str]:
    n = shown.count(calibration.n_columns, "parameter")
    return n, f"σ0² {calibration.sigma0_sq:.3f}" if calibration.n_columns else ""


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
    open_columns = _open_reported(calibration)
    out = []
    for k, camera in enumerate(calibration.cameras):
        values = reported_values(camera)
        for key, column in zip((*INTERIOR, *MOUNT), _columns(calibration, k), strict=True):
            if column >= 0:
                name, unit = REPORTED[key]
                out.append(
                    Parameter(
                        camera=camera.name,
                        name=name,
                        key=key,
                        unit=unit,
                        value=values[name],
                        sigma=np.inf if open_columns[column] else float(sigma[column]),
                        sigma_before=float(before[column]),
                    )
                )
    return sorted(out, key=lambda p: _position(calibration, p))


def _position(calibration: Calibration, parameter: Parameter) -> int:
    names = [camera.name for camera in calibration.cameras]
    columns = _columns(calibration, names.index(parameter.camera))
    return int(columns[(*INTERIOR, *MOUNT).index(parameter.key)])


def _columns(calibration: Calibration, k: int) -> Index:
    return np.concatenate([calibration.layout.interior[k], calibration.layout.mount[k]])


def reported_values(camera: Camera) -> dict[str, float]:
    """Return all parameters of a camera by their names in results, in their units."""
    mounting = np.concatenate([camera.T_b_c.r, np.degrees(camera.T_b_c.opk)])
    values = np.concatenate([camera.interior.to_array(), mounting]).tolist()
    return {REPORTED[key][0]: v for key, v in zip((*INTERIOR, *MOUNT), values, strict=True)}


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


def _open_reported(calibration: Calibration) -> Mask:
    """Mark reported parameters that depend on undetermined columns, shape (n,)."""
    return (np.abs(to_reported(calibration)) > 1e-6) @ calibration.open_columns > 0


def is_determined(calibration: Calibration) -> Mask:
    """Tell for every reported parameter whether the data determine it, shape (n,)."""
    f = {camera.name: camera.interior.f for camera in calibration.cameras}
    listed, limits = parameters(calibration), []
    for p in listed:
        if p.key in ("f", "xp", "yp"):
            limits.append(LIMIT_INTERIOR * f[p.camera])
        elif p.key in LEVER_ARM:
            limits.append(LIMIT_LEVER_M)
        elif p.key in BORESIGHT:
            limits.append(calibration.limit_boresight_deg)
        else:
            limits.append(np.inf)
    sigma = np.array([p.sigma for p in listed])
    return (sigma <= np.array(limits)) & np.isfinite(sigma)


def undetermined(calibration: Calibration) -> list[Parameter]:
    """Return the reported parameters that the data do not determine."""
    listed = zip(parameters(calibration), is_determined(calibration), strict=True)
    return [p for p, determined in listed if not determined]


# --- The flight geometry that determines a parameter, and the part that a flight lacks


ALONG, ACROSS = 0.9, 0.3
"""Cosines of flying directions that are opposite, and of those that are crosswise."""

SAME_SPEED = 0.1
"""Strips whose ground speeds differ by less than this share count as flown at one speed."""

OUTER = 0.85
"""Share of half the image diagonal from which a measurement lies in a corner."""

ENOUGH = "more images or measurements of what is there already, or it held"
"""Advice for a parameter where the flight already has the geometry."""

BEYOND = 300_000.0
"""Distance from the median of the control points, m, that no point of a block can have."""


@dataclass(frozen=True, kw_only=True)
class Need:
    """A condition that determines a parameter.

    Attributes
    ----------
    text : str
    features : tuple of str
        Features of a flight, any of which is enough, as `features` returns them.
    """

    text: str
    features: tuple[str, ...]


_HEIGHTS = Need(text="two flying heights", features=("heights",))
_CONTROL = Need(text="control points", features=("control",))
_OPPOSITE = Need(text="strips flown in opposite directions", features=("opposite",))
_SIDES = Need(text="measurements on all sides of the images", features=("sides",))
_CORNERS = Need(text="measurements in the corners of the images, or k3 held", features=("corners",))
_HELD = Need(text="two flying heights, or the lever arm held", features=("heights",))
_CROSSWISE = Need(text="strips flown crosswise", features=("crosswise",))
_TIED = Need(
    text="control points or strips flown in opposite directions", features=("control", "opposite")
)

NEEDS: Mapping[str, tuple[Need, ...]] = {
    "f": (
        Need(
            text="two flying heights (hills or tilted images in a bundle on control points alone)",
            features=("heights",),
        ),
        Need(text="control points or accurate GNSS heights", features=("control",)),
    ),
    "xp": (_HELD,),
    "yp": (_HELD,),
    "k1": (
        Need(
            text="measurements from the middle to the corners of the images", features=("corners",)
        ),
    ),
    "k2": (_CORNERS,),
    "k3": (_CORNERS,),
    "p1": (_SIDES, _OPPOSITE),
    "p2": (_SIDES, _OPPOSITE),
    "b1": (_SIDES, _CROSSWISE),
    "b2": (_SIDES, _CROSSWISE),
    "lever_x": (_HEIGHTS, _TIED),
    "lever_y": (_HEIGHTS, _TIED),
    "lever_z": (_CONTROL, Need(text="two flying heights or f held", features=("heights",))),
    "boresight_x": (_OPPOSITE, _CONTROL),
    "boresight_y": (_OPPOSITE, _CONTROL),
    "boresight_z": (
        Need(
            text="tie points over overlapping strips, or control points",
            features=("overlap", "control"),
        ),
    ),
    "shift": (
        _CONTROL,
        Need(
            text="strips flown in opposite directions or the lever arm held", features=("opposite",)
        ),
    ),
    "drift": (Need(text="control points along the strip", features=()),),
    "delay": (
        Need(text="strips flown at different speeds, or the lever arm held", features=("speeds",)),
        _TIED,
    ),
    "deviation": (
        Need(text="strips flown in opposite directions", features=("opposite",)),
        Need(text="strips across the others", features=("crosswise",)),
    ),
}
"""Conditions that determine each parameter, by its name in the library."""


def needed(key: str, features: frozenset[str] = frozenset()) -> str:
    """Return the conditions for a parameter that a flight does not meet, for a message.

    Parameters
    ----------
    key : str
        The library's name of the parameter.
    features : frozenset of str
        Features of the flight; by default, none.
    """
    lacking = [need.text for need in NEEDS[key] if not features.intersection(need.features)]
    return ", and ".join(lacking) or ENOUGH


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
        needs = [need for key in keys for need in NEEDS[key] if need.features]
        lacking = [need.text for need in needs if not present.intersection(need.features)]
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
    flags = {
        "heights": bool(height.min() < (1 - SAME_HEIGHT) * height.max()),
        "control": _has_control(block),
        "opposite": bool(np.any(turns < -ALONG)),
        "crosswise": bool(np.any(np.abs(turns) < ACROSS)),
        "overlap": _has_overlap(block),
        "speeds": _has_speeds(block),
        **_places(block),
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
    rays = block.rays[block.control.point_idx]
    usable = np.isfinite(block.control.sigma_m).all(axis=1) & (rays > 0)
    x_m, spread = block.control.x_m[usable], np.zeros(3)
    if len(x_m):  # seen from an absurdly far point, all others seem to lie in one place
        x_m = x_m[np.abs(x_m - np.median(x_m, axis=0)).max(axis=1) < BEYOND]
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
    return min(usual) < (1 - SAME_SPEED) * max(usual)


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


def _places(block: Block) -> dict[str, bool]:
    """Tell where in their images all cameras have measurements."""
    points, cameras = block.image_points, block.cameras
    camera_idx = block.images.camera_idx[points.image_idx]
    size = np.array([[camera.width_px, camera.height_px] for camera in cameras])
    half = (size[camera_idx] - 1) / 2
    place = (points.colrow - half) / half
    corner = np.hypot(*place.T) / np.sqrt(2) > OUTER
    masks = [camera_idx == k for k in range(len(cameras))]
    return {
        "corners": all(bool(corner[mask].any()) for mask in masks),
        "sides": all(
            bool(np.any(side * place[mask, axis] > 0.5))
            for mask in masks
            for axis in (0, 1)
            for side in (-1, 1)
        ),
    }


# --- joint tests of several parameters --------------------------------------------------------
#
# A single test compares a parameter with a value while the others are free. Where k1, k2 and k3
# correlate by -0.99, each of them may be near zero if the other two take over its part. So none
# seems significant, although together they are. A joint test compares all of them at once.


KEYS = (*INTERIOR, *MOUNT)

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
    expected.whole("redundancy", redundancy, least=0)
    return list(_group_tests(calibration, against, redundancy))


def _group_tests(
    calibration: Calibration, against: Sequence[Camera], redundancy: int
) -> Iterator[GroupTest]:
    for k, (camera, other) in enumerate(zip(calibration.cameras, against, strict=True)):
        differences = difference(camera, other)
        for group in GROUPS:
            indices, columns = estimated_columns(calibration.layout, k, group)
            if len(indices) < 2 or calibration.open_columns[columns].any():
                continue
            cov = calibration.sigma0_sq * calibration.cov[np.ix_(columns, columns)]
            z = differences[indices] / sigmas(cov)
            yield GroupTest(
                camera=camera.name,
                keys=tuple(KEYS[i] for i in indices),
                largest=float(np.abs(z).max()),
                f_ratio=float(z @ np.linalg.solve(correlation(cov), z)) / len(indices),
                redundancy=redundancy,
            )


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
