"""Flights that are made to be computed, or to open other files."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from acx4files.flight.tables import name_fault
from acx4lib.geometry.geodesy import GridSystem, crs_fault
from support.flights.written import write_flight
from support.helpers import flight_problems as problems

IMAGES = "calibration/images.csv"
CONTROL = "control_points.csv"
TOML = "flight.toml"


def change(folder: Path, file: str, old: str, new: str) -> None:
    text = (folder / file).read_text("utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1), "utf-8")


# --- names -----------------------------------------------------------------------------------

REFUSED = [
    *("=1+1", "@SUM(A1)", "\tx", "\rx", "+x", "-x", "-1-1", "+1,5", "- 5", "--1"),
    *(" =1+1", "\u00a0=1"),
    *("\uff1d1+1", "\uff0dx", "\uff20x", "﹦1", "⩵", "\u200b=1", "a;=1", "a; +x", "a\nb", "a\x85b"),
    *("a\x7fb", "a\x1b[0m"),
    *("a\u2028b", "a\u2029b", "a\u202eb", "a\u2066b", "a\u200fb", "\ufffe", "x" * 201),
]


@pytest.mark.parametrize("name", REFUSED)
def test_a_name_that_is_a_formula_or_no_line_of_text_is_refused_everywhere(tmp_path, name):
    assert name_fault(name)
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


def write_geoid(path: Path, height: float = 3.0) -> None:
    header = struct.pack(">4d2i", -27.0, -51.0, 1.0, 1.0, 4, 4)
    path.write_bytes(header + np.full(16, height, dtype=">f4").tobytes())


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
