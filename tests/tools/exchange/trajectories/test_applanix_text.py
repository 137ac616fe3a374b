"""Text exports of POSPac: the documented layout, and what real headings look like."""

import pyproj
import pytest

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4tools.exchange.trajectories import applanix_text
from acx4tools.exchange.trajectories.orientation_table import TableOptions
from acx4tools.exchange.trajectories.orientations import Meaning
from support.reference_files import needs

UNITS = "(position in Meters, orientation in Degrees, lat, long in Deg)"
PREAMBLE = f"POSPac\nBoresight values used: tx 0.1 deg\n\n{UNITS}\n"
HEADING = "ID, # EVENT, TIME (s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG"
ROW = "365324.63 3096141.49 2088.37 -1.05 0.32 179.18 27.984 -82.369"
LON, LAT = pyproj.Proj("EPSG:32617")(365324.63, 3096141.49, inverse=True)
PLACE = f"{LAT:.7f} {LON:.7f}"
"""Of the row's east and north."""


def read(tmp_path, text, **meaning):
    (tmp_path / "eo.txt").write_text(text)
    given = Meaning(**{"crs": "EPSG:32617", **meaning})
    return applanix_text.read(tmp_path / "eo.txt", given, TableOptions())


def rows(*cells):
    return "".join(f"{cell}\n" for cell in cells)


def sequence(axes):
    names = {"x": "omega", "y": "phi", "z": "kappa"}
    said = zip(("First", "Second", "Third"), axes, strict=True)
    lines = [f"{n} rotation is about the '{a}' axis by the '{names[a]}' angle." for n, a in said]
    return rows("Sequence of the rotation from mapping to image frame:", *lines)


@pytest.mark.parametrize(
    ("heading", "begin", "name"),
    [
        ("ID # EVENT TIME(s) EASTING NORTHING ELLIPSOID HEIGHT OMEGA PHI KAPPA", "i7 3", "i7"),
        (HEADING.replace(", LAT, LONG", ""), "i7 3", "i7"),
        (HEADING.replace(", LAT, LONG", ""), "\t3", "3"),
        (HEADING.replace(", LAT, LONG", "").replace(", ", "\t"), "\t3", "3"),
    ],
)
def test_exterior_orientations(tmp_path, heading, begin, name):
    body = " ".join(ROW.split()[:6])
    row = f"{begin} 564155.65 {body}"
    if begin.startswith("\t"):
        row = f"\t3\t564155.65\t{body}".replace(" ", "\t")
    brought = read(tmp_path, f"{PREAMBLE}\n {heading}\n\n{row}\n")
    table = brought.tables["calibration/trajectory.csv"]
    assert table["exposure"] == [name]
    assert table["time_s"][0] == 564155.65
    assert [table[f"{n}_deg"][0] for n in ("omega", "phi", "kappa")] == [-1.05, 0.32, 179.18]
    assert "those of the camera" in brought.assumed[2]
    assert "Boresight values used: tx 0.1 deg" in brought.found[-1]


def test_a_preamble_of_windows(tmp_path):
    row = f"7 3 1.5 {' '.join(ROW.split()[:6])} {PLACE}"
    text = f"Vol d'été\n{PREAMBLE}{HEADING}\n{row}\n"
    (tmp_path / "eo.txt").write_bytes(text.encode("cp1252"))
    brought = applanix_text.read(tmp_path / "eo.txt", Meaning(crs="EPSG:32617"), TableOptions())
    assert "Vol d'été" in brought.found[-1]
    assert any("Windows-1252" in line for line in brought.assumed)


def test_positions_in_two_forms_say_whether_the_crs_is_right(tmp_path):
    text = f"{PREAMBLE}{HEADING}\n7 3 1.5 {' '.join(ROW.split()[:6])} {PLACE}\n"
    brought = read(tmp_path, text)
    assert any("differ by at most" in line for line in brought.found)
    with pytest.raises(FlightError, match=r"eo.txt:6: east, north: .* is --crs right\?"):
        read(tmp_path, text, crs="EPSG:32618")


def test_the_units_may_stand_below_the_heading(tmp_path):
    """As POSPac MMS writes them: heading, blank line, units, blank line, rows."""
    units = UNITS.replace("Degrees", "Grads")
    row = f"3 564155.65 {' '.join(ROW.split()[:6])}"
    heading = HEADING.replace(", LAT, LONG", "")
    brought = read(tmp_path, f"*****\n POSPac\n {heading}\n\n {units} \n\n{row}\n")
    table = brought.tables["calibration/trajectory.csv"]
    assert table["exposure"] == ["3"]
    assert table["omega_deg"][0] == pytest.approx(-1.05 * 0.9)


@pytest.mark.parametrize(("axes", "order"), [("xyz", "Rx(omega) Ry"), ("yxz", "Ry(phi) Rx")])
def test_the_sequence_of_rotations_is_the_preambles(tmp_path, axes, order):
    row = f"7 3 1.5 {' '.join(ROW.split()[:6])} {PLACE}"
    brought = read(tmp_path, f"{PREAMBLE}{sequence(axes)}{HEADING}\n{row}\n")
    assert f"R = {order}" in brought.assumed[1]


