"""Calibrations and orientations that are exported."""

import io
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.lens import Left
from acx4files.exchange.outward import content, programs
from acx4files.exchange.outward.content import (
    R_C_V,
    Taken,
    orient,
    to_first,
)
from acx4files.exchange.outward.programs import KINDS
from acx4files.flight.settings import camera_of
from acx4lib.errors import FlightError, OutputError
from acx4lib.geometry.frames import Pose, exp, log
from acx4lib.geometry.geodesy import GridSystem, mean_origin
from support.helpers import needs
from support.run_results import edit_summary, estimated, leave_calibration


def test_a_calibration_comes_back_with_its_a_posteriori_covariance(rig):
    found, known = content.read(rig), estimated("LEFT", "RIGHT")
    assert (found.method, found.others) == ("rig", ())
    for own, camera in zip(found.cameras, known.cameras, strict=True):
        assert_allclose(own.interior.to_array(), camera.interior.to_array(), rtol=1e-14)
        assert_allclose(own.T_b_c.R, camera.T_b_c.R, atol=1e-14)
    scale = np.sqrt(np.diag(known.cov))
    assert_allclose(
        found.calibration.cov / scale / scale[:, None],
        1.25 * known.cov / scale / scale[:, None],
        atol=1e-9,
    )


def test_what_is_not_there_is_one_line_that_says_what_is(rig, single, tmp_path):
    with pytest.raises(FlightError, match="no results of a run; acx4 run FLIGHT --results makes"):
        content.read(tmp_path)
    with pytest.raises(FlightError, match=r"no calibration of single_step that can be .*; it has"):
        content.read(rig, method="single_step")
    with pytest.raises(
        FlightError, match=r"no calibration of heads that can .*; it has single_step"
    ):
        content.read(single, heads=True)
    with pytest.raises(FlightError, match=r"no calibration of single_step .*; of heads are rig"):
        content.read(single, method="single_step", heads=True)
    with pytest.raises(ValueError, match="method: expected one of"):
        content.read(rig, method="best")


def test_a_calibration_whose_data_contradict_each_other_is_not_exported(tmp_path):
    results = leave_calibration(tmp_path, estimated("CAM"))
    edit_summary(results, "mounting/single_step", stopped=["too much: one sentence"])
    with pytest.raises(FlightError, match="any method that can be exported; it has none"):
        content.read(results)
    with pytest.raises(FlightError, match="single_step that can be exported; too much: one"):
        content.read(results, method="single_step")


def test_a_kept_flight_that_was_changed_is_refused(tmp_path):
    results = leave_calibration(tmp_path, estimated("CAM"))
    with (results / "flight" / "flight.toml").open("a") as file:
        file.write("# more\n")
    with pytest.raises(FlightError, match=r"flight\.toml changed since the run"):
        content.read(results)


# --- Heads relative to the first: against a numerical derivative, and as a chain of poses


RIG = estimated("LEFT", "RIGHT")


def moved(k, step):
    """Return the rig with one mounting changed: lever arm along body, rotation about camera."""
    cameras = list(RIG.cameras)
    T = cameras[k].T_b_c
    cameras[k] = replace(cameras[k], T_b_c=Pose(R=T.R @ exp(step[3:]), r=T.r + step[:3]))
    return replace(RIG, cameras=tuple(cameras))


def test_points_go_from_head_to_reference_as_through_the_body():
    first, second = RIG.cameras
    x_h = np.array([0.3, -0.2, -5.0])
    x_b = second.T_b_c.R @ x_h + second.T_b_c.r
    x_r = first.T_b_c.R.T @ (x_b - first.T_b_c.r)
    T = to_first(RIG)[1]
    assert_allclose(T.T_r_h.R @ x_h + T.T_r_h.r, x_r, atol=1e-12)
    assert_allclose(T.T_v_r_h.R @ (R_C_V @ x_h) + T.T_v_r_h.r, R_C_V @ x_r, atol=1e-12)


