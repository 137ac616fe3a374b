"""A bad file of any program is one line with its place: program, file, old text, new text, line."""

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
    "mmvii": (written_micmac.mmvii_write, micmac.read, ""),
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
CALIB = "MMVII-PhgrProj/Ori/A/Calib-PerspCentral-C.xml"
POSE = "MMVII-PhgrProj/Ori/A/Ori-PerspCentral-a.JPG.xml"
MES_IM = "MMVII-PhgrProj/PointsMeasure/S/MesIm-a.JPG.xml"
MES_GCP = "MMVII-PhgrProj/PointsMeasure/S/MesGCP-S.xml"
PARAMS = "p_calibrated_camera_parameters.txt"
EXTERNAL = "p_calibrated_external_camera_parameters.txt"

ROWS = [
    ("colmap", "cameras.txt", "OPENCV", "EQUIRECTANGULAR", "cameras.txt:2: camera: lens model 'EQ"),
    ("colmap", "cameras.txt", "1450.0", "-1450.0", ":2: camera: OPENCV [-1450.0"),
    ("colmap", "cameras.txt", "-0.05 ", "", "has 7 parameters; must be fx, fy, cx, cy, k1, k2, p1"),
    ("colmap", "cameras.txt", "2 OPENCV", "1 OPENCV", ":3: CAMERA_ID: 1 is there twice"),
    ("colmap", "cameras.txt", "1280", "0", "0.0 x 960.0 px"),
    ("colmap", "cameras.txt", "-0.05 ", "-5 ", "cameras.txt:2: camera: camera 1: lens: expected a"),
    ("colmap", "images.txt", " 1 cam0/one", " 9 cam0/one", "camera 9; must be in cameras"),
    ("colmap", "images.txt", "cam0/two", "cam0/one", "'cam0/one.jpg' is there twice"),
    ("colmap", "images.txt", "cam0/one", "=cam0/one", "would be computed as a formula"),
    ("colmap", "images.txt", "20.5 -1", "20.5", "images.txt:3: POINTS2D: 29 cells; must be X, Y"),
    ("colmap", "images.txt", "20.5 -1", "20.5 0.5", "POINT3D_ID: is not whole"),
    ("colmap", "points3D.txt", "1 ", "1x ", "points3D.txt:1: POINT3D_ID: '1x'; must be a whole"),
    ("colmap", "rigs.txt", "CAMERA 1", "IMU 1", "REF_SENSOR_TYPE: 'IMU'; must be CAMERA"),
    ("colmap", "frames.txt", " 2 CAMERA", " 3 CAMERA", "DATA_IDS: 6 cells; must be 3 times 3"),
    ("metashape", "c.xml", "<f>1450.0</f>", "<fx>1.0</fx>", "calibration: has <fx>: PhotoScan"),
    ("metashape", "c.xml", "<f>1450.0</f>", "<f>-3</f>", "f: '-3'; must be positive"),
    ("metashape", "c.xml", "<f>1450.0</f>", "<f>nan</f>", "f: 'nan'; must be a finite number"),
    ("metashape", "c.xml", 'sensor_id="1"', 'sensor_id="7"', "camera sensor_id: '7'; must be a"),
    ("metashape", "c.xml", 'master_id="2"', 'master_id="77"', "camera master_id: '77'; must be a"),
    ("metashape", "c.xml", 'label="P3"', 'label="P2"', "marker label: 'P2' is there twice"),
    ("metashape", "c.xml", 'label="P3"', 'label="=P3"', "marker label: '=P3' would be computed"),
    ("metashape", "c.xml", "<rotation>", "<rotation>9 ", "must be 9 numbers"),
    ("metashape", "c.xml", "<scale>4.7</scale>", "<scale>0</scale>", "scale: 0; must be positive"),
    ("metashape", "c.xml", "PROJCS[", "PROJXX[", "reference: coordinate system is none that PROJ"),
    ("metashape", "c.xml", "<document", "<kml", "file: mismatched tag; must be valid XML"),
    ("saved", "s.xml", ">frame<", ">equirectangular<", "s.xml:2: projection: 'equirectangular'"),
    ("saved", "s.xml", ">1280<", ">12.5<", "s.xml:3: width: '12.5'; must be a positive whole"),
    ("saved", "s.xml", "<f>1450.0</f>", "", "s.xml:1: calibration: <f> is missing"),
    ("saved", "s.xml", SAVED, "<kml/>", "s.xml:1: kml: is no file of Metashape"),
    ("saved", "s.xml", SAVED, "<document/>", "s.xml:1: document: has no <chunk>"),
    ("saved", "s.xml", SAVED, "PK\x03\x04nothing", "is no ZIP archive"),
    ("opf", "project.opf", '"camera-list.json"', '"../c.json"', "must lie below the project"),
    ("opf", "project.opf", '"uri": "camera-list.json"', '"uri": "none.json"', "none.json"),
    ("opf", "input-cameras.json", '"yaw_pitch_roll"', '"quaternion"', "'quaternion'; must be yaw_"),
    ("opf", "calibrated-cameras.json", "1450.0", "-3", "focal_length_px: -3; must be positive"),
    ("opf", "calibrated-cameras.json", '"perspective"', '"fisheye"', "'affine' is missing"),
    ("opf", "input-control-points.json", '"P3"', '"P2"', "'P2' is there twice"),
    ("opf", "input-control-points.json", '"P3"', '"=P3"', "would be computed as a formula"),
    ("opf", "camera-list.json", "one.jpg", "=one.jpg", "would be computed as a formula"),
    ("opf tracks", GLTF, "positions.bin", "../x.bin", "must lie below the project's folder"),
    ("opf tracks", GLTF, "positions.bin", "none.bin", "none.bin"),
    ("opensfm", "reconstruction.json", '"shots"', '"shot"', "0: 'shots' is missing"),
    ("opensfm", "reconstruction.json", '"camera": "m"', '"camera": "n"', "'n' is missing"),
    ("opensfm", "reconstruction.json", '"0.jpg"', '"=1"', "image: '=1' would be computed"),
    ("opensfm", "reconstruction.json", '"brown"', '"spherical"', "has rays in all directions"),
    ("opensfm", "reconstruction.json", '"brown"', '"division"', "must be one of perspective"),
    ("opensfm", "reconstruction.json", '"brown"', "3.5", "projection_type: 3.5; must be text"),
    ("opensfm", "reconstruction.json", '"focal_x": 0.9', '"x": 0.9', "'focal_x' is missing"),
    ("opensfm", "reconstruction.json", '"focal_x": 0.9', '"focal_x": 0', "divided by the longer"),
    ("opensfm", "reconstruction.json", '"width": 400', '"width": -5', "must be a positive whole"),
    ("opensfm", "tracks.csv", "VERSION_v2", "VERSION_v9", "tracks.csv:1: version: 'OPENSFM_TRACKS"),
    ("opensfm", "tracks.csv", "\t0.01\t1\t2\t3\t-1\t-1", "", ""),
    ("micmac", DOWN, "<L1>1 0 0", "<L1>1 0.1 0", "CodageMatr: L1, L2, L3 are no rotation"),
    ("micmac", DOWN, "<L1>1 0 0", "<L1>-1 0 0", "CodageMatr: L1, L2, L3 are no rotation"),
    ("micmac", DOWN, "eConvApero_DistM2C", "eConvAngErdas", "KnownConv: 'eConvAngErdas'; must be"),
    ("micmac", DOWN, "L1>1 0 0</L1", "L4>1 0 0</L4", "<L1> is missing"),
    ("micmac", DOWN, "AutoCal_C", "AutoCal_D", "'AutoCal_D.xml' is not there"),
    ("micmac", AUTOCAL, "_DistM2C", "_DistC2M", "KnownConv: 'eConvApero_DistC2M'; must be eConvA"),
    ("micmac", AUTOCAL, "<F>1000</F>", "", "<F> is missing"),
    ("micmac", AUTOCAL, "<F>1000</F>", "<F>-5</F>", "F: '-5'; must be a focal length in pixels"),
    ("micmac", AUTOCAL, "1000 800", "1000", "SzIm: '1000'; must be 2 numbers"),
    ("micmac", "measured.xml", "<NamePt>T<", "<NamePt>P<", "'P' stands twice in 'a.JPG'"),
    ("micmac", "measured.xml", "1 2</PtIm>", "1</PtIm>", "PtIm: '1'; must be 2 numbers"),
    ("micmac", "points.xml", "<Pt>10 20 0", "<Pt>10 20 nan", "Pt: '10 20 nan'; must be 3 numbers"),
    ("micmac", "points.xml", "<NamePt>P</NamePt>", "", "<NamePt> is missing"),
    ("mmvii", CALIB, '"Stenope"', '"EquiRect"', "Projection: 'EquiRect'; must be one of Stenope"),
    ("mmvii", CALIB, "<F>1000</F>", "<F>0</F>", "F: '0'; must be a focal length in pixels"),
    ("mmvii", CALIB, "1000 800", "1000", "NbPix: '1000'; must be 2 numbers"),
    ("mmvii", CALIB, "<b2>", "<y2>1</y2><b2>", "y2: 1; must be 0; K1 to K6, p1, p2, b1, b2 are"),
    ("mmvii", CALIB, "Mode>1<", "Mode>0<", "b1: 0.0003; must be 0; K1 to K6, p1, p2"),
    ("mmvii", CALIB, "<K1>-0.1", "<K1>-9", "lens: expected a ray for every pixel"),
    ("mmvii", POSE, "<AxeI>1 0", "<AxeI>1 0.1", "AxeI, AxeJ, AxeK are no rotation; must be the"),
    ("mmvii", POSE, "<Center>10 20", "<Center>10", "Center: '10 100'; must be 3 numbers"),
    ("mmvii", MES_IM, '"Q"', '"P"', "'P' stands twice in 'a.JPG'; must once"),
    ("mmvii", MES_IM, '"Q"', '"=Q"', "point: '=Q' would be computed as a formula"),
    ("mmvii", MES_GCP, '"Q"', '"P"', "point 'P' stands twice; must stand once"),
    ("mmvii", MES_GCP, "1e-4 0 0 1e-4", "-1 0 0 1e-4", "Sigma2: '-1 0 0 1e-4 0 4e-4'; must have"),
    ("pix4d", PARAMS, "camera matrix K [3x3]", "fisheye", ":2: head: 'fisheye'; must be 'camera m"),
    ("pix4d", PARAMS, "one.jpg 1280", "one.jpg 0", ":9: size: '0'; must be a positive whole"),
    ("pix4d", PARAMS, "one.jpg", "two.jpg", "image: 'two.jpg' is there twice; must be once"),
    ("pix4d", PARAMS, "1450.0 0.0", "-3.0 0.0", ":10: focal length: '-3.0'; must be a focal"),
    ("pix4d", PARAMS, "0.0 0.0 1.0\n", "0.0 0.1 1.0\n", "K: is no camera matrix; must be fx s cx"),
    ("pix4d", PARAMS, "-0.05 ", "-50 ", "camera: CAM1: lens: expected a ray for every pixel"),
    ("pix4d", PARAMS, "two.jpg 1280 960\n", "", ":19: size: '0.0'; must be a positive whole"),
    ("pix4d", EXTERNAL, "one.jpg 67", "one.jpg 68", "'one.jpg' is off by 1e+04 m and"),
    ("pix4d", EXTERNAL, "imageName", "name", "head: is another; must be imageName X Y Z Omega"),
    ("pix4d", "p_pmatrix.txt", "one.jpg ", "one.jpg 9", "matrix: that of 'one.jpg' is off by "),
    ("pix4d", "p_offset.xyz", "676000.0 ", "", "offset: is missing, the line has 2 cells; must be"),
    ("pix4d", "p_wkt.prj", "PROJCS[", "PROJXX[", "wkt.prj:1: crs: coordinate system is none that"),
    ("bingo", "image.dat", "6 0.1", "5 0.1", "image.dat:3: point: '5' stands twice in image '1'"),
    ("bingo", "image.dat", "5 0.1 0.2", "5 0.1 x", "image.dat:2: y: 'x'; must be a finite number"),
    ("bingo", "image.dat", LIST, "-99\n", "image.dat:1: block: -99 without a header"),
    ("bingo", "image.dat", LIST, "1 c\n", "image.dat:1: file: has no measurement"),
    ("bingo", "geoin.dat", "5 1 2 3", "5 1 2", "geoin.dat:1: east, north, height: is missing, the"),
    ("bingo", "geoin.dat", "CHCK 6", "CHCK 5", "geoin.dat:2: point: '5' stands twice; must stand"),
    ("patb", "a.im", "6 0.1", "5 0.1", "a.im:3: point: '5' stands twice in image '1'"),
    ("odm", "gcp_list.txt", "EPSG:32610", "WGS84 UTM 99N", ":1: CRS: 'WGS84 UTM 99N': "),
    ("odm", "gcp_list.txt", "EPSG:32610", "+proj=utm +zone=10 +nadgrids=/etc/passwd", "passwd"),
    ("odm", "gcp_list.txt", GCP_LIST, "EPSG:32610\n", ":1: file: has no point after the CRS"),
    ("odm", "gcp_list.txt", "4 5 a x", "4 5", ":2: image: is missing, the line has 5 cells"),
    ("odm", "gcp_list.txt", "4 5 a x", "4 5,5 a x", ":2: row: '5,5'; must be a finite number"),
    ("odm", "gcp_list.txt", "1 2 3", "1 2 inf", ":2: z: 'inf'; must be a finite number"),
    ("odm", "gcp_list.txt", "b y", "b x", ":3: name: 'x' has different coordinates"),
    ("odm", "gcp_list.txt", "7 2 3", "1 2 3", ":3: name: 'y' has the coordinates of 'x'"),
    ("odm", "gcp_list.txt", "7 2 3 4 5 b y", "1 2 3 4 6 a x", ":3: image: 'x' stands twice in 'a'"),
    ("odm", "gcp_list.txt", "a x", "=cmd()", ":2: name: '=cmd()' would be computed as a formula"),
]


