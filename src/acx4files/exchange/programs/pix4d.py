"""Pix4Dmapper's folder params: lenses and adjusted orientations, proved by its matrices.

Layout as the heads of its files and the support pages of Pix4D have it. In
``*_calibrated_camera_parameters.txt`` an image has ten lines: name and size; K; three radial and
two tangential coefficients, OpenCV's; its position t without the offset; R, from the world to axes
x right, y down, z ahead. ``*_offset.xyz`` is to be added to t. ``*_pmatrix.txt`` has K [R | -R t].
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from acx4files.exchange import coordinates, safe
from acx4files.exchange.coordinates import FLIP, Chosen, is_rotation, nearest_rotation, stacked
from acx4files.exchange.flight_folder import ImportedFlight, number_of
from acx4files.exchange.lens import OPENCV, WORST_PX, Lens, Pinhole
from acx4files.exchange.options import (
    Allow,
    AsAdjusted,
    BlockOfProject,
    CrsOfProject,
    HeightsOfFlight,
    Source,
)
from acx4files.exchange.project import (
    Images,
    InGrid,
    Measured,
    Project,
    Proof,
    as_they_are,
    flight_of,
    nowhere,
    numbered,
    require_all_names,
)
from acx4files.exchange.safe import Line, Opened, refusal
from acx4files.flight.problems import METRES, PIXELS, RANGES, Range, quoted
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import LOCAL

PARAMETERS = "calibrated_camera_parameters.txt"
EXTERNAL = "calibrated_external_camera_parameters.txt"
MATRICES, OFFSET, SYSTEM = "pmatrix.txt", "offset.xyz", "wkt.prj"
INTERNAL = "pix4d_calibrated_internal_camera_parameters.cam"
"""Ends of the names of files, which begin with the project's name."""

HEAD = (
    "fileName imageWidth imageHeight",
    "camera matrix K [3x3]",
    "radial distortion [3x1]",
    "tangential distortion [2x1]",
    "camera position t [3x1]",
    "camera rotation R [3x3]",
    "camera model m = K [R|-Rt] X",
)
"""First lines of the parameters; those of a fisheye are others."""

