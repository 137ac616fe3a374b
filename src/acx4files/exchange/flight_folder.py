"""Write imported data as a flight's folder, or into the folder that an import began.

A file that the user changed is not replaced: a table is an error, and flight.toml stays as it is.
"""

from __future__ import annotations

import csv
import datetime as dt
import filecmp
import hashlib
import io
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from acx4files.flight.problems import lines_of
from acx4files.flight.table_files import Columns
from acx4files.flight.tables import name_fault
from acx4files.flight.toml_file import read_toml
from acx4files.results import whole_files
from acx4lib.errors import FlightError, OutputError
from acx4lib.geometry.geodesy import LOCAL

SETTINGS, STATEMENT, CONTROL = "flight.toml", "import.md", "control_points.csv"

SYSTEMS = ("crs", "heights")
"""Settings that hold for all numbers of a flight."""

SYNTHETIC = "SYN"
"""Name of the camera that a rig's heads make together, where the source has none."""

SEEN = ("width_px", "height_px", "pixel_um", "focal_mm")
SEEN_FROM = ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg")
"""Settings that the synthetic camera takes from the first head."""


def write(imported: ImportedFlight, folder: Path) -> tuple[str, ...]:
    """Write all imported data, or nothing.

    Parameters
    ----------
    imported : ImportedFlight
    folder : Path
        New, empty, or written by an import before: then tables of the same name are replaced,
        which is said, and settings are added to those of flight.toml.

    Returns
    -------
    tuple of str
        What the user has to know of the folder; a sentence each.

    Raises
    ------
    OutputError
        Where a file that would be replaced was changed, or is not of an import, or the flight
        has its numbers in another CRS or other heights.
    FlightError
        Where measurements lie outside the pictures.
    """
    _require_inside(imported)
    with whole_files.claim(folder, signs=[STATEMENT]):
        edited = (folder / SETTINGS).exists() and bool(_changed(folder, [SETTINGS]))
        texts = {name: _table_text(table) for name, table in imported.tables.items()}
        if imported.settings and not edited:
            texts[SETTINGS] = _settings(folder, imported.settings)
        pictures = {
            name: picture
            for name, picture in imported.pictures.items()
            if picture.absolute() != (folder / name).absolute()
        }
        changed = _changed(folder, texts) + [
            f"{folder / name}: is another picture than {picture}"
            for name, picture in pictures.items()
            if (folder / name).exists() and not filecmp.cmp(picture, folder / name)
        ]
        if changed:
            raise OutputError(f"{changed[0]}; move it away, or choose another folder")
        before = {name: _read(folder / name) for name in imported.tables}
        remarks = tuple(
            f"{name}: {number_of(n, 'rows')} of an earlier import replaced by "
            f"{_n_rows(texts[name])}"
            for name, text in before.items()
            if (n := _n_rows(text)) and text != texts[name]
        )
        said = statement(imported, edited=edited) + _written(texts)
        _place(folder, {**texts, STATEMENT: _read(folder / STATEMENT) + said}, pictures)
    if edited and imported.settings:
        kept = f"{SETTINGS} was edited and stays as it is; what the source says is in {STATEMENT}"
        return (kept, *remarks)
    return remarks


def _require_inside(imported: ImportedFlight) -> None:
    """Raise FlightError for the first measurement outside its picture, with their number."""
    cameras = imported.settings.get("cameras", {})
    for file, points in imported.tables.items():
        images = imported.tables.get(file.replace("image_points.csv", "images.csv"))
        if not file.endswith("/image_points.csv") or images is None:
            continue
        camera_of = dict(zip(images["image"], images["camera"], strict=True))
        rows = zip(*(points[name] for name in ("image", "point", "col_px", "row_px")), strict=True)
        outside = []
        for name, point, col, row in rows:
            camera = cameras.get(camera_of.get(name), {})
            width, height = camera.get("width_px", np.inf), camera.get("height_px", np.inf)
            if not (-0.5 <= col <= width - 0.5 and -0.5 <= row <= height - 0.5):
                size = f"{width:g} x {height:g} px, the size that was given or read"
                outside.append((f"point {point} in {name}: col {col:.1f}, row {row:.1f}", size))
        if outside:
            read = min(imported.sha256, default=imported.source)
            said = (
                f"{len(outside)} of {len(points['image'])} measurements lie outside their pictures"
            )
            first, size = outside[0]
            raise FlightError([f"{read}:1: {first}, and {said}; must lie in {size}"])


