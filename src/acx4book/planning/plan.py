"""A plan.

The settings of flight.toml, terrain, control points, strips; read from a TOML file, checked,
written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4files.exchange import flight_folder
from acx4files.flight.block_from_tables import BLOCKS
from acx4files.flight.problems import (
    METRES,
    NOT_NEGATIVE,
    POSITIVE,
    RANGES,
    Problem,
    Range,
    lines_of,
    quoted,
)
from acx4files.flight.reader import of_degrees
from acx4files.flight.settings import CAMERA, Setup, camera_of, flight_table, setup_of
from acx4files.flight.toml_file import (
    Entries,
    Keys,
    Table,
    Tables,
    Toml,
    Value,
    choice,
    defaults,
    is_number,
    number,
    numbers,
    read_toml,
)
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera

# --- A plan: the settings of flight.toml, terrain, control points, strips


SPEED_M_S = 70.0
"""Ground speed of a strip that states none."""

TURN_S = 240.0
"""Time from the last exposure of a strip to the first of the next."""

PLACE = ("forward_m", "left_m")
"""Keys of a strip that are zero by default."""


@dataclass(frozen=True, kw_only=True)
class Strip:
    """One strip; its middle is given along the axes of its block.

    Attributes
    ----------
    flying_height_m : float
        Over the mean ground.
    course_deg : float
        Direction of flight, clockwise from grid north.
    length_m : float
        From the first exposure to the last; what is no multiple of the base is rounded up.
    base_m : float
        Distance between exposures.
    forward_m, left_m : float
        Middle of the strip relative to the middle of the block.
    speed_m_s : float
        Over ground.
    """

    flying_height_m: float
    course_deg: float
    length_m: float
    base_m: float
    forward_m: float = 0.0
    left_m: float = 0.0
    speed_m_s: float = SPEED_M_S

    @property
    def n_exposures(self) -> int:
        """Number of exposures, one at least."""
        return 1 + int(np.ceil(self.length_m / self.base_m - 1e-6))


@dataclass(frozen=True, kw_only=True)
class Area:
    """Where a block lies: its middle in the map, and its axes forward and left.

    Attributes
    ----------
    east_m, north_m : float
        Middle, in the flight's CRS.
    course_deg : float
        Direction of the axis forward, clockwise from grid north.
    """

    east_m: float
    north_m: float
    course_deg: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Points:
    """Surveyed points, laid out in a rectangle along the axes of a block.

    Attributes
    ----------
    layout : str
        ``grid``, ``corners`` or ``at``: see `places`.
    number : tuple of int
        Rows and columns of a grid, or how many points.
    area_m : tuple of float
        Length forward and width left of the rectangle.
    play_m : float
        Largest displacement of a point from a regular layout.
    at_m : tuple of tuple of float
        Forward and left of every point, for layout ``at``.
    sigma_m : tuple of float
        East, north, height.
    sigma_px : float or None
        Of measuring a point; as that of all image points by default.
    """

    layout: str = "grid"
    number: tuple[int, ...] = ()
    area_m: tuple[float, float] = (0.0, 0.0)
    play_m: float = 0.0
    at_m: tuple[tuple[float, float], ...] = ()
    sigma_m: tuple[float, float, float] = (0.01, 0.01, 0.02)
    sigma_px: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedBlock:
    """One block of a plan.

    Attributes
    ----------
    name : str
        ``heads``, ``calibration`` or ``validation``.
    area : Area
    strips : dict of str to Strip
        In the order of flight.
    points : Points
        The block's control points, or its check points if it is ``validation``.
    tie_points : int
        Number of tie points on the ground.
    tie_area_m : tuple of float or None
        Length forward and width left of the area with tie points; all that images show by
        default.
    """

    name: str
    area: Area
    strips: Mapping[str, Strip]
    points: Points
    tie_points: int = 0
    tie_area_m: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """A flight before it is flown.

    Attributes
    ----------
    setup : Setup
        What flight.toml says.
    values : dict
        The plan as its file has it.
    height_m, relief_m : float
        Mean of the ground, in the flight's height system, and root mean square of its hills.
    control : Points
        Those of the blocks heads and calibration.
    blocks : dict of str to PlannedBlock
        By name, in the order of `block_from_tables.BLOCKS`.
    truth : dict of str to Camera
        Cameras that `acx4 simulate` flies, where they are not those of the settings; planning
        does not use them.
    """

    setup: Setup
    values: Mapping[str, Any]
    height_m: float
    relief_m: float
    control: Points
    blocks: Mapping[str, PlannedBlock]
    truth: Mapping[str, Camera] = field(default_factory=dict)

    def cameras(self, block: str) -> tuple[Camera, ...]:
        """Return the cameras whose images are measured in a block.

        The heads in ``heads``, and in the others where they are measured in heads; else the
        synthetic camera. Without a synthetic camera, all.
        """
        setup = self.setup
        if setup.synthetic is None:
            return tuple(setup.cameras.values())
        if block == "heads" or setup.measured_in_heads:
            return tuple(setup.cameras[name] for name in setup.synthetic.heads)
        return (setup.cameras[setup.synthetic.camera],)

    def with_strips(
        self, strips: Mapping[str, Strip] | Sequence[Strip], block: str = "calibration"
    ) -> Plan:
        """Return the plan with other strips in one of its blocks.

        Parameters
        ----------
        strips : mapping of str to Strip, or sequence of Strip
            In the order of flight, by name; those of a sequence are named by their numbers.
        block : str
        """
        if not isinstance(strips, Mapping):
            strips = {str(number): strip for number, strip in enumerate(strips, 1)}
        tables = {
            name: {key: value for key, value in asdict(strip).items() if value or key not in PLACE}
            for name, strip in strips.items()
        }
        return replace(
            self,
            blocks={**self.blocks, block: replace(self.blocks[block], strips=dict(strips))},
            values={**self.values, block: {**self.values.get(block, {}), "strips": tables}},
        )

    def with_control(self, number: int, area_m: tuple[float, float] | None = None) -> Plan:
        """Return the plan with so many control points in a rectangle.

        Parameters
        ----------
        number : int
            0 to 9: four corners, the middle, the middles of the four sides, in this order.
        area_m : tuple of float, optional
            Length forward and width left of the rectangle; by default that of the plan's own.
        """
        table = {
            "layout": "corners",
            "number": number,
            "area_m": [*(area_m or self.control.area_m)],
            "play_m": self.control.play_m,
            "sigma_m": [*self.control.sigma_m],
        }
        points = replace(_points(table), sigma_px=self.control.sigma_px)
        blocks = {
            name: block if name == "validation" else replace(block, points=points)
            for name, block in self.blocks.items()
        }
        return replace(
            self, control=points, blocks=blocks, values={**self.values, "control": table}
        )

    def frame(self, block: str) -> Camera | None:
        """Return the camera whose image decides what is measured; None where each decides."""
        synthetic = self.setup.synthetic
        if synthetic is None or block == "heads" or not self.setup.measured_in_heads:
            return None
        return self.setup.cameras[synthetic.camera]


def image_length_m(camera: Camera, flying_height_m: float, *, across: bool = False) -> float:
    """Return how much level ground an image shows along the flight, through its middle.

    Parameters
    ----------
    camera : Camera
    flying_height_m : float
    across : bool
        Across the flight instead.

    Notes
    -----
    With an overlap p the base is (1 - p) times this length.
    """
    towards = np.abs(camera.T_b_c.R[int(across), :2])
    size: Array = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    chord_mm = float(np.min(size / np.maximum(towards, 1e-9)))
    return chord_mm * flying_height_m / camera.interior.f


def strip_of(
    camera: Camera,
    flying_height_m: float,
    course_deg: float,
    *,
    images: int,
    overlap: float = 0.8,
) -> Strip:
    """Return a strip over the middle of its block, from the number of its images.

    Parameters
    ----------
    camera : Camera
    flying_height_m : float
        Over the mean ground.
    course_deg : float
        Clockwise from grid north.
    images : int
    overlap : float
        Of neighbouring images, as a part of what each of them shows along the flight.
    """
    base_m = (1 - overlap) * image_length_m(camera, flying_height_m)
    return Strip(
        flying_height_m=flying_height_m,
        course_deg=course_deg % 360.0,
        length_m=(images - 1) * base_m,
        base_m=base_m,
    )


# --- A plan as a TOML file: read, with everything that is wrong named by its line, and written


def read(path: str | Path) -> Plan:
    """Return the plan in a TOML file.

    Raises
    ------
    FlightError
        With all problems, one line each.
    """
    return checked(read_toml(Path(path), needed_by="planning"))


def from_values(values: Mapping[str, Any]) -> Plan:
    """Return the plan of a nested dict with the keys of the file; FlightError as `read`."""
    return checked(Toml(folder=Path(), file="plan", values=dict(values), in_memory=True))


def checked(toml: Toml) -> Plan:
    """Return the plan of a document; FlightError as `read`."""
    problems = [*_problems(toml)]
    if problems:
        raise FlightError(lines_of(problems))
    plan = _plan(toml, setup_of(toml))
    problems = [*_flying_problems(toml, plan)]
    if problems:
        raise FlightError(lines_of(problems))
    return plan


def _plan(toml: Toml, setup: Setup) -> Plan:
    field = toml.table("field")
    plan = Plan(
        setup=setup,
        values=toml.values,
        height_m=float(field["height_m"]),
        relief_m=float(field.get("relief_m", 0.0)),
        control=_points(toml.table("control")),
        blocks={},
        truth={
            name: camera_of(name, {**toml.table("cameras", name), **table})
            for name, table in toml.table("truth").items()
        },
    )
    blocks = {name: _block(toml, plan, name) for name in BLOCKS if name in toml.values}
    return replace(plan, blocks=blocks)


def _block(toml: Toml, plan: Plan, name: str) -> PlannedBlock:
    table = toml.table(name)
    given = {**toml.table("field"), **table}
    area = Area(
        east_m=float(given["east_m"]),
        north_m=float(given["north_m"]),
        course_deg=float(given.get("course_deg", 0.0)),
    )
    check = name == "validation"
    tie_area = table.get("tie_area_m")
    return PlannedBlock(
        name=name,
        area=area,
        strips=dict(_strips(plan, name, area, table["strips"])),
        points=_points(table["check"]) if check else plan.control,
        tie_points=int(table.get("tie_points", 0)),
        tie_area_m=None if tie_area is None else (float(tie_area[0]), float(tie_area[1])),
    )


def _points(table: Mapping[str, Any]) -> Points:
    """Return surveyed points; none for an empty table."""
    number = table.get("number", 0)
    east, north, height = map(float, table.get("sigma_m", Points.sigma_m))
    forward, left = map(float, table.get("area_m", Points.area_m))
    return Points(
        layout=table.get("layout", "grid") if table else "at",
        number=tuple(map(int, number if isinstance(number, list) else [number])),
        area_m=(forward, left),
        play_m=float(table.get("play_m", 0.0)),
        at_m=tuple((float(a), float(b)) for a, b in table.get("at_m", ())),
        sigma_m=(east, north, height),
        sigma_px=float(table["sigma_px"]) if "sigma_px" in table else None,
    )


def _strips(
    plan: Plan, block: str, area: Area, tables: Mapping[str, Mapping[str, Any]]
) -> Iterator[tuple[str, Strip]]:
    """Yield strips by name; parallel ones, flown in turn both ways, get a number each."""
    camera = plan.frame(block) or plan.cameras(block)[0]
    for name, table in tables.items():
        fields = {key: float(table[key]) for key in Strip.__dataclass_fields__ if key in table}
        height = fields["flying_height_m"]
        if "overlap" in table:
            fields["base_m"] = (1 - table["overlap"]) * image_length_m(camera, height)
        strip = Strip(**fields)
        n = int(table.get("parallel", 1))
        spacing = float(table.get("spacing_m", 0.0))
        if "side_overlap" in table:
            spacing = (1 - table["side_overlap"]) * image_length_m(camera, height, across=True)
        if n == 1:
            yield name, strip
            continue
        turn = np.radians(strip.course_deg - area.course_deg)
        for i in range(n):
            beside = (0.5 * (n - 1) - i) * spacing  # to the left of the strip's own course
            yield (
                f"{name}-{i + 1}",
                replace(
                    strip,
                    forward_m=strip.forward_m + float(beside * np.sin(turn)),
                    left_m=strip.left_m + float(beside * np.cos(turn)),
                    course_deg=(strip.course_deg + 180.0 * (i % 2)) % 360.0,
                ),
            )


def _place_problems(toml: Toml, plan: Plan, block: PlannedBlock) -> Iterator[Problem]:
    """Yield a problem where the middle of a block is nowhere, or given in degrees."""
    grid, east, north = plan.setup.grid, block.area.east_m, block.area.north_m
    key = block.name if "east_m" in toml.table(block.name) else "field"
    place = f"{east:g} east, {north:g} north"
    if not np.isfinite(grid.lonlat_from_grid(np.array([[east, north]]))).all():
        limit = f"must lie where {grid.crs} maps the earth; easting first"
        yield toml.problem((key, "east_m"), place, limit)
    elif of_degrees(grid, np.array([east]), np.array([north])):
        place += " (longitude, latitude in degrees?)"
        yield toml.problem((key, "east_m"), place, f"must be metres where {grid.crs} is meant for")


def _flying_problems(toml: Toml, plan: Plan) -> Iterator[Problem]:
    """Yield blocks that cannot be flown where, or with what, they are planned."""
    for name, block in plan.blocks.items():
        yield from _place_problems(toml, plan, block)
        if name == "heads" and plan.setup.synthetic is None and len(plan.setup.cameras) < 2:
            count, cure = "one camera", "heads are several; a single camera is flown in calibration"
            yield toml.problem((name,), count, cure)


# --- written ---------------------------------------------------------------------------------


def written(values: Mapping[str, Any]) -> str:
    """Return the TOML text of nested tables: those of a plan, or of flight.toml.

    A strip is one line. Values are text, numbers, truth values, dates, and lists of them.
    """
    return flight_folder.written(values, inline="strips")


# --- The keys of a plan that flight.toml does not have


MOST_STRIPS = 500
"""Largest number of strips of a block."""

EXAMPLE = "{flying_height_m = 600, course_deg = 0, length_m = 600, overlap = 0.8}"

LAYOUTS = ("grid", "corners", "at")

_COURSE = Range(-360.0, 360.0)
_COUNT = Range(0, 500, "must be a whole number up to 500", whole=True)
_FIRST = Range(0, 9, "must be a whole number up to 9 for corners", whole=True)
_SHARE = Range(0.0, 0.99, "must be a share from 0 to 0.99")
_FROM_MIDDLE = Range(-1e6, 1e6)
"""Distances from the middle of a field, m; farther away grid coordinates have no place."""


def _spacing_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield a strip with both or neither of two keys that say the same."""
    given = toml.table(*keys)
    if ("base_m" in given) == ("overlap" in given):
        conflict = "both base_m and overlap" if "base_m" in given else "neither base_m nor overlap"
        yield toml.problem(keys, conflict, "needs one of the two")
    beside = [key for key in ("spacing_m", "side_overlap") if key in given]
    if "parallel" in given and len(beside) != 1:
        conflict = (
            "both spacing_m and side_overlap" if beside else "parallel strips without a spacing"
        )
        yield toml.problem(keys, conflict, "needs spacing_m or side_overlap")
    elif beside and "parallel" not in given:
        yield toml.problem((*keys, beside[0]), "a spacing of one strip", "needs parallel as well")


