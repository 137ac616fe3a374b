"""Pix4Dmapper's folder params: lenses and adjusted orientations, proved by its matrices.

Layout as the heads of its files and the support pages of Pix4D have it. In
``*_calibrated_camera_parameters.txt`` an image has ten lines: name and size; K; three radial and
two tangential coefficients, OpenCV's; its position t without the offset; R, from the world to axes
x right, y down, z ahead. ``*_offset.xyz`` is to be added to t. ``*_pmatrix.txt`` has K [R | -R t].
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from acx4files.exchange import coordinates, lens, options, project, safe
from acx4files.exchange.coordinates import FLIP, Chosen
from acx4files.exchange.flight_folder import number_of
from acx4files.exchange.lens import Lens, Pinhole
from acx4files.exchange.project import Images, Measured, Project, Proof
from acx4files.exchange.safe import Line, Opened, refusal, told
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
    """An image: its first line, K, coefficients, position without the offset, R_v_w."""

    line: Line
    name: str
    size: tuple[int, int]
    K: Array
    coefficients: tuple[float, ...]
    t: Array
    R: Array

    @property
    def camera(self) -> tuple[float, ...]:
        """Numbers of the lens; images with equal ones are of one camera."""
        return (*self.size, *self.K.ravel().tolist(), *self.coefficients)


def read_project(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfProject = None,
    heights: options.HeightsOfFlight = None,
    orientations: options.AsAdjusted = "adjusted",
) -> Project:
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
        For files that are not Pix4D's, of a fisheye, or of different projects.
    """
    files = _files(source)
    parameters = files[PARAMETERS]
    offset: Array = np.zeros(3)
    shots = _shots(parameters)
    names = tuple(shot.name for shot in shots)
    project.require_names(names, partial(parameters.wrong, "image"))
    if OFFSET in files:
        blank = Line(file=files[OFFSET].file, number=1, cells=())
        offset = next(safe.lines(files[OFFSET]), blank).numbers(0, 3, "offset", METRES)
    T_w_c = Pose(
        R=np.stack([shot.R.T @ FLIP for shot in shots]),
        r=np.stack([shot.t for shot in shots]) + offset,
    )
    called = project.numbered(shot.camera for shot in shots)
    cameras = tuple(called[shot.camera] for shot in shots)
    lenses = {called[shot.camera]: _lens(parameters, shot) for shot in reversed(shots)}
    if INTERNAL in files and len(called) == 1:
        lenses = {name: _with_pixel(one, files[INTERNAL]) for name, one in lenses.items()}
    compared, shown = [], Measured()
    if EXTERNAL in files:
        compared.append(_compared(files[EXTERNAL], shots, T_w_c, placed=OFFSET in files))
    if MATRICES in files:
        of_images = [lenses[camera] for camera in cameras]
        sentence, shown = _matrices(files[MATRICES], shots, of_images, offset)
        compared += [sentence] if shown.points else []
    system = _system(files, crs)
    if system is not None and heights is not None:
        system = replace(system, heights=heights)
    return Project(
        source="Pix4Dmapper",
        sources=files.values(),
        lenses={name: lenses[name] for name in called.values()},
        images=Images(names=names, cameras=cameras, exposures=names, T_w_c=T_w_c),
        settings={} if system is None else system.settings,
        orientations=orientations,
        in_grid=_in_grid(parameters, system, placed=OFFSET in files),
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        found=tuple(compared),
        proofs=(Proof(whose="places in all images, by Pix4D's own matrices,", measured=shown),),
        left_out=("tie points: acx4 import bingo reads *_tp_bingo.txt of the same folder",),
    )


read = project.reader(read_project, ("block", "allow"))