def _n_rows(text: str) -> int:
    """Return the number of rows of a table after its header."""
    return max(sum(1 for _ in csv.reader(io.StringIO(text))) - 1, 0)


def begin(
    folder: Path, texts: Mapping[str, str], files: Mapping[str, Path] = MappingProxyType({})
) -> None:
    """Write the files of a new flight, to which imports may add.

    Parameters
    ----------
    folder : Path
        New or empty.
    texts : mapping of str to str
        By file below the flight.
    files : mapping of str to Path
        Files that it gets as they are, such as a geoid grid.

    Raises
    ------
    OutputError
        Where the folder holds anything.
    """
    with whole_files.claim(folder, signs=[]):
        _place(folder, {**texts, STATEMENT: _written(texts)}, files)


def _table_text(table: Columns) -> str:
    """Return a table as the text of a CSV file; numbers have as many digits as they need."""
    names = list(table) if isinstance(table, Mapping) else list(table.columns)
    columns = [np.asarray(table[name], dtype=object).tolist() for name in names]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns, strict=True))
    return buffer.getvalue()


def statement(imported: ImportedFlight, *, edited: bool = False) -> str:
    """Return the part of import.md on the imported data.

    Parameters
    ----------
    imported : ImportedFlight
    edited : bool
        Whether the settings have no other place.
    """
    files = [f"{name}, SHA-256 {sha256}" for name, sha256 in imported.sha256.items()]
    parts = {
        "Warnings": imported.warnings,
        "Read": files,
        "Assumed": imported.assumed,
        "Found": imported.found,
        "Left out": imported.left_out,
    }
    lines = [f"# {imported.source}", ""]
    for title, sentences in parts.items():
        if sentences:
            lines += [f"## {title}", "", *(f"- {sentence}" for sentence in sentences), ""]
    if imported.lenses:
        heading = ("camera", "width x height", "f", "f there", "largest difference", "rms")
        rows = (heading, ("---",) * len(heading), *imported.lenses)
        cells = ([cell.replace("|", "\\|") for cell in row] for row in rows)
        lines += ["## Lenses", "", *(f"| {' | '.join(row)} |" for row in cells), ""]
    if edited and imported.settings:
        text = written(imported.settings).rstrip("\n")
        lines += ["## Settings", "", "```toml", *text.split("\n"), "```", ""]
    return "\n".join(lines) + "\n"


WRITTEN = re.compile(r"^- (.+), written with SHA-256 ([0-9a-f]{64})$", re.MULTILINE)
"""Line of import.md on a file, by which a later import sees whether it was changed since."""


def _written(texts: Mapping[str, str]) -> str:
    """Return the part of import.md on the files that are written."""
    digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}
    lines = [f"- {name}, written with SHA-256 {digest}" for name, digest in digests.items()]
    return "\n".join(["## Written", "", *lines, ""]) + "\n"


def _changed(folder: Path, names: Iterable[str]) -> list[str]:
    """Return a line for each existing file that is not as an import left it."""
    digests = dict(WRITTEN.findall(_read(folder / STATEMENT)))
    return [
        f"{folder / name}: was {'changed since' if name in digests else 'not written by'} an import"
        for name in names
        if (folder / name).exists()
        and digests.get(name) != hashlib.sha256((folder / name).read_bytes()).hexdigest()
    ]


def _settings(folder: Path, imported: Mapping[str, Any]) -> str:
    """Return the text of flight.toml with settings added; a new one gets the folder's name."""
    before, known = _read(folder / SETTINGS), {}
    if before:
        toml = read_toml(folder / SETTINGS)
        if toml.problems:
            raise FlightError(lines_of(toml.problems))
        known = toml.values
    for key in SYSTEMS:
        if key in known and key in imported and known[key] != imported[key]:
            msg = (
                f"{folder / SETTINGS}: {key} is {known[key]!r}, and {imported[key]!r} in what is "
                f"brought: name the same by --{key}, or choose another folder"
            )
            raise OutputError(msg)
    name = folder.resolve().name
    named = {} if "name" in known or name_fault(name) else {"name": name}
    is_new_on_map = "crs" not in known and imported.get("crs", LOCAL) != LOCAL
    air = {"refraction": "standard"} if is_new_on_map and "refraction" not in known else {}
    return added(before, named | dict(imported) | air)


