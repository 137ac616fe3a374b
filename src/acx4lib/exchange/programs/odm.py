"""ODM's gcp_list.txt: surveyed points and where they are in the pictures.

https://docs.opendronemap.org/gcp/: the first line is the CRS; then ``x y z col row image [name]``.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.shared import crs as coordinates
from acx4lib.exchange.programs.shared import tables
from acx4lib.exchange.safe import opened, text_lines
from acx4lib.exchange.safe.opened import Opened
from acx4lib.exchange.safe.text_lines import Line
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, RANGES, quoted
from acx4lib.flight.text.in_memory import Columns

UTM = re.compile(r"WGS\s?84\s+UTM\s+(\d{1,2})\s*([NS]?)", re.ASCII | re.I)

_EXPECTED = "must be WGS84 UTM 17N, EPSG:n, WGS84, or a PROJ string"


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A line of the list.

    Attributes
    ----------
    line : Line
    name : str
        Empty where the point has none.
    xyz : tuple of float
        Two, where the height is not known.
    colrow : tuple of float
    image : str
    """

    line: Line
    name: str
    xyz: tuple[float, ...]
    colrow: tuple[float, ...]
    image: str


def read(
    source: Path, *, block: str | None = None, crs: str | None = None, camera: str | None = None
) -> Brought:
    """Read gcp_list.txt.

    Parameters
    ----------
    source : Path
    block : str, optional
        Of the measurements, by default calibration.
    crs : str, optional
        Of the flight; by default the file's own, or the UTM zone for longitudes and latitudes.
    camera : str, optional
        Name of the camera of all images: then images.csv is brought, too.

    Raises
    ------
    FlightError
        For another layout, or one name for two points.
    """
    file = opened.read(source)
    first, *rows = [*text_lines.lines(file, comment="#")] or [_blank(file)]
    seen = [_seen(row) for row in rows]
    if not seen:
        raise first.wrong("file", "has no point after the CRS", "must have one at least")
    names = _names(seen)
    _require_once(seen, names)
    xyz = np.array([(*one, np.nan)[:3] for one in names])
    chosen = _chosen(first, file, xyz, crs)
    try:
        enh = chosen.from_source(xyz)
    except ValueError as error:
        raise first.wrong("CRS", str(error), "must lead to the flight's CRS") from None
    brought = _brought(file, seen, names, enh, block or "calibration")
    return _with_images(brought, chosen, seen, block or "calibration", camera)


def _brought(
    file: Opened, seen: list[Seen], names: dict[tuple[float, ...], str], enh: Array, block: str
) -> Brought:
    known = np.isfinite(enh[:, 2])
    points = [name for name, one in zip(names.values(), known, strict=True) if one]
    flat = [name for name, one in zip(names.values(), known, strict=True) if not one]
    images, measured = [one.image for one in seen], [names[one.xyz] for one in seen]
    colrow = np.array([one.colrow for one in seen])
    return Brought(
        source="ODM's control points",
        sha256=opened.checksums([file]),
        tables={
            "control_points.csv": _control(points, enh[known]),
            f"{block}/image_points.csv": tables.image_points(images, measured, colrow),
        },
        assumed=("pixel 0, 0 is the centre of the top-left one, rows grow down",),
        found=(_counts(len(names), len(seen), len(set(images))),),
        left_out=_without_height(flat),
    )


def _with_images(
    brought: Brought, chosen: coordinates.Chosen, seen: list[Seen], block: str, camera: str | None
) -> Brought:
    """Return what was brought with the CRS, and with images.csv where the camera is named."""
    pictures = list(dict.fromkeys(one.image for one in seen))
    made: dict[str, Columns] = {}
    if camera is not None:
        made[f"{block}/images.csv"] = tables.images(pictures, [camera] * len(pictures), pictures)
    return replace(
        brought,
        settings=chosen.settings,
        tables={**brought.tables, **made},
        assumed=(*chosen.assumed, *brought.assumed),
    )