def _strips_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    strips = toml.get(*keys)
    if not (isinstance(strips, dict) and 0 < len(strips) <= MOST_STRIPS):
        expected = f"must be a table of 1 to {MOST_STRIPS} strips by name"
        yield toml.problem(keys, quoted(strips), expected)


def _number_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield problems of the number of points; its form depends on their layout."""
    layout = toml.table(*keys[:-1]).get("layout", "grid")
    alone = number(_FIRST if layout == "corners" else _COUNT)
    listed = layout == "grid" or (layout != "corners" and isinstance(toml.get(*keys), list))
    yield from (numbers(2, _COUNT) if listed else alone).problems(toml, keys)


def _places_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    value = toml.get(*keys)
    pairs = isinstance(value, list) and len(value) <= int(_COUNT.high)
    if not pairs or not all(
        isinstance(pair, list) and len(pair) == 2 and all(map(is_number, pair)) for pair in value
    ):
        expected = "must be a list of points [forward, left] in metres, 500 at most"
        yield toml.problem(keys, "missing" if value is None else quoted(value), expected)
    elif not all(coordinate in _FROM_MIDDLE for pair in value for coordinate in pair):
        yield toml.problem(keys, quoted(value), str(_FROM_MIDDLE))


def _layout_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield keys that the layout of points needs."""
    table = toml.table(*keys)
    layout = table.get("layout", "grid")
    if layout == "at" and "at_m" not in table:
        yield from _places_problems(toml, (*keys, "at_m"))
    elif layout in LAYOUTS and layout != "at":
        for key in ("number", "area_m"):
            if key not in table:
                yield toml.problem((*keys, key), "missing", "required")