def _read(path: Path) -> str:
    return path.read_text("utf-8-sig") if path.exists() else ""


def _place(folder: Path, texts: Mapping[str, str], files: Mapping[str, Path]) -> None:
    """Write files, and give others, as pictures, a second name, by their names in a folder."""
    for name in (*texts, *files):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    for name, file in files.items():
        whole_files.link(file, folder / name)
    whole_files.write_all({folder / name: text for name, text in texts.items()})


def with_no_control(imported: ImportedFlight, folder: Path) -> ImportedFlight:
    """Return imported data with an empty table of control points, where coordinates are local.

    Parameters
    ----------
    imported : ImportedFlight
    folder : Path
        Of the flight; one that has control points keeps them.
    """
    has_them = CONTROL in imported.tables or (folder / CONTROL).exists()
    if imported.settings.get("crs") != LOCAL or has_them:
        return imported
    empty: dict[str, list[Any]] = {name: [] for name in ("point", "east_m", "north_m", "height_m")}
    return replace(imported, tables={**imported.tables, CONTROL: empty})


def with_synthetic(imported: ImportedFlight) -> ImportedFlight:
    """Return imported data of heads with the synthetic camera that their flight needs.

    The first head, the reference of the others, is the one whose own angles in the rig are zero;
    where there is none or more than one, that of the first image. The synthetic camera has its
    size, its focal length and its direction: right for heads whose fields coincide, and to be
    enlarged where they look apart.
    """
    images = imported.tables.get("heads/images.csv")
    cameras = imported.settings.get("cameras", {})
    heads = [] if images is None else [*dict.fromkeys(images["camera"])]
    has_one = "synthetic" in imported.settings or SYNTHETIC in cameras
    if len(heads) < 2 or has_one or not cameras.keys() >= {*heads}:
        return imported
    heads.sort(key=lambda name: not _looks_along_the_rig(cameras[name]))
    first = cameras[heads[0]]
    virtual = {key: first[key] for key in (*SEEN, *SEEN_FROM) if key in first}
    settings = dict(imported.settings) | {
        "cameras": {**cameras, SYNTHETIC: virtual},
        "synthetic": {"camera": SYNTHETIC, "heads": heads},
    }
    said = f"The synthetic camera {SYNTHETIC} has size, focal length and direction of {heads[0]}"
    return replace(imported, settings=settings, assumed=(*imported.assumed, said))


def _looks_along_the_rig(camera: Mapping[str, Any]) -> bool:
    """Tell whether the mounting of a camera is turned by right angles about its axis alone."""
    omega, phi, kappa = (float(camera.get(key, 0.0)) for key in SEEN_FROM)
    return max(abs(omega), abs(phi), abs((kappa + 45) % 90 - 45)) < 1e-6


# --- Imported data in the form of a flight, and the sentences on them


@dataclass(frozen=True, kw_only=True)
class ImportedFlight:
    """Imported data: a part of a flight, or all of it, from another program's files.

    Attributes
    ----------
    source : str
        Program or format, with its version where the files state it: "Metashape 1.7.2".
    sha256 : mapping of str to str
        The files that were read, by their names without folders.
    settings : mapping
        Keys of flight.toml, nested as there. What the source does not know is absent.
    tables : mapping of str to table
        By file below the flight: ``calibration/images.csv``, ``control_points.csv``. Columns and
        units are those of the file of this name.
    pictures : mapping of str to Path
        Where the pictures are that column ``file`` of an images.csv names, by file below the
        flight: ``calibration/images/a.tif``.
    warnings : tuple of str
        What a user must know before all else: a sentence each.
    assumed : tuple of str
        Conventions that were assumed: axes, origins, angles, time bases, datums; a sentence each.
    lenses : sequence of tuple of str
        Rows of a table in import.md where there are many: camera, size, f, f of the program, the
        largest and the rms difference, all in px.
    found : tuple of str
        Sentences on the numbers of things read, and on the proof that they were read rightly.
    left_out : tuple of str
        Sentences on parts of the source that the flight does not have, and why.
    """

    source: str
    sha256: Mapping[str, str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, Columns] = field(default_factory=dict)
    pictures: Mapping[str, Path] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    lenses: Sequence[tuple[str, ...]] = ()
    left_out: tuple[str, ...] = ()


