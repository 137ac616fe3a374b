"""What the numbers of a flight may have meant: every usual sign, order, unit, axis and row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from acx4lib.expected import Array
from acx4lib.flight.text.table import Table
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk, rph_from_rotation, turn
from acx4lib.geometry.geodesy import GridSystem

ANGLES = {
    "geographic": ("roll_deg", "pitch_deg", "heading_deg"),
    "grid": ("omega_deg", "phi_deg", "kappa_deg"),
}
SIGNS = sorted(product((1, -1), repeat=3), key=lambda signs: signs.count(-1))[1:]
"""Signs of three angles, those with the fewest changes first."""

QUARTERS = {
    90: "90 degrees too small",
    180: "180 degrees too small",
    -90: "90 degrees too large",
}
FOOT = 0.3048
"""International foot, m; that of the US survey is longer by a hundredth of a millimetre in 5 m."""

ROUND_GON, ROUND_DEG = 400.0, 360.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A trajectory with one supposed meaning of its numbers, in the terms of the contract.

    Attributes
    ----------
    quantity : {"attitude", "position"}
        What it changes most.
    columns : tuple of str
        Columns that are read otherwise.
    meaning : str
        What they are then, such as "of opposite sign".
    table : Table
        The trajectory in the contract's own signs, orders and units.
    """

    quantity: str
    columns: tuple[str, ...]
    meaning: str
    table: Table

    @property
    def says(self) -> str:
        """The end of a sentence that begins with "it looks as if"."""
        return f"{', '.join(self.columns)} were {self.meaning}"

    @property
    def name(self) -> str:
        """Columns and meaning, as in "pitch of opposite sign"."""
        plain = [column.removesuffix("_deg").removesuffix("_m") for column in self.columns]
        return f"{', '.join(plain)} {self.meaning}"


def angle_columns(table: Table) -> tuple[str, str, str]:
    """Return the names of a trajectory's three angles."""
    return ANGLES["geographic" if "lat_deg" in table.numbers else "grid"]


def changed(table: Table, **columns: Array) -> Table:
    """Return a table with other numbers in some of its columns."""
    return replace(table, numbers={**table.numbers, **columns})


def readings(table: Table, grid: GridSystem) -> Iterator[Reading]:
    """Yield a trajectory in each of its usual readings, the simplest first.

    Parameters
    ----------
    table : Table
        A trajectory in either form.
    grid : GridSystem
        Of the flight, for the convergence of its meridians and the heights of its geoid.
    """
    yield from _signs(table)
    yield from _headings(table, grid)
    yield from _exchanged(table)
    yield from _units(table)
    yield from _orders(table)
    yield from _heights(table, grid)
    yield from _rows(table)


def _attitude(table: Table, meaning: str, **columns: Array) -> Reading:
    return Reading(
        quantity="attitude",
        columns=tuple(columns),
        meaning=meaning,
        table=changed(table, **columns),
    )


def _signs(table: Table) -> Iterator[Reading]:
    """Roll, pitch and heading counted the other way round, one, two or all three."""
    names = angle_columns(table)
    for signs in SIGNS:
        flipped = {n: -table.numbers[n] for n, s in zip(names, signs, strict=True) if s < 0}
        yield _attitude(table, "of opposite sign", **flipped)


def _headings(table: Table, grid: GridSystem) -> Iterator[Reading]:
    """Headings from other zero directions."""
    heading = angle_columns(table)[2]
    value = table.numbers[heading]
    other = "an angle from east" if heading == "heading_deg" else "a heading from north"
    yield _attitude(table, other, **{heading: 90.0 - value})
    for k, wrong in QUARTERS.items():
        yield _attitude(table, wrong, **{heading: value + k})
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        convergence = np.degrees(grid.convergence(_lonlat(table, grid)))
    north = "from grid north" if heading == "heading_deg" else "from true north"
    yield _attitude(table, north, **{heading: value + np.nan_to_num(convergence)})


def _lonlat(table: Table, grid: GridSystem) -> Array:
    if "lat_deg" in table.numbers:
        return table.stack("lon_deg", "lat_deg")
    return grid.lonlat_from_grid(table.stack("east_m", "north_m"))


def _exchanged(table: Table) -> Iterator[Reading]:
    """Roll and pitch in each other's column, with all their signs; a body with z down."""
    roll, pitch, heading = angle_columns(table)
    a, b, c = (table.numbers[name] for name in (roll, pitch, heading))
    signs = {(1, 1): "", (-1, 1): "the first", (1, -1): "the second", (-1, -1): "both"}
    for (i, j), which in signs.items():
        turned = f", then {which} of opposite sign" if which else ""
        yield _attitude(table, f"exchanged{turned}", **{roll: i * b, pitch: j * a})
    yield _attitude(table, "exchanged", **{roll: c, heading: a})
    yield _attitude(table, "exchanged", **{pitch: c, heading: b})
    if heading == "kappa_deg":
        down = {roll: a + 180.0, pitch: -b, heading: -c}
        yield _attitude(table, "of a body with z down", **down)


