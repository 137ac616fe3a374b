"""Flights that are made to hang, to fill the memory, to be computed, or to open other files."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from acx4files import flight
from acx4files.flight.tables import faulty, name_fault
from acx4lib.errors import FlightError, visible
from acx4lib.geometry.geodesy import GridSystem, crs_fault
from support.flights.written import write_flight
from support.helpers import flight_problems as problems

IMAGES = "calibration/images.csv"
POINTS = "calibration/image_points.csv"
TRAJECTORY = "calibration/trajectory.csv"
CONTROL = "control_points.csv"
TOML = "flight.toml"


def change(folder: Path, file: str, old: str, new: str) -> None:
    text = (folder / file).read_text("utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1), "utf-8")


# --- sizes -----------------------------------------------------------------------------------

# All of these took minutes, gigabytes or a traceback; a second each is generous.
SECONDS = 5.0

HEADER = "image,point,col_px,row_px\n"
LARGE = [
    (TOML, " " * 30_000 + "x\n", "flight.toml:15: character 30002: Expected '='"),
    (TOML, "x = 1" + " " * 300_000 + "1\n", "flight.toml:15: character 300006: Expected newline"),
    (TOML, "a." * 15_000 + "a = 1\n", "flight.toml:15: file: 9 keys joined by dots; must be at"),
    (TOML, "a = {b." + "b." * 9 + "b = 1}\n", "flight.toml:15: file: 9 keys joined by dots"),
    (TOML, "x = " + "[" * 100_000, "flight.toml:15: file: 9 brackets inside each other; must"),
    (TOML, "x = " + "{a=" * 100_000, "flight.toml:15: file: 9 brackets inside each other; must"),
    (TOML, "x = " + "9" * 6000, "flight.toml:15: file: a number of 6000 characters; must have"),
    (TOML, "x = 0x" + "f" * 6000, "flight.toml:15: file: a number of 6002 characters; must have"),
    (TOML, "k" * 6000 + " = 1", "flight.toml:15: file: a word of 6000 characters; must have"),
    (TOML, "# x\n" * 300_000, "flight.toml:1: file: has 1200228 bytes; must have at most 1000000"),
    (TOML, "x = [" + '"k1",' * 100_000 + "]", "flight.toml:15: cameras.CAM.x: unknown key"),
    (
        TOML,
        "[stages.mounting]\nestimate = [" + '"k1",' * 150_000 + "]",
        "flight.toml:16: stages.mounting.estimate: 'k1' again; every name once",
    ),
    (
        TOML,
        "".join(f"[cameras.c{i}]\n" for i in range(40_000)),
        "flight.toml:5: cameras: 40001 cameras; must be at most 1000",
    ),
    (
        TOML,
        "".join(f"q{i} = 1\n" for i in range(60_000)),
        "flight.toml:15: cameras.CAM.q0: unknown key; must be one of",
    ),
    (POINTS, "\n" * 3_000_000 + "a,b,1,1\n", f"{POINTS}:44: row: is blank; as many as the header"),
    (POINTS, "a\n" * 1_000_000, f"{POINTS}:44: row: has 1 cells (cut off?); as many as"),
    (POINTS, '"",' * 1_000_000 + "x\n", f"{POINTS}:44: row: has 1000001 cells (a decimal comma?)"),
    (POINTS, "a" * 1_000_000, f"{POINTS}:44: row: a cell is too long; must have at most 131072"),
    (POINTS, f"a,b,{'9' * 90_000},1\n", f"{POINTS}:44: col_px: '{'9' * 80}'…; must be a finite"),
    (POINTS, f"a,b,{'0' * 90_000}1,1\n", f"{POINTS}:44: col_px: has 90001 characters; must be"),
    (POINTS, "i,p,x,1\n" * 300_000, f"{POINTS}:44: col_px: 'x'; must be a finite number"),
]


@pytest.mark.parametrize(("file", "added", "line"), LARGE, ids=range(len(LARGE)))
def test_what_is_large_or_deep_is_refused_in_time(tmp_path, file, added, line):
    write_flight(tmp_path)
    with (tmp_path / file).open("a") as opened:
        opened.write(added)
    start = time.process_time()
    found = problems(tmp_path)
    assert time.process_time() - start < SECONDS
    assert len(found) < 120
    assert any(one.startswith(line) for one in found), found[0][:300]


def test_a_million_columns_are_one_line_and_ten_thousand_as_well(tmp_path):
    write_flight(tmp_path)
    for n in (1_000_000, 10_000):
        (tmp_path / POINTS).write_text(HEADER.strip() + "".join(f",c{i}" for i in range(n)) + "\n")
        expected = f"{POINTS}:1: header: has {n + 4} columns; must have at most 1000"
        assert problems(tmp_path) == [expected]


def test_many_columns_that_are_not_read_are_few_notes(tmp_path):
    lines = (write_flight(tmp_path) / POINTS).read_text().splitlines()
    extra = [",".join(f"c{i}" for i in range(900)), *[",".join("x" * 900)] * (len(lines) - 1)]
    (tmp_path / POINTS).write_text(
        "".join(f"{line},{more}\n" for line, more in zip(lines, extra, strict=True))
    )
    notes = [note for note in flight.read(tmp_path).notes if "column" in note]
    assert len(notes) == 11
    assert notes[-1].endswith("image_points.csv: 890 more columns are not read")


def test_names_of_files_that_are_not_there_are_looked_up_in_time(tmp_path):
    write_flight(tmp_path)
    rows = "".join(f"i{i},CAM,E{i},a/b/c/{i}.tif\n" for i in range(30_000))
    (tmp_path / IMAGES).write_text("image,camera,exposure,file\n" + rows)
    start = time.process_time()
    assert f"{IMAGES}:2: file: 'a/b/c/0.tif' is not there" in problems(tmp_path)[0]
    assert time.process_time() - start < SECONDS


def test_the_nearest_of_many_names_is_found_in_time(tmp_path):
    write_flight(tmp_path)
    rows = "".join(f"X{i:06d},0,0,1900,0,0,0\n" for i in range(40_000))
    with (tmp_path / TRAJECTORY).open("a") as opened:
        opened.write(rows)
    change(tmp_path, IMAGES, "CAM,E1,", "CAM,X0012x4,")
    start = time.process_time()
    assert "'X0012x4' is unknown (did you mean 'X000124'?)" in problems(tmp_path)[0]
    assert time.process_time() - start < SECONDS


def test_a_wrong_mounting_of_many_images_is_explained_in_time(tmp_path):
    write_flight(tmp_path)
    flown, images, points = ((tmp_path / f).read_text() for f in (TRAJECTORY, IMAGES, POINTS))
    for file, text, column in ((TRAJECTORY, flown, 0), (IMAGES, images, 2), (POINTS, points, 0)):
        header, *rows = text.splitlines()
        many = [
            ",".join(f"{k}{c}" if i in ((0, 2) if column else (0,)) else c for i, c in enumerate(r))
            for k in range(1500)
            for r in (row.split(",") for row in rows)
        ]
        (tmp_path / file).write_text("\n".join([header, *many]) + "\n")
    change(tmp_path, TOML, "mount_kappa_deg = 90.0", "mount_kappa_deg = 0.0")
    start = time.process_time()
    (line,) = problems(tmp_path)
    assert "the camera axes were turned by 90 degrees about z" in line
    assert time.process_time() - start < 4 * SECONDS  # half of it for reading 63 000 measurements


def test_of_many_wrong_cameras_some_are_explained(tmp_path):
    write_flight(tmp_path)
    toml, points = (tmp_path / TOML).read_text(), (tmp_path / POINTS).read_text()
    begin, camera = toml[: toml.index("[cameras")], toml[toml.index("[cameras") :]
    turned = camera.replace("kappa_deg = 90.0", "kappa_deg = 0.0")
    mounted = [(turned if k else camera).replace("CAM", f"C{k}") for k in range(300)]
    (tmp_path / TOML).write_text(begin + "".join(mounted))
    rows = [(f"I{k}_{e},C{k},E{e}\n", f"I{k}_{e}") for k in range(300) for e in range(6)]
    (tmp_path / IMAGES).write_text("image,camera,exposure\n" + "".join(row for row, _ in rows))
    header, *measured = points.splitlines()
    many = [
        row.replace(f"E{e}_CAM", f"I{k}_{e}")
        for k in range(300)
        for e in range(6)
        for row in measured
        if row.startswith(f"E{e}_")
    ]
    (tmp_path / POINTS).write_text("\n".join([header, *many]) + "\n")
    start = time.process_time()
    found = problems(tmp_path)
    assert time.process_time() - start < SECONDS
    assert len(found) == 11
    expected = (
        "control points do not fit images of 289 more cameras; must lie near their measurements"
    )
    assert found[0] == f"{TOML}:5: cameras: {expected}"


def test_a_file_larger_than_the_memory_is_refused_unread(tmp_path):
    write_flight(tmp_path)
    with (tmp_path / POINTS).open("r+b") as opened:
        opened.truncate(2**40)
    (line,) = problems(tmp_path)
    assert line == (
        f"{POINTS}:1: file: has {2**40} bytes, reading it takes 25 times as much memory; "
        "must fit into free memory"
    )


MEMORY_ENDS = """
import resource, sys
from acx4lib.errors import FlightError
from acx4files.flight import read
pages = int(open("/proc/self/statm").read().split()[0])
limit = pages * resource.getpagesize() + 30_000_000
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    read(sys.argv[1])
except FlightError as error:
    print(*error.problems, sep="\\n")
