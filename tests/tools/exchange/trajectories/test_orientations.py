"""Orientations of a list, in the forms of a flight."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acx4lib.errors import FlightError
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories import orientations
from acx4tools.exchange.trajectories.listed import NUMBERS, read_list
from acx4tools.exchange.trajectories.orientations import Meaning

CRS = "EPSG:31982"
# section 1.7 of the notes on geodesy: two independent computations agree on these
GEOGRAPHIC = "image lat lon h roll pitch heading\nA -25.45 -49.25 2250 1.25 -2.5 37\n"
EAST, NORTH, CONVERGENCE = 675960.7544160, 7184067.8846027, -0.7522096122


def table(text, **meaning):
    source = Opened(file="a.txt", data=text.encode())
    listed, meaning = read_list(source, "", numbers=NUMBERS), Meaning(**meaning)
    return orientations.trajectory(listed, orientations.oriented(listed, meaning), meaning)


def message(text, **meaning):
    with pytest.raises(FlightError) as raised:
        table(text, **meaning)
    return str(raised.value)


def test_a_geographic_list_stays_what_it_is():
    found = table(GEOGRAPHIC)
    assert [found[name][0] for name in ("lat_deg", "lon_deg", "height_m")] == [-25.45, -49.25, 2250]
    assert found["roll_deg"][0] == 1.25
    assert found["heading_deg"][0] == pytest.approx(37.0, abs=1e-12)


def test_a_heading_from_grid_north_gets_the_convergence():
    grid = f"image x y z roll pitch yaw\nA {EAST} {NORTH} 2250 1.25 -2.5 {37 - CONVERGENCE}\n"
    found = table(grid, crs=CRS, north="grid")
    assert found["lat_deg"][0] == pytest.approx(-25.45, abs=1e-9)
    assert found["heading_deg"][0] == pytest.approx(37.0, abs=1e-8)
    assert table(grid, crs=CRS)["heading_deg"][0] == pytest.approx(37.0 - CONVERGENCE)


def test_omega_phi_kappa_against_true_north_become_roll_pitch_heading():
    # a body forward-left-up with zero roll and pitch: kappa = 90 - heading
    text = "image lat lon h omega phi kappa\nA -25.45 -49.25 2250 0 0 53\n"
    found = table(text, north="true")
    assert found["heading_deg"][0] == pytest.approx(37.0)
    on_grid = table(text, crs=CRS)
    assert on_grid["east_m"][0] == pytest.approx(EAST, abs=1e-5)
    assert on_grid["kappa_deg"][0] == pytest.approx(53.0)


def test_units_and_orders():
    text = "image x y z omega phi kappa\nA 1 2 3 {} {} {}\n"
    gon = table(text.format(10, 20, 100), angle="gon")
    rad = table(text.format(*np.radians([9, 18, 90])), angle="rad")
    for name, degrees in (("omega_deg", 9), ("phi_deg", 18), ("kappa_deg", 90)):
        assert gon[name][0] == pytest.approx(degrees)
        assert rad[name][0] == pytest.approx(degrees)
    pok = table(text.format(10, 20, 30), order="pok")
    opk = np.array([pok[f"{name}_deg"][0] for name in ("omega", "phi", "kappa")])
    expected = Rotation.from_euler("YXZ", [20, 10, 30], degrees=True)
    assert Rotation.from_euler("XYZ", opk, degrees=True).approx_equal(expected, atol=1e-9)
    assert abs(opk[0] - 10) > 0.5


def test_scaled_heights_and_heights_of_the_flight():
    text = f"image x y z omega phi kappa\nA {EAST} {NORTH} 2250 0 0 0\n"
    scaled = table(text, crs=CRS, ground_m=250.0)["height_m"][0]
    assert scaled == pytest.approx(250 + 2000 / 0.9999823472, abs=1e-4)
    geoid = table(text, crs=CRS, heights=5.25, ellipsoidal=True)["height_m"][0]
    assert geoid == pytest.approx(2244.75)


@pytest.mark.parametrize(
    ("text", "meaning", "says"),
    [
        ("image x y omega phi kappa\nA 1 2 3 4 5\n", {}, "must have east north or lat lon, height"),
        ("image x y z omega phi kappa\nA 1 2 3 400 0 0\n", {}, "a.txt:2: omega: '400'; must be an"),
        (GEOGRAPHIC.replace("-25.45", "-95"), {}, "a.txt:2: lat: '-95'; must lie"),
        (GEOGRAPHIC, {"north": "grid"}, "--crs: is not given; a heading from grid north need it"),
        (GEOGRAPHIC, {"north": "grid", "crs": "EPSG:4326"}, "is not a projected CRS"),
    ],
)
def test_other_lists_are_refused(text, meaning, says):
    assert says in message(text, **meaning)


def test_positions_in_two_forms_must_agree():
    text = f"image x y lat lon z omega phi kappa\nA {EAST} {NORTH} {{}} -49.25 1 0 0 0\n"
    for lat, good in (("-25.45", True), ("-25.4500000", True), ("-25.5000000", False)):
        source = Opened(file="a.txt", data=text.format(lat).encode())
        listed, meaning = read_list(source, "", numbers=NUMBERS), Meaning(crs=CRS)
        found = orientations.oriented(listed, meaning)
        if good:
            assert orientations.apart(listed, found, meaning) < 0.001
        else:
            with pytest.raises(FlightError, match=r"must be within 1.011 m of lat, lon in EPSG"):
                orientations.apart(listed, found, meaning)