def _counts(points: int, measured: int, images: int) -> str:
    return (
        f"{number_of(points, 'points')}, {number_of(measured, 'measurements')} in "
        f"{number_of(images, 'images')}"
    )


def _without_height(flat: list[str]) -> tuple[str, ...]:
    if not flat:
        return ()
    n = number_of(len(flat), "points")
    return (f"coordinates of {n} without a height: {', '.join(flat[:5])}",)


def _control(names: list[str], enh: Array) -> dict[str, Any]:
    east, north, height = np.round(enh, tables.METRES).T.tolist()
    return {"point": names, "east_m": east, "north_m": north, "height_m": height}


def crs_of(text: str) -> str:
    """Return the CRS of a first line: a UTM zone of WGS 84, WGS 84 alone, a code, a PROJ string."""
    text = text.strip().strip("'\"")
    found = UTM.fullmatch(text)
    if found and 1 <= int(found[1]) <= 60:
        return f"EPSG:{(32700 if found[2].upper() == 'S' else 32600) + int(found[1])}"
    return "EPSG:4326" if re.fullmatch(r"WGS\s?84", text, re.I) else text


def _blank(file: Opened) -> NoReturn:
    raise file.wrong("file", "has no line but remarks", _EXPECTED)


def _chosen(first: Line, file: Opened, xyz: Array, crs: str | None) -> coordinates.Chosen:
    text = file.text().split("\n")[first.number - 1]
    try:
        found = coordinates.chosen(crs_of(text), xyz[:, :2].mean(axis=0), crs)
    except ValueError as error:
        raise first.wrong("CRS", f"{quoted(text.strip())}: {error}", _EXPECTED) from None
    if found is None:
        raise first.wrong("CRS", quoted(text.strip()), _EXPECTED)
    return found


def _seen(row: Line) -> Seen:
    x, y = (row.number_at(k, name, METRES) for k, name in ((0, "x"), (1, "y")))
    z = float("nan")
    if row.cell(2, "z").lower() != "nan":
        z = row.number_at(2, "z", RANGES["height_m"])
    colrow = tuple(row.number_at(k, name, RANGES["col_px"]) for k, name in ((3, "col"), (4, "row")))
    return Seen(
        line=row,
        name=row.cells[6] if len(row) > 6 else "",
        xyz=(x, y) if np.isnan(z) else (x, y, z),  # no two NaN are equal
        colrow=colrow,
        image=row.cell(5, "image"),
    )


def _names(seen: list[Seen]) -> dict[tuple[float, ...], str]:
    """Return names by coordinates; points without one are numbered in the order of the file."""
    names: dict[tuple[float, ...], str] = {}
    for one in seen:
        name = names.setdefault(one.xyz, one.name or f"GCP{len(names) + 1}")
        if one.name not in ("", name):
            found = f"{quoted(one.name)} has the coordinates of {quoted(name)}"
            raise one.line.wrong("name", found, "must be one name for one point")
    times = Counter(names.values())
    if len(times) < len(names):
        again = [one for one in seen if times[names[one.xyz]] > 1]
        found = f"{quoted(names[again[0].xyz])} has different coordinates"
        raise again[-1].line.wrong("name", found, "must be one point for one name")
    return names


def _require_once(seen: list[Seen], names: dict[tuple[float, ...], str]) -> None:
    before: set[tuple[str, str]] = set()
    for one in seen:
        key = (one.image, names[one.xyz])
        if key in before:
            found = f"{quoted(key[1])} stands twice in {quoted(key[0])}"
            raise one.line.wrong("image", found, "must stand once")
        before.add(key)
        tables.require_names(key, partial(_wrong_name, one.line))


def _wrong_name(line: Line, name: str, found: str, expected: str) -> FlightError:
    return line.wrong("name", found if name in found else f"{quoted(name)} {found}", expected)