"""


def test_memory_that_ends_while_reading_is_a_line(tmp_path):
    """In a process of its own: one that has freed memory may fill that again."""
    rows = "".join(f"E0_CAM,T{i},1,1\n" for i in range(500_000))
    with (write_flight(tmp_path) / POINTS).open("a") as opened:
        opened.write(rows)
    command = [sys.executable, "-c", MEMORY_ENDS, str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ended.stdout == (
        f"{tmp_path}:1: folder: reading it takes more memory than there is; "
        "must fit into free memory\n"
    )


# --- names -----------------------------------------------------------------------------------

REFUSED = [
    *("=1+1", "@SUM(A1)", "\tx", "\rx", "+x", "-x", "-1-1", "+1,5", "- 5", "--1"),
    *(" =1+1", "\u00a0=1"),
    *("\uff1d1+1", "\uff0dx", "\uff20x", "﹦1", "⩵", "\u200b=1", "a;=1", "a; +x", "a\nb", "a\x85b"),
    *("a\x7fb", "a\x1b[0m"),
    *("a\u2028b", "a\u2029b", "a\u202eb", "a\u2066b", "a\u200fb", "\ufffe", "x" * 201),
]
ACCEPTED = [
    *("-12", "+3.5", "-", "-.5", "-1e5", "1-2", "a=b", "a@b", "a;b", "a;-5", "a+b", "x" * 200),
    *("$x^2$", "a b", "a/b", "é", "日本語", "{{ x }}", "<b>", "|", "`", "\\", "🛩"),
    *("नमस्ते", "می\u200cشود"),
]


@pytest.mark.parametrize("name", REFUSED)
def test_a_name_that_is_a_formula_or_no_line_of_text_is_refused_everywhere(tmp_path, name):
    assert name_fault(name) == faulty({name, "good"})[name]
    cell = f'"{name}"'
    write_flight(tmp_path)
    change(tmp_path, IMAGES, "E1_CAM,CAM,E1,1", f"{cell},CAM,{cell},{cell}")
    change(tmp_path, CONTROL, "G3,", f"{cell},")
    change(tmp_path, TOML, '"small"', f'"{toml(name)}"')
    change(tmp_path, TOML, "cameras.CAM", f'cameras."{toml(name)}"')
    found = problems(tmp_path)
    for begin in (
        f"{IMAGES}:3: image: ",
        f"{IMAGES}:3: exposure: ",
        f"{IMAGES}:3: strip: ",
        f"{CONTROL}:5: point: ",
        f"{TOML}:1: name: ",
        f"{TOML}:5: cameras.",
    ):
        said = [line for line in found if line.startswith(begin) and name_fault(name)[1] in line]
        assert len(said) == 1


def toml(name: str) -> str:
    """Return a name as TOML's basic strings have it."""
    return "".join(c if c.isalnum() or c == " " else f"\\U{ord(c):08x}" for c in name)


