"""Files of strangers take time in proportion to their size, and less memory than a gigabyte.

Every file here once took seconds or minutes, or gigabytes.
"""

import time
import zipfile

import cv2
import numpy as np
import pytest

from acx4files.exchange import flight_folder, metadata, safe
from acx4files.exchange.programs import micmac
from acx4files.flight.toml_file import read_toml
from acx4files.images.image_files import image_from_file
from acx4files.measuring import views
from acx4files.results import table_files
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from support import swelling
from support.commands import MEMORY, told
from support.flights import written
from support.helpers import ROOT, repeats

SECONDS = 20
"""Of processor time: each takes one or two here, and took minutes when it grew with the square."""

LESS = 9.0
"""Quotient of the times of a file and one four times as large: about 4, or 16 with the square."""


def imported(folder, kind, write, n):
    folder.mkdir()
    source, options = write(folder, n)
    return told("import", kind, source, "--out", folder.with_name(f"{folder.name}-out"), *options)


@pytest.mark.parametrize(
    ("kind", "write", "n"),
    [
        ("orientations", swelling.spaces_in_orientations, 600),
        ("orientations", swelling.spaces_in_orientations, 2_000),
        ("orientations", swelling.spaces_in_orientations, 100_000),
        ("orientations", swelling.spaces_between_commas, 100_000),
        ("pospac-text", swelling.spaces_in_pospac, 100_000),
        ("opensfm", swelling.spaces_in_tracks, 100_000),
        ("opensfm", swelling.brackets, 40_000),
        ("orientations", swelling.columns, 40_000),
        ("pospac-text", swelling.columns_of_pospac, 40_000),
        ("opf", swelling.named_again, 3_000),
        ("metashape", swelling.chunks, 300),
        ("opf", swelling.meshes, 30_000),
    ],
)
def test_what_wants_much_is_refused_or_read_quickly(tmp_path, kind, write, n):
    found = imported(tmp_path / "source", kind, write, n)
    assert found.status in (0, 2), found
    assert "mistake" not in found.err
    assert found.err.count("\n") <= 1
    assert found.seconds < SECONDS
    assert found.memory < MEMORY


@pytest.mark.parametrize(
    ("kind", "write", "n"),
    [
        ("odm-control", swelling.control, 5_000),
        ("micmac", swelling.surveyed, 5_000),
        ("opensfm", swelling.shots, 5_000),
        ("orientations", swelling.columns, 10_000),
    ],
)
def test_four_times_as_much_takes_four_times_as_long(tmp_path, kind, write, n):
    few, many = (imported(tmp_path / f"{m}", kind, write, m) for m in (n, 4 * n))
    assert {few.status, many.status} <= {0, 2}, (few.err, many.err)
    assert few.status == many.status
    assert many.seconds < LESS * few.seconds
    assert many.seconds < SECONDS


def test_interior_orientations_of_each_image_are_told_apart_in_linear_time(tmp_path):
    seconds = []
    for n in (250, 1_000):
        folder, _ = swelling.interiors(tmp_path / f"{n}", n)
        start = time.process_time()
        found = micmac.project(folder)
        seconds.append(time.process_time() - start)
        assert len(found.images.names) == n + 1  # and that of the measured points
    assert seconds[1] < LESS * max(seconds[0], 0.05)


def test_settings_of_many_cameras_are_added_in_linear_time():
    seconds = []
    for n in (500, 2_000):
        cameras = {f"C{k}": {f"k{j}": 1.0 for j in range(10)} for k in range(n)}
        start = time.process_time()
        found = flight_folder.added("# remark\nname = 'x'\n", {"cameras": cameras})
        seconds.append(time.process_time() - start)
        assert found.startswith("# remark")
    assert seconds[1] < LESS * seconds[0]


# --- TOML ------------------------------------------------------------------------------------

DOTTED = (".".join(["a"] * 400_000) + " = 1", f"[{'.'.join(['a'] * 400_000)}]")
DEEP = "".join(f"[a{k}.b.c.d.e.f.g.h]\n" for k in range(40_000))