def _block_problems(toml: Toml, _: Keys) -> Iterator[Problem]:
    if not any(name in toml.values for name in BLOCKS):
        yield toml.problem(("calibration",), "no block at all", f"needs one of {', '.join(BLOCKS)}")


def _truth_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield problems of the true cameras, checked as cameras of flight.toml."""
    cameras = toml.table("cameras")
    for name, table in toml.table(*keys).items():
        if name not in cameras or not isinstance(table, dict):
            yield toml.problem((*keys, name), "unknown key", f"must be one of {', '.join(cameras)}")
            continue
        changed = {**toml.values, "cameras": {**cameras, name: {**cameras[name], **table}}}
        for problem in CAMERA.problems(replace(toml, values=changed), ("cameras", name)):
            key = problem.column.rpartition(".")[2]
            yield toml.problem((*keys, name, key), problem.found, problem.expected)


_AREA: Entries = {
    "east_m": number(METRES),
    "north_m": number(METRES),
    "course_deg": number(_COURSE),
}

_STRIP = Table(
    keys={
        "flying_height_m": number(Range(1.0, 30_000.0)),
        "course_deg": number(_COURSE),
        "length_m": number(Range(0.0, 1e6)),
        "base_m": number(Range(0.1, 1e5)),
        "overlap": number(_SHARE),
        "forward_m": number(_FROM_MIDDLE),
        "left_m": number(_FROM_MIDDLE),
        "speed_m_s": number(Range(1.0, 1000.0)),
        "parallel": number(Range(1, 200, "must be a whole number from 1 to 200", whole=True)),
        "spacing_m": number(Range(1.0, 1e5)),
        "side_overlap": number(_SHARE),
    },
    required=("flying_height_m", "course_deg", "length_m"),
    default=defaults(Strip),
    rules=[_spacing_problems],
    example=EXAMPLE,
)

_POINTS = Table(
    keys={
        "layout": choice(LAYOUTS, f"must be one of {', '.join(LAYOUTS)}"),
        "number": Value("whole number up to 500, or for a grid a list of two", _number_problems),
        "area_m": numbers(2, NOT_NEGATIVE),
        "play_m": number(NOT_NEGATIVE),
        "at_m": Value("list of up to 500 `[forward, left]`", _places_problems),
        "sigma_m": numbers(3, NOT_NEGATIVE),
        "sigma_px": number(POSITIVE),
    },
    default={key: value for key, value in defaults(Points).items() if key not in ("area_m")},
    rules=[_layout_problems],
)

_BLOCK: Entries = {
    "tie_points": number(Range(0, 20_000, "must be a whole number up to 20000", whole=True)),
    "tie_area_m": numbers(2, POSITIVE),
    "strips": Tables(of=_STRIP, whole=_strips_problems),
}
_CALIBRATION = Table(keys=_BLOCK, required=("strips",), default={"tie_points": 0})

PLAN: Entries = {
    "field": Table(
        keys={
            **_AREA,
            "height_m": number(RANGES["height_m"]),
            "relief_m": number(Range(0.0, 3000.0)),
        },
        required=("east_m", "north_m", "height_m"),
        default={"course_deg": 0.0, "relief_m": 0.0},
    ),
    "control": _POINTS,
    **dict.fromkeys(BLOCKS, _CALIBRATION),
    "validation": Table(
        keys={**_AREA, **_BLOCK, "check": _POINTS},
        required=("strips", "check"),
        default={"tie_points": 0},
    ),
    "truth": Value("keys of `[cameras.NAME]`", _truth_problems),
}
"""The tables of a plan that flight.toml does not have."""


def settings(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a plan that flight.toml has, too."""
    return {key: value for key, value in values.items() if key not in PLAN}