EXTERNAL_HEAD = ("imageName", "X", "Y", "Z", "Omega", "Phi", "Kappa")

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5."""

ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")
FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")
COEFFICIENT = Range(-1e3, 1e3)

SAME_M, SAME_DEG, SAME_PX = 0.01, 1e-3, 0.5
"""Largest differences of two files of one project: positions, attitudes, matrices."""

DISTANCE_M = 100.0
"""Distance of the points by which matrices are compared."""

ASSUMED = (
    "Pixels: Pix4D counts from the outer corner of the top-left one, so 0.5 is taken off",
    "R takes the world's axes to x right, y down, z ahead; K1 to K3, T1, T2 are OpenCV's k1 to k3, "
    "p1, p2",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shot:
    """An image: the line of its name, K, coefficients, position without the offset, R_v_w."""

    line: Line
    name: str
    size: tuple[int, int]
    K: Array
    coefficients: tuple[float, ...]
    t: Array
    R: Array

    @property
    def lens(self) -> tuple[float, ...]:
        """Numbers of the lens; images with equal ones are of one camera."""
        return (*self.size, *self.K.ravel().tolist(), *self.coefficients)


@dataclass(kw_only=True, eq=False)
class _Folder:
    """The files of a folder that are read, by the ends of their names."""

    path: Path
    read: list[Opened] = field(default_factory=list)

    def maybe(self, end: str) -> Opened | None:
        """Return the file with this end of its name; None where there is none."""
        paths = sorted(path for path in self.path.iterdir() if _ends(path.name, end))
        if not paths:
            return None
        if len(paths) > 1:
            fault = f"has {', '.join(path.name for path in paths)}"
            raise refusal(str(self.path), 1, "folder", fault, "must have the files of one project")
        source = safe.read(paths[0])
        self.read.append(source)
        return source


def project(source: Path, *, crs: str | None = None, heights: str | float | None = None) -> Project:
    """Return the folder params, or the one in a project's folder.

    Parameters
    ----------
    source : Path
        ``params``, a project's folder with ``1_initial/params``, or one of its files.
    crs : str, optional
        Of the flight; by default that of ``*_wkt.prj``.
    heights : str or float, optional
        As the key of flight.toml; by default those of that file.

    Raises
    ------
    FlightError
        For files that are not Pix4D's, of a fisheye, or of different projects.
    """
    folder = _Folder(path=_folder(source))
    parameters = folder.maybe(PARAMETERS)
    if parameters is None:
        expected = f"must hold *_{PARAMETERS} of Pix4D"
        raise refusal(str(folder.path), 1, "folder", f"has no *_{PARAMETERS}", expected)
    shots = list(_shots(parameters))
    names, offset = _names(shots), _offset(folder.maybe(OFFSET))
    T_w_c = stacked([_pose(shot, np.zeros(3) if offset is None else offset) for shot in shots])
    matrices = _matrices(folder.maybe(MATRICES), shots)
    compared = (
        *_external(folder.maybe(EXTERNAL), shots, T_w_c, placed=offset is not None),
        *_compared(shots, matrices),
    )
    system = _system(folder.maybe(SYSTEM), str(folder.path), crs, heights)
    called, lenses = _lenses(parameters, shots, folder.maybe(INTERNAL))
    shown = _shown(shots, [lenses[called[shot.lens]] for shot in shots], matrices, T_w_c)
    require_all_names({"image": names}, parameters.wrong)
    return Project(
        source="Pix4Dmapper",
        sources=folder.read,
        lenses=lenses,
        images=Images(
            names=names,
            cameras=tuple(called[shot.lens] for shot in shots),
            exposures=names,
            T_w_c=T_w_c,
        ),
        settings={} if system is None else system.settings,
        in_grid=_in_grid(parameters, system, placed=offset is not None),
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        found=compared,
        proofs=(Proof(whose="places in all images, by Pix4D's own matrices,", measured=shown),),
        left_out=("tie points: acx4 import bingo reads *_tp_bingo.txt of the same folder",),
    )


def read(
    source: Annotated[Path, Source],
    *,
    block: BlockOfProject = None,
    crs: CrsOfProject = None,
    heights: HeightsOfFlight = None,
    orientations: AsAdjusted = "adjusted",
    allow: Allow = WORST_PX,
) -> ImportedFlight:
    """Read the folder params of Pix4Dmapper: lenses, and the adjusted orientations.

    SOURCE is that folder (1_initial/params), or the project's folder. From its files
    *_calibrated_camera_parameters.txt and *_offset.xyz come lenses and poses, from *_wkt.prj the
    CRS. *_pmatrix.txt and *_calibrated_external_camera_parameters.txt must agree with them: the
    differences are told. A boresight on this trajectory means nothing. Tie points: acx4 import
    bingo.

    Examples
    --------
    acx4 import pix4d my_project/1_initial/params --out my_flight

    Raises
    ------
    FlightError
        As `project` and `flight_of`.
    """
    return flight_of(
        project(source, crs=crs, heights=heights),
        orientations=orientations,
        block=block,
        allow=allow,
    )


def _folder(source: Path) -> Path:
    if not source.is_dir():
        return source.parent
    inside = source / "1_initial" / "params"
    return inside if inside.is_dir() else source


def _ends(name: str, end: str) -> bool:
    """Tell whether a name is an end alone, or the project's name with it."""
    if end == PARAMETERS and name.endswith(EXTERNAL):
        return False
    return name == end or name.endswith(f"_{end}")


# images


def _shots(source: Opened) -> Iterator[_Shot]:
    """Yield the images of the parameters."""
    rows = list(safe.lines(source))
    for row, known in zip(rows, HEAD, strict=False):
        if " ".join(row.cells) != known:
            expected = f"must be {quoted(known)}: a fisheye's parameters are not read"
            raise row.wrong("head", quoted(" ".join(row.cells)), expected)
    rows = rows[len(HEAD) :]
    if not rows:
        raise source.wrong("file", "has no image", "must have one")
    for k in range(0, len(rows), 10):
        block = rows[k : k + 10]
        if len(block) < 10:
            count = f"{len(block)} lines of an image"
            raise block[0].wrong("image", count, "must be ten; is the file cut off?")
        yield _shot(block)


def _shot(rows: list[Line]) -> _Shot:
    first = rows[0]
    if len(first) < 3:
        raise first.wrong("image", f"{len(first)} cells", "must be name, width, height")
    n = len(first) - 2
    width, height = (int(first.number_at(n + k, "size", PIXELS)) for k in (0, 1))
    K = np.array([row.numbers(0, 3, "K", METRES) for row in rows[1:4]])
    for k in (0, 1):
        rows[1 + k].number_at(k, "focal length", FOCAL)
    if K[1, 0] or K[2].tolist() != [0.0, 0.0, 1.0]:
        raise rows[2].wrong("K", "is no camera matrix", "must be fx s cx; 0 fy cy; 0 0 1")
    R = np.array([row.numbers(0, 3, "R", ENTRY) for row in rows[7:10]])
    if not is_rotation(R):
        raise rows[7].wrong("R", "three rows are no rotation", "must be one")
    k1, k2, k3 = rows[4].numbers(0, 3, "radial distortion", COEFFICIENT).tolist()
    p1, p2 = rows[5].numbers(0, 2, "tangential distortion", COEFFICIENT).tolist()
    return _Shot(
        line=first,
        name=" ".join(first.cells[:n]),
        size=(width, height),
        K=K,
        coefficients=(k1, k2, p1, p2, k3),
        t=rows[6].numbers(0, 3, "position", METRES),
        R=nearest_rotation(R),
    )