def number_of(n: int, nouns: str) -> str:
    """Return a number with its noun, given for many: 2 cameras, 1 camera."""
    return f"{n} {nouns.removesuffix('s') if n == 1 else nouns}"


# --- The files of a new flight, to be filled in: a flight.toml with remarks, tables with a header


TABLES = {
    "images.csv": "image,camera,exposure,strip\n",
    "image_points.csv": "image,point,col_px,row_px\n",
    "trajectory.csv": "exposure,lat_deg,lon_deg,height_m,roll_deg,pitch_deg,heading_deg,time_s\n",
}
VIRTUAL = ("SYN", *(f"SYN_{k}" for k in range(1, 100)))
"""Names of the synthetic camera: the first that no head has."""

HEAD = """\
# A flight of acx4. What begins with # is a remark: take the # away to use a key.
# All keys, and all columns of the tables, are in the part "Your own flight" of the book.

name = {name}
crs = {crs}  # projected CRS, in metres, of all east and north
heights = {heights}  # "ellipsoidal", a vertical CRS, a geoid grid file, or an undulation in m
refraction = {refraction}  # or {other}
"""

CAMERA = """
[cameras.{camera}]
# width_px = 8984  # columns of an image
# height_px = 6732  # rows of an image
# pixel_um = 6.0  # size of a pixel
# focal_mm = 74.0  # approximate; the calibration estimates it
# mount_omega_deg = 0.0  # approximate boresight: camera axes (x right, y up) in those of the body
# mount_phi_deg = 0.0
# mount_kappa_deg = -90.0  # the top of the image points forward; 90.0: backward
# lever_x_m = 0.0  # from the IMU to the camera: forward
# lever_y_m = 0.0  # left
# lever_z_m = 0.0  # up
"""

_SYNTHETIC_TABLE = """
# The image into which the heads are rendered is that of a camera as well; the first head is the
# reference of the others.
[synthetic]
camera = {camera}
heads = {heads}
# measured_in = "synthetic"  # or "heads": where points of calibration/ and validation/ are measured
"""

END = """
[apriori]  # standard deviations where a table has no column for them
image_point_px = 0.5
gnss_horizontal_m = 0.05
gnss_vertical_m = 0.1
roll_pitch_deg = 0.005
heading_deg = 0.008
"""


def files(name: str, *, cameras: Sequence[str], crs: str, heights: str | float) -> dict[str, str]:
    """Return the texts of a new flight by their names below its folder.

    Parameters
    ----------
    name : str
        Of the flight.
    cameras : sequence of str
        One camera has the block calibration; several are heads, and have the block heads.
    crs : str
    heights : str or float
        As flight.toml takes them.
    """
    of_air = ("none", "standard") if crs == LOCAL else ("standard", "none")
    known = {"name": name, "crs": crs, "heights": heights}
    known |= dict(zip(("refraction", "other"), of_air, strict=True))
    value = {key: _value_of(entry) for key, entry in known.items()}
    text = HEAD.format(**value)
    is_rig = len(cameras) > 1
    synthetic = next(name for name in VIRTUAL if name not in cameras[: len(VIRTUAL) - 1])
    for camera in (*cameras, *([synthetic] if is_rig else [])):
        text += CAMERA.format(camera=_key_of(camera))
    if is_rig:
        names = {"camera": synthetic, "heads": list(cameras)}
        text += _SYNTHETIC_TABLE.format(**{key: _value_of(entry) for key, entry in names.items()})
    block = "heads" if is_rig else "calibration"
    tables = {f"{block}/{file}": header for file, header in TABLES.items()}
    return {"flight.toml": text + END, CONTROL: "point,east_m,north_m,height_m,role\n", **tables}


