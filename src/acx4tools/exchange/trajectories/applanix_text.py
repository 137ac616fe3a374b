"""Text exports of Applanix's POSPac: exterior orientations, or the trajectory at events.

A preamble tells mapping frame, datum, boresight and lever arms; a heading the columns; a line in
brackets, before the heading or after it, the units; rows follow. The heading has commas, tabs or
spaces, the rows tabs or spaces. In exterior orientations the column ID may be empty.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from acx4lib.flight.problems import quoted
from acx4tools.exchange.flight_folder import Brought
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import Line, cut, lines
from acx4tools.exchange.trajectories import orientation_table
from acx4tools.exchange.trajectories.listed import SKIP, Column, Listed
from acx4tools.exchange.trajectories.orientations import Meaning

ELLIPSOIDAL, ORTHOMETRIC = "height", "orthometric"

PHRASES = {
    r"(?:ELLIPSOID(?:AL)?|ELL\.?) (?:HEIGHT|HGT)": ELLIPSOIDAL,
    r"(?:ORTHOMETRIC|ORTHO|MSL) (?:HEIGHT|HGT)": ORTHOMETRIC,
    r"(?:EAST|NORTH|UP|DOWN)(?:ING)? VELOCITY": SKIP,
    r"EAST(?:ING)? SD": "sigma_east",
    r"NORTH(?:ING)? SD": "sigma_north",
    r"HEIGHT SD": "sigma_height",
    r"ROLL SD": "sigma_roll",
    r"PITCH SD": "sigma_pitch",
    r"HEADING SD": "sigma_heading",
    r"(?:DISTANCE|WANDER(?: ANGLE)?)": SKIP,
    r"EASTING": "east",
    r"NORTHING": "north",
    r"LAT(?:ITUDE)?": "lat",
    r"LON(?:G|GITUDE)?": "lon",
    r"OMEGA": "omega",
    r"PHI": "phi",
    r"KAPPA": "kappa",
    r"ROLL": "roll",
    r"PITCH": "pitch",
    r"HEADING": "heading",
    r"(?:# ?)?EVENT(?: ?#)?": "exposure",
    r"(?:GPS ?)?TIME(?: ?\(S(?:EC)?\))?": "time",
    r"(?:IMAGE |PHOTO )?(?:ID|NAME)": "image",
    r"HEIGHT": ELLIPSOIDAL,
}
"""What a heading calls its columns; the longer of two phrases first."""

# The group is empty and behind its phrase: a branch that begins with a letter is quickly refused.
WORDS = re.compile("|".join(f"{p}(?![A-Z])(?P<_{k}>)" for k, p in enumerate(PHRASES)))
NEEDED = ({"omega", "phi", "kappa"}, {"roll", "pitch", "heading"})
ANGLE = {"DEG": "deg", "GRAD": "gon", "GON": "gon", "RAD": "rad"}
TURN = re.compile(r"(?:FIRST|SECOND|THIRD) ROTATION IS ABOUT THE \W?([XYZ])\W")
"""How a preamble tells the sequence of rotations, mapping to image."""

SEQUENCES = {"": "", "XYZ": "opk", "YXZ": "pok"}
"""Orders of `Meaning` by the axes that a preamble lists."""

APPLIED = re.compile(r"(?:BORESIGHT|LEVER ARM) VALUES.*[1-9]")
"""A line of the preamble with a boresight or lever arms that are not zero."""

MOST_PREAMBLE = 60
"""Lines of the preamble that are kept."""


def read(path: Path, meaning: Meaning, options: orientation_table.TableOptions) -> Brought:
    """Return the orientations of a text export of POSPac.

    Parameters
    ----------
    path : Path
    meaning : Meaning
        Its unit of angles, and the order of omega and phi, are replaced by what the text states.
    options : TableOptions
        Whose they are is found: omega, phi, kappa are the camera's, roll, pitch and heading the
        IMU's, unless the preamble has a boresight or lever arms that are not zero.

    Raises
    ------
    FlightError
        With file and line, where no heading is found, a word of it is not known, positions are
        not in metres, or a row is wrong.
    """
    source = opened.of_windows(opened.read(path))
    heading, columns = _heading(source)
    listed = _listed(source, heading, columns)
    preamble = _preamble(source, heading.number)
    meaning = replace(meaning, angle=_angle_unit(source, listed.rows[0].number))
    names = {one.name for one in columns}
    camera = NEEDED[0] <= names
    applied = camera or any(APPLIED.match(one.upper()) for one in preamble)
    order = _order(source, heading.number) if camera else ""
    meaning = replace(meaning, order=order or meaning.order)
    if ORTHOMETRIC in names:
        if meaning.heights == "ellipsoidal":
            expected = "needs --heights: a vertical CRS, a geoid grid file or a number"
            raise heading.wrong("ORTHOMETRIC HEIGHT", "is no ellipsoidal height", expected)
    else:
        meaning = replace(meaning, ellipsoidal=True)
    if not camera:  # a heading of POSPac is from true north
        meaning = replace(meaning, north="true")
    return orientation_table.brought(
        _with_height(listed),
        meaning,
        replace(options, of="camera" if applied else "imu"),
        source=f"POSPac {'exterior orientations' if camera else 'trajectory at events'}",
        says=(f"The file states: {'; '.join(preamble)}.",) if preamble else (),
    )


def _heading(source: Opened) -> tuple[Line, tuple[Column, ...]]:
    """Return the heading and its columns, a column of every name once."""
    for number, text in enumerate(source.text().split("\n"), start=1):
        upper = re.sub(r"[ \t]+", " ", text.upper())
        if not ("KAPPA" in upper or "HEADING" in upper):
            continue
        found = list(WORDS.finditer(upper))
        names = [list(PHRASES.values())[int(str(one.lastgroup)[1:])] for one in found]
        if any(form <= set(names) for form in NEEDED) and not text.lstrip().startswith("("):
            line = Line(file=source.file, number=number, cells=(text,))
            unknown = re.findall(r"[A-Z]{2,}|\b[XYZ]\b", WORDS.sub("", upper))
            if unknown:
                raise line.wrong("heading", f"{quoted(unknown[0])} is not known", "use 'table'")
            first = {name: k for k, name in reversed([*enumerate(names)])}
            once = (name if first[name] == k else SKIP for k, name in enumerate(names))
            return line, tuple(Column(name=name) for name in once)
    expected = (
        "must have a line with EASTING, NORTHING, … OMEGA, PHI, KAPPA or ROLL, PITCH, HEADING"
    )
    raise source.wrong("heading", "is not there", expected)


def _listed(source: Opened, heading: Line, columns: tuple[Column, ...]) -> Listed:
    """Return the rows after the heading; a first column ID that all rows lack is dropped."""
    rows: list[Line] = []
    for line in lines(source):
        are_units = not rows and line.cells[0].startswith("(")
        if line.number > heading.number and not are_units:
            rows.append(line)
    if not rows:
        raise source.wrong("file", "has a heading and no rows", "must have rows")
    text = source.text().split("\n")
    by_tabs = [cut(text[row.number - 1].rstrip(), "\t") for row in rows]
    if all(len(own) == len(columns) for own in by_tabs):
        rows = [replace(row, cells=own) for row, own in zip(rows, by_tabs, strict=True)]
    else:
        plain = (" ".join(row.cells).replace(",", " ").split() for row in rows)
        rows = [replace(row, cells=tuple(own)) for row, own in zip(rows, plain, strict=True)]
    if columns[0].name == "image" and all(_lacks_id(row, columns) for row in rows):
        rows = [replace(row, cells=row.cells[len(row.cells) == len(columns) :]) for row in rows]
        columns = columns[1:]
    for row in rows:
        if len(row) != len(columns):
            found = f"has {len(row)} cells"
            raise row.wrong(
                "row", found, f"must have {len(columns)}, as the heading of line {heading.number}"
            )
    return Listed(source=source, columns=columns, rows=tuple(rows), heading=heading)


def _lacks_id(row: Line, columns: tuple[Column, ...]) -> bool:
    return len(row) == len(columns) - 1 or (len(row) == len(columns) and not row.cells[0])


def _with_height(listed: Listed) -> Listed:
    columns = tuple(
        Column(name="height") if one.name == ORTHOMETRIC else one for one in listed.columns
    )
    return replace(listed, columns=columns)


def _preamble(source: Opened, before: int) -> list[str]:
    text = (" ".join(one.split()) for one in source.text().split("\n")[: before - 1])
    return [one[:200] for one in text if re.search(r"\w", one)][:MOST_PREAMBLE]


def _angle_unit(source: Opened, before: int) -> str:
    """Return the unit of attitudes by the line in brackets, degrees where there is none."""
    for number, text in enumerate(source.text().split("\n")[: before - 1], start=1):
        upper = text.upper()
        if "POSITION IN" not in upper:
            continue
        if not re.search(r"POSITION IN M", upper):
            raise source.wrong("units", quoted(text.strip()), "must be metres", line=number)
        unit = re.search(r"ORIENTATION(?: ANGLES)?(?: AND SD)? IN (DEG|GRAD|GON|RAD)", upper)
        if unit is None:
            expected = "must state degrees, grads or radians"
            raise source.wrong("units", quoted(text.strip()), expected, line=number)
        return ANGLE[unit[1]]
    return "deg"


def _order(source: Opened, before: int) -> str:
    """Return the order of omega, phi, kappa that the preamble states; empty where it does not."""
    axes = ""
    for number, text in enumerate(source.text().split("\n")[: before - 1], start=1):
        if found := TURN.search(text.upper()):
            axes += found[1]
            if not any(known.startswith(axes) for known in SEQUENCES):
                expected = "must be about x, y, z or y, x, z"
                raise source.wrong("rotations", quoted(text.strip()), expected, line=number)
    return SEQUENCES.get(axes, "")