def _files(source: Path) -> dict[str, Opened]:
    """Return the files of a folder that are read, by the ends of their names."""
    folder = source if source.is_dir() else source.parent
    params = folder / "1_initial" / "params"
    folder = params if params.is_dir() else folder
    files: dict[str, Opened] = {}
    for end in (PARAMETERS, OFFSET, MATRICES, EXTERNAL, SYSTEM, INTERNAL):
        paths = [one for one in folder.iterdir() if one.name == end or one.name.endswith(f"_{end}")]
        if len(paths) > 1:
            fault = f"has {', '.join(sorted(path.name for path in paths))}"
            raise refusal(str(folder), 1, "folder", fault, "must have the files of one project")
        if paths:
            files[end] = safe.read(paths[0])
    if PARAMETERS not in files:
        expected = f"must hold *_{PARAMETERS} of Pix4D"
        raise refusal(str(folder), 1, "folder", f"has no *_{PARAMETERS}", expected)
    return files


def _system(files: dict[str, Opened], crs: str | None) -> Chosen | None:
    said = files.get(SYSTEM)
    text = "" if said is None else said.text().strip()
    where = partial((said or files[PARAMETERS]).wrong, "crs")
    with told(where, "must be what a flight can have"):
        return coordinates.chosen(text, None, crs)


# images


def _shots(source: Opened) -> list[_Shot]:
    """Return the images of the parameters."""
    rows = list(safe.lines(source))
    for row, known in zip(rows, HEAD, strict=False):
        if " ".join(row.cells) != known:
            expected = f"must be {quoted(known)}: a fisheye's parameters are not read"
            raise row.wrong("head", quoted(" ".join(row.cells)), expected)
    shots: dict[str, _Shot] = {}
    for k in range(len(HEAD), len(rows), 10):
        shot = _shot(rows[k : k + 10])
        if shot.name in shots:
            raise shot.line.wrong("image", f"{quoted(shot.name)} is there twice", "must be once")
        shots[shot.name] = shot
    if not shots:
        raise source.wrong("file", "has no image", "must have one")
    return list(shots.values())


def _shot(rows: list[Line]) -> _Shot:
    first, n = rows[0], len(rows[0]) - 2
    if len(rows) < 10 or n < 1:
        fault = f"{len(rows)} lines, the first of {len(first)} cells"
        expected = "must be ten, the first with name, width, height; is the file cut off?"
        raise first.wrong("image", fault, expected)
    K = np.array([row.numbers(0, 3, "K", METRES) for row in rows[1:4]])
    for k in (0, 1):
        rows[1 + k].number_at(k, "focal length", FOCAL)
    if K[1, 0] or K[2].tolist() != [0.0, 0.0, 1.0]:
        raise rows[2].wrong("K", "is no camera matrix", "must be fx s cx; 0 fy cy; 0 0 1")
    R = np.array([row.numbers(0, 3, "R", ENTRY) for row in rows[7:10]])
    if not coordinates.is_rotation(R):
        raise rows[7].wrong("R", "three rows are no rotation", "must be one")
    k1, k2, k3 = rows[4].numbers(0, 3, "radial distortion", COEFFICIENT).tolist()
    p1, p2 = rows[5].numbers(0, 2, "tangential distortion", COEFFICIENT).tolist()
    return _Shot(
        line=first,
        name=" ".join(first.cells[:n]),
        size=(int(first.number_at(n, "size", PIXELS)), int(first.number_at(n + 1, "size", PIXELS))),
        K=K,
        coefficients=(k1, k2, p1, p2, k3),
        t=rows[6].numbers(0, 3, "position", METRES),
        R=coordinates.nearest_rotation(R),
    )


def _lens(source: Opened, shot: _Shot) -> Lens:
    (fx, skew, cx), (_, fy, cy) = shot.K[:2].tolist()
    hole = Pinhole(fx=fx, fy=fy, cx=cx - HALF, cy=cy - HALF, skew=skew)
    wrong = partial(source.wrong, "camera", line=shot.line.number)
    return lens.OPENCV.lens(shot.coefficients, hole, shot.size, wrong)


