"""Clean flights, systematic mistakes put into them, and how each is rightly named.

Rotations are scipy's, not the library's.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

import acx4sim
from acx4sim.designs import acx4_ideal_plan, single_head_plan
from acx4sim.files import SimulatedFlight, simulate_plan
from acx4sim.plan import Plan, layout

FORMS = ("grid", "geodetic")
DESIGNS = ("acx4-ideal", "single-head")
SIZES = {"small": 12, "medium": 40, "large": 160}
"""Number of images, about."""


@lru_cache(maxsize=8)
def clean(design: str, form: str, size: str, *, seed: int = 1) -> SimulatedFlight:
    """Simulate the calibration block of a design in another size and form of trajectory."""
    plan = {"acx4-ideal": acx4_ideal_plan, "single-head": single_head_plan}[design]()
    sized = {"small": _small, "medium": lambda plan: plan, "large": _large}[size](plan)
    options = acx4sim.Options(blocks=("calibration",))
    return simulate_plan(replace(sized, angles=form), seed, options)


def _small(plan: Plan) -> Plan:
    """Plan twelve images: two low strips there and back, and one at the other height."""
    block = plan.blocks["calibration"]
    strips = tuple(replace(block.strips[i], n=4, left_m=0.0, forward_m=0.0) for i in (0, 1, -1))
    return _with_block(plan, strips=strips, tie_points=60)


def _large(plan: Plan) -> Plan:
    """Plan some 160 images: strips there and back, and two at the other height."""
    block = plan.blocks["calibration"]
    low, high = block.strips[0], block.strips[-1]
    aside = abs(low.left_m)
    strips = [
        replace(low, n=16, turn_deg=180.0 * (i % 2), left_m=(i - 3.5) * aside) for i in range(8)
    ]
    strips += [replace(high, n=16, turn_deg=turn, forward_m=0.0) for turn in (0.0, 180.0)]
    half = (7.5 * low.base_m, 3.5 * aside)
    big = _with_block(plan, strips=tuple(strips), tie_points=400, tie_area_m=half)
    return replace(big, control=layout(9, 9, half, 40.0))


def _with_block(plan: Plan, **changes) -> Plan:
    block = replace(plan.blocks["calibration"], **changes)
    return replace(plan, blocks={**plan.blocks, "calibration": block})


# --- systematic mistakes put into clean flights, and how each is rightly named -----------------


GEOID_M = 31.4
"""Height of the geoid above the ellipsoid in flights with a geoid, m."""

FILES = {
    "trajectory": "calibration/trajectory.csv",
    "points": "calibration/image_points.csv",
    "control": "control_points.csv",
}


# --- mistakes --------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A systematic mistake.

    Attributes
    ----------
    makes : callable
        Changes a table in place; gets the table and the flight.
    table : str
        Key of `FILES`.
    named : tuple of str
        What a right message contains, one of them, with the form's angles for {0}, {1}, {2}.
    absorbed : bool
        Whether an unknown may take it up: then it leaves nothing, or hardly anything.
    forms : tuple of str
        Forms of trajectory that it exists in.
    geoid : bool
        Whether the flight has heights above a geoid, with its grid.
    """

    makes: Callable[[pd.DataFrame, SimulatedFlight], None]
    table: str = "trajectory"
    named: tuple[str, ...] = ()
    absorbed: bool = False
    forms: tuple[str, ...] = FORMS
    geoid: bool = False


def angles_of(table: pd.DataFrame) -> list[str]:
    """Return the columns of the three angles of a trajectory."""
    grid = "kappa_deg" in table
    return (
        ["omega_deg", "phi_deg", "kappa_deg"] if grid else ["roll_deg", "pitch_deg", "heading_deg"]
    )


def _angles(change: Callable[..., object]) -> Callable[[pd.DataFrame, SimulatedFlight], None]:
    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        names = angles_of(table)
        changed = np.column_stack(np.broadcast_arrays(*change(*table[names].to_numpy().T)))
        changed[:, 2] = (changed[:, 2] + 180.0) % 360.0 - 180.0
        table[names] = changed

    return makes


