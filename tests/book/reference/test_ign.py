"""Seven UltraCam images: through convergence, geoid and altered heights to surveyed points."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from acx4book.reference import data, ign
from acx4files.conventions import best_reading
from acx4files.flight.reader import read
from support.flights.written import CONTROL, TRAJECTORY, change
from support.helpers import needs

AXES = ["east", "north", "height"]


@pytest.fixture(scope="module")
def table():
    return ign.results().set_index("point")


@pytest.fixture(scope="module")
def steps():
    return ign.forgotten_steps().set_index("reading")


@needs("ign-uce-m3")
@pytest.mark.parametrize("off_px", [0.0, 0.5])
def test_the_principal_point_counts_in_the_pixels_of_the_measurements(off_px):
    """IGN's orientations and ground points leave nothing on average; half a pixel would be seen."""
    flight = ign.load()
    inner = flight.camera.interior
    moved = replace(inner, xp=inner.xp - off_px * flight.camera.pixel_mm)
    flight = replace(flight, camera=replace(flight.camera, interior=moved))
    got = ign.intersected(flight, ign.READINGS["complete"](flight))
    is_tie = ~flight.is_surveyed[got.rays.group]
    mean = np.abs(got.misfit[is_tie].mean(axis=0))
    assert mean == pytest.approx([off_px, 0.0], abs=0.04)


@needs("ign-uce-m3")
def test_680_tie_points_intersect_within_a_fifth_of_a_pixel():
    flight = ign.load()
    got = ign.intersected(flight, ign.READINGS["complete"](flight))
    is_tie = ~flight.is_surveyed[got.rays.group]
    assert len(np.unique(got.rays.group[is_tie])) == 680
    assert np.sqrt((got.found.v[is_tie] ** 2).mean(axis=0)).max() < 0.2  # px


@needs("ign-uce-m3")
def test_tie_points_have_igns_coordinates(table):
    tie = table[table["kind"] == "tie point"]
    d = tie[[f"d_{axis}_m" for axis in AXES]].to_numpy()
    assert np.abs(d.mean(axis=0)).max() < 0.01  # m
    # most have two rays that meet at 8 degrees; 0.2 px are 0.1 m in height
    assert (d.std(axis=0) < [0.03, 0.02, 0.11]).all()


@needs("ign-uce-m3")
@pytest.mark.parametrize(("point", "rays", "ground_pixels"), [("1003", 3, 1.0), ("1006", 2, 2.5)])
def test_surveyed_points_in_space(table, point, rays, ground_pixels):
    assert table.loc[point, "rays"] == rays
    assert table.loc[point, "ground_pixels"] < ground_pixels


@needs("ign-uce-m3")
def test_point_1005(table):
    """In space the point nearest to its two rays is just within 2.5 pixels on the ground.

    The least-squares point has the smaller image residuals and lies 3 mm farther away.
    """
    own = table.loc["1005"]
    pixel_m = np.linalg.norm([own[f"d_{axis}_m"] for axis in AXES]) / own["ground_pixels"]
    assert own["rays"] == 2
    assert own["nearest_ground_pixels"] < 2.5
    assert max(abs(own[f"d_{axis}_m"]) for axis in AXES) < 2.5 * pixel_m


@needs("ign-uce-m3")
def test_surveyed_points_lie_within_three_predicted_sigma(table):
    surveyed = table[table["kind"] == "surveyed"]
    assert len(surveyed) == 3
    for axis in AXES:
        in_sigma = surveyed[f"d_{axis}_m"].abs() / surveyed[f"sigma_{axis}_m"]
        assert in_sigma.max() < 3