def _names(shots: list[_Shot]) -> tuple[str, ...]:
    seen: set[str] = set()
    for shot in shots:
        if shot.name in seen:
            raise shot.line.wrong("image", f"{quoted(shot.name)} is there twice", "must be once")
        seen.add(shot.name)
    return tuple(shot.name for shot in shots)


def _pose(shot: _Shot, offset: Array) -> Pose:
    return Pose(R=shot.R.T @ FLIP, r=shot.t + offset)


def _offset(source: Opened | None) -> Array | None:
    if source is None:
        return None
    row = next(safe.lines(source), None)
    if row is None:
        raise source.wrong("offset", "is missing", "must be three numbers")
    return row.numbers(0, 3, "offset", METRES)


def _lenses(
    source: Opened, shots: list[_Shot], internal: Opened | None
) -> tuple[Mapping[tuple[float, ...], str], dict[str, Lens]]:
    """Return the names of cameras by their numbers, and the lenses."""
    called = numbered(shot.lens for shot in shots)
    first = {called[shot.lens]: shot for shot in reversed(shots)}
    wide_mm = _sensor_mm(internal) if len(called) == 1 else 0.0
    return called, {name: _lens(source, first[name], wide_mm) for name in called.values()}


def _lens(source: Opened, shot: _Shot, wide_mm: float) -> Lens:
    (fx, skew, cx), (_, fy, cy) = shot.K[:2].tolist()
    pixel_um = 1000 * wide_mm / shot.size[0]
    return Lens(
        width_px=shot.size[0],
        height_px=shot.size[1],
        hole=Pinhole(fx=fx, fy=fy, cx=cx - HALF, cy=cy - HALF, skew=skew),
        distortion=OPENCV.distortion(shot.coefficients),
        pixel_um=pixel_um if pixel_um in RANGES["pixel_um"] else 0.0,
        wrong=partial(source.wrong, "camera", line=shot.line.number),
    )


def _sensor_mm(internal: Opened | None) -> float:
    """Return the width of the sensor by the .cam, mm; 0 without it."""
    match = internal and re.search(r"sensor width of (\d{1,6}(?:\.\d{0,40})?)x", internal.text())
    return float(match[1]) if match else 0.0


# what the other files say


def _external(
    source: Opened | None, shots: list[_Shot], T_w_c: Pose, *, placed: bool
) -> tuple[str, ...]:
    """Compare positions and omega, phi, kappa with the parameters; return a sentence on it."""
    if source is None:
        return ()
    rows = list(safe.lines(source))
    if not rows or rows[0].cells != EXTERNAL_HEAD:
        raise source.wrong("head", "is another", f"must be {' '.join(EXTERNAL_HEAD)}")
    by_name = {" ".join(row.cells[:-6]): row for row in rows[1:]}
    worst = np.zeros(2)
    for k, shot in enumerate(shots):
        if (row := by_name.get(shot.name)) is None:
            continue
        n = len(row) - 6
        position = row.numbers(n, n + 3, "X, Y, Z", METRES)
        opk = np.radians(row.numbers(n + 3, n + 6, "Omega, Phi, Kappa", RANGES["omega_deg"]))
        turn = rotation_from_opk(opk).T @ T_w_c.R[k]
        degrees = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))
        off = np.array([np.abs(position - T_w_c.r[k]).max() if placed else 0.0, degrees])
        if off[0] > SAME_M or off[1] > SAME_DEG:
            fault = f"{quoted(shot.name)} is off by {off[0]:.3g} m and {off[1]:.3g} degrees"
            raise row.wrong("orientation", fault, f"must be that of *_{PARAMETERS}")
        worst = np.maximum(worst, off)
    largest = f"{worst[0]:.2g} m and {worst[1]:.2g} degrees"
    return (f"Omega, Phi, Kappa and positions of *_{EXTERNAL} are those of R and t to {largest}",)