def _with_pixel(one: Lens, internal: Opened) -> Lens:
    """Return a lens with the pixel size by the sensor's width in the .cam, where it is there."""
    match = re.search(r"sensor width of (\d{1,6}(?:\.\d{0,40})?)x", internal.text())
    pixel_um = 1000 * float(match[1]) / one.width_px if match else 0.0
    return replace(one, pixel_um=pixel_um) if pixel_um in RANGES["pixel_um"] else one


# what the other files say


def _compared(source: Opened, shots: list[_Shot], T_w_c: Pose, *, placed: bool) -> str:
    """Compare positions and omega, phi, kappa with the parameters; return a sentence on it."""
    by_name = {" ".join(row.cells[:-6]): row for row in safe.lines(source)}
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
    return f"Omega, Phi, Kappa and positions of *_{EXTERNAL} are those of R and t to {largest}"


def _matrices(
    source: Opened, shots: list[_Shot], lenses: list[Lens], offset: Array
) -> tuple[str, Measured]:
    """Compare matrices with K [R | -R t] by places in the rays of pixels all over each image.

    Return a sentence on it, and the places with their pixels by the matrices and Pix4D's lens.
    """
    by_name = {" ".join(row.cells[:-12]): row for row in safe.lines(source)}
    seen: list[tuple[int, str, Array]] = []
    places: dict[str, Array] = {}
    count, worst = 0, 0.0
    for k, shot in enumerate(shots):
        if (row := by_name.get(shot.name)) is None:
            continue
        P = row.numbers(len(row) - 12, len(row), "matrix").reshape(3, 4)
        across, down = (np.array([0.1, 0.5, 0.9]) * side for side in shot.size)
        pixels = np.stack(np.meshgrid(across, down), axis=2).reshape(-1, 2)
        rays = np.linalg.solve(shot.K, np.column_stack([pixels, np.ones(len(pixels))]).T)
        x_w = (DISTANCE_M * shot.R.T @ rays).T + shot.t
        with np.errstate(all="ignore"):  # what is not finite is far
            u, v, w = P @ np.column_stack([x_w, np.ones(len(x_w))]).T
            by_matrix = np.stack([u / w, v / w], axis=1)
        apart = float(np.hypot(*(by_matrix - pixels).T).max())
        if not apart <= SAME_PX:
            fault = f"that of {quoted(shot.name)} is off by {apart:.3g} px"
            raise row.wrong("matrix", fault, f"must be K [R | -R t] of *_{PARAMETERS}")
        count, worst = count + 1, max(worst, apart)
        ideal = np.linalg.solve(shot.K, np.column_stack([by_matrix, np.ones(len(x_w))]).T)[:2].T
        names = [f"{k} {j}" for j in range(len(x_w))]
        seen += zip([k] * len(names), names, lenses[k].colrow(ideal), strict=True)
        places |= zip(names, x_w + offset, strict=True)
    agrees = f"are K [R | -R t], to {worst:.2g} px in the images"
    return f"{number_of(count, 'matrices')} of *_{MATRICES} {agrees}", Measured.of(seen, places)


# where it is


def _in_grid(parameters: Opened, system: Chosen | None, *, placed: bool) -> project.InGrid:
    def lacks(fault: str, cure: str) -> FlightError:
        expected = f"{cure}, or --orientations none"
        return parameters.wrong("crs", f"adjusted orientations: {fault}", expected)

    if system is None:
        return lacks(f"no *_{SYSTEM} says the CRS", "give it by --crs")
    if not placed:
        return lacks(f"*_{OFFSET} is not there", "must be beside it")
    if system.crs == LOCAL:
        return project.as_they_are

    def in_grid(T: Pose) -> tuple[Array, Array]:
        with told(lacks, "must be what a flight can have"):
            enh = coordinates.into(system, T.r)
        if not np.allclose(enh[:, :2], T.r[:, :2], atol=SAME_M, rtol=0):
            raise lacks(f"its CRS is not {system.crs}", "give that of Pix4D's output")
        return enh, T.opk

    return in_grid
