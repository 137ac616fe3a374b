"""A real flight as a user's: wrong readings planted in it are named, the right one is not."""

from __future__ import annotations

import shutil

import numpy as np
import pandas as pd
import pytest

from acx4book.reference import data
from acx4book.reference.ign import readings
from acx4lib.conventions.search import best_reading
from acx4lib.flight.reader import read
from support.flights.spoilt import CONTROL, TRAJECTORY, change
from support.reference_files import needs

pytestmark = needs("ign-uce-m3")

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
    flight = readings.load()
    camera, given, measured = flight.camera, flight.orientations, flight.measurements
    (tmp_path / "calibration").mkdir()
    shutil.copy(data.path("ign-uce-m3/fr_ign_RAF20.tif"), tmp_path / "geoid.tif")
    pixel_um = 1000 * camera.pixel_mm
    text = TOML.format(crs=readings.CRS, camera=camera, pixel_um=pixel_um)
    (tmp_path / "flight.toml").write_text(text)
    names = [f"I{name}" for name in given.names]
    pd.DataFrame({"image": names, "camera": "UCE", "exposure": names}).to_csv(
        tmp_path / "calibration/images.csv", index=False
    )
    points = pd.DataFrame(measured.colrow, columns=["col_px", "row_px"])
    points.insert(0, "image", [f"I{name}" for name in measured.images])
    points.insert(1, "point", [f"P{name}" for name in measured.points])
    points.to_csv(tmp_path / "calibration/image_points.csv", index=False)
    height = readings.true_altitudes(flight, readings.SCALE)
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


def test_the_data_as_they_are_get_no_sentence(folder):
    assert best_reading(read(folder), "calibration") is None


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