def _units(*factors: float) -> Callable[[pd.DataFrame, SimulatedFlight], None]:
    """Write the angles in other units; the full circle counts from zero."""

    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        names = angles_of(table)
        angles = table[names].to_numpy(copy=True)
        angles[:, 2] = (angles[:, 2] + 180.0) % 360.0 - 180.0
        table[names] = angles * factors

    return makes


def _order(order: str, columns: tuple[int, int, int], *, transposed: bool = False):
    """Write angles of the same rotation in another order of its three turns."""

    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        names = angles_of(table)
        ours, ijk = ("XYZ", [0, 1, 2]) if names[2] == "kappa_deg" else ("ZYX", [2, 1, 0])
        R = Rotation.from_euler(ours, table[names].to_numpy()[:, ijk], degrees=True)
        if transposed:
            R = R.inv()
        other = R.as_euler(order or ours, degrees=True)
        for k, column in enumerate(columns if order else ijk):
            table[names[column]] = other[:, k]

    return makes


def _of_camera(table: pd.DataFrame, flight: SimulatedFlight) -> None:
    (name,) = flight.plan.blocks["calibration"].cameras
    R_b_c = Rotation.from_euler("XYZ", flight.plan.cameras[name].boresight_deg, degrees=True)
    names = angles_of(table)
    R = Rotation.from_euler("XYZ", table[names].to_numpy(), degrees=True) * R_b_c
    table[names] = R.as_euler("XYZ", degrees=True)


def _north(table: pd.DataFrame, flight: SimulatedFlight) -> None:
    """Count from the other north, by the convergence of the middle's meridian."""
    import pyproj  # noqa: PLC0415

    grid = pyproj.Proj(flight.plan.crs)
    east, north = flight.plan.blocks["calibration"].centre_m
    convergence = grid.get_factors(*grid(east, north, inverse=True)).meridian_convergence
    table[angles_of(table)[2]] -= convergence


def _rows(step: int):
    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        others = [name for name in table if name not in ("exposure", "time_s")]
        table[others] = np.roll(table[others].to_numpy(), step, axis=0)

    return makes


def _late(delay_s: float):
    """Positions of a later time, between those of the neighbours in the strip."""

    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        names = ["lat_deg", "lon_deg"] if "lat_deg" in table else ["east_m", "north_m"]
        strip = table["exposure"].str.partition("-")[0]
        for _, own in table.groupby(strip):
            for name in [*names, "height_m"]:
                rate = np.gradient(own[name].to_numpy(), own["time_s"].to_numpy())
                table.loc[own.index, name] += delay_s * rate

    return makes


def _multiplied(*columns: str, by: float):
    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        table[list(columns)] *= by

    return makes


def _added(column: str, value: float):
    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        table[column] += value

    return makes


def _exchanged(*pairs: tuple[str, str]):
    def makes(table: pd.DataFrame, _: SimulatedFlight) -> None:
        for a, b in pairs:
            if a in table:
                table[[a, b]] = table[[b, a]].to_numpy()

    return makes


def _pixels(change):
    def makes(table: pd.DataFrame, flight: SimulatedFlight) -> None:
        (name,) = flight.plan.blocks["calibration"].cameras
        camera = flight.plan.cameras[name]
        colrow = change(table["col_px"], table["row_px"], camera)
        table["col_px"], table["row_px"] = colrow

    return makes


def _sigma_attitude(factor: float):
    def makes(table: pd.DataFrame, flight: SimulatedFlight) -> None:
        noise = flight.plan.noise
        for name, sigma in (
            ("roll", noise.roll_pitch_deg),
            ("pitch", noise.roll_pitch_deg),
            ("heading", noise.heading_deg),
        ):
            table[f"sigma_{name}_deg"] = factor * sigma

    return makes


def _sigma_position(factor: float):
    def makes(table: pd.DataFrame, flight: SimulatedFlight) -> None:
        noise = flight.plan.noise
        for name in ("east", "north"):
            table[f"sigma_{name}_m"] = factor * noise.gnss_horizontal_m
        table["sigma_height_m"] = factor * noise.gnss_vertical_m

    return makes