def test_the_covariance_is_that_of_numerical_derivatives():
    at, step = to_first(RIG)[1].T_r_h, 1e-5
    J = np.zeros((6, RIG.n_columns))
    for k in range(2):
        for j, column in enumerate(RIG.layout.mount[k]):
            for sign in (1, -1):
                T = to_first(moved(k, sign * step * np.eye(6)[j]))[1].T_r_h
                change = np.concatenate([T.r - at.r, log(at.R.T @ T.R)])
                J[:, column] += sign * change / (2 * step)
    assert_allclose(to_first(RIG)[1].cov, J @ RIG.cov @ J.T, rtol=1e-6, atol=1e-14)


def test_sigma_of_angles_is_that_of_many_rotations(rng):
    one = to_first(RIG)[1]
    turns = rng.multivariate_normal(np.zeros(3), one.cov[3:, 3:], size=20_000)
    R = one.T_r_h.R @ exp(turns)
    opk = Pose(R=R_C_V @ R @ R_C_V, r=np.zeros((len(R), 3))).opk
    assert_allclose(one.sigma_opk, opk.std(axis=0), rtol=0.03)  # 4 sigma of 20 000 draws


# --- orientations ----------------------------------------------------------------------------
#
# Orientations by direct georeferencing, held against PROJ, another program, and the contract.


@pytest.fixture(scope="module")
def oriented(rig):
    found = content.read(rig)
    return orient(found, found.flight, "heads")


def test_the_grid_table_is_a_trajectory_of_the_cameras_themselves(oriented):
    """As the contract reads it: camera = body, so that mount angles and lever arm are zero."""
    table = content.in_grid(oriented)
    frame = oriented.block.frame
    T = frame.pose_from_grid(
        table[["east_m", "north_m", "height_m"]].to_numpy(),
        np.radians(table[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy()),
    )
    mounts = [oriented.georeferenced.cameras[k].T_b_c for k in oriented.block.images.camera_idx]
    for i, T_b_c in enumerate(mounts):
        T_m_b = oriented.block.T_m_b_images[i]
        assert_allclose(T.R[i], T_m_b.R @ T_b_c.R, atol=1e-12)
        assert_allclose(T.r[i], T_m_b.r + T_m_b.R @ T_b_c.r, atol=1e-6)
    assert (table["sigma_east_m"] > 0.05).all()  # of the trajectory, and of the lever arm


def written(made):
    return pd.read_csv(io.StringIO(made.files["orientations.csv"]))


def test_positions_are_where_proj_has_them(oriented):
    """Three tables, one point: grid, geographic by PROJ, earth-centred through the origin."""
    grid, geographic = content.in_grid(oriented), written(content.rph(oriented))
    lonlat = geographic[["lon_deg", "lat_deg"]].to_numpy()
    to_grid = pyproj.Transformer.from_crs("EPSG:4674", "EPSG:31982", always_xy=True)
    assert_allclose(
        np.stack(to_grid.transform(*lonlat.T), 1), grid[["east_m", "north_m"]], atol=1e-4
    )
    assert_allclose(geographic["height_m"], grid["height_m"], atol=1e-5)
    lon, lat = oriented.block.frame.origin.tolist()
    local = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=GRS80 "
        f"+step +proj=topocentric +ellps=GRS80 +lon_0={lon!r} +lat_0={lat!r} +h_0=0"
    )
    xyz = np.stack(local.transform(*lonlat.T, geographic["height_m"].to_numpy()), 1)
    topocentric = written(content.topocentric_table(oriented))
    assert_allclose(topocentric[["x_m", "y_m", "z_m"]], xyz, atol=1e-4)