READING = {
    "check": ("check", "{}"),
    "plan": ("plan", "{}/flight.toml"),
    "import": ("import", "orientations", "{}/eo.csv", "--of", "camera", "--out", "{}"),
}


@pytest.mark.parametrize(
    ("text", "command"),
    [
        (text, name) if k == n else repeats(text, name)
        for k, text in enumerate([*DOTTED, DEEP])
        for n, name in enumerate(READING)
    ],
    ids=lambda one: one[:8],
)
def test_keys_joined_by_dots_take_no_memory(tmp_path, text, command):
    swelling.folder_with(tmp_path, {"flight.toml": text, "eo.csv": swelling.sources.ORIENTATIONS})
    found = told(*(one.format(tmp_path) for one in READING[command]), memory=MEMORY)
    assert found.status == 2
    assert "mistake" not in found.err
    assert found.memory < MEMORY
    assert found.seconds < SECONDS


def test_the_depth_of_keys_is_bounded_before_they_are_read(tmp_path):
    (tmp_path / "x.toml").write_text(DOTTED[0])
    (problem,) = read_toml(tmp_path / "x.toml").problems
    assert str(problem).endswith("x.toml:1: file: 9 keys joined by dots; must be at most 8")


def test_toml_of_strangers_is_parsed_in_one_place():
    named = [p.name for p in (ROOT / "src").rglob("*.py") if "tomllib.load" in p.read_text("utf-8")]
    assert sorted(named) == ["flight_folder.py", "toml_file.py"]  # the first adds to what is read


# --- shared bytes ----------------------------------------------------------------------------


def test_tags_of_a_tiff_share_no_bytes(tmp_path):
    path = tmp_path / "a.tif"
    path.write_bytes(swelling.tags(4_000, count=250_000))
    with pytest.raises(FlightError, match=r"a\.tif:1: file: has tags of more than 1048"):
        metadata.read(path)
    with pytest.raises(FlightError, match=r"a\.tif: has tags of more than 1048"):
        image_from_file(path, of_size(1, 1))
    path.write_bytes(swelling.tags(1, count=25_000, pages=90))  # all pages of a picture
    with pytest.raises(FlightError, match="they may share none"):
        image_from_file(path, of_size(1, 1))


def test_tags_of_exif_share_no_bytes(tmp_path):
    (tmp_path / "a.jpg").write_bytes(swelling.exif(3_900))
    with pytest.raises(FlightError, match=r"a\.jpg:1: file: has tags of more than 5"):
        metadata.read(tmp_path / "a.jpg")


def test_pictures_whose_tags_share_bytes_take_no_memory(tmp_path):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for k in range(40):
        (folder / f"{k}.jpg").write_bytes(swelling.exif(3_900))
    (folder / "a.tif").write_bytes(swelling.tags(4_000, count=250_000))
    found = told("import", "pictures", folder, "--out", tmp_path / "out")
    assert (found.status, found.err.count("they may share none")) == (2, 41)
    assert found.memory < MEMORY / 4
    assert found.seconds < SECONDS


def test_a_link_is_no_second_file(tmp_path):
    found = named(tmp_path, swelling.named_again, "opf", 30)
    assert "is the same file as" in found.err


def named(tmp_path, write, kind, n):
    return imported(tmp_path / "source", kind, write, n)


# --- packed bytes ----------------------------------------------------------------------------


def test_a_false_header_of_an_archive_helps_nothing(tmp_path):
    path = tmp_path / "chunk.zip"
    path.write_bytes(swelling.false_header(150_000_000))
    with zipfile.ZipFile(path) as known:
        (entry,) = known.infolist()
        assert entry.compress_size * safe.LARGEST_RATIO > entry.file_size
    with pytest.raises(FlightError, match="must have at most 200 times as many"):
        safe.member(safe.read(path), "doc.xml")
    found = told("import", "metashape", path, "--out", tmp_path / "out")
    assert (found.status, found.err.count("\n")) == (2, 1)
    assert found.memory < MEMORY / 10


