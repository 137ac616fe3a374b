"""The tables of a results folder: their columns, read and written."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.errors import FlightError

STAGES = ("heads", "synthetic", "mounting", "validation")
"""The stages in the order of the paper, and of the rows of every table."""

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

PART_OF: Mapping[str, str] = {"rig": "mounting"}
"""The stage of the results folder for a stage that has none of its own."""

RELATIVE = ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg")
"""Names of the parameters of a head's relative orientation, in their order."""

COMPONENTS = {
    "image_point": ("col_px", "row_px"),
    "control_point": ("east_m", "north_m", "height_m"),
    "gnss": ("east_m", "north_m", "height_m"),
    "attitude": ("roll_deg", "pitch_deg", "heading_deg"),
    "lever_arm": ("lever_x_m", "lever_y_m", "lever_z_m"),
    "boresight": ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"),
    "interior": ("f_mm", "xp_mm", "yp_mm"),
}
"""Components of the residuals of every kind; angles are about the body's x, y, z axes."""


_METHOD = ("stage", "method")
_POSITION = ("east_m", "north_m", "height_m")
_ATTITUDE = ("omega_deg", "phi_deg", "kappa_deg")
_SIGMA = tuple(f"sigma_{name}" for name in _POSITION)
_DIFFERENCE = (*(f"d_{name}" for name in _POSITION), *_SIGMA)
_POSE = (*_POSITION, *_ATTITUDE, *_SIGMA, *(f"sigma_{name}" for name in _ATTITUDE))
_OBSERVED = (*_METHOD, "kind", "image_or_exposure", "point")
_PIXELS = ("col_px", "row_px", "sigma_col_px", "sigma_row_px")

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "parameters": (*_METHOD, "camera", "parameter", "value", "sigma", "unit", "sigma_before"),
    "validation": ("method", "point", "image_a", "image_b", *_DIFFERENCE),
    "check_points": (*_METHOD, "point", "n_images", *_DIFFERENCE),
    "exterior_orientation": (*_METHOD, "image", *_POSE),
    "residuals": (*_OBSERVED, "component", "v", "sigma", "redundancy", "w"),
    "covariance": (*_METHOD, "row", "column", "value"),
    "rejected": (*_OBSERVED, "statistic", "reason"),
    "synthetic_points": ("block", "image", "point", "head", *_PIXELS),
}
"""Columns of every table, in order; a table's file is its name with ``.csv``."""

TEXTS = {
    *("stage", "method", "camera", "parameter", "unit", "point", "image", "image_a", "image_b"),
    *("kind", "image_or_exposure", "component", "row", "column", "reason", "block", "head"),
}
"""Columns of text; the others are numbers."""

COUNTS = {"n_images"}
"""Columns of whole numbers."""

OF = {"validation": "validation", "synthetic_points": "synthetic"}
"""The stage of all rows of a table that has no column for it."""

LATER = {"parameters": ("sigma_before",)}
"""Last columns that tables of earlier versions lack."""

ROWS = 50_000
"""Number of rows that are made into text at a time."""

FEW = 1000
"""Number of rows by which the numbers of a column are seen to be few."""

_SPECIAL = ',"\n\r'
"""Characters for which a cell is quoted."""


# --- read ------------------------------------------------------------------------------------


def read(path: Path, content: bytes) -> pd.DataFrame:
    """Return the table in the content of a file.

    Parameters
    ----------
    path : Path
        Its name is one of `COLUMNS` with ``.csv``.
    content : bytes
        Empty for a file that is not there.

    Returns
    -------
    DataFrame
        Names are text, counts whole numbers, unknown numbers NaN.

    Raises
    ------
    FlightError
        Where columns are missing or too many, or a cell is no number.
    """
    columns = COLUMNS[path.stem]
    numbers = [name for name in columns if name not in TEXTS]
    first, *later = (content or header(path.stem)).split(b"\n", 1)
    names = first.decode("utf-8-sig", "replace").strip().split(",")
    if set(columns) - set(names) - set(LATER.get(path.stem, ())) or set(names) - set(columns):
        raise _broken(path, f"has the columns {','.join(names)}, not {','.join(columns)}")
    try:
        frame = pd.read_csv(
            io.BytesIO(b"".join(later)),
            names=names,
            encoding="utf-8",
            dtype={**dict.fromkeys(TEXTS, "str"), **dict.fromkeys(numbers, "float64")},
            keep_default_na=False,
            na_values=dict.fromkeys(numbers, ""),
            skip_blank_lines=False,
        )
    except ValueError as error:
        raise _broken(path, " ".join(str(error).split())) from None
    if not isinstance(frame.index, pd.RangeIndex):
        raise _broken(path, "has rows of another width than its header")
    frame = frame.assign(**{name: np.nan for name in columns if name not in names})
    return frame.astype(dict.fromkeys(COUNTS & {*columns}, "int64"))[list(columns)]


def _broken(path: Path, fault: str) -> FlightError:
    problem = f"{path}:1: file: {fault}; must be a table of results"
    return FlightError([f"{problem}; run all stages again"])


# --- written ---------------------------------------------------------------------------------


def header(name: str) -> bytes:
    """Return the first line of a table's file."""
    return f"{','.join(COLUMNS[name])}\n".encode()


def lines(name: str, frame: pd.DataFrame) -> Iterator[bytes]:
    """Yield the rows of a table as they stand in its file, many at a time.

    Numbers are written as by Python's ``repr``, text as by its module csv. The cell of a value that
    is not known, or not finite, is empty. The writer of pandas takes twice as long.

    Parameters
    ----------
    name : str
        One of `COLUMNS`.
    frame : DataFrame
        With these columns; those of text are written fastest as categories.
    """
    columns = [_coded(frame[column], is_text=column in TEXTS) for column in COLUMNS[name]]
    for begin in range(0, len(frame), ROWS):
        cells = [_cells(values[begin : begin + ROWS], known) for values, known in columns]
        yield ("\n".join(map(",".join, zip(*cells, strict=True))) + "\n").encode()


def _coded(column: pd.Series, *, is_text: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the code of every cell of text and the cells that occur, or numbers and None."""
    if not is_text:
        values = np.ascontiguousarray(column, dtype=None if column.name in COUNTS else float)
        if column.name in COUNTS or len(np.unique(values[:FEW])) > FEW // 10:
            return values, None
        code, bits = pd.factorize(values.view(np.int64))  # a few sigma stand in all rows; -0 is -0
        return code, np.array([*_cells(bits.view(float), None), ""], dtype=object)
    text = column.astype("category").cat
    known = text.categories
    return text.codes.to_numpy(), np.array(
        [*map(_quoted, map(str, known.tolist())), ""], dtype=object
    )


def _quoted(text: str) -> str:
    """Return text as a cell."""
    if any(special in text for special in _SPECIAL):
        return '"{}"'.format(text.replace('"', '""'))
    return text


def _cells(values: np.ndarray, known: np.ndarray | None) -> list[str]:
    """Return the cells of a part of a column; no value has the last code, -1."""
    if known is not None:
        return known[values].tolist()
    cells = list(map(float.__repr__ if values.dtype == float else repr, values.tolist()))
    for k in np.flatnonzero(~np.isfinite(values)):
        cells[k] = ""
    return cells
