"""ODM's gcp_list.txt: surveyed points and where they are in the pictures.

https://docs.opendronemap.org/gcp/: the first line is the CRS; then ``x y z col row image [name]``.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NoReturn

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, RANGES, quoted
from acx4tools.exchange import crs as coordinates
from acx4tools.exchange import tables
from acx4tools.exchange.axes import UNKNOWN, stacked
from acx4tools.exchange.flight_folder import Brought
from acx4tools.exchange.project import Control, Images, Measured, Project, flight_of
from acx4tools.exchange.safe import opened, text_lines
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import Line

UTM = re.compile(r"WGS\s?84\s+UTM\s+(\d{1,2})\s*([NS]?)", re.ASCII | re.I)

_EXPECTED = "must be WGS84 UTM 17N, EPSG:n, WGS84, or a PROJ string"


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """A line of the list: two coordinates where the height is not known, maybe no name."""

    line: Line
    name: str
    xyz: tuple[float, ...]
    colrow: tuple[float, ...]
    image: str


def read(
    source: Path, *, block: str | None = None, crs: str | None = None, camera: str | None = None
) -> Brought:
    """Read gcp_list.txt as a part of a flight; options as those of `project` and `flight_of`."""
    return flight_of(project(source, crs=crs, camera=camera), block=block or "calibration")


def project(source: Path, *, crs: str | None = None, camera: str | None = None) -> Project:
    """Return the points of gcp_list.txt and their measurements.

    Parameters
    ----------
    source : Path
    crs : str, optional
        Of the flight; by default the file's own, or the UTM zone for longitudes and latitudes.
    camera : str, optional
        Name of the camera of all images: then there are images, too.

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
    known = np.isfinite(enh[:, 2])
    high, flat = (
        tuple(name for name, one in zip(names.values(), mask, strict=True) if one)
        for mask in (known, ~known)
    )
    images, image_idx = tables.first_use([one.image for one in seen])
    pairs = zip(image_idx, seen, strict=True)
    without = f"points without a height: {', '.join(flat[:5])}"
    return Project(
        source="ODM's control points",
        sources=[file],
        images=Images(
            names=tuple(images),
            cameras=(camera or "",) * len(images),
            exposures=tuple(images),
            T_w_c=stacked([UNKNOWN] * len(images)),
        ),
        measured=Measured.of([(k, names[one.xyz], one.colrow) for k, one in pairs]),
        control=Control(names=high, enh=enh[known]),
        settings=chosen.settings,
        lost={without: len(flat)},
        assumed=(*chosen.assumed, "pixel 0, 0 is the centre of the top-left one, rows grow down"),
    )


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


def _seen(row: Line) -> _Seen:
    x, y = (row.number_at(k, name, METRES) for k, name in ((0, "x"), (1, "y")))
    z = float("nan")
    if row.cell(2, "z").lower() != "nan":
        z = row.number_at(2, "z", RANGES["height_m"])
    colrow = tuple(row.number_at(k, name, RANGES["col_px"]) for k, name in ((3, "col"), (4, "row")))
    return _Seen(
        line=row,
        name=row.cells[6] if len(row) > 6 else "",
        xyz=(x, y) if np.isnan(z) else (x, y, z),  # no two NaN are equal
        colrow=colrow,
        image=row.cell(5, "image"),
    )


def _names(seen: list[_Seen]) -> dict[tuple[float, ...], str]:
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


def _require_once(seen: list[_Seen], names: dict[tuple[float, ...], str]) -> None:
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