def _sigma_px(table: pd.DataFrame, flight: SimulatedFlight) -> None:
    (name,) = flight.plan.blocks["calibration"].cameras
    table["sigma_px"] = flight.plan.noise.image_px * flight.plan.cameras[name].pixel_um / 1000


def _moved(table: pd.DataFrame, _: SimulatedFlight) -> None:
    table[["east_m", "north_m"]] += [0.5, 0.5]


def _scaled(table: pd.DataFrame, _: SimulatedFlight) -> None:
    for name in ("east_m", "north_m"):
        middle = table[name].mean()
        table[name] = middle + (table[name] - middle) * (1 + 400e-6)


def _strips_of(table: pd.DataFrame, flight: SimulatedFlight) -> list:
    """Return the planned strip of every measurement: images are called C1-01 and on."""
    strips = flight.plan.blocks["calibration"].strips
    return [strips[int(name[1:].partition("-")[0]) - 1] for name in table["image"]]


def _camera_of(flight: SimulatedFlight):
    (name,) = flight.plan.blocks["calibration"].cameras
    return flight.plan.cameras[name]


def _north_up(table: pd.DataFrame, flight: SimulatedFlight) -> None:
    """Turn the images of the strips that are flown against the first one."""
    camera, strips = _camera_of(flight), _strips_of(table, flight)
    turns = np.radians([strip.turn_deg - strips[0].turn_deg for strip in strips])
    for column, size in (("col_px", camera.width_px), ("row_px", camera.height_px)):
        table[column] = np.where(np.cos(turns) < -0.5, size - 1 - table[column], table[column])


def _rolling(table: pd.DataFrame, flight: SimulatedFlight) -> None:
    """Read the rows out in 30 ms, at the planned speed over level ground."""
    camera, strips = _camera_of(flight), _strips_of(table, flight)
    ahead = Rotation.from_euler("XYZ", camera.boresight_deg, degrees=True).inv().apply([1, 0, 0])
    late_s = 0.03 * (table["row_px"] - (camera.height_px - 1) / 2) / camera.height_px
    scale = camera.f_mm / (camera.pixel_um / 1000) / np.array([s.height_m for s in strips])
    moved = scale * late_s * np.array([strip.speed_m_s for strip in strips])
    table["col_px"] -= ahead[0] * moved
    table["row_px"] += ahead[1] * moved


RADIAN, GON = np.pi / 180, 400 / 360

TURNED = "the camera axes"
"""A constant turn of the body's own axes is the mounting's, too."""

