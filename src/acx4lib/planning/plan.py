"""A plan: the settings of flight.toml, terrain, control points, strips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.flight.setup import Setup
from acx4lib.geometry.camera import Camera

SPEED_M_S = 70.0
"""Ground speed of a strip that says nothing else."""

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

    def __post_init__(self) -> None:
        for name in ("flying_height_m", "base_m", "speed_m_s"):
            expected.positive_number(name, getattr(self, name))
        expected.size("length_m", self.length_m)
        for name in ("course_deg", "forward_m", "left_m"):
            expected.number(name, getattr(self, name))

    @property
    def n_exposures(self) -> int:
        """Number of exposures, one at least."""
        return 1 + int(np.ceil(self.length_m / self.base_m - 1e-6))

    def beside(self, left_m: float, block_course_deg: float) -> Strip:
        """Return the strip moved to its own left."""
        turn = np.radians(self.course_deg - block_course_deg)
        forward, left = left_m * np.sin(turn), left_m * np.cos(turn)
        return replace(
            self, forward_m=self.forward_m + float(forward), left_m=self.left_m + float(left)
        )

    def turned(self, by_deg: float) -> Strip:
        """Return the strip flown on another course through the same middle."""
        return replace(self, course_deg=(self.course_deg + by_deg) % 360.0)


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
class Terrain:
    """Smooth hills.

    Attributes
    ----------
    height_m : float
        Mean, in the flight's height system.
    relief_m : float
        Root mean square of the heights over and under the mean.
    """

    height_m: float
    relief_m: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Points:
    """Surveyed points, laid out in a rectangle along the axes of a block.

    Attributes
    ----------
    layout : str
        ``grid``, ``corners``, ``border`` or ``at``: see `ground.places`.
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
    terrain : Terrain
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
    terrain: Terrain
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
        expected.one_of("block", block, self.blocks)
        listed = [*(strips.values() if isinstance(strips, Mapping) else strips)]
        expected.sequence("strips", listed, Strip)
        names = strips if isinstance(strips, Mapping) else map(str, range(1, len(listed) + 1))
        by_name = dict(zip(names, listed, strict=True))
        tables = {
            name: {key: value for key, value in asdict(one).items() if value or key not in PLACE}
            for name, one in by_name.items()
        }
        return replace(
            self,
            blocks={**self.blocks, block: replace(self.blocks[block], strips=by_name)},
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
        expected.one_of("number", number, range(10))
        points = replace(
            self.control,
            layout="corners",
            number=(number,),
            area_m=self.control.area_m if area_m is None else area_m,
        )
        table = {"layout": "corners", "number": number, "area_m": [*points.area_m]}
        own = {**table, "play_m": points.play_m, "sigma_m": [*points.sigma_m]}
        blocks = {
            name: block if name == "validation" else replace(block, points=points)
            for name, block in self.blocks.items()
        }
        return replace(self, control=points, blocks=blocks, values={**self.values, "control": own})

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
    expected.instance("camera", camera, Camera)
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
    expected.whole("images", images)
    expected.number("course_deg", course_deg)
    base_m = (1 - overlap) * image_length_m(camera, flying_height_m)
    return Strip(
        flying_height_m=flying_height_m,
        course_deg=course_deg % 360.0,
        length_m=(images - 1) * base_m,
        base_m=base_m,
    )
