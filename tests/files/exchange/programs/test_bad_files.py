"""A bad file of any program is one line with its place: program, file, old text, new text, line."""

import json
import re

import pytest

from acx4files.exchange.programs import (
    colmap,
    metashape,
    micmac,
    opensfm,
    opf,
    photo_lists,
    pix4d,
)
from acx4lib.errors import FlightError
from support.projects import colmap as written_colmap
from support.projects import metashape as written_metashape
from support.projects import micmac as written_micmac
from support.projects import opensfm as written_opensfm
from support.projects import opf as written_opf
from support.projects import pix4d as written_pix4d
from support.projects import scene

LIST = "1 c\n5 0.1 0.2\n6 0.1 0.2\n-99\n2 c\n5 0.3 0.2\n-99\n"
GEOIN = "CONT 5 1 2 3\nCHCK 6 4 5 6\n"
GCP_LIST = "EPSG:32610\n1 2 3 4 5 a x\n7 2 3 4 5 b y\n"
SIZED = {"size": "640x480", "pixel_um": 2.0}
SAVED = """<calibration>
<projection>frame</projection>
<width>1280</width><height>960</height>
<f>1450.0</f></calibration>"""
CONTROL = {
    "points": [
        {
            "id": "A",
            "position": {"latitude": -25.4, "longitude": -49.3, "altitude": 905.0},
            "observations": [{"shot_id": "0.jpg", "projection": [0.0, 0.0]}],
        }
    ]
}


def text(name, content):
    """Return a writer of one file."""

    def write(folder):
        (folder / name).write_text(content)

    return write


def write_opensfm(folder):
    written_opensfm.write(folder, ground_control_points=CONTROL)


def write_bingo(folder):
    text("image.dat", LIST)(folder)
    text("geoin.dat", GEOIN)(folder)


ADJUSTED = {"orientations": "adjusted"}
PROGRAMS = {
    "colmap": (written_colmap.write_text, colmap.read, ""),
    "metashape": (
        lambda folder: written_metashape.write(folder / "c.xml"),
        lambda path: metashape.read(path, **ADJUSTED),
        "c.xml",
    ),
    "saved": (text("s.xml", SAVED), metashape.read, "s.xml"),
    "opf": (written_opf.write, opf.read, ""),
    "opf adjusted": (written_opf.write, lambda path: opf.read(path, **ADJUSTED), ""),
    "opf tracks": (lambda folder: written_opf.write(folder, tracks=True), opf.read, ""),
    "opensfm": (write_opensfm, opensfm.read, ""),
    "micmac": (written_micmac.write, micmac.read, ""),
    "pix4d": (written_pix4d.write, pix4d.read, ""),
    "bingo": (write_bingo, lambda path: photo_lists.read_bingo(path, **SIZED), ""),
    "patb": (
        text("a.im", LIST),
        lambda path: photo_lists.read_patb(path, unit="mm", **SIZED),
        "a.im",
    ),
    "odm": (text("gcp_list.txt", GCP_LIST), opensfm.read_control, "gcp_list.txt"),
}
"""What writes a good project, what reads it, and which of its files is given to that."""

DOWN = "Ori-A/Orientation-a.JPG.xml"
AUTOCAL = "Ori-A/AutoCal_C.xml"
GLTF = "points/sparse.gltf"
PARAMS = "p_calibrated_camera_parameters.txt"
EXTERNAL = "p_calibrated_external_camera_parameters.txt"