@pytest.mark.parametrize("name", ACCEPTED)
def test_any_other_name_is_accepted_everywhere(tmp_path, name):
    assert name_fault(name) is None
    assert not faulty({name})
    write_flight(tmp_path)
    cell = f'"{name}"'
    for file in (IMAGES, POINTS, TRAJECTORY):
        text = (
            (tmp_path / file)
            .read_text()
            .replace("E1_CAM,", f"{cell},")
            .replace("\nE1,", f"\n{cell},")
        )
        (tmp_path / file).write_text(text.replace(",E1,", f",{cell},").replace(",G3,", f",{cell},"))
    change(tmp_path, CONTROL, "G3,", f"{cell},")
    change(tmp_path, TOML, '"small"', f'"{toml(name)}"')
    read = flight.read(tmp_path)
    assert read.name == name
    assert name in read.calibration.images.names
    assert name in read.calibration.points
    assert name in read.calibration.trajectory.exposures


def test_what_is_no_text_is_shown_escaped():
    text = "a\x1b[31m\x9b\u2028\u202e\udcff\n\ufffe"
    assert visible(text) == r"a\x1b[31m\x9b\u2028\u202e\xff\n\ufffe"
    assert FlightError([text]).problems == (visible(text),)
    assert visible("σ é 日本語 🛩 \\ '") == "σ é 日本語 🛩 \\ '"


