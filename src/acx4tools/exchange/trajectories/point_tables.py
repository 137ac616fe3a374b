"""Texts with a row for each point: measured in an image, or surveyed; in declared columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.flight.problems import quoted
from acx4tools.exchange.flight_folder import Brought, number_of
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.text_lines import Line
from acx4tools.exchange.trajectories import orientations
from acx4tools.exchange.trajectories.listed import MEASURED, SURVEYED, Listed, left_out, read_list
from acx4tools.exchange.trajectories.orientations import Meaning

ROLES = {"control": "control", "gcp": "control", "check": "check", "chk": "check", "": ""}
PLACES = ("east", "north", "height", "lat", "lon")


@dataclass(frozen=True, kw_only=True)
class MeasuredOptions:
    """What is done with a table of measurements.

    Attributes
    ----------
    columns, separator : str
        As `read_list` takes them.
    first : float
        What the table calls column and row of the middle of the first pixel: 0, 0.5 or 1.
    block : str
        Block of the flight.
    camera : str
        Of all images; empty: no images.csv.
    """

    columns: str = ""
    separator: str = ""
    first: float = 0.0
    block: str = "calibration"
    camera: str = ""


def measured(paths: Sequence[Path], options: MeasuredOptions) -> Brought:
    """Return the image points of texts, one after the other.

    Raises
    ------
    FlightError
        With file and line; for a point that stands twice in an image, too.
    """
    every = [_measured(path, options) for path in paths]
    _refuse_twice(every)
    images = [name for one in every for name in one.names("image")]
    points = [name for one in every for name in one.names("point")]
    colrow = np.concatenate([[one.numbers("col"), one.numbers("row")] for one in every], axis=1)
    colrow = np.round(colrow - options.first, 5)
    cols, rows = colrow.tolist()
    table: dict[str, Any] = {"image": images, "point": points, "col_px": cols, "row_px": rows}
    if all(one.has("sigma") for one in every):
        table["sigma_px"] = [px for one in every for px in one.numbers("sigma").tolist()]
    names = [*dict.fromkeys(images)]
    tables: dict[str, Any] = {f"{options.block}/image_points.csv": table}
    if options.camera:
        by = {"image": names, "camera": [options.camera] * len(names), "exposure": names}
        tables[f"{options.block}/images.csv"] = by
    (left, top), (right, bottom) = colrow.min(axis=1), colrow.max(axis=1)
    return Brought(
        source="Table of image points",
        sha256=opened.checksums([one.source for one in every]),
        tables=tables,
        assumed=(
            *dict.fromkeys(_columns_said(one) for one in every),
            "Columns count to the right and rows down, in pixels; the middle of the first pixel is "
            f"{options.first:g}, {options.first:g}.",
        ),
        found=(
            f"{number_of(len(images), 'measurements')} of {number_of(len(set(points)), 'points')} "
            f"in {number_of(len(names), 'images')}; columns {left:.1f} to {right:.1f}, rows "
            f"{top:.1f} to {bottom:.1f} px.",
        ),
        left_out=tuple(line for one in every for line in left_out(one, "measurement", MEASURED)),
    )


def _measured(path: Path, options: MeasuredOptions) -> Listed:
    listed = read_list(
        opened.of_windows(opened.read(path)),
        options.columns,
        separator=options.separator,
        numbers=("col", "row"),
        known=MEASURED,
    )
    _require(listed, "point", "image", "col", "row", says="point image col row")
    return listed


def surveyed(
    path: Path, meaning: Meaning, *, columns: str = "", separator: str = "", role: str = ""
) -> Brought:
    """Return the control and check points of a text.

    Parameters
    ----------
    path : Path
    meaning : Meaning
        Of positions; attitudes have no part in it.
    columns, separator : str
        As `read_list` takes them.
    role : str
        Of points whose role no column says: control, check, or empty, which is control.

    Raises
    ------
    FlightError
        With file and line.
    """
    source = opened.of_windows(opened.read(path))
    listed = read_list(source, columns, separator=separator, numbers=PLACES, known=SURVEYED)
    _require(listed, "point", says="point east north height")
    if not orientations.is_located(listed):
        raise _lacks(listed, "no position", "point east north height")
    found = orientations.located(listed)
    table = {"point": listed.unique("point"), **orientations.in_grid(listed, found, meaning)}
    table |= orientations.extras(listed, meaning)
    if listed.has("role") or role:
        table["role"] = _roles(listed, role)
    n_check = sum(one == "check" for one in table.get("role", ()))
    return Brought(
        source="Table of surveyed points",
        sha256=opened.checksums([source]),
        settings=orientations.settings(meaning),
        tables={"control_points.csv": table},
        pictures=orientations.grid_file(meaning),
        assumed=(
            _columns_said(listed) + " x counts east, y north.",
            orientations.heights_said(meaning),
        ),
        found=(
            f"{number_of(len(listed.rows), 'points')}, {n_check} of them to check; heights "
            f"{table['height_m'].min():.3f} to {table['height_m'].max():.3f} m.",
        ),
        left_out=left_out(listed, "coordinate", SURVEYED),
    )


def _require(listed: Listed, *names: str, says: str) -> None:
    missing = [name for name in names if not listed.has(name)]
    if missing:
        raise _lacks(listed, f"no {missing[0]}", says)


def _lacks(listed: Listed, found: str, says: str) -> Exception:
    line = listed.heading.number if listed.heading else 1
    expected = f"must be {says}, in any order; declare them by --columns"
    return listed.source.wrong("columns", f"have {found}", expected, line=line)


def _refuse_twice(every: Sequence[Listed]) -> None:
    first: dict[tuple[str, str], Line] = {}
    for listed in every:
        pairs = zip(listed.names("image"), listed.names("point"), strict=True)
        for row, (image, point) in zip(listed.rows, pairs, strict=True):
            if (image, point) in first:
                before = first[image, point]
                where = f"line {before.number}" + f" of {before.file}" * (before.file != row.file)
                found = f"{quoted(point)} stands in image {quoted(image)} in {where} already"
                raise row.wrong("point", found, "must stand once in an image")
            first[image, point] = row


def _roles(listed: Listed, otherwise: str) -> list[str]:
    if not listed.has("role"):
        return [otherwise] * len(listed.rows)
    k = listed.at("role")
    found = []
    for row in listed.rows:
        cell = row.cell(k, "role")
        if cell.lower() not in ROLES:
            raise row.wrong("role", quoted(cell), "must be control or check")
        found.append(ROLES[cell.lower()] or otherwise)
    return found


def _columns_said(listed: Listed) -> str:
    names = " ".join(one.name for one in listed.columns)
    by = "declaration" if listed.declared else "its heading"
    said = "" if not listed.source.encoding else " The text is in Windows-1252: it is not UTF-8."
    return f"The columns, by {by}, are: {names}.{said}"