@pytest.mark.parametrize(("program", "file", "old", "new", "message"), ROWS)
def test_what_is_wrong_is_told_with_its_place(tmp_path, program, file, old, new, message):
    write, read, given = PROGRAMS[program]
    folder = tmp_path / "p"
    if program not in ("opf", "opf adjusted", "opf tracks", "micmac", "mmvii"):
        folder.mkdir()
    write(folder)
    path = folder / file
    content = path.read_text()
    assert old in content
    path.write_text(content.replace(old, new, 1))
    if not message:
        read(folder / given)
        return
    with pytest.raises(FlightError, match=re.escape(message)) as told:
        read(folder / given)
    assert re.fullmatch(r"(?s).+:[1-9]\d*: [^:]+.*: .+; .+", str(told.value))


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_good_projects_are_read(tmp_path, program):
    write, read, given = PROGRAMS[program]
    folder = tmp_path / "p"
    if program not in ("opf", "opf adjusted", "opf tracks", "micmac", "mmvii"):
        folder.mkdir()
    write(folder)
    assert read(folder / given).found


def test_crs_that_cannot_be_used_are_refused(tmp_path):
    folder = written_opensfm.write(tmp_path / "p")
    with pytest.raises(FlightError, match=r"--crs:1: crs: .*must be projected and in metres"):
        opensfm.read(folder, crs="EPSG:4326")
    model = written_colmap.write_text(tmp_path / "m")
    with pytest.raises(FlightError, match=r"--crs: .* is not a projected CRS"):
        colmap.read(model, crs="EPSG:4326")
    assert scene.CRS in colmap.read(model, crs=scene.CRS).settings["crs"]