MISTAKES: Mapping[str, Mistake] = {
    "sign of roll": Mistake(
        makes=_angles(lambda a, b, c: (-a, b, c)), named=("{0} of opposite sign",)
    ),
    "sign of pitch": Mistake(
        makes=_angles(lambda a, b, c: (a, -b, c)), named=("{1} of opposite sign",)
    ),
    "sign of heading": Mistake(
        makes=_angles(lambda a, b, c: (a, b, -c)), named=("{2} of opposite sign",)
    ),
    "signs of roll, pitch": Mistake(
        makes=_angles(lambda a, b, c: (-a, -b, c)), named=("{0}, {1} of opposite sign",)
    ),
    "signs of pitch, heading": Mistake(
        makes=_angles(lambda a, b, c: (a, -b, -c)), named=("{1}, {2} of opposite sign",)
    ),
    "all signs": Mistake(
        makes=_angles(lambda a, b, c: (-a, -b, -c)),
        named=("{0}, {1}, {2} of opposite sign", "transposed"),
    ),
    "roll, pitch exchanged": Mistake(
        makes=_angles(lambda a, b, c: (b, a, c)), named=("{0}, {1} exchanged",)
    ),
    "roll, pitch exchanged, a sign": Mistake(
        makes=_angles(lambda a, b, c: (b, -a, c)),
        named=("{0}, {1} exchanged, then the first of opposite sign",),
    ),
    "pitch, heading exchanged": Mistake(
        makes=_angles(lambda a, b, c: (a, c, b)), named=("{1}, {2} exchanged",)
    ),
    "radians": Mistake(makes=_units(RADIAN, RADIAN, RADIAN), named=("{0}, {1}, {2} in radians",)),
    "gon": Mistake(makes=_units(GON, GON, GON), named=("{0}, {1}, {2} in gon", "{2} in gon")),
    "roll, pitch in radians": Mistake(
        makes=_units(RADIAN, RADIAN, 1.0), named=("{0}, {1} in radians",)
    ),
    "heading in gon": Mistake(
        makes=_units(1.0, 1.0, GON), named=("{2} in gon", "{0}, {1}, {2} in gon")
    ),
    "heading + 90": Mistake(
        makes=_angles(lambda a, b, c: (a, b, c + 90)), named=("{2} 90 degrees too large", TURNED)
    ),
    "heading - 90": Mistake(
        makes=_angles(lambda a, b, c: (a, b, c - 90)), named=("{2} 90 degrees too small", TURNED)
    ),
    "heading + 180": Mistake(
        makes=_angles(lambda a, b, c: (a, b, c + 180)), named=("{2} 180 degrees too small", TURNED)
    ),
    "heading from east": Mistake(
        makes=_angles(lambda a, b, c: (a, b, 90 - c)), named=("an angle from east", "from north")
    ),
    "order phi, omega, kappa": Mistake(
        makes=_order("YXZ", (1, 0, 2)), named=("phi, omega, kappa",), absorbed=True, forms=("grid",)
    ),
    "order kappa, phi, omega": Mistake(
        makes=_order("ZYX", (2, 1, 0)), named=("kappa, phi, omega",), forms=("grid",)
    ),
    "order roll, pitch, heading": Mistake(
        makes=_order("XYZ", (0, 1, 2)), named=("roll, pitch, heading",), forms=("geodetic",)
    ),
    "transposed": Mistake(
        makes=_order("", (0, 1, 2), transposed=True),
        named=("transposed", "{0}, {1}, {2} of opposite sign"),
    ),
    "of the camera": Mistake(
        makes=_of_camera, forms=("grid",), named=("of the camera",), absorbed=True
    ),
    "of a body with z down": Mistake(
        makes=_angles(lambda a, b, c: (a + 180 - 360 * (a > 0), -b, -c)),
        named=("z down", TURNED),
        forms=("grid",),
    ),
    "the other north": Mistake(makes=_north, named=("from grid north",), absorbed=True),
    "the next row": Mistake(makes=_rows(-1), named=("previous row",)),
    "the previous row": Mistake(makes=_rows(1), named=("next row",)),
    "20 ms late": Mistake(makes=_late(0.02), absorbed=True),
    "0.6 s late": Mistake(makes=_late(0.6), named=(" s late",)),
    "1 s early": Mistake(makes=_late(-1.0), named=(" s early",)),
    "height in feet": Mistake(makes=_multiplied("height_m", by=1 / 0.3048), named=("in feet",)),
    "control in feet": Mistake(
        makes=_multiplied("height_m", by=1 / 0.3048), table="control", named=("in feet",)
    ),
    "a constant height": Mistake(makes=_added("height_m", 2.0), absorbed=True),
    "ellipsoidal heights": Mistake(
        makes=_added("height_m", GEOID_M), named=("above the ellipsoid",), geoid=True
    ),
    "control of ellipsoidal heights": Mistake(
        makes=_added("height_m", GEOID_M),
        table="control",
        named=("height of control points above the ellipsoid",),
        geoid=True,
    ),
    "control of another height system": Mistake(
        makes=_added("height_m", -46.2), table="control", named=("as from another height system",)
    ),
    "another focal length": Mistake(
        makes=_pixels(
            lambda col, row, c: (
                0.94 * col + 0.03 * (c.width_px - 1),
                0.94 * row + 0.03 * (c.height_px - 1),
            )
        ),
        table="points",
        named=("as by another focal_mm",),
    ),
    "control of another epoch": Mistake(
        makes=_moved, table="control", named=("as from another epoch",)
    ),
    "control on the ground": Mistake(
        makes=_scaled, table="control", named=("control points scaled by",), absorbed=True
    ),
    "pixels not square": Mistake(
        makes=_pixels(lambda col, row, c: (1.002 * col - 0.001 * (c.width_px - 1), row)),
        table="points",
        named=("wider than high",),
    ),
    "north up": Mistake(  # nothing, where no strip is flown against the first
        makes=_north_up, table="points", named=("in one direction turned",), absorbed=True
    ),
    "rolling shutter": Mistake(
        makes=_rolling, table="points", named=("a rolling shutter",), absorbed=True
    ),
    "positions exchanged": Mistake(
        makes=_exchanged(("lat_deg", "lon_deg"), ("east_m", "north_m")),
        named=("exchanged", "swapped"),
    ),
    "control exchanged": Mistake(
        makes=_exchanged(("east_m", "north_m")), table="control", named=("exchanged", "swapped")
    ),
    "row from the bottom": Mistake(
        makes=_pixels(lambda col, row, camera: (col, camera.height_px - 1 - row)),
        table="points",
        named=("from the bottom",),
    ),
    "col from the right": Mistake(
        makes=_pixels(lambda col, row, camera: (camera.width_px - 1 - col, row)),
        table="points",
        named=("from the right", "from the bottom"),
    ),
    "col, row exchanged": Mistake(
        makes=_pixels(lambda col, row, _: (row, col)),
        table="points",
        named=("exchanged", "swapped"),
    ),
    "millimetres": Mistake(
        makes=_pixels(
            lambda col, row, c: (
                (col - (c.width_px - 1) / 2) * c.pixel_um / 1000,
                ((c.height_px - 1) / 2 - row) * c.pixel_um / 1000,
            )
        ),
        table="points",
        named=("in mm",),
    ),
    "half a pixel": Mistake(
        makes=_pixels(lambda col, row, _: (col + 0.5, row + 0.5)),
        table="points",
        absorbed=True,
    ),
    "sigma in seconds of arc": Mistake(makes=_sigma_attitude(3600.0), named=("in seconds of arc",)),
    "sigma in radians": Mistake(makes=_sigma_attitude(RADIAN), named=("in radians",)),
    "sigma in mm": Mistake(makes=_sigma_position(1000.0), named=("in mm",)),
    "sigma of pixels in mm": Mistake(makes=_sigma_px, table="points", named=("in mm",)),
}


