"""The content of another program's project, and the part of a flight that it becomes.

A program's file returns a `Project`: lenses, images, orientations, measurements, surveyed points,
assumptions, and parts that have no place in a flight. `flight_of` makes tables and settings of all
programs in the same way, and proves them: the imported cameras and poses project the program's own
points. Pixels, camera axes and units are the library's; the frame w is any Cartesian one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import Signature, signature
from pathlib import Path
from typing import Any, Protocol, TypeVar, get_type_hints

import numpy as np

from acx4files.exchange import coordinates
from acx4files.exchange.coordinates import UNKNOWN, stacked
from acx4files.exchange.flight_folder import ImportedFlight, number_of
from acx4files.exchange.lens import NOMINAL_UM, WARNED_PX, WORST_PX, Lens, Refitted, too_far
from acx4files.exchange.options import Allow, BlockOfProject, PixelUmOfProject
from acx4files.exchange.safe import Opened, checksums, refusal
from acx4files.flight.problems import quoted
from acx4files.flight.table_files import Columns
from acx4files.flight.tables import name_fault
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import project as projected
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import (
    LOCAL,
    GridSystem,
    mean_origin,
    rotation_enu_to_ecef,
)
from acx4lib.geometry.intersection import intersect


class Place(Protocol):
    """A place in a file: an element, a node, a line."""

    def wrong(self, found: str, expected: str, /) -> FlightError:
        """Return the error that says what is wrong there."""


P = TypeVar("P", bound=Place)

MEANS_NOTHING = (
    "The trajectory is what the program adjusted, camera and body being one: the boresight and "
    "the lever arm that a calibration finds on it mean nothing"
)

START_VALUES = (
    "The trajectory holds the orientations that the program adjusted, camera and body being one: "
    "they are start values without sigma, and nothing observes them"
)

FAILED_PX = 3.0
"""Distance, rms, of a program's own points from their measurements above which a proof fails."""

NOWHERE = np.full(3, np.nan)

SHOWN = 8
"""Number of lenses that have a sentence each; more of them have a table in import.md."""

InGrid = Callable[[Pose], tuple[Array, Array]] | FlightError
"""From poses in w to east, north, height (m) and omega, phi, kappa (rad) in the flight's grid; an
error where the place of w is not known."""


def as_they_are(T: Pose) -> tuple[Array, Array]:
    """Return poses in w as those of a flight on no map."""
    return T.r, T.opk