def test_the_trajectory_at_events_is_the_imus(tmp_path):
    units = "(time in Sec, position in Meters, orientation angles and SD in Degrees)"
    heading = (
        "TIME, DISTANCE, EASTING, NORTHING, ELLIPSOID HEIGHT, LATITUDE, LONGITUDE, "
        "ELLIPSOID HEIGHT, ROLL, PITCH, HEADING, EAST VELOCITY, NORTH VELOCITY, UP VELOCITY, "
        "EAST SD, NORTH SD, HEIGHT SD, ROLL SD, PITCH SD, HEADING SD"
    )
    row = f"5.25 100 365324.63 3096141.49 88.5 {PLACE} 88.5 1 2 3 4 5 6 .05 .06 .07 .002 .003 .004"
    brought = read(tmp_path, f"{units}\n{heading}\n{row}\n", heights=-25.0)
    table = brought.tables["calibration/trajectory.csv"]
    assert (table["exposure"], table["height_m"][0]) == (["1"], 113.5)
    assert table["lat_deg"][0] == pytest.approx(LAT, abs=1e-9)
    assert [table[f"{n}_deg"][0] for n in ("roll", "pitch", "heading")] == [1, 2, 3]
    assert table["sigma_heading_deg"][0] == pytest.approx(0.004)
    assert "those of the IMU" in brought.assumed[2]
    zero = f"Boresight values: tx = 0.0000 arc min\n{units}\n{heading}\n{row}\n"
    assert "those of the IMU" in read(tmp_path, zero).assumed[2]
    applied = read(tmp_path, zero.replace("0.0000", "0.0100"))
    assert "those of the camera" in applied.assumed[2]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("nothing\n", "eo.txt:1: heading: is not there; must have a line with EASTING"),
        (f"{PREAMBLE}{HEADING}\n", "has a heading and no rows"),
        (f"{PREAMBLE}{HEADING}\n1 2 3\n", "eo.txt:6: row: has 3 cells; must have 11"),
        (f"{PREAMBLE}{HEADING}, FOO\n{ROW}\n", "eo.txt:5: heading: 'FOO' is not known"),
        (f"{PREAMBLE}{HEADING.replace('EASTING', 'X')}\n{ROW}\n", "heading: 'X' is not known"),
        (f"{PREAMBLE}{sequence('zyx')}{HEADING}\n7 3 1 {ROW}\n", "eo.txt:6: rotations: "),
        (f"{PREAMBLE.replace('Meters', 'Feet')}{HEADING}\n7 3 1 {ROW}\n", "eo.txt:4: units:"),
        (
            f"{PREAMBLE}{HEADING.replace('ELLIPSOID', 'ORTHOMETRIC')}\n7 3 1 {ROW}\n",
            "ORTHOMETRIC HEIGHT: is no ellipsoidal height; needs --heights",
        ),
        (
            f"{PREAMBLE}{HEADING}\n7 3 1.5 {ROW.replace('179.18', 'x')}\n",
            "eo.txt:6: kappa: 'x'; must be a finite number",
        ),
    ],
)
def test_other_texts_are_refused(tmp_path, text, says):
    with pytest.raises(FlightError) as raised:
        read(tmp_path, text)
    assert says in str(raised.value)


def test_grads_are_read_where_the_text_says_so(tmp_path):
    text = f"{PREAMBLE.replace('orientation in Degrees', 'orientation in Grads')}{HEADING}\n"
    body = "365324.63 3096141.49 2088.37 10 20 100"
    brought = read(tmp_path, f"{text}7 3 1.5 {body} {PLACE}\n")
    assert brought.tables["calibration/trajectory.csv"]["kappa_deg"][0] == pytest.approx(90.0)


@needs("noaa-dss-dg")
@pytest.mark.parametrize("name", ["C19748959", "C25959144"])
def test_orientations_of_a_real_flight_by_applanix(tmp_path, name):
    """The values of NOAA's files in the documented layout; both forms of position agree."""
    said = dict(
        line.split(":  ", 1)
        for line in data.path(f"noaa-dss-dg/{name}.geom").read_text().splitlines()
        if ":  " in line
    )
    lat, lon, height, _ = said["latlonh_platform_position"].split()
    east, north, _, _ = said["utm_platform_position"].split()
    angles = " ".join(said[key] for key in ("omega", "phi", "kappa"))
    row = f"{name} 1 2.5 {east} {north} {height} {angles} {float(lat):.8f} {float(lon):.8f}"
    crs = f"EPSG:326{int(said['utm_zone']):02d}"
    brought = read(tmp_path, f"{PREAMBLE}{HEADING}\n{row}\n", crs=crs)
    table = brought.tables["calibration/trajectory.csv"]
    assert table["exposure"] == [name]
    assert table["omega_deg"][0] == float(said["omega"])
    (line,) = (line for line in brought.found if "differ by at most" in line)
    assert float(line.split("at most ")[1].split()[0]) < 0.005