@needs("ign-uce-m3")
def test_each_forgotten_step_costs_what_it_should(steps):
    """Magnitudes from the map scale, the convergence and the undulation at this place."""
    height = steps["mean_height_m"]
    assert abs(height["complete"]) < 0.01
    above_m = 1763
    assert height["linear alteration left in"] == pytest.approx(0.000283 * above_m, abs=0.01)
    assert height["geoid forgotten"] == pytest.approx(-49.33, abs=0.03)
    assert height["map as Cartesian, true heights"] == pytest.approx(-0.000283 * above_m, abs=0.03)
    assert abs(height["map as Cartesian, altered heights"]) < 0.05
    assert steps.loc["convergence forgotten", "residual_px"] > 20
    assert steps.loc["one vertical for all images", "misfit_px"] > 20
    assert steps.loc["complete", "misfit_px"] < 0.25


# --- A real flight as a user's: wrong readings planted in it are named, the right one is not


TOML = """name = "Camargue"
crs = "{crs}"
heights = "geoid.tif"
[cameras.UCE]
width_px = {camera.width_px}
height_px = {camera.height_px}
pixel_um = {pixel_um}
focal_mm = {camera.interior.f}
xp_mm = {camera.interior.xp}
yp_mm = {camera.interior.yp}
"""


@pytest.fixture
def folder(tmp_path):
    """Write the data set in the layout of a flight; the body has the camera's axes."""
    flight = ign.load()
    camera, given, measured = flight.camera, flight.orientations, flight.measurements
    (tmp_path / "calibration").mkdir()
    shutil.copy(data.path("ign-uce-m3/fr_ign_RAF20.tif"), tmp_path / "geoid.tif")
    pixel_um = 1000 * camera.pixel_mm
    text = TOML.format(crs=ign.CRS, camera=camera, pixel_um=pixel_um)
    (tmp_path / "flight.toml").write_text(text)
    names = [f"I{name}" for name in given.names]
    pd.DataFrame({"image": names, "camera": "UCE", "exposure": names}).to_csv(
        tmp_path / "calibration/images.csv", index=False
    )
    points = pd.DataFrame(measured.colrow, columns=["col_px", "row_px"])
    points.insert(0, "image", [f"I{name}" for name in measured.images])
    points.insert(1, "point", [f"P{name}" for name in measured.points])
    points.to_csv(tmp_path / "calibration/image_points.csv", index=False)
    height = ign.true_altitudes(flight, ign.SCALE)
    values = np.column_stack([given.enh[:, :2], height, np.degrees(given.opk)])
    columns = ["east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg"]
    table = pd.DataFrame(values, columns=columns)
    table.insert(0, "exposure", names)
    table.to_csv(tmp_path / TRAJECTORY, index=False)
    control = pd.DataFrame(flight.enh, columns=["east_m", "north_m", "height_m"])
    lonlat = flight.grid.lonlat_from_grid(flight.enh[:, :2])
    control["height_m"] -= flight.altitudes.undulation(lonlat)
    control.insert(0, "point", [f"P{name}" for name in flight.points])
    control.to_csv(tmp_path / CONTROL, index=False)
    return tmp_path


@needs("ign-uce-m3")
def test_the_data_as_they_are_get_no_sentence(folder):
    assert best_reading(read(folder), "calibration") is None


@needs("ign-uce-m3")
@pytest.mark.parametrize(
    ("file", "mistake", "name"),
    [
        (TRAJECTORY, lambda t: t.assign(phi_deg=-t["phi_deg"]), "phi of opposite sign"),
        (TRAJECTORY, lambda t: t.assign(kappa_deg=-t["kappa_deg"]), "kappa of opposite sign"),
        (
            TRAJECTORY,
            lambda t: t.rename(columns={"omega_deg": "phi_deg", "phi_deg": "omega_deg"}),
            "omega, phi exchanged",
        ),
        (TRAJECTORY, lambda t: t.assign(height_m=t["height_m"] / 0.3048), "height in feet"),
        (  # the geoid is 49.3 m above the ellipsoid, as the data set says
            CONTROL,
            lambda t: t.assign(height_m=t["height_m"] + 49.3),
            "height of control points above the ellipsoid",
        ),
    ],
)
def test_what_is_planted_in_real_data_is_named(folder, file, mistake, name):
    change(folder, file, mistake)
    found = best_reading(read(folder), "calibration")
    assert found is not None
    assert found.name == name
