"""Tables of orientations that other programs wrote."""

import json

import numpy as np
import pytest

from acx4book.reference import data
from acx4lib.geometry import frames
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, GridSystem
from acx4tools.exchange.trajectories import orientation_table
from acx4tools.exchange.trajectories.orientation_table import TableOptions
from acx4tools.exchange.trajectories.orientations import Meaning
from support.reference_files import needs


def read(file, options=None, **meaning):
    return orientation_table.read(data.path(file), Meaning(**meaning), options or TableOptions())


def columns(table, *names):
    return np.stack([np.asarray(table[name], dtype=float) for name in names], axis=-1)


@needs("formats")
def test_a_table_is_what_the_same_program_wrote_as_json():
    crs = data.path("formats/orthority/io_ngi_xyz_opk.prj").read_text()
    brought = read("formats/orthority/io_ngi_xyz_opk.csv", TableOptions(of="camera"), crs=crs)
    table = brought.tables["calibration/trajectory.csv"]
    said = json.loads(data.path("formats/orthority/io_ngi_ext_param.geojson").read_text())
    shots = [shot["properties"] for shot in said["features"]]
    assert table["exposure"] == [shot["filename"] for shot in shots]
    xyz = columns(table, "east_m", "north_m", "height_m")
    assert xyz == pytest.approx(np.array([shot["xyz"] for shot in shots]), abs=6e-4)
    opk = np.radians(columns(table, "omega_deg", "phi_deg", "kappa_deg"))
    assert opk == pytest.approx(np.array([shot["opk"] for shot in shots]), abs=1e-5)


@needs("formats")
def test_roll_pitch_yaw_of_a_drone_against_its_adjusted_omega_phi_kappa():
    # the camera's x points right and its y forward: a quarter turn from the body's axes
    measured = read("formats/orthority/io_odm_lla_rpy.csv").tables["calibration/trajectory.csv"]
    adjusted = read("formats/orthority/io_odm_xyz_opk.csv", TableOptions(of="camera"))
    table = adjusted.tables["calibration/trajectory.csv"]
    order = [table["exposure"].index(name.removesuffix(".tif")) for name in measured["exposure"]]
    grid = GridSystem(crs="EPSG:32651")
    lonlat = columns(measured, "lon_deg", "lat_deg")
    R_n_b = frames.rotation_from_rph(
        np.radians(columns(measured, "roll_deg", "pitch_deg", "heading_deg"))
    )
    R_g_b = frames.turn(2, grid.convergence(lonlat)) @ R_ENU_NED @ R_n_b @ R_FRD_FLU
    R_g_c = R_g_b @ frames.turn(2, -np.pi / 2)
    opk = np.radians(columns(table, "omega_deg", "phi_deg", "kappa_deg"))[order]
    apart = np.swapaxes(R_g_c, 1, 2) @ frames.rotation_from_opk(opk)
    assert np.degrees(np.linalg.norm(frames.log(apart), axis=1)).max() < 2.0
    east_north = columns(table, "east_m", "north_m")[order]
    assert np.abs(grid.grid_from_lonlat(lonlat) - east_north).max() < 5.0


@needs("ign-uce-m3")
def test_the_heights_of_a_real_block_lose_the_scale_of_the_map():
    options = TableOptions(of="camera", block="validation")
    meaning = {"crs": "EPSG:2154", "heights": str(data.path("ign-uce-m3/fr_ign_RAF20.tif"))}
    brought = read("ign-uce-m3/images.OPK", options, ground_m=3.0, **meaning)
    table = brought.tables["validation/trajectory.csv"]
    # IGN's own factor at this place is 1.000283
    assert table["height_m"][0] == pytest.approx(3 + (1771.280 - 3) / 1.000283, abs=2e-3)
    assert brought.settings == {"crs": "EPSG:2154", "heights": "fr_ign_RAF20.tif"}
    assert list(brought.pictures) == ["fr_ign_RAF20.tif"]
    assert brought.tables["validation/images.csv"]["camera"][0] == "UCE-M3-f120-s06"
    assert any("the scale of the map" in line for line in brought.assumed)


def test_a_list_without_names_is_numbered(tmp_path):
    meaning = Meaning(crs="EPSG:31982")
    (tmp_path / "b.txt").write_text("x y z omega phi kappa\n400000 7200000 3 0 0 10\n")
    brought = orientation_table.read(tmp_path / "b.txt", meaning, TableOptions(camera="CAM"))
    images = brought.tables["calibration/images.csv"]
    assert images == {"image": ["1"], "camera": ["CAM"], "exposure": ["1"]}
    assert brought.assumed[0].endswith("exposures are numbered.")