def test_odd_bytes_in_a_path_are_one_line_each(tmp_path):
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\n\x1b[31m\xe2\x80\xae"))
    write_flight(folder)
    (folder / POINTS).unlink()
    (line,) = problems(folder)
    begin = visible(str(folder))
    assert line == f"{begin}/{POINTS}:1: file: is not there; block calibration needs it"
    assert r"\xff\n\x1b[31m\u202e" in line
    (folder / "calibration").rename(folder / "calibraton")
    assert "(calibraton/images.csv is in none)" in problems(folder)[0]


# --- what is no file ---------------------------------------------------------------------------


def unix_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(path))


SPECIAL = {
    "pipe": (os.mkfifo, "cannot be read (no regular file); must be a readable file"),
    "device": (lambda p: p.symlink_to("/dev/zero"), "cannot be read (no regular file); must be"),
    "folder": (lambda p: p.mkdir(), "cannot be read (Is a directory); must be a readable file"),
    "loop": (lambda p: p.symlink_to(p.name), "cannot be read (Too many levels of symbolic links)"),
    "dangling": (lambda p: p.symlink_to("x"), "is a link to nothing; must be a readable file"),
    "socket": (unix_socket, "cannot be read (No such device or address); must be a readable"),
    "kernel": (lambda p: p.symlink_to("/proc/kmsg"), ""),
    "memory": (lambda p: p.symlink_to("/proc/self/mem"), ""),
}


@pytest.mark.parametrize("kind", SPECIAL)
@pytest.mark.parametrize("file", [TOML, CONTROL, "i.csv"])
def test_what_is_no_regular_file_is_neither_waited_for_nor_read(tmp_path, monkeypatch, kind, file):
    write_flight(tmp_path / "f")
    monkeypatch.chdir(tmp_path)  # the path of a socket is short
    make, says = SPECIAL[kind]
    path = Path("f") / (IMAGES if file == "i.csv" else file)
    path.unlink()
    make(path)
    with pytest.raises(FlightError) as caught:
        flight.read("f")
    assert caught.value.problems[0].startswith(f"{path}:1: ")
    assert says in caught.value.problems[0]


