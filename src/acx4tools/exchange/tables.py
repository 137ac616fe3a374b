"""The tables of a flight, with the digits that their numbers need."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.flight.problems import quoted
from acx4lib.flight.table_files import Columns
from acx4lib.flight.tables import faulty
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem, MappingFrame, mean_origin, rotation_enu_to_ecef

PIXELS, METRES, DEGREES = 4, 5, 9
"""Decimals of pixels, metres, degrees."""


def image_points(image: Sequence[str], point: Sequence[str], colrow: Array) -> Columns:
    """Return the table image_points.csv; `colrow`, shape (n, 2), in the library's pixels."""
    cols, rows = np.round(colrow, PIXELS).T.tolist() if len(colrow) else ([], [])
    return {"image": list(image), "point": list(point), "col_px": cols, "row_px": rows}


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
    east, north, height = np.round(enh, METRES).T.tolist()
    omega, phi, kappa = np.round(np.degrees(opk), DEGREES).T.tolist()
    return {
        "exposure": list(exposures),
        "east_m": east,
        "north_m": north,
        "height_m": height,
        "omega_deg": omega,
        "phi_deg": phi,
        "kappa_deg": kappa,
    }


def grid_poses_of_ecef(grid: GridSystem, T_e_b: Pose) -> tuple[Array, Array]:
    """Return east, north, height (m) and omega, phi, kappa (rad) of poses in the ECEF frame."""
    lonlat = grid.geographic_from_ecef(T_e_b.r)[:, :2]
    frame = mean_origin(grid, lonlat)
    return frame.pose_to_grid(_in_frame(frame, T_e_b))


def _in_frame(frame: MappingFrame, T_e_b: Pose) -> Pose:
    """Return poses in the ECEF frame as those in a mapping frame."""
    R_e_m = rotation_enu_to_ecef(np.asarray(frame.origin)[None])[0]
    x_m = frame.from_geographic(frame.grid.geographic_from_ecef(T_e_b.r))
    return Pose(R=R_e_m.T @ T_e_b.R, r=x_m)


def require_names(names: Sequence[str], wrong: Callable[[str, str, str], FlightError]) -> None:
    """Raise for the first name that no flight may use.

    Parameters
    ----------
    names : sequence of str
    wrong : callable
        From the name, what is wrong with it and what was expected, to the error.
    """
    if "" in names:
        raise wrong("", "is empty", "must be a name")
    for name, (fault, expected) in faulty(list(dict.fromkeys(names))).items():
        raise wrong(name, fault, expected)


def require_all_names(
    kinds: Mapping[str, Sequence[str]], wrong: Callable[[str, str, str], FlightError]
) -> None:
    """Raise for the first name that no flight may use.

    Parameters
    ----------
    kinds : mapping of str to sequence of str
        Names by what they are of: "image", "point".
    wrong : callable
        From what they are of, what is wrong and what was expected, to the error.
    """
    for kind, names in kinds.items():

        def of_kind(name: str, fault: str, expected: str, kind: str = kind) -> FlightError:
            return wrong(kind, fault if name in fault else f"{quoted(name)} {fault}", expected)

        require_names(names, of_kind)


def first_use(names: Sequence[str]) -> tuple[list[str], Index]:
    """Return the different names in the order of the file, and the place of each name in them."""
    order = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return list(order), np.array([order[name] for name in names], dtype=int)


def without_doubles(names: Sequence[str], ids: Sequence[object]) -> tuple[list[str], int]:
    """Return names, those that occur twice with the program's own number, and their count."""
    counts: dict[str, int] = {}
    for name in names:
        counts[name] = counts.get(name, 0) + 1
    new = [f"{name}#{i}" if counts[name] > 1 else name for name, i in zip(names, ids, strict=True)]
    return new, sum(n for n in counts.values() if n > 1)


def without_folders(paths: Sequence[str]) -> tuple[str, ...]:
    """Return names of files without their folders; with them where two would be the same."""
    whole = [path.replace("\\", "/") for path in paths]
    short = [path.rpartition("/")[2] for path in whole]
    return tuple(short if len(set(short)) == len(short) else whole)