@dataclass(frozen=True, kw_only=True, eq=False)
class Images:
    """Images of a project.

    Attributes
    ----------
    names, cameras, exposures : tuple of str
        One for each image; the image of its exposure's name, else the first one, has its pose.
    T_w_c : Pose
        Orientations in the library's camera axes; NaN where there is none.
    enabled : ndarray of bool, shape (n,), optional
        Images that the program uses; by default all.
    """

    names: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    exposures: tuple[str, ...] = ()
    T_w_c: Pose = field(default_factory=lambda: stacked([]))
    enabled: Mask | None = None

    @classmethod
    def of(
        cls, rows: Iterable[tuple[str, str, str, Pose | None]], enabled: Mask | None = None
    ) -> Images:
        """Return images from name, camera, exposure and orientation, if any, of each."""
        listed = [*rows]
        if not listed:
            return cls()
        names, cameras, exposures, poses = zip(*listed, strict=True)
        T_w_c = stacked([UNKNOWN if pose is None else pose for pose in poses])
        return cls(names=names, cameras=cameras, exposures=exposures, T_w_c=T_w_c, enabled=enabled)

    @property
    def used(self) -> Mask:
        """Whether the program uses each image."""
        return np.ones(len(self.names), dtype=bool) if self.enabled is None else self.enabled

    @property
    def oriented(self) -> Mask:
        """Whether each image has an orientation."""
        return np.asarray(np.isfinite(self.T_w_c.r).all(axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Points that were measured in images.

    Attributes
    ----------
    points : tuple of str
        Names of points.
    x_w : ndarray, shape (n_points, 3), optional
        Coordinates in w, NaN where the program has none; None where it has none of all points.
    image_idx, point_idx : ndarray of int, shape (n,)
        Of each measurement.
    colrow : ndarray, shape (n, 2)
    """

    points: tuple[str, ...] = ()
    x_w: Array | None = None
    image_idx: Index = field(default_factory=lambda: np.zeros(0, dtype=int))
    point_idx: Index = field(default_factory=lambda: np.zeros(0, dtype=int))
    colrow: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @classmethod
    def of(
        cls, seen: Sequence[tuple[int, str, Any]], places: Mapping[str, Array] | None = None
    ) -> Measured:
        """Return measurements from image, point and pixel of each, and places of points, if any."""
        points, point_idx = first_use([point for _, point, _ in seen])
        x_w = None if places is None else [places.get(point, NOWHERE) for point in points]
        return cls(
            points=tuple(points),
            x_w=None if x_w is None else np.array(x_w, dtype=float).reshape(-1, 3),
            image_idx=np.array([image for image, _, _ in seen], dtype=int),
            point_idx=point_idx,
            colrow=np.array([pixel for _, _, pixel in seen], dtype=float).reshape(-1, 2),
        )

    def where(self, images: Mask) -> Measured:
        """Return the measurements in some of the images."""
        return self.some(images[self.image_idx])

    def some(self, rows: Mask | Index) -> Measured:
        """Return some of the measurements."""
        return replace(
            self,
            image_idx=self.image_idx[rows],
            point_idx=self.point_idx[rows],
            colrow=self.colrow[rows],
        )


def joined(*parts: Measured) -> Measured:
    """Return measurements of different points as one value."""
    if not parts:
        return Measured()
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    places = [np.full((len(o.points), 3), np.nan) if o.x_w is None else o.x_w for o in parts]
    return Measured(
        points=tuple(point for part in parts for point in part.points),
        x_w=np.concatenate(places),
        image_idx=np.concatenate([part.image_idx for part in parts]),
        point_idx=np.concatenate([n + o.point_idx for n, o in zip(first, parts, strict=False)]),
        colrow=np.concatenate([part.colrow for part in parts]),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Proof:
    """Points by which an import is proved: projected, or, where their place is unknown, met.

    Attributes
    ----------
    whose : str
        Which points, in words.
    measured : Measured
    T_w_c : Pose, optional
        Of all images in the frame of the points; by default the project's.
    is_own : bool
        Whether the program has the points from these poses and lenses, so that they must fit.
    """

    whose: str
    measured: Measured
    T_w_c: Pose | None = None
    is_own: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Control:
    """Surveyed points.

    Attributes
    ----------
    names : tuple of str
    enh : ndarray, shape (n, 3)
        East, north, height in the flight's coordinate system, m.
    sigma : ndarray, shape (n, 3), optional
        Standard deviations, m; a coordinate of which one is not positive has no column.
    is_check : sequence of bool, optional
        Whether a point is a check point; by default no file says it.
    """

    names: tuple[str, ...]
    enh: Array
    sigma: Array | None = None
    is_check: tuple[bool, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Positions and attitudes of exposures, or why there are none.

    Attributes
    ----------
    table : table or None
        trajectory.csv.
    assumed, found, left_out : tuple of str
    """

    table: Columns | None = None
    assumed: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Project:
    """The content of another program's project.

    Attributes
    ----------
    source : str
        Program, with its version where the files state it.
    sources : iterable of Opened
        Files that were read.
    lenses : mapping of str to Lens
        By the names of cameras.
    sensors : mapping of str to table
        What flight.toml says of cameras that have no lens in the files.
    images : Images
    measured : Measured
        What becomes image_points.csv.
    proofs : tuple of Proof
    control : Control or None
    settings : mapping
        Keys of flight.toml but cameras.
    orientations : {"initial", "adjusted", "none"}
        The trajectory: what was measured of the cameras, what the program adjusted, or none. Images
        whose exposures it has not are left out.
    in_grid : callable or FlightError
        As `InGrid`.
    placed : tuple of str
        What is assumed where `in_grid` is used.
    trajectory : Trajectory
        What was measured of the cameras.
    lost : mapping of str to int
        What has no place in a flight, in words, and how many.
    assumed, found, left_out : tuple of str
        Sentences of this program alone.
    may_leave_cameras : bool
        Whether cameras that no flight can have are left out with their images, not refused.
    """

    source: str
    sources: Iterable[Opened]
    lenses: Mapping[str, Lens] = field(default_factory=dict)
    sensors: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    images: Images = field(default_factory=Images)
    measured: Measured = field(default_factory=Measured)
    proofs: tuple[Proof, ...] = ()
    control: Control | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    orientations: str = "none"
    in_grid: InGrid = as_they_are
    placed: tuple[str, ...] = ()
    trajectory: Trajectory = field(default_factory=Trajectory)
    lost: Mapping[str, int] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    may_leave_cameras: bool = False


def flight_of(
    project: Project,
    *,
    block: str | None = None,
    pixel_um: float | None = None,
    allow: float = WORST_PX,
) -> ImportedFlight:
    """Return a project as a part of a flight, with what was assumed, found and left out.

    Parameters
    ----------
    project : Project
    block : str, optional
        Name of the block; by default heads where several images have one exposure, else
        calibration.
    pixel_um : float, optional
        Pixel size of cameras that have none.
    allow : float
        Largest difference of a refitted lens, px.

    Raises
    ------
    FlightError
        Where no camera of a flight is like a lens, or adjusted orientations have no place.
    """
    images, control, enabled = project.images, project.control, project.images.used
    fitted, unfit = _refitted(project, pixel_um, allow)
    flown = _flown(project)
    known = {*fitted, *project.sensors} if project.lenses else {*images.cameras}
    kept = enabled & np.array([name in known for name in images.cameras], dtype=bool)
    unflown = np.zeros(len(kept), dtype=bool)
    if flown.table is not None:
        exposures = set(flown.table["exposure"])
        unflown = np.array([name not in exposures for name in images.exposures], dtype=bool)
        kept &= ~unflown
    rows, inside = np.flatnonzero(kept).tolist(), project.measured.where(kept)
    listed = {
        "image": [images.names[i] for i in rows],
        "camera": [images.cameras[i] for i in rows],
        "exposure": [images.exposures[i] for i in rows],
    }
    seen = {
        "image": [images.names[i] for i in inside.image_idx],
        "point": [inside.points[k] for k in inside.point_idx],
        **columns("col_px row_px", inside.colrow),
    }
    if rows:
        fitted = {name: lens for name, lens in fitted.items() if name in listed["camera"]}
    proved, failed = _proved(project, {name: one.camera for name, one in fitted.items()})
    cameras = {name: dict(sensor) for name, sensor in project.sensors.items()}
    cameras |= {name: refitted.table for name, refitted in fitted.items()}
    settings = dict(project.settings)
    apriori = settings.pop("apriori", None)
    settings |= {"cameras": cameras} if cameras or not settings else {}
    settings |= {"apriori": apriori} if apriori else {}
    is_rig = len({*listed["exposure"]}) < len(rows)
    folder = block or ("heads" if is_rig else "calibration")
    lost = {
        **project.lost,
        "images that are switched off": int((~enabled).sum()),
        "images whose exposures are not in the trajectory": int((enabled & unflown).sum()),
        "measurements in images that are left out": len(project.measured.colrow)
        - len(inside.colrow),
    }
    tables: dict[str, Columns | None] = {
        f"{folder}/images.csv": listed if rows and all(images.cameras) else None,
        f"{folder}/image_points.csv": seen if len(inside.colrow) else None,
        "control_points.csv": _control_table(control) if control and control.names else None,
        f"{folder}/trajectory.csv": flown.table,
    }
    return ImportedFlight(
        source=project.source,
        sha256=checksums(project.sources),
        settings=settings,
        tables={name: table for name, table in tables.items() if table is not None},
        warnings=(
            *failed,
            *(
                f"the lens of {name} differs from the program's by {refitted.left}"
                for name, refitted in fitted.items()
                if refitted.left.largest_px > WARNED_PX
            ),
        ),
        assumed=(*project.assumed, *_sizes(project, fitted, pixel_um), *flown.assumed),
        found=(
            *_counted(project, listed, int(images.oriented[kept].sum()), inside),
            *project.found,
            *flown.found,
            *_of_lenses(project, fitted),
            *proved,
        ),
        lenses=[refitted.row for refitted in fitted.values()] if len(fitted) > SHOWN else (),
        left_out=(
            *(f"{n} {words}" for words, n in lost.items() if n),
            *unfit,
            *project.left_out,
            *flown.left_out,
        ),
    )


def reader(
    read_project: Callable[..., Project], common: Sequence[str] = ("block", "pixel_um", "allow")
) -> Callable[..., ImportedFlight]:
    """Return the reader of a program's files: with its own options, and some of `flight_of`."""

    def read(
        source: Path,
        *,
        block: BlockOfProject = None,
        pixel_um: PixelUmOfProject = None,
        allow: Allow = WORST_PX,
        **own: Any,
    ) -> ImportedFlight:
        found = read_project(source, **own)
        return flight_of(found, block=block, pixel_um=pixel_um, allow=allow)

    hints = get_type_hints(read, include_extras=True)
    of_flight = [signature(read).parameters[name] for name in common]
    parameters = [*signature(read_project).parameters.values(), *of_flight]
    read.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    read.__annotations__ = hints | get_type_hints(read_project, include_extras=True)
    read.__doc__ = read_project.__doc__
    return read


def numbered(lenses: Iterable[Hashable]) -> dict[Any, str]:
    """Return names of cameras that a program has no names for, by their lenses."""
    different = list(dict.fromkeys(lenses))
    names = ["CAM"] if len(different) == 1 else [f"CAM{k + 1}" for k in range(len(different))]
    return dict(zip(different, names, strict=True))


def in_crs(source: Path, crs: str | None) -> InGrid:
    """Return the map into the grid of a frame w in the flight's CRS, which no file states.

    Parameters
    ----------
    source : Path
        What an error names, where `crs` is none or cannot be used.
    crs : str, optional
    """
    if crs is None:
        fault = "adjusted orientations are in coordinates whose CRS the files do not say"
        return refusal(str(source), 1, "crs", fault, "give it by --crs")
    try:
        coordinates.chosen("", None, crs)
    except ValueError as error:
        return refusal(str(source), 1, "crs", str(error), "must be projected, in metres")
    return as_they_are


def _refitted(
    project: Project, pixel_um: float | None, allow: float
) -> tuple[dict[str, Refitted], tuple[str, ...]]:
    """Return the cameras of all images, and sentences on cameras that no flight can have."""
    images = project.images
    used = {images.cameras[i] for i in np.flatnonzero(images.used)} or {*project.lenses}
    lenses = {name: lens for name, lens in project.lenses.items() if name in used}
    fitted, unfit = dict[str, Refitted](), list[str]()
    for name, lens in lenses.items():
        try:
            fitted[name] = lens.refitted(name, pixel_um)
        except ValueError as error:
            if not project.may_leave_cameras or len(unfit) + 1 == len(lenses):
                fault, expected = f"{name}: {error}", "must be a lens that a flight can have"
                raise lens.wrong(fault, expected) from None
            unfit.append(f"camera and its images: {name}: {error}")
            continue
        if (fault_and_cure := too_far(fitted[name].left, allow)) is not None:
            raise lens.wrong(f"{name}: {fault_and_cure[0]}", fault_and_cure[1])
    return fitted, tuple(unfit)


def _flown(project: Project) -> Trajectory:
    """Return the trajectory that is asked for."""
    images, n = project.images, int(project.images.oriented.sum())
    is_local, measured = project.settings.get("crs") == LOCAL, Trajectory()
    if project.orientations == "initial":
        measured = project.trajectory
    is_adjusted = project.orientations == "adjusted"
    if not is_adjusted and not (is_local and n and project.trajectory.table is None):
        said = f"{number_of(n, 'adjusted orientations')} (--orientations adjusted)"
        return replace(measured, left_out=(*measured.left_out, *([said] if n else [])))
    leaders: dict[str, int] = {}
    for i in np.flatnonzero(images.oriented & images.used).tolist():
        exposure = images.exposures[i]
        if exposure not in leaders or images.names[i] == exposure:
            leaders[exposure] = i
    if not leaders:
        nothing = "a trajectory: no image is oriented"
        return Trajectory(left_out=(nothing,) if images.names else ())
    if isinstance(project.in_grid, FlightError):
        raise project.in_grid
    rows = np.array([*leaders.values()])
    T_b_c = stacked([project.lenses[images.cameras[i]].mount for i in rows])
    return Trajectory(
        table=trajectory_in_grid(
            list(leaders), *project.in_grid(images.T_w_c[rows] @ T_b_c.inverse)
        ),
        assumed=(*project.placed, START_VALUES if is_local else MEANS_NOTHING),
        found=(f"{number_of(len(leaders), 'adjusted orientations')}",),
    )


def _control_table(control: Control) -> dict[str, list[Any]]:
    table = {"point": list(control.names)} | columns("east_m north_m height_m", control.enh)
    if control.sigma is not None:
        sigmas = columns("sigma_east_m sigma_north_m sigma_height_m", control.sigma)
        table |= {name: sigma for name, sigma in sigmas.items() if min(sigma) > 0}
    if control.is_check is not None:
        table["role"] = ["check" if is_check else "control" for is_check in control.is_check]
    return table


def _sizes(
    project: Project, fitted: Mapping[str, Refitted], pixel_um: float | None
) -> Iterator[str]:
    """Yield a sentence on the pixel size assumed for cameras that have none in any file."""
    nominal = [name for name in fitted if not project.lenses[name].pixel_um]
    if nominal and pixel_um is None:
        said = f"Pixels of {', '.join(nominal)}: {NOMINAL_UM:g} µm, since no file says it"
        yield f"{said}; only millimetres depend on it (--pixel-um)"


def _counted(
    project: Project, listed: Mapping[str, Sequence[str]], n_oriented: int, measured: Measured
) -> Iterator[str]:
    """Yield sentences on the numbers of images, measurements and surveyed points."""
    n, exposures, cameras = len(listed["image"]), {*listed["exposure"]}, {*listed["camera"]} - {""}
    if n:
        by = f" by {number_of(len(cameras), 'cameras')}" if cameras else ""
        of = f"{number_of(n, 'images')} of {number_of(len(exposures), 'exposures')}"
        yield f"{of}{by}, {n_oriented} of them oriented"
    points, control = {measured.points[k] for k in measured.point_idx}, project.control
    if points:
        n_measured = number_of(len(measured.colrow), "measurements")
        yield f"{n_measured} of {number_of(len(points), 'points')}"
    if control is not None and control.names:
        seen, checks = len(points.intersection(control.names)), sum(control.is_check or ())
        of_them = f"{seen} of them measured" + (f", {checks} check points" if checks else "")
        yield f"{number_of(len(control.names), 'surveyed points')}, {of_them}"


def _of_lenses(project: Project, fitted: Mapping[str, Refitted]) -> Iterator[str]:
    """Yield a sentence for each kind of calibration, each remark and each lens; one for many."""
    kinds: dict[str, list[str]] = {}
    for name in fitted:
        if kind := project.lenses[name].kind:
            kinds.setdefault(kind, []).append(name)
    yield from (f"calibration of {'; '.join(names)}: {kind}" for kind, names in kinds.items())
    yield from (remark for name in fitted if (remark := project.lenses[name].remark))
    if len(fitted) <= SHOWN:
        yield from (refitted.said for refitted in fitted.values())
        return
    f = [refitted.camera.interior.f / refitted.camera.pixel_mm for refitted in fitted.values()]
    name, worst = max(fitted.items(), key=lambda item: item[1].left.largest_px)
    yield (
        f"{len(fitted)} lenses, f {min(f):.2f} to {max(f):.2f} px; refitted as Brown's model they "
        f"differ by {worst.left} ({name}), or less: import.md lists them"
    )


def _proved(project: Project, cameras: Mapping[str, Camera]) -> tuple[list[str], list[str]]:
    """Return sentences: how well the program's own points agree with the imported cameras.

    The second are those of points that do not agree.
    """
    said, failed = list[str](), list[str]()
    for proof in project.proofs:
        how, apart = _apart(project.images, cameras, proof)
        if len(apart):
            said.append(how.format(_said_of(apart)))
            if proof.is_own and np.nanmean(np.append(apart**2, 0.0)) > FAILED_PX**2:
                failed.append(
                    f"{said[-1]}: poses, lenses or points are not what they are taken for"
                )
    if project.images.names and project.lenses and not said:
        said.append("nothing proves the conventions: the files lack points, measurements, or poses")
    return said, failed


def _apart(images: Images, cameras: Mapping[str, Camera], proof: Proof) -> tuple[str, Array]:
    """Return a sentence without its size, and the distances of the points of a proof, px."""
    measured = proof.measured
    known = np.array([name in cameras for name in images.cameras], dtype=bool) & images.oriented
    usable = measured.where(known)
    if measured.x_w is not None:
        has_place = np.asarray(np.isfinite(measured.x_w).all(axis=1))
        usable = usable.some(has_place[usable.point_idx])
    names = np.array([images.cameras[i] for i in usable.image_idx])
    T_w_c = (images.T_w_c if proof.T_w_c is None else proof.T_w_c)[usable.image_idx]
    if measured.x_w is not None:
        apart = misfits(cameras, names, T_w_c, measured.x_w[usable.point_idx], usable.colrow)
        return f"{proof.whose} are reprojected by the cameras as imported to {{}}", apart
    if not len(names):
        return "", np.zeros(0)
    x_w = _intersected(cameras, names, T_w_c, usable, len(measured.points))[usable.point_idx]
    apart = misfits(cameras, names, T_w_c, x_w, usable.colrow)[np.isfinite(x_w[:, 0])]
    return f"{proof.whose} meet in a point to {{}}, by the cameras as imported", apart


def misfits(
    cameras: Mapping[str, Camera], names: Array, T_w_c: Pose, x_w: Array, colrow: Array
) -> Array:
    """Return the distances of measured points from projected ones, px, shape (n,).

    Parameters
    ----------
    cameras : mapping of str to Camera
    names : ndarray of str, shape (n,)
        The camera of each measurement.
    T_w_c : Pose
        The camera pose of each measurement in any Cartesian frame, the library's camera axes.
    x_w : ndarray, shape (n, 3)
        The point of each measurement.
    colrow : ndarray, shape (n, 2)

    Returns
    -------
    ndarray, shape (n,)
        NaN where a point is not seen.
    """
    apart = np.full(len(colrow), np.nan)
    for name, camera in cameras.items():
        k = np.flatnonzero(names == name)
        if len(k):
            computed = projected(camera, T_w_c[k], x_w[k])
            apart[k] = np.hypot(*(computed - colrow[k]).T)
    return apart


def _intersected(
    cameras: Mapping[str, Camera], names: Array, T_w_c: Pose, measured: Measured, n_points: int
) -> Array:
    """Return the points in which rays meet best, shape (n_points, 3); arrays as in `misfits`."""
    along, middle = np.zeros((len(measured.colrow), 3)), T_w_c.r.mean(axis=0)
    for name, camera in cameras.items():
        k = np.flatnonzero(names == name)
        if len(k):
            along[k] = rays(camera, T_w_c[k], measured.colrow[k])
    return middle + intersect(T_w_c.r - middle, along, measured.point_idx, n_points)


def _said_of(apart: Array) -> str:
    """Return the size of misfits as text: rms, median and largest, px."""
    known = apart[np.isfinite(apart)]
    if not len(known):
        return "none is seen by its image"
    rms = np.sqrt(np.mean(known**2))
    return (
        f"{rms:.3g} px rms, median {np.median(known):.3g} px, largest {known.max():.3g} px "
        f"({number_of(len(known), 'measurements')}"
        + (f", {n} not seen)" if (n := len(apart) - len(known)) else ")")
    )


# --- Tables of a flight, with the digits that their numbers need, and names that it may have


DECIMALS = {"px": 4, "m": 5, "deg": 9}
"""Of numbers by their units; latitude and longitude have one more."""


def columns(names: str, values: Array) -> dict[str, list[Any]]:
    """Return columns of a table, named with their units, of values, shape (n, n_names)."""
    decimals = {name: DECIMALS[name.rpartition("_")[2]] for name in names.split()}
    return {
        name: np.round(column, n + (name in ("lat_deg", "lon_deg"))).tolist()
        for (name, n), column in zip(decimals.items(), values.T, strict=True)
    }


def trajectory_in_grid(exposures: Sequence[str], enh: Array, opk: Array) -> dict[str, list[Any]]:
    """Return the table trajectory.csv.

    Parameters
    ----------
    exposures : sequence of str
    enh : ndarray, shape (n, 3)
        m.
    opk : ndarray, shape (n, 3)
        The body's, against the grid, radians.
    """
    names = "east_m north_m height_m omega_deg phi_deg kappa_deg"
    values = np.column_stack([enh, np.degrees(opk)])
    return {"exposure": list(exposures), **columns(names, values)}


def grid_poses_of_ecef(grid: GridSystem, T_e_b: Pose) -> tuple[Array, Array]:
    """Return east, north, height (m) and omega, phi, kappa (rad) of poses in the ECEF frame."""
    geographic = grid.geographic_from_ecef(T_e_b.r)
    frame = mean_origin(grid, geographic[:, :2])
    R_e_m = rotation_enu_to_ecef(np.asarray(frame.origin)[None])[0]
    return frame.pose_to_grid(Pose(R=R_e_m.T @ T_e_b.R, r=frame.from_geographic(geographic)))


def require_names(names: Iterable[str], wrong: Callable[[str, str], FlightError]) -> None:
    """Raise for the first name that no flight may use.

    Parameters
    ----------
    names : iterable of str
    wrong : callable
        From what is wrong and what was expected to the error.
    """
    for name in dict.fromkeys(names):
        fault = name_fault(name) if name else ("is empty", "must be a name")
        if fault is not None:
            said = fault[0] if name in fault[0] else f"{quoted(name)} {fault[0]}"
            raise wrong(said, fault[1])


def first_use(names: Sequence[str]) -> tuple[list[str], Index]:
    """Return the different names in the order of the file, and the place of each name in them."""
    order = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return list(order), np.array([order[name] for name in names], dtype=int)


def without_doubles(names: Sequence[str], ids: Sequence[object]) -> tuple[list[str], int]:
    """Return names, those that occur twice with the program's own number, and their count."""
    often = Counter(names)
    new = [f"{name}#{i}" if often[name] > 1 else name for name, i in zip(names, ids, strict=True)]
    return new, sum(n for n in often.values() if n > 1)


def by_id(places: Iterable[tuple[str, P]]) -> dict[str, P]:
    """Return places of a file by their ids, which must be unique."""
    found: dict[str, P] = {}
    for i, place in places:
        if found.setdefault(i, place) is not place:
            raise place.wrong(f"{quoted(i)} is there twice", "must be unique")
    return found


def named(places: Mapping[str, P], labels: Sequence[str]) -> tuple[dict[str, str], int]:
    """Return names that a flight may use by ids, and how many labels stand twice.

    Ids stand behind these.
    """
    names, doubled = without_doubles(labels, list(places))
    for name, place in zip(names, places.values(), strict=True):
        require_names([name], place.wrong)
    return dict(zip(places, names, strict=True)), doubled