@pytest.mark.parametrize("name", ["heads", "validation"])
@pytest.mark.parametrize("kind", ["file", "loop", "dangling", "pipe"])
def test_a_block_that_is_no_folder_is_said(tmp_path, name, kind):
    path = write_flight(tmp_path) / name
    make = {"file": lambda p: p.write_text("")} | {k: m for k, (m, _) in SPECIAL.items()}
    make[kind](path)
    assert problems(tmp_path) == [f"{name}:1: folder: is no folder; must be the folder of a block"]


@pytest.mark.parametrize("name", [TOML, POINTS, "calibration"])
def test_what_may_not_be_read_is_said(name):
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        path = write_flight(Path(folder) / "f") / name
        Path(folder).chmod(0o755)
        path.chmod(0)
        stack.callback(path.chmod, 0o755)
        if os.geteuid() == 0:  # who reads everything
            os.seteuid(65534)
            stack.callback(os.seteuid, 0)
        found = problems(Path(folder) / "f")
    assert "cannot be read (Permission denied); must be a readable file" in found[0]


def test_a_picture_that_is_no_regular_file_is_said(tmp_path):
    text = (write_flight(tmp_path) / IMAGES).read_text()
    os.mkfifo(tmp_path / "calibration/a.tif")
    rows = text.replace("strip\n", "strip,file\n").replace(",1\n", ",1,a.tif\n")
    (tmp_path / IMAGES).write_text(rows.replace(",2\n", ",2,\n"))
    assert problems(tmp_path)[0].startswith(f"{IMAGES}:2: file: 'a.tif' is no regular file; must")


# --- systems that open files ---------------------------------------------------------------------

GRID_WKT = (
    'BOUNDCRS[SOURCECRS[PROJCRS["x"]],TARGETCRS[GEOGCRS["y"]],'
    'ABRIDGEDTRANSFORMATION["z",METHOD["NTv2"],PARAMETERFILE["f","/etc/passwd"]]]'
)
OPENS = [
    *("+proj=utm +zone=22 +nadgrids=/etc/passwd", "+proj=utm +zone=22 +geoidgrids=g.gtx"),
    *("+init=file:x", "+init=epsg:31982", "file:x", "/etc/passwd", "flight.toml", "@flight.toml"),
    *("+proj=pipeline +step +proj=utm +zone=22", "proj=utm zone=22 nadgrids=x", "a name of a CRS"),
    "http://www.opengis.net/def/crs/EPSG/0/31982",
    '{"proj": "utm", "zone": 22, "nadgrids": "x"}',
    *(
        GRID_WKT,
        'PROJCS["x",EXTENSION["PROJ4","+proj=utm +nadgrids=x"]]',
        "+proj=utm +zone=22 +file=x",
    ),
    *(
        'PROJCRS["x",CONVERSION["y",METHOD["PROJ-based operation method: +proj=x"]]]',
        "",
        "P[" * 9999,
    ),
]


@pytest.mark.parametrize("crs", OPENS)
def test_a_crs_that_could_open_a_file_is_refused(tmp_path, monkeypatch, crs):
    assert crs_fault(crs)
    write_flight(tmp_path)
    monkeypatch.chdir(tmp_path)
    change(tmp_path, TOML, "EPSG:31982", crs.replace('"', '\\"'))
    assert problems(tmp_path)[0].startswith(f"{TOML}:2: crs: ")
    with pytest.raises(ValueError, match=r".+"):
        GridSystem(crs=crs)
    with pytest.raises(ValueError, match=r".+"):
        GridSystem(crs="EPSG:31982", heights=crs)


