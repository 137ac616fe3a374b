"""Exports: a calibration of a results folder, images oriented by it, eq. (14), and their files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd

from acx4files.exchange.lens import Left, above
from acx4files.flight.block_from_tables import BLOCKS, read_block, without_points
from acx4files.flight.reader import Flight, checked
from acx4files.flight.toml_file import read_toml
from acx4files.results import folder, whole_files
from acx4files.results.provenance import read_run
from acx4files.results.read_back import read_calibration
from acx4files.results.tables import exterior_table
from acx4files.results.whole_files import write_all
from acx4lib import expected
from acx4lib.block import Block, select_cameras, unobserved
from acx4lib.calibration.estimates import Calibration
from acx4lib.errors import FlightError, OutputError
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, opk_jacobian, skew
from acx4lib.geometry.geodesy import R_ENU_NED, MappingFrame, rotation_enu_to_ecef
from acx4lib.georeferencing.direct import Georeferenced, georeference, pose_covariances
from acx4lib.least_squares.covariance import propagate, sigmas

CAMERA = ("single_step", "two_step_gnss", "two_step")
HEADS = ("rig", "rig_calibration")
"""Methods that calibrate one mounted camera, and those that calibrate heads; the best first."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated:
    """A calibration to export.

    Attributes
    ----------
    flight : Flight
        As the results keep it.
    method : str
        One of `CAMERA` or `HEADS`.
    calibration : Calibration
        In `cov`, a posteriori.
    others : tuple of str
        Methods that the results have besides.
    digest : str
        SHA-256 of the tables of the flight.
    """

    flight: Flight
    method: str
    calibration: Calibration
    others: tuple[str, ...] = ()
    digest: str = ""

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The calibrated cameras; of heads the first one is the reference."""
        return self.calibration.cameras

    @property
    def title(self) -> str:
        """Names of the cameras, and the method."""
        return f"{', '.join(camera.name for camera in self.cameras)} by {self.method}"

    @property
    def origin(self) -> str:
        """Sentence on the flight of the calibration."""
        return f"calibrated on the flight {self.flight.name!r}; SHA-256 of its tables {self.digest}"


def read(results: str | Path, *, method: str = "", heads: bool = False) -> Calibrated:
    """Read a calibration from the results of a run.

    Parameters
    ----------
    results : path
    method : str
        One of `CAMERA` or `HEADS`; by default the best that the results have.
    heads : bool
        Whether only calibrations of heads can be used.

    Raises
    ------
    FlightError
        Where the folder has no such results, they were changed after the run, or the method did
        not end with a calibration.
    ValueError
        For an unknown method.
    """
    if method:
        expected.one_of("method", method, (*CAMERA, *HEADS))
    run = read_run(results)
    stored, flight = run.found, run.flight
    ended = [name for name in (*CAMERA, *HEADS) if _ended(stored, f"mounting/{name}")]
    usable = [name for name in ended if not heads or name in HEADS]
    chosen = method or next(iter(usable), "")
    if chosen not in usable:
        entry = stored.summary.get(f"mounting/{chosen}", {})
        said = [*folder.messages(entry, "stopped"), *folder.messages(entry, "left_out")]
        said.append(f"it has {', '.join(ended) or 'none'}; of heads are {', '.join(HEADS)}")
        wanted = chosen or ("heads" if heads else "any method")
        problem = f"{stored.folder}: no calibration of {wanted} that can be exported"
        raise FlightError([f"{problem}; {said[0]}"])
    key = f"mounting/{chosen}"
    cameras = [flight.cameras[name] for name in folder.cameras(stored, key)]
    known = read_calibration(stored, key, cameras)
    return Calibrated(
        flight=flight,
        method=chosen,
        calibration=replace(known, cov=known.cov * known.sigma0_sq, sigma0_sq=1.0),
        others=tuple(name for name in usable if name != chosen),
        digest=run.provenance.digest,
    )


def _ended(stored: folder.Results, key: str) -> bool:
    """Tell whether a method ended with a calibration."""
    entry = stored.summary.get(key, {})
    named = folder.has(stored, key) and folder.cameras(stored, key)
    return bool(named) and bool(entry.get("converged", True)) and not entry.get("stopped")


# --- Heads of a rig relative to the first of them


R_C_V = np.diag([1.0, -1.0, -1.0])
"""From the axes of computer vision, y down and z ahead, to the library's camera axes, and back."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relative:
    """A head in the axes of the reference head.

    Attributes
    ----------
    T_r_h : Pose
        Head to reference, library's camera axes, m.
    cov : ndarray, shape (6, 6)
        Of the position along the reference's axes, m, and of a rotation about the head's axes,
        radians; zero where nothing is estimated.
    """

    T_r_h: Pose
    cov: Array

    @property
    def T_v_r_h(self) -> Pose:
        """Pose of the head with y down and z ahead in both heads."""
        return Pose(R=R_C_V @ self.T_r_h.R @ R_C_V, r=R_C_V @ self.T_r_h.r)

    @property
    def sigma_opk(self) -> Array:
        """Standard deviations of omega, phi, kappa of `T_v_r_h`, radians, shape (3,)."""
        J = opk_jacobian(self.T_v_r_h.opk) @ R_C_V
        return sigmas(propagate(J, self.cov[3:, 3:]))

    @property
    def sigma_position(self) -> Array:
        """Standard deviations of the position, m, shape (3,); signs of axes do not matter."""
        return sigmas(self.cov[:3, :3])