def of_size(width, height):
    return Camera(
        name="C", width_px=width, height_px=height, pixel_mm=0.005, interior=Interior(f=25.0)
    )


def test_pixels_are_compared_with_the_file_before_they_are_unpacked(tmp_path):
    path = tmp_path / "a.tif"
    path.write_bytes(swelling.deflated(60_000, 60_000))
    assert path.stat().st_size < 4_000_000
    with pytest.raises(FlightError, match=r"a\.tif: has 3600000000 bytes of pixels in \d+; 200"):
        image_from_file(path, of_size(60_000, 60_000))
    with pytest.raises(FlightError, match="has 60000 x 60000 px; C has 100 x 90"):
        views.size_on_file(path, of_size(100, 90))


def test_parts_of_a_picture_are_no_larger_than_it_says(tmp_path):
    path, grey = tmp_path / "a.tif", np.zeros((900, 900), np.uint8)
    whole = bytearray(swelling.deflated(90, 90))
    at = whole.rindex(b"\x03\x01\x03\x00\x01\x00\x00\x00\x08")
    for way, what in ((7, "parts of JPEG that are larger"), (34933, "packed in the way 34933")):
        packed = cv2.imencode(".jpg" if way == 7 else ".png", grey)[1].tobytes()
        whole[at + 8 : at + 10] = way.to_bytes(2, "little")
        place = whole.index(b"\x11\x01\x04\x00")
        whole[place + 8 : place + 12] = len(whole).to_bytes(4, "little")
        counts = whole.index(b"\x17\x01\x04\x00")
        whole[counts + 8 : counts + 12] = len(packed).to_bytes(4, "little")
        path.write_bytes(bytes(whole) + packed)
        with pytest.raises(FlightError, match=what):
            image_from_file(path, of_size(90, 90))


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_a_photograph_is_compared_with_its_camera_before_it_is_unpacked(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    cv2.imwrite(str(path), np.zeros((12_000, 12_000), np.uint8))
    with pytest.raises(FlightError, match="has 12000 x 12000 px; C has 100 x 90"):
        views.size_on_file(path, of_size(100, 90))
    if suffix == ".png":
        with pytest.raises(FlightError, match="has 144000000 bytes of pixels in"):
            views.pixels(path, (12_000, 12_000), 1)


def test_measure_unpacks_no_picture_that_is_larger_than_memory(tmp_path):
    flight = written.write_flight(tmp_path / "flight")
    large = {"width_px = 4000": "width_px = 60000", "height_px = 3000": "height_px = 60000"}
    large |= {"pixel_um = 5.0": "pixel_um = 0.5"}
    settings = (flight / "flight.toml").read_text()
    for before, after in large.items():
        settings = settings.replace(before, after)
    (flight / "flight.toml").write_text(settings)
    block = flight / "calibration"
    (block / "image_points.csv").write_text("image,point,col_px,row_px\n")
    header, *rows = (block / "images.csv").read_text().splitlines()
    rows = [f"{row},p.tif" for row in rows[:1]] + [f"{row}," for row in rows[1:]]
    (block / "images.csv").write_text("\n".join([f"{header},file", *rows]))
    (block / "p.tif").write_bytes(swelling.deflated(60_000, 60_000))
    found = told("measure", flight, "--out", tmp_path / "measured")
    assert (found.status, found.err.count("\n")) == (2, 1)
    assert "p.tif: has 3600000000 bytes of pixels in" in found.err
    assert found.memory < MEMORY / 4


# --- results ---------------------------------------------------------------------------------


def test_a_quotation_mark_without_another_makes_one_row_in_linear_time(tmp_path):
    seconds = []
    for n in (50_000, 200_000):
        path = tmp_path / "parameters.csv"
        path.write_bytes(table_files.header("parameters") + b'a,"x\n' + b"b,y\n" * n)
        start = time.process_time()
        (row,) = table_files.others(path, (b"-",))
        seconds.append(time.process_time() - start)
        assert row[0] == "a"
        assert len(row[1]) == 5 + 4 * n
    assert seconds[1] < LESS * max(seconds[0], 0.02)