def _problems(toml: Toml) -> Iterator[Problem]:
    """Yield all problems of a plan but those of its size."""
    flight = flight_table(toml)
    table = replace(
        flight,
        keys={**flight.keys, **PLAN},
        required=(*flight.required, "field"),
        rules=(*flight.rules, _block_problems),
    )
    yield from toml.problems or table.problems(toml)


# --- Where points lie on the ground; the same in every run


STEPS = np.array([0.7548776662, 0.5698402910])
"""Multiples of these, without their whole parts, fill a square evenly (the sequence R2)."""

_CORNERS = np.array(
    [[1, 1], [-1, -1], [1, -1], [-1, 1], [0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=float
)


def places(points: Points) -> Array:
    """Return where surveyed points lie, forward and left of the block's middle, m, shape (n, 2).

    A ``grid`` has rows along and columns across the axis forward. ``corners`` takes the first of
    the four corners, the middle, and the middles of the four sides. ``at`` lists them.
    """
    half = 0.5 * np.array(points.area_m)
    if points.layout == "at":
        return np.array(points.at_m, dtype=float).reshape(-1, 2)
    if points.layout == "grid":
        regular = _grid(points.number, half)
    else:
        regular = half * _CORNERS[: points.number[0]]
    play = evenly(len(regular), first=0) * 2 - 1
    return regular + points.play_m * play


def _grid(number: Sequence[int], half: Array) -> Array:
    forward, left = np.meshgrid(
        *(
            np.linspace(-h, h, n) if n > 1 else np.zeros(n)
            for h, n in zip(half, number, strict=True)
        )
    )
    return np.column_stack([forward.ravel(), left.ravel()])


def evenly(n: int, *, first: int = 1) -> Array:
    """Return points that fill the unit square evenly, shape (n, 2)."""
    return (np.arange(first, first + n)[:, None] * STEPS) % 1


def on_map(area: Area, local: Array) -> Array:
    """Return east and north of positions forward and left of an area's middle, shape (n, 2)."""
    course = np.radians(area.course_deg)
    forward = np.array([np.sin(course), np.cos(course)])
    left = np.array([-forward[1], forward[0]])
    return np.array([area.east_m, area.north_m]) + local[:, :1] * forward + local[:, 1:2] * left