def _matrices(source: Opened | None, shots: list[_Shot]) -> dict[int, Array]:
    """Return the matrices of images by their numbers; each must be K [R | -R t]."""
    if source is None:
        return {}
    by_name = {" ".join(row.cells[:-12]): row for row in safe.lines(source)}
    matrices: dict[int, Array] = {}
    for k, shot in enumerate(shots):
        if (row := by_name.get(shot.name)) is None:
            continue
        matrices[k] = row.numbers(len(row) - 12, len(row), "matrix").reshape(3, 4)
        apart = _apart(shot, matrices[k])
        if not apart <= SAME_PX:
            fault = f"that of {quoted(shot.name)} is off by {apart:.3g} px"
            raise row.wrong("matrix", fault, f"must be K [R | -R t] of *_{PARAMETERS}")
    return matrices


def _compared(shots: list[_Shot], matrices: Mapping[int, Array]) -> tuple[str, ...]:
    if not matrices:
        return ()
    worst = max(_apart(shots[k], P) for k, P in matrices.items())
    count = number_of(len(matrices), "matrices")
    return (f"{count} of *_{MATRICES} are K [R | -R t], to {worst:.2g} px in the images",)


def _rays(shot: _Shot) -> tuple[Array, Array]:
    """Return pixels all over an image, shape (9, 2), and places in their rays without the lens."""
    width, height = shot.size
    cols, rows = np.meshgrid(np.array([0.1, 0.5, 0.9]) * width, np.array([0.1, 0.5, 0.9]) * height)
    pixels = np.column_stack([cols.ravel(), rows.ravel()])
    rays = np.linalg.solve(shot.K, np.column_stack([pixels, np.ones(9)]).T)
    return pixels, (DISTANCE_M * shot.R.T @ rays).T + shot.t


def _seen(P: Array, x_w: Array) -> Array:
    """Return the pixels of places by a matrix, shape (n, 2)."""
    with np.errstate(all="ignore"):  # what is not finite is far
        u, v, w = P @ np.column_stack([x_w, np.ones(len(x_w))]).T
        return np.stack([u / w, v / w], axis=1)


def _apart(shot: _Shot, P: Array) -> float:
    """Return the largest distance, px, of pixels from their rays projected by a matrix."""
    pixels, x_w = _rays(shot)
    return float(np.hypot(*(_seen(P, x_w) - pixels).T).max())


def _shown(
    shots: list[_Shot], lenses: list[Lens], matrices: Mapping[int, Array], T_w_c: Pose
) -> Measured:
    """Return places, and their pixels by the matrices and Pix4D's lens."""
    parts = []
    for k, P in matrices.items():
        _, x_w = _rays(shots[k])
        points = np.column_stack([_seen(P, x_w), np.ones(len(x_w))]).T
        ideal = np.linalg.solve(shots[k].K, points)[:2].T
        parts.append((k, x_w + T_w_c.r[k] - shots[k].t, lenses[k].colrow(ideal)))
    n = 9 * len(parts)
    return Measured(
        points=tuple(map(str, range(n))),
        x_w=np.concatenate([np.zeros((0, 3)), *(x_w for _, x_w, _ in parts)]),
        image_idx=np.repeat([k for k, _, _ in parts], 9).astype(int),
        point_idx=np.arange(n),
        colrow=np.concatenate([np.zeros((0, 2)), *(colrow for _, _, colrow in parts)]),
    )


# where it is


def _system(
    source: Opened | None, folder: str, crs: str | None, heights: str | float | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where no file and no option says it."""
    try:
        system = coordinates.chosen("" if source is None else source.text().strip(), None, crs)
    except ValueError as error:
        file = folder if source is None else source.file
        message = " ".join(str(error).split())
        raise refusal(file, 1, "crs", message, "must be what a flight can have") from None
    if system is None or heights is None:
        return system
    return Chosen(crs=system.crs, heights=heights, assumed=system.assumed, source=system.source)


def _in_grid(parameters: Opened, system: Chosen | None, *, placed: bool) -> InGrid:
    if system is None:
        return nowhere(_lacks(parameters, f"no *_{SYSTEM} says the CRS", "give it by --crs"))
    if not placed:
        return nowhere(_lacks(parameters, f"*_{OFFSET} is not there", "must be beside it"))

    if system.crs == LOCAL:
        return as_they_are

    def in_grid(T: Pose) -> tuple[Array, Array]:
        try:
            enh = coordinates.into(system, T.r)
            plain = np.allclose(enh[:, :2], T.r[:, :2], atol=SAME_M, rtol=0)
        except ValueError as error:
            message = " ".join(str(error).split())
            raise _lacks(parameters, message, "must be what a flight can have") from None
        if not plain:
            raise _lacks(parameters, f"its CRS is not {system.crs}", "give that of Pix4D's output")
        return enh, T.opk

    return in_grid


def _lacks(source: Opened, fault: str, cure: str) -> FlightError:
    return source.wrong("crs", f"adjusted orientations: {fault}", f"{cure}, or --orientations none")