ROWS = [
    ("colmap", "cameras.txt", "OPENCV", "EQUIRECTANGULAR", "cameras.txt:2: camera: lens model 'EQ"),
    ("colmap", "cameras.txt", "2 OPENCV", "1 OPENCV", ":3: camera: camera 1 is there twice"),
    ("colmap", "cameras.txt", "-0.05 ", "-5 ", "cameras.txt:2: camera: camera 1: lens: expected a"),
    ("colmap", "images.txt", "20.5 -1", "20.5 0.5", "POINT3D_ID: is not whole"),
    ("colmap", "rigs.txt", "CAMERA 1", "IMU 1", "rig: reference sensor 'IMU'; must be CAMERA"),
    ("metashape", "c.xml", "<f>1450.0</f>", "<fx>1.0</fx>", "calibration: has <fx>: PhotoScan"),
    ("metashape", "c.xml", "<f>1450.0</f>", "<f>-3</f>", "f: '-3'; must be positive"),
    ("metashape", "c.xml", 'label="P3"', 'label="P2"', "marker: 'P2' is there twice"),
    ("metashape", "c.xml", "PROJCS[", "PROJXX[", "reference: coordinate system is none that PROJ"),
    ("saved", "s.xml", ">frame<", ">equirectangular<", "s.xml:2: projection: 'equirectangular'"),
    ("saved", "s.xml", "<f>1450.0</f>", "", "s.xml:1: calibration: <f> is missing"),
    ("saved", "s.xml", SAVED, "PK\x03\x04nothing", "is no ZIP archive"),
    (
        "opf",
        "project.opf",
        '"version": "1.0", "format"',
        '"version": "2", "format"',
        "version: '2'",
    ),
    ("opf", "project.opf", '"camera-list.json"', '"../c.json"', "must lie below the project"),
    (
        "opf",
        "input-cameras.json",
        '"sensor_id": 2',
        '"sensor_id": 9',
        "sensor_id: '9'; must be the",
    ),
    ("opf", "calibrated-cameras.json", "1450.0", "-3", "focal_length_px: -3; must be positive"),
    ("opf", "input-control-points.json", '"P3"', '"P2"', "'P2' is there twice"),
    ("opf tracks", GLTF, "positions.bin", "../x.bin", "must lie below the project's folder"),
    ("opensfm", "reconstruction.json", '"shots"', '"shot"', "0: 'shots' is missing"),
    ("opensfm", "reconstruction.json", '"0.jpg"', '"=1"', "image: '=1' would be computed"),
    (
        "opensfm",
        "reconstruction.json",
        '"brown"',
        '"spherical"',
        "'spherical'; must be one of perspective",
    ),
    ("opensfm", "reconstruction.json", '"focal_x": 0.9', '"focal_x": 0', "divided by the longer"),
    ("opensfm", "tracks.csv", "VERSION_v2", "VERSION_v9", "tracks.csv:1: version: 'OPENSFM_TRACKS"),
    ("opensfm", "tracks.csv", "\t0.01\t1\t2\t3\t-1\t-1", "", ""),
    (
        "opensfm",
        "ground_control_points.json",
        "-25.4",
        "-95.4",
        "latitude: -95.4; must lie between",
    ),
    ("micmac", DOWN, "<L1>1 0 0", "<L1>1 0.1 0", "CodageMatr: L1, L2, L3 are no rotation"),
    ("micmac", DOWN, "<L1>1 0 0", "<L1>-1 0 0", "CodageMatr: L1, L2, L3 are no rotation"),
    (
        "micmac",
        DOWN,
        "eProjStenope",
        "eProjOrthographique",
        "TypeProj: 'eProjOrthographique'; must",
    ),
    ("micmac", DOWN, "AutoCal_C", "AutoCal_D", "'AutoCal_D.xml' is not there"),
    (
        "micmac",
        AUTOCAL,
        "<ModNoDist></ModNoDist>",
        "<ModGrid></ModGrid>",
        "ModGrid: distortion 'ModGrid'; must be ModNoDist",
    ),
    (
        "micmac",
        DOWN,
        "<Externe>",
        "<Interne/><Externe>",
        "Interne: a calibration in an orientation",
    ),
    ("micmac", AUTOCAL, "<F>1000</F>", "", "<F> is missing"),
    ("micmac", AUTOCAL, "<F>1000</F>", "<F>-5</F>", "F: '-5'; must be a focal length in pixels"),
    ("micmac", "measured.xml", "<NamePt>T<", "<NamePt>P<", "'P' stands twice in 'a.JPG'"),
    ("micmac", "points.xml", "<Pt>10 20 0", "<Pt>10 20 nan", "Pt: '10 20 nan'; must be 3 numbers"),
    ("pix4d", PARAMS, "camera matrix K [3x3]", "fisheye", ":2: head: 'fisheye'; must be 'camera m"),
    ("pix4d", PARAMS, "one.jpg", "two.jpg", "image: 'two.jpg' is there twice; must be once"),
    ("pix4d", EXTERNAL, "one.jpg 67", "one.jpg 68", "'one.jpg' is off by 1e+04 m and"),
    ("pix4d", "p_wkt.prj", "PROJCS[", "PROJXX[", "wkt.prj:1: crs: coordinate system is none that"),
    (
        "bingo",
        "image.dat",
        "6 0.1",
        "5 0.1",
        "image.dat:3: image, point: '1', '5' stands in line 2",
    ),
    ("bingo", "image.dat", "5 0.1 0.2", "5 0.1 x", "image.dat:2: y: 'x'; must be a finite number"),
    ("bingo", "image.dat", LIST, "1 c\n", "image.dat:1: file: has no measurement"),
    ("patb", "a.im", "6 0.1", "5 0.1", "a.im:3: image, point: '1', '5' stands in line 2"),
    ("odm", "gcp_list.txt", "EPSG:32610", "WGS84 UTM 99N", ":1: CRS: 'WGS84 UTM 99N': "),
    ("odm", "gcp_list.txt", "EPSG:32610", "+proj=utm +zone=10 +nadgrids=/etc/passwd", "passwd"),
    ("odm", "gcp_list.txt", GCP_LIST, "EPSG:32610\n", ":1: file: has no point after the CRS"),
    ("odm", "gcp_list.txt", "4 5 a x", "4 5,5 a x", ":2: col, row: '5,5'; must be a finite number"),
]


