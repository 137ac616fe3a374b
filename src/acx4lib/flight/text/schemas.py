"""The columns of a flight's tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from acx4lib.flight.problems import NOT_NEGATIVE, RANGES, Range

SIGMA_POSITION = ("sigma_east_m", "sigma_north_m", "sigma_height_m")
SIGMA_ATTITUDE = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg")
GEOGRAPHIC = ("lat_deg", "lon_deg", "roll_deg", "pitch_deg", "heading_deg")
GRID = ("east_m", "north_m", "omega_deg", "phi_deg", "kappa_deg")


@dataclass(frozen=True, kw_only=True)
class Schema:
    """The required content of a table.

    Attributes
    ----------
    required, optional : tuple of str
        Columns.
    forms : tuple of tuple of str
        Sets of columns; one of these sets is required.
    may_be_empty : tuple of str
        Text columns whose cells may be empty.
    keys : tuple of tuple of str
        Sets of columns; no two rows may have the same cells in all columns of a set.
    ranges : Mapping
        Ranges of the numeric columns; other columns are text.
    rows : bool
        Whether the table needs at least one row.
    """

    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    forms: tuple[tuple[str, ...], ...] = ()
    may_be_empty: tuple[str, ...] = ()
    keys: tuple[tuple[str, ...], ...]
    ranges: Mapping[str, Range] = field(default_factory=lambda: RANGES)
    rows: bool = True

    @property
    def known(self) -> tuple[str, ...]:
        """All columns that the table may have."""
        return (*self.required, *(name for form in self.forms for name in form), *self.optional)


SCHEMAS = {
    "images.csv": Schema(
        required=("image", "camera", "exposure"),
        optional=("strip", "file"),
        may_be_empty=("strip", "file"),
        keys=(("image",), ("camera", "exposure")),
    ),
    "image_points.csv": Schema(
        required=("image", "point", "col_px", "row_px"),
        optional=("sigma_px",),
        keys=(("image", "point"),),
    ),
    "trajectory.csv": Schema(
        required=("exposure", "height_m"),
        forms=(GEOGRAPHIC, GRID),
        optional=("time_s", *SIGMA_POSITION, *SIGMA_ATTITUDE),
        keys=(("exposure",),),
    ),
    "control_points.csv": Schema(
        required=("point", "east_m", "north_m", "height_m"),
        optional=(*SIGMA_POSITION, "role"),
        may_be_empty=("role",),
        keys=(("point",),),
        ranges={**RANGES, **dict.fromkeys(SIGMA_POSITION, NOT_NEGATIVE)},
        rows=False,
    ),
    "distances.csv": Schema(
        required=("point_a", "point_b", "distance_m", "sigma_m"),
        keys=(),
        rows=False,
    ),
}