@pytest.mark.parametrize("form", ["wkt", "proj", "urn", "compound", "merc"])
def test_a_crs_may_be_a_code_wkt_or_a_plain_proj_string(form):
    import pyproj  # noqa: PLC0415 here alone

    crs = {
        "wkt": pyproj.CRS("EPSG:31982").to_wkt(pretty=True),
        "proj": "+proj=utm +zone=22 +south +ellps=GRS80 +towgs84=0,0,0,0,0,0,0 +units=m +no_defs",
        "urn": "urn:ogc:def:crs:EPSG::31982",
        "compound": "EPSG:31982+5773",
        "merc": pyproj.CRS("EPSG:3857").to_wkt("WKT1_GDAL"),
    }[form]
    assert not crs_fault(crs)
    assert GridSystem(crs=crs).crs == crs


def test_wkt_of_many_lines_is_one_line_of_the_summary(tmp_path):
    import pyproj  # noqa: PLC0415 here alone

    wkt = pyproj.CRS("EPSG:31982").to_wkt(pretty=True).replace("SIRGAS 2000 / UTM", "SIRGAS\n2000")
    change(write_flight(tmp_path), TOML, '"EPSG:31982"', f"'''{wkt}'''")
    lines = flight.summary(flight.read(tmp_path)).split("\n")
    assert lines[1] == f"  CRS            {' '.join(wkt.split())[:80]}…, SIRGAS\\n2000 zone 22S"
    change(tmp_path, TOML, "2000 zone", "2000\x85 zone")
    assert problems(tmp_path)[0].startswith(f"{TOML}:2: crs: holds the character U+0085; must be")


def write_geoid(path: Path, height: float = 3.0) -> None:
    header = struct.pack(">4d2i", -27.0, -51.0, 1.0, 1.0, 4, 4)
    path.write_bytes(header + np.full(16, height, dtype=">f4").tobytes())


def test_a_geoid_grid_may_have_any_name_that_proj_can_open(tmp_path):
    write_flight(tmp_path / "a flight")
    write_geoid(tmp_path / "a flight" / "my geoid +proj=x.gtx")
    change(tmp_path / "a flight", TOML, "ellipsoidal", "my geoid +proj=x.gtx")
    read = flight.read(tmp_path / "a flight")
    assert read.grid.undulation(np.array([[-49.5, -25.5]]))[0] == pytest.approx(3.0)


@pytest.mark.parametrize("name", ['a" +step +proj=x.gtx', "a,b.gtx"])
def test_a_geoid_grid_whose_name_would_be_part_of_a_pipeline_is_refused(tmp_path, name):
    write_flight(tmp_path)
    write_geoid(tmp_path / name)
    change(tmp_path, TOML, '"ellipsoidal"', f"'{name}'")
    (line,) = problems(tmp_path)
    assert (
        f"{TOML}:3: heights: {name!r} cannot be used (PROJ opens no file with a comma, a quo"
        in line
    )


def test_a_file_of_the_working_folder_is_no_crs_and_no_geoid(tmp_path, monkeypatch):
    write_flight(tmp_path / "f")
    monkeypatch.chdir(tmp_path)
    write_geoid(tmp_path / "EPSG:5773")
    change(tmp_path / "f", TOML, "ellipsoidal", "EPSG:5773")
    (line,) = problems(tmp_path / "f")
    assert line.startswith(f"{TOML}:3: heights: 'EPSG:5773' cannot be used (")
    assert "egm96" in line  # it is the vertical CRS, whose grid is not here
    write_geoid(tmp_path / "g.gtx")
    change(tmp_path / "f", TOML, "EPSG:5773", "g.gtx")
    assert problems(tmp_path / "f")[0].startswith(f"{TOML}:3: heights: 'g.gtx' is not there; must")


def test_of_a_file_with_very_many_problems_the_first_are_written_out(tmp_path):
    write_flight(tmp_path)
    with (tmp_path / TOML).open("a") as opened:
        opened.writelines(f"[cameras.c{i}]\n" for i in range(200))
    found = problems(tmp_path)
    assert len(found) == 201
    assert found[-1] == f"{TOML}:65: file: and more; correct these first"