def _units(table: Table) -> Iterator[Reading]:
    names = angle_columns(table)
    for chosen in (names, names[:2], names[2:]):
        for unit, degrees in (("radians", 180 / np.pi), ("gon", ROUND_DEG / ROUND_GON)):
            turned = {name: table.numbers[name] * degrees for name in chosen}
            yield _attitude(table, f"in {unit}", **turned)


def _orders(table: Table) -> Iterator[Reading]:
    """Rotations multiplied in another order, or transposed."""
    names = angle_columns(table)
    opk = np.radians(table.stack(*names))
    R1, R2, R3 = (turn(axis, opk[:, axis]) for axis in range(3))
    ours = "heading, pitch, roll" if names[2] == "heading_deg" else "omega, phi, kappa"
    if names[2] == "heading_deg":
        orders = {
            "in the order pitch before roll": R3 @ R1 @ R2,
            "in the order roll, pitch, heading": R1 @ R2 @ R3,
        }
    else:
        orders = {
            "in the order phi, omega, kappa": R2 @ R1 @ R3,
            "in the order kappa, phi, omega": R3 @ R2 @ R1,
        }
    orders[f"of the transposed rotation ({ours})"] = np.swapaxes(
        R3 @ R2 @ R1 if names[2] == "heading_deg" else R1 @ R2 @ R3, -1, -2
    )
    for meaning, R in orders.items():
        angles = np.degrees(
            rph_from_rotation(R) if names[2] == "heading_deg" else opk_from_rotation(R)
        )
        yield _attitude(table, meaning, **dict(zip(names, angles.T, strict=True)))


def _heights(table: Table, grid: GridSystem) -> Iterator[Reading]:
    height = table.numbers["height_m"]
    for meaning, value in height_readings(height, _lonlat(table, grid), grid):
        yield Reading(
            quantity="position",
            columns=("height_m",),
            meaning=meaning,
            table=changed(table, height_m=value),
        )


def height_readings(height: Array, lonlat: Array, grid: GridSystem) -> Iterator[tuple[str, Array]]:
    """Yield heights of points in their other readings, with the meaning of each.

    Parameters
    ----------
    height : ndarray, shape (n,)
        As they are given, m.
    lonlat : ndarray, shape (n, 2)
        Degrees.
    grid : GridSystem
    """
    yield "in feet", height * FOOT
    undulation = grid.undulation(lonlat)
    if np.any(undulation != 0):
        yield "above the ellipsoid", height - undulation


def plane_readings(east_north: Array) -> Iterator[tuple[str, Array]]:
    """Yield east and north of points, shape (n, 2), in their other readings."""
    yield "exchanged", east_north[:, ::-1]


def pixel_readings(colrow: Array, size: Array, pixel_mm: Array) -> Iterator[tuple[str, str, Array]]:
    """Yield the other readings of image measurements: columns, their meaning, pixels.

    Half a pixel is not among them: no measurement tells it from the principal point.

    Parameters
    ----------
    colrow : ndarray, shape (n, 2)
        As they are given.
    size : ndarray, shape (n, 2)
        Width and height of the image of each, px.
    pixel_mm : ndarray, shape (n, 1)
    """
    col, row = colrow.T
    right, bottom = (size - 1 - colrow).T
    yield "row_px", "counted from the bottom", np.column_stack([col, bottom])
    yield "col_px", "counted from the right", np.column_stack([right, row])
    yield "col_px, row_px", "exchanged", np.column_stack([row, col])
    yield "col_px, row_px", "in mm from the middle", (size - 1) / 2 + colrow / pixel_mm * [1, -1]
    yield "col_px, row_px", "in mm from the corner", colrow / pixel_mm - 0.5


def _rows(table: Table) -> Iterator[Reading]:
    """Positions and angles of the row before or after; the row beyond the end is the last."""
    n = np.arange(len(table))
    taken = [name for name in table.numbers if not name.startswith(("sigma", "time"))]
    for step, which in ((1, "next"), (-1, "previous")):
        rows = np.clip(n + step, 0, len(table) - 1)
        yield Reading(
            quantity="position",
            columns=("positions", "angles"),
            meaning=f"of the {which} row",
            table=changed(table, **{name: table.numbers[name][rows] for name in taken}),
        )


def of_cameras(table: Table, R_b_c: Array) -> Iterator[Reading]:
    """Yield the trajectory whose angles are a camera's, not the body's.

    Parameters
    ----------
    table : Table
    R_b_c : ndarray, shape (3, 3)
        Boresight of the camera.
    """
    names = angle_columns(table)
    angles = np.radians(table.stack(*names))
    if names[2] == "kappa_deg":
        body = opk_from_rotation(rotation_from_opk(angles) @ R_b_c.T)
        found = dict(zip(names, np.degrees(body).T, strict=True))
        yield _attitude(table, "of the camera, not of the body", **found)