@pytest.mark.parametrize(("program", "file", "old", "new", "message"), ROWS)
def test_what_is_wrong_is_told_with_its_place(tmp_path, program, file, old, new, message):
    write, read, given = PROGRAMS[program]
    folder = tmp_path / "p"
    if program not in ("opf", "opf adjusted", "opf tracks", "micmac"):
        folder.mkdir()
    write(folder)
    path = folder / file
    content = path.read_text()
    assert old in content
    assert read(folder / given).found
    path.write_text(content.replace(old, new, 1))
    if not message:
        read(folder / given)
        return
    with pytest.raises(FlightError, match=re.escape(message)) as told:
        read(folder / given)
    assert re.fullmatch(r"(?s).+:[1-9]\d*: [^:]+.*: .+; .+", str(told.value))


@pytest.mark.parametrize("program", ["colmap", "opf", "opensfm", "micmac", "pix4d"])
def test_a_folder_without_a_project_is_told(tmp_path, program):
    (tmp_path / "a.json").write_text("{}")
    (tmp_path / "a.xml").write_text("<x/>")
    with pytest.raises(FlightError, match=r"(folder: has n|has no XML of MicMac; must hold Ori-)"):
        PROGRAMS[program][1](tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["accessors"][0].update(count=10), "mmap length is greater"),
        (lambda d: d["accessors"][3].update(type="VEC3"), "pyopf cannot read it"),
        (lambda d: d["accessors"][1].update(count=8), "are not as many"),
        (lambda d: d["bufferViews"][1].update(byteOffset=-4), "pyopf cannot read it"),
        (lambda d: d["nodes"][0].update(mesh=7), "index out of range; must be tie points"),
    ],
)
def test_tie_points_of_opf_that_do_not_fit_are_told(tmp_path, change, message):
    folder = written_opf.write(tmp_path / "p", tracks=True)
    path = folder / "points" / "sparse.gltf"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(FlightError, match=message):
        opf.read(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda w: w["shots"].clear(), r"0.shots: has no shot; must have one at least"),
        (lambda w: w["shots"]["0.jpg"].update(rotation=[1, 2]), r"\[1, 2\]; must be a list of 3"),
        (lambda w: w["shots"]["0.jpg"].update(rotation=[1e9, 0, 0]), "must be a rotation vector"),
    ],
)
def test_shots_of_opensfm_that_cannot_be_are_told(tmp_path, change, message):
    whole = written_opensfm.reconstruction()
    change(whole)
    with pytest.raises(FlightError, match=message):
        opensfm.read(written_opensfm.write(tmp_path / "p", whole))


def test_crs_that_cannot_be_used_are_refused(tmp_path):
    folder = written_opensfm.write(tmp_path / "p")
    with pytest.raises(FlightError, match=r"--crs:1: crs: .*must be projected and in metres"):
        opensfm.read(folder, crs="EPSG:4326")
    model = written_colmap.write_text(tmp_path / "m")
    with pytest.raises(FlightError, match=r"--crs: .* is not a projected CRS"):
        colmap.read(model, crs="EPSG:4326")
    assert scene.CRS in colmap.read(model, crs=scene.CRS).settings["crs"]