def to_first(calibration: Calibration) -> tuple[Relative, ...]:
    """Return every camera's pose relative to the first camera; its own is the identity.

    Parameters
    ----------
    calibration : Calibration
        With a posteriori covariance.
    """
    first, mount = calibration.cameras[0].T_b_c, calibration.layout.mount
    out = []
    for k, camera in enumerate(calibration.cameras):
        T_r_h = first.inverse @ camera.T_b_c if k else Pose(R=np.eye(3), r=np.zeros(3))
        J = np.zeros((6, calibration.n_columns + 1))  # the last column is of what is held
        if k:  # d(relative pose) / d(mounting) of the reference and of the head
            by_first, by_head = np.zeros((6, 6)), np.eye(6)
            by_first[:3, :3], by_head[:3, :3] = -first.R.T, first.R.T
            by_first[:3, 3:] = skew(T_r_h.r)
            by_first[3:, 3:] = -T_r_h.R.T
            np.add.at(J.T, mount[0], by_first.T)
            np.add.at(J.T, mount[k], by_head.T)
        out.append(Relative(T_r_h=T_r_h, cov=propagate(J[:, :-1], calibration.cov)))
    return tuple(out)


# --- Exterior orientations of a block by direct georeferencing, as other programs count


R_C_TOP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From a body whose forward axis is up in the image, to the camera's axes; its down is the view."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Oriented:
    """The images of a block with calibrated cameras, and their poses.

    Attributes
    ----------
    block : Block
    georeferenced : Georeferenced
        Cameras and poses in the block's topocentric frame.
    """

    block: Block
    georeferenced: Georeferenced

    @property
    def T_m_c(self) -> Pose:
        """Poses of the images."""
        return self.georeferenced.T_m_c

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the images."""
        return self.block.images.names

    @property
    def origin(self) -> str:
        """Where the topocentric axes begin, in words."""
        if self.block.frame.grid.is_local:
            return "the origin of the flight's coordinates, whose axes they are"
        lon, lat = self.block.frame.origin
        return f"longitude {lon:.9f}, latitude {lat:.9f} degrees, ellipsoidal height 0"


def read_flown(path: Path) -> Flight:
    """Read a flight that may have no measurements and no control points.

    Raises
    ------
    FlightError
        With all that is wrong with it.
    """
    present = [name for name in BLOCKS if (path / name).is_dir()]
    blocks = [without_points(read_block(path, name, pictures=path)) for name in present]
    return checked(read_toml(path / "flight.toml"), blocks)


def orient(calibrated: Calibrated, flight: Flight, block: str) -> Oriented:
    """Return the images of a block that calibrated cameras took, oriented by eq. (14).

    Parameters
    ----------
    calibrated : Calibrated
    flight : Flight
        That of the calibration, or a later one with the same cameras.
    block : str
        Of its blocks.

    Raises
    ------
    FlightError
        Where the block has no image of a calibrated camera, or its trajectory observes nothing.
    """
    names = [camera.name for camera in calibrated.cameras]
    if block not in flight.blocks:
        raise FlightError([f"{flight.path}: no block {block}; it has {', '.join(flight.blocks)}"])
    if unobserved(flight.block(block)):
        problem = f"{flight.path}: block {block}: its trajectory has start values without sigma"
        raise FlightError([f"{problem}; nothing can be oriented by it"])
    for variant in (flight.mounted(block), flight.block(block)):
        present = [camera.name for camera in variant.cameras if camera.name in names]
        if present:
            mounted = select_cameras(variant, present)
            g = georeference(mounted, calibrated.calibration)
            return Oriented(block=mounted, georeferenced=g)
    listed = ", ".join(camera.name for camera in flight.block(block).cameras)
    problem = f"{flight.path}: block {block} has images of {listed}, not of {', '.join(names)}"
    raise FlightError([f"{problem}; name another --method"])


def in_grid(oriented: Oriented) -> pd.DataFrame:
    """Return positions and omega, phi, kappa in the grid with their sigma, as results have them."""
    cov = pose_covariances(oriented.block, oriented.georeferenced)
    return exterior_table(oriented.block, oriented.names, T_m_c=oriented.T_m_c, cov=cov)


def roll_pitch_heading(frame: MappingFrame, T_m_c: Pose) -> Array:
    """Return roll, pitch, heading of images as bodies with the top edge ahead, radians, (n, 3).

    Parameters
    ----------
    frame : MappingFrame
    T_m_c : Pose
        Of n images.

    Returns
    -------
    ndarray, shape (n, 3)
        Heading from true north, between 0 and a whole turn.
    """
    lonlat = frame.to_geographic(T_m_c.r)[:, :2]
    R_e_m = rotation_enu_to_ecef(frame.origin[None])[0]
    R_t_c = np.swapaxes(rotation_enu_to_ecef(lonlat), -1, -2) @ R_e_m @ T_m_c.R
    R = R_ENU_NED @ R_t_c @ R_C_TOP
    roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    pitch = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 2, 1], R[:, 2, 2]))
    heading = np.mod(np.arctan2(R[:, 1, 0], R[:, 0, 0]), 2 * np.pi)
    return np.stack([roll, pitch, heading], axis=-1)


# --- Exterior orientations as tables of text, which most programs read by declared columns


FILE = "orientations.csv"

DIGITS = {"_m": 5, "_deg": 9}
"""Decimals of metres and degrees; those of latitude and longitude are a tenth of a millimetre."""

OPK = (
    "omega, phi, kappa of R = Rx(omega) Ry(phi) Rz(kappa), from the camera's axes, x right and y "
    "up in the image, to those of {}"
)
GRID = "grid east, grid north and the ellipsoid's normal at the image: {}; heights: {}"
ELLIPSOIDAL = "heights are ellipsoidal"
CENTRE = "positions are those of the perspective centre, by trajectory, boresight and lever arm"
RPH = (
    "roll, pitch and heading are those of the image, not of the body: a camera that looks down is "
    "level, its heading, from true north, is that of the top edge, positive pitch lifts the view "
    "ahead, positive roll lowers the right edge; as a trajectory of a flight they belong to a "
    "camera with mount_kappa_deg = -90"
)
SIGMA_OF = "sigma: a priori of the trajectory, a posteriori of the calibration, with correlations"


def opk(oriented: Oriented) -> Taken:
    """Return positions and angles in the grid of the flight, with a priori sigma."""
    grid = oriented.block.frame.grid
    axes = GRID.format(grid.crs, grid.heights)
    return _taken(in_grid(oriented), CENTRE, OPK.format(axes), SIGMA_OF)


def topocentric_table(oriented: Oriented) -> Taken:
    """Return positions and angles in topocentric axes: east, north, up at `Oriented.origin`."""
    names, T = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg"), oriented.T_m_c
    axes = f"east, north, up at {oriented.origin}"
    return _taken(_table(oriented, names, T.r, T.opk), CENTRE, OPK.format(axes))


def rph(oriented: Oriented) -> Taken:
    """Return latitude, longitude, ellipsoidal height and roll, pitch, heading of the images."""
    names = ("lat_deg", "lon_deg", "height_m", "roll_deg", "pitch_deg", "heading_deg")
    frame = oriented.block.frame
    lonlath = frame.to_geographic(oriented.T_m_c.r)
    angles = roll_pitch_heading(frame, oriented.T_m_c)
    table = _table(oriented, names, lonlath[:, [1, 0, 2]], angles)
    return _taken(table, CENTRE, ELLIPSOIDAL, RPH)


def _table(oriented: Oriented, names: Sequence[str], r: Array, angles: Array) -> pd.DataFrame:
    frame = pd.DataFrame(np.column_stack([r, np.degrees(angles)]), columns=list(names))
    frame.insert(0, "image", list(oriented.names))
    return frame


def _taken(table: pd.DataFrame, *assumed: str) -> Taken:
    for name in table.columns[1:]:
        unit = next(unit for unit in DIGITS if name.endswith(unit))
        table[name] = [f"{value:.{DIGITS[unit]}f}" for value in table[name]]
    text = table.to_csv(index=False, lineterminator="\n")
    left_out = () if "sigma_east_m" in table else ("standard deviations: --to opk has them",)
    return Taken(files={FILE: text}, assumed=assumed, left_out=left_out)


# --- Files that are exported for another program, and their folder


STATEMENT = "export.md"

LARGEST_PX = 0.05
"""Largest difference between a lens and its refit in the other program."""

SIGMA = "standard deviations and covariance: parameters.csv and covariance.csv have them"
BODY = "boresight and lever arm: --to toml has them"
"""Sentences on parts that many formats cannot hold."""


@dataclass(frozen=True, kw_only=True)
class Taken:
    """Files for another program, and notes for their user.

    Attributes
    ----------
    files : mapping of str to str
        Contents by file below the folder.
    lenses : mapping of str to Left
        By camera, how far the lens of the other program is from the calibrated one.
    assumed, left_out : tuple of str
        Conventions of the files, and what they have no place for: a sentence each.
    """

    files: Mapping[str, str]
    lenses: Mapping[str, Left] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def near(taken: Taken, allowed_px: float = LARGEST_PX) -> Taken:
    """Return an export if its lenses are near enough.

    Raises
    ------
    OutputError
        Where a lens differs by more than is allowed.
    """
    for name, left in sorted(taken.lenses.items(), key=lambda item: -item[1].largest_px):
        if not left.largest_px <= allowed_px:
            msg = (
                f"{name}: the other program's lens differs by {left.largest_px:.3g} px somewhere "
                f"in the image, more than {allowed_px:g} px; --allow {above(left.largest_px)} "
                "exports it nevertheless"
            )
            raise OutputError(msg)
    return taken


def sentences(taken: Taken) -> tuple[str, ...]:
    """Return a sentence for each lens on its difference."""
    return tuple(
        f"{name}: lens refitted over the whole image, off by at most {left.largest_px:.4f} px, "
        f"rms {left.rms_px:.4f} px"
        for name, left in taken.lenses.items()
    )


def write(taken: Taken, folder: Path, *, title: str, origin: str) -> None:
    """Write the files and export.md into a folder, all of them or none.

    Parameters
    ----------
    taken : Taken
    folder : Path
        New, empty, or written by an export before; then its files are replaced.
    title : str
    origin : str
        Where the calibration comes from, a sentence without its full stop.

    Raises
    ------
    OutputError
        Where the folder is somebody else's.
    """
    said = [f"# {title}", "", f"{origin[0].upper()}{origin[1:]}.", ""]
    parts = {"Lenses": sentences(taken), "Conventions": taken.assumed, "Left out": taken.left_out}
    for name, remarks in parts.items():
        if remarks:
            said += [f"## {name}", "", *(f"- {remark}" for remark in remarks), ""]
    texts = {**taken.files, STATEMENT: "\n".join(said)}
    with whole_files.claim(folder, signs=[STATEMENT]):
        for name in texts:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_all({folder / name: text for name, text in texts.items()})


# --- Numbers, JSON and XML as text: numbers with all the digits that they have


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them."""
    return " ".join(map(repr, map(float, values)))


def lines(texts: Iterable[str]) -> str:
    """Return texts, each with an end of line."""
    return "".join(f"{text}\n" for text in texts)


def add_numbers(element: ET.Element, name: str, values: Iterable[float]) -> None:
    """Put numbers as an element below another one."""
    ET.SubElement(element, name).text = numbers(values)


def as_xml(element: ET.Element) -> str:
    """Return an element with all below it as a document."""
    ET.indent(element)
    body = ET.tostring(element, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'