@needs("formats/orthority")
def test_roll_pitch_and_heading_are_another_programs():
    """Of the same shots adjusted omega, phi, kappa, and roll, pitch, yaw of the drone's gimbal.

    They differ by what the adjustment changed, 3 degrees at most.
    """
    folder = data.folder() / "formats" / "orthority"
    opk = pd.read_csv(folder / "io_odm_xyz_opk.csv", sep=" ", quotechar="'")
    rpy = pd.read_csv(folder / "io_odm_lla_rpy.csv", sep=" ").set_index("filename")
    grid = GridSystem(crs="EPSG:32651")
    enh = opk[["x", "y", "z"]].to_numpy()
    frame = mean_origin(grid, grid.lonlat_from_grid(enh[:, :2]))
    T = frame.pose_from_grid(enh, np.radians(opk[["omega", "phi", "kappa"]].to_numpy()))
    given = rpy.loc[opk["filename"] + ".tif", ["roll", "pitch", "yaw"]].to_numpy()
    found = np.degrees(content.roll_pitch_heading(frame, T))
    assert_allclose((found - given + 180) % 360 - 180, 0.0, atol=3.0)


def test_what_cannot_be_oriented_is_one_line(rig, single):
    found = content.read(rig)
    with pytest.raises(FlightError, match="no block validation; it has heads, calibration"):
        orient(found, found.flight, "validation")
    with pytest.raises(FlightError, match="images of CAM, not of LEFT, RIGHT; name another"):
        orient(found, found.flight, "calibration")


# --- what is written, and what is refused ----------------------------------------------------


FAR = Taken(
    files={"a/b.txt": "1\n"},
    lenses={"A": Left(largest_px=0.2, rms_px=0.1), "B": Left(largest_px=0.01, rms_px=0.0)},
    assumed=("y is down",),
    left_out=("colours",),
)


def test_a_folder_of_others_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds files that acx4 did not write"):
        content.write(FAR, tmp_path, title="some", origin="x")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_lens_that_is_too_far_is_refused_with_what_would_allow_it():
    with pytest.raises(OutputError, match=r"A: .* differs by 0\.2 px .* 0\.05 px; --allow 0\.21 "):
        content.near(FAR, 0.05)
    assert content.near(FAR, 0.21) == FAR
    with pytest.raises(OutputError, match="nan px"):
        content.near(Taken(files={}, lenses={"A": Left(largest_px=float("nan"), rms_px=0)}), 0.05)


# --- tables for flight.toml: read back they are the calibration, digit by digit --------------


def test_the_cameras_come_back(rig):
    found = content.read(rig)
    tables = tomllib.loads(KINDS["toml"].cameras(found).files["cameras.toml"])["cameras"]
    assert list(tables) == ["LEFT", "RIGHT"]
    for camera in found.cameras:
        back = camera_of(camera.name, tables[camera.name])
        assert back.interior == camera.interior
        assert_allclose(back.T_b_c.R, camera.T_b_c.R, atol=1e-15)
        assert_allclose(back.T_b_c.r, camera.T_b_c.r, atol=1e-15)


def test_sigma_of_the_mounting_is_along_and_about_the_bodys_axes(single, rng):
    """As comments; about body axes they are the scatter of boresights drawn about camera axes."""
    found = content.read(single)
    text = KINDS["toml"].cameras(found).files["cameras.toml"]
    said = tomllib.loads(text.replace("# lever_s", "lever_s").replace("# mount_s", "mount_s"))
    columns = found.calibration.layout.mount[0]
    cov = found.calibration.cov[np.ix_(columns, columns)]
    own = said["cameras"]["CAM"]
    assert_allclose(own["lever_sigma_m"], np.sqrt(np.diag(cov)[:3]), rtol=1e-3)
    R = found.cameras[0].T_b_c.R
    drawn = R @ exp(rng.multivariate_normal(np.zeros(3), cov[3:, 3:], size=20_000)) @ R.T
    about = np.stack([drawn[:, 2, 1], drawn[:, 0, 2], drawn[:, 1, 0]])
    assert_allclose(own["mount_sigma_deg"], np.degrees(about.std(axis=1)), rtol=0.03)


def test_a_synthetic_camera_keeps_its_frame(rig):
    found = content.read(rig)
    synthetic = replace(found.flight.synthetic, camera="LEFT")
    named = replace(found, flight=replace(found.flight, synthetic=synthetic))
    assert programs.FRAME.format("LEFT") in KINDS["toml"].cameras(named).assumed
    assert not any("synthetic" in one for one in KINDS["toml"].cameras(found).assumed)