def is_right(mistake: Mistake, form: str, message: str) -> bool:
    """Tell whether a message on a flight names its mistake, or is rightly silent."""
    names = ("omega", "phi", "kappa") if form == "grid" else ("roll", "pitch", "heading")
    plain = re.sub(r"_(deg|px|m)\b", "", message.replace(" were ", " "))
    named = any(text.format(*names) in plain for text in mistake.named)
    return named or (mistake.absorbed and not message)


def write(flight: SimulatedFlight, folder: Path, mistake: Mistake | None = None) -> Path:
    """Write a flight, with a mistake or without one."""
    files = {path: table.copy() for path, table in flight.tables.items()}
    toml = flight.toml
    if mistake is not None and mistake.geoid:
        toml = toml.replace('"ellipsoidal"', '"geoid.gtx"')
        for path in (FILES["trajectory"], FILES["control"]):
            files[path]["height_m"] -= GEOID_M
    if mistake is not None:
        mistake.makes(files[FILES[mistake.table]], flight)
    acx4sim.write(replace(flight, tables=files, toml=toml), folder)
    if mistake is not None and mistake.geoid:
        write_geoid(folder)
    return folder


def write_geoid(folder: Path) -> None:
    """Write a level geoid over the whole earth."""
    header = np.array([-90.0, -180.0, 90.0, 90.0], dtype=">f8").tobytes()
    size = np.array([3, 5], dtype=">i4").tobytes()
    heights = np.full(15, GEOID_M, dtype=">f4").tobytes()
    (folder / "geoid.gtx").write_bytes(header + size + heights)
