"""What the tables of a results folder hold: columns, ranges of numbers, words, and what is once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from acx4lib.flight.problems import Range
from acx4lib.geometry.parameters import REPORTED

STAGES = ("heads", "synthetic", "mounting", "validation")
"""The stages in the order of the paper, and of the rows of every table."""

PART_OF: Mapping[str, str] = {"rig": "mounting"}
"""The stage of the results folder that a stage belongs to, where it is not one of its own."""

NOTEBOOKS: Mapping[str, str] = {
    "flight": "00-flight",
    "heads": "01-head-calibration",
    "synthetic": "02-synthetic-image",
    "mounting": "03-mounting-calibration",
    "rig": "08-rig",
    "validation": "04-validation",
}
"""The notebook of every stage, in the order in which they are run. ``flight`` only shows the data.
``rig`` is the part of the stage mounting that uses the block heads."""

COMPONENTS = {
    "image_point": ("col_px", "row_px"),
    "control_point": ("east_m", "north_m", "height_m"),
    "gnss": ("east_m", "north_m", "height_m"),
    "attitude": ("roll_deg", "pitch_deg", "heading_deg"),
    "lever_arm": ("lever_x_m", "lever_y_m", "lever_z_m"),
    "distance": ("distance_m",),
    "boresight": ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"),
}
"""Components of the residuals of every kind; angles are about the body's x, y, z axes."""

RELATIVE = ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg")
"""Names of the parameters of a head's relative orientation, in their order."""

UNITS = {
    **{name: (unit,) for name, unit in REPORTED.values()},
    **{name: (name.rpartition("_")[2],) for name in RELATIVE},
}
"""Units of the parameters of cameras and of heads."""

OF_TRAJECTORY = {
    "gnss_shift_": ("m",),
    "gnss_drift_": ("m/min", "m/exposure"),
    "gnss_delay_s": ("s",),
    "attitude_delay_s": ("s",),
}
"""Units of the parameters of a trajectory, which belong to no camera, by their first letters."""

ANY = Range(-1e12, 1e12)
SIGMA = Range(0.0, 1e12, "must be zero or positive, at most 1e12")
COVARIANCE = Range(-1e24, 1e24)
COUNT = Range(0, 1e9, "must be a whole number, zero or positive, at most 1e9", whole=True)


@dataclass(frozen=True, kw_only=True)
class Schema:
    """The required content of a table of results.

    Attributes
    ----------
    columns : tuple of str
        All of them, in the order in which they are written.
    ranges : mapping
        Ranges of the columns of numbers; the others are text.
    needed : tuple of str
        Columns of numbers without empty cells.
    words : mapping
        What alone may stand in some columns of text.
    key : tuple of str
        No two rows have the same cells in all these columns; none where rows are too many to be
        compared, and only counted. Excepted are
    often : tuple of mapping
        rows with such words: heads, each adjusted by itself, share points and exposures.
    """

    columns: tuple[str, ...]
    ranges: Mapping[str, Range]
    needed: tuple[str, ...] = ()
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    key: tuple[str, ...] = ()
    often: tuple[Mapping[str, tuple[str, ...]], ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """The columns of text."""
        return tuple(name for name in self.columns if name not in self.ranges)


_METHOD = ("stage", "method")
_OF_STAGE = {"stage": STAGES}
_POSITION = ("east_m", "north_m", "height_m")
_DIFFERENCE = tuple(f"d_{name}" for name in _POSITION)
_SIGMA = tuple(f"sigma_{name}" for name in _POSITION)
_ATTITUDE = ("omega_deg", "phi_deg", "kappa_deg")
_SIGMA_ATTITUDE = tuple(f"sigma_{name}" for name in _ATTITUDE)
_PIXELS = ("col_px", "row_px")
_SIGMA_PIXELS = ("sigma_col_px", "sigma_row_px")
_DIFFERENCES = dict.fromkeys(_DIFFERENCE, ANY) | dict.fromkeys(_SIGMA, SIGMA)
_KINDS = tuple(COMPONENTS)
_HEADS = {"stage": ("heads",)}
_OFTEN = (
    _HEADS | {"kind": tuple(kind for kind in _KINDS if kind != "image_point")},
    {"kind": ("distance",)},
)

SCHEMAS: Mapping[str, Schema] = {
    "parameters": Schema(
        columns=(*_METHOD, "camera", "parameter", "value", "sigma", "unit"),
        ranges={"value": ANY, "sigma": SIGMA},
        needed=("value",),
        words=_OF_STAGE,
        key=(*_METHOD, "camera", "parameter"),
    ),
    "validation": Schema(
        columns=("method", "point", "image_a", "image_b", *_DIFFERENCE, *_SIGMA),
        ranges=_DIFFERENCES,
        key=("method", "point", "image_a", "image_b"),
    ),
    "check_points": Schema(
        columns=(*_METHOD, "point", "n_images", *_DIFFERENCE, *_SIGMA),
        ranges={"n_images": COUNT, **_DIFFERENCES},
        needed=("n_images",),
        words=_OF_STAGE,
        key=(*_METHOD, "point"),
        often=(_HEADS,),
    ),
    "exterior_orientation": Schema(
        columns=(*_METHOD, "image", *_POSITION, *_ATTITUDE, *_SIGMA, *_SIGMA_ATTITUDE),
        ranges={
            **dict.fromkeys((*_POSITION, *_ATTITUDE), ANY),
            **dict.fromkeys((*_SIGMA, *_SIGMA_ATTITUDE), SIGMA),
        },
        words=_OF_STAGE,
        key=(*_METHOD, "image"),
    ),
    "residuals": Schema(
        columns=(
            *(*_METHOD, "kind", "image_or_exposure", "point", "component"),
            *("v", "sigma", "redundancy", "w"),
        ),
        ranges={"v": ANY, "sigma": SIGMA, "redundancy": ANY, "w": ANY},
        words={
            **_OF_STAGE,
            "kind": _KINDS,
            "component": tuple(dict.fromkeys(name for k in _KINDS for name in COMPONENTS[k])),
        },
    ),
    "covariance": Schema(
        columns=(*_METHOD, "row", "column", "value"),
        ranges={"value": COVARIANCE},
        words=_OF_STAGE,
        key=(*_METHOD, "row", "column"),
    ),
    "rejected": Schema(
        columns=(*_METHOD, "kind", "image_or_exposure", "point", "statistic", "reason"),
        ranges={"statistic": ANY},
        words={**_OF_STAGE, "kind": _KINDS},
        key=(*_METHOD, "kind", "image_or_exposure", "point", "reason"),
        often=_OFTEN,
    ),
    "synthetic_points": Schema(
        columns=("block", "image", "point", "head", *_PIXELS, *_SIGMA_PIXELS),
        ranges=dict.fromkeys(_PIXELS, ANY) | dict.fromkeys(_SIGMA_PIXELS, SIGMA),
        needed=(*_PIXELS, *_SIGMA_PIXELS),
        key=("block", "image", "point"),
    ),
}
"""By the name of the table; its file is this name with ``.csv``."""