# --- Nested tables as TOML text, and values added to a text with its remarks


ROW = 5
"""Lists inside a list that stand on one line."""


def written(values: Mapping[str, Any], *, inline: str = "") -> str:
    """Return the TOML text of nested tables: those of flight.toml, or of a plan.

    Parameters
    ----------
    values : mapping
        Text, numbers, truth values, dates, lists of them, and tables of these.
    inline : str
        Name of the table whose tables are a line each.
    """
    return "\n".join(_lines(values, (), inline)).strip("\n") + "\n"


def added(text: str, values: Mapping[str, Any]) -> str:
    """Return a TOML text with values added; they replace old ones.

    Remarks stay. A key that stands there as a remark, ``# focal_mm = 74.0``, gets its value in
    that place.

    Parameters
    ----------
    text : str
        Valid TOML.
    values : mapping
        As `written` takes them.
    """
    both = _merged(tomllib.loads(text), values)
    if "#" not in text:
        return written(both)
    parts = re.split(r"(?m)^(?=\[)", text)
    for keys, value in _flat(values, ()):
        _set(parts, keys, _value_of(value))
    edited = "".join(parts)
    try:
        return edited if tomllib.loads(edited) == both else written(both)
    except tomllib.TOMLDecodeError:  # a form that is not edited line by line
        return written(both)


def _merged(before: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    return {**before, **new} | {
        key: _merged(before[key], value)
        for key, value in new.items()
        if isinstance(value, Mapping) and isinstance(before.get(key), Mapping)
    }


def _flat(
    values: Mapping[str, Any], keys: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the values of nested tables with the keys that lead to them."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, (*keys, key))
        else:
            yield (*keys, key), value


def _set(parts: list[str], keys: tuple[str, ...], value: str) -> None:
    """Set a value in the parts of a text that begin with the headers of its tables."""
    *table, key = map(_key_of, keys)
    header = f"[{'.'.join(table)}]"
    heads = [part.partition("\n")[0].partition("#")[0].strip() for part in parts]
    k = heads.index(header) if header in heads else len(parts) if table else 0
    if k == len(parts):
        parts[-1] = parts[-1].rstrip("\n") + "\n\n"
        parts.append(f"{header}\n")
    for off in ("", r"#\s*"):
        form = re.compile(rf"(?m)^{off}{re.escape(key)}\s*=[^#\n]*?(\s*#.*)?$")
        if match := form.search(parts[k]):
            remark = match[1].strip() if match[1] else ""
            line = f"{key} = {value}" + (f"  {remark}" if remark else "")
            parts[k] = parts[k][: match.start()] + line + parts[k][match.end() :]
            return
    body = parts[k].rstrip("\n")
    parts[k] = f"{body}\n{key} = {value}{parts[k][len(body) :] or chr(10)}"


def _lines(table: Mapping[str, Any], keys: tuple[str, ...], inline: str) -> Iterator[str]:
    whole = keys[-1:] == (inline,)
    plain = {key: value for key, value in table.items() if whole or not isinstance(value, Mapping)}
    if keys and (plain or not table):
        yield ""
        yield f"[{'.'.join(map(_key_of, keys))}]"
    yield from (f"{_key_of(key)} = {_value_of(value)}" for key, value in plain.items())
    for key, value in table.items():
        if key not in plain:
            yield from _lines(value, (*keys, key), inline)


def _key_of(name: str) -> str:
    """Return a key as it stands in TOML."""
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else _text(name)


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value_of(value: Any) -> str:
    """Return a value as it stands in TOML."""
    if isinstance(value, Mapping):
        return (
            f"{{{', '.join(f'{_key_of(k)} = {_value_of(entry)}' for k, entry in value.items())}}}"
        )
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
        lines = (value[i : i + ROW] for i in range(0, len(value), ROW))
        return "[\n" + "".join(f"    {', '.join(map(_value_of, line))},\n" for line in lines) + "]"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value_of, value))}]"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    return json.dumps(value)
