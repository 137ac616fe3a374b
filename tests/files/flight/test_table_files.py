"""Files that are missing, cut off, no text, or changed at random."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acx4files import flight
from acx4lib.errors import FlightError
from support.flights.written import CONTROL, IMAGES, POINTS, TOML, TRAJECTORY, replace, write_flight
from support.helpers import LINE
from support.helpers import flight_problems as problems


def test_files_that_are_not_there_or_empty(tmp_path):
    write_flight(tmp_path)
    (tmp_path / CONTROL).unlink()
    (tmp_path / TOML).unlink()
    (tmp_path / IMAGES).write_text("")
    (tmp_path / POINTS).write_text("image,point,col_px,row_px\n\n")
    assert problems(tmp_path) == [
        "flight.toml:1: file: is not there; a flight needs it",
        f"{IMAGES}:1: file: is empty; needs a header",
        f"{POINTS}:1: file: has no rows; at least one row under the header",
        f"{CONTROL}:1: file: is not there; block calibration without its own needs it",
    ]


def test_a_file_that_was_cut_off(tmp_path):
    data = (write_flight(tmp_path) / POINTS).read_bytes()
    (tmp_path / POINTS).write_bytes(data[: data.rindex(b",")])
    assert problems(tmp_path) == [
        f"{POINTS}:43: row: has 3 cells (cut off?); as many as the header: 4"
    ]


def test_a_file_that_is_not_utf8(tmp_path):
    text = (write_flight(tmp_path) / POINTS).read_text()
    (tmp_path / POINTS).write_bytes(text.replace("G4", "Gä").encode("latin-1"))
    assert problems(tmp_path) == [f"{POINTS}:5: file: byte 0xe4 is not UTF-8; must be UTF-8 text"]
    (tmp_path / POINTS).write_bytes(text.encode("utf-16-le"))
    assert problems(tmp_path) == [f"{POINTS}:1: file: holds a null character; must be UTF-8 text"]
    (tmp_path / POINTS).write_bytes(text.encode("utf-16"))
    assert problems(tmp_path) == [
        f"{POINTS}:1: file: byte 0xff is not UTF-8 (UTF-16?); must be UTF-8 text"
    ]


def test_a_quote_that_is_not_closed(tmp_path):
    replace(write_flight(tmp_path), POINTS, "E1_CAM,G1", '"E1_CAM,G1')
    (line,) = problems(tmp_path)
    assert line.startswith(f"{POINTS}:9: file: cannot be read as a table (unexpected end of data)")


@pytest.mark.parametrize(
    ("separator", "called"), [(";", "semicolons"), ("\t", "tabs"), (" ", "spaces")]
)
def test_other_separators_are_one_line(tmp_path, separator, called):
    replace(write_flight(tmp_path), TRAJECTORY, ",", separator)
    assert problems(tmp_path) == [
        f"{TRAJECTORY}:1: header: is separated by {called}; "
        "must be separated by commas, numbers with decimal points"
    ]


def test_a_blank_first_line_is_no_header(tmp_path):
    write_flight(tmp_path)
    (tmp_path / CONTROL).write_text("\n\n")
    assert problems(tmp_path) == [f"{CONTROL}:1: file: is empty; needs a header"]
    (tmp_path / CONTROL).write_text("\npoint,east_m,north_m,height_m\n")
    assert problems(tmp_path) == [f"{CONTROL}:1: file: begins with a blank line; needs a header"]


def test_a_last_line_without_an_end_is_noted(tmp_path):
    """Cut inside its last number, a row still has all its cells."""
    text = (write_flight(tmp_path) / POINTS).read_text()
    (tmp_path / POINTS).write_text(text[:-3])
    expected = f"{tmp_path / POINTS}: the last line has no line end; was the file cut off?"
    assert flight.read(tmp_path).notes[0] == expected


def test_a_pipe_is_not_waited_for(tmp_path):
    (write_flight(tmp_path) / POINTS).unlink()
    os.mkfifo(tmp_path / POINTS)
    expected = "cannot be read (no regular file); must be a readable file"
    assert problems(tmp_path) == [f"{POINTS}:1: file: {expected}"]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_flight(tmp_path_factory.mktemp("good") / "flight", blocks=("heads", "validation"))


FILES = [TOML, CONTROL, *(f"heads/{n}.csv" for n in ("images", "image_points", "trajectory"))]


def read_or_flight_error(folder: Path) -> None:
    lines: tuple[str, ...] = ()
    try:
        flight.read(folder)
    except FlightError as error:
        lines = error.problems
    assert all(LINE.match(line) for line in lines)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    file=st.sampled_from(FILES),
    at=st.floats(0, 1),
    junk=st.binary(max_size=8),
    cut=st.integers(0, 40),
)
def test_changed_bytes_never_raise_anything_else(good, file, at, junk, cut):
    with_changed(good, file, lambda data: splice(data, int(at * len(data)), cut, junk))


CELLS = st.one_of(
    st.text(max_size=6),
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(["", "nan", "inf", "1e308", "-1e308", "0", "\0", '"', "\n", "G0", "E0", "CAM"]),
)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(file=st.sampled_from(FILES), cell=CELLS, data=st.data())
def test_changed_cells_never_raise_anything_else(good, file, cell, data):
    text = (good / file).read_bytes().decode()
    parts = re.split(r"([,\n=])", text)
    where = data.draw(st.integers(0, len(parts) - 1))
    parts[where] = cell
    with_changed(good, file, lambda _: "".join(parts).encode(errors="surrogatepass"))


def splice(data: bytes, at: int, cut: int, junk: bytes) -> bytes:
    return data[:at] + junk + data[at + cut :]


def with_changed(good: Path, file: str, by: Callable[[bytes], bytes]) -> None:
    """Read a flight with one file changed, then put it back."""
    before = (good / file).read_bytes()
    try:
        (good / file).write_bytes(by(before))
        read_or_flight_error(good)
    finally:
        (good / file).write_bytes(before)


def test_a_folder_where_a_file_should_be(tmp_path):
    write_flight(tmp_path)
    (tmp_path / IMAGES).unlink()
    (tmp_path / IMAGES).mkdir()
    assert problems(tmp_path)[0].startswith(f"{IMAGES}:1: file: cannot be read (Is a directory)")
    shutil.rmtree(tmp_path / "calibration")
    (tmp_path / "calibration").write_text("")
    assert problems(tmp_path)[0].startswith(f"{tmp_path}:1: folder: no block at all")


def test_a_block_of_pictures_without_points_names_the_command_that_measures_them(tmp_path):
    write_flight(tmp_path)
    header = (tmp_path / POINTS).read_text().splitlines()[0]
    (tmp_path / POINTS).write_text(f"{header}\n")
    fault = f"{POINTS}:1: file: has no rows; at least one row under the header"
    assert problems(tmp_path) == [fault]
    picture = tmp_path / "calibration/a.tif"
    picture.write_bytes(b"")
    head, *rows = (tmp_path / IMAGES).read_text().splitlines()
    lines = [f"{head},file", *(f"{row},a.tif" for row in rows)]
    (tmp_path / IMAGES).write_text("\n".join(lines) + "\n")
    assert problems(tmp_path) == [f"{fault}; acx4 measure finds points in its pictures"]
