"""Orientations by direct georeferencing, held against PROJ, another program, and the contract."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4lib.geometry.geodesy import GridSystem, mean_origin
from acx4tools.exchange.outward import calibrated, orientations
from acx4tools.exchange.outward.orientations import orient
from support.reference_files import needs


@pytest.fixture(scope="module")
def oriented(rig):
    found = calibrated.read(rig)
    return orient(found, found.flight, "heads")


def test_the_grid_table_is_a_trajectory_of_the_cameras_themselves(oriented):
    """As the contract reads it: camera = body, so that mount angles and lever arm are zero."""
    table = orientations.in_grid(oriented)
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


def test_positions_are_where_proj_has_them(oriented):
    """Three tables, one point: grid, geographic by PROJ, earth-centred through the origin."""
    grid, geographic = orientations.in_grid(oriented), orientations.geographic(oriented)
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
    assert_allclose(orientations.topocentric(oriented)[["x_m", "y_m", "z_m"]], xyz, atol=1e-4)


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
    found = np.degrees(orientations.roll_pitch_heading(frame, T))
    assert_allclose((found - given + 180) % 360 - 180, 0.0, atol=3.0)


def test_what_cannot_be_oriented_is_one_line(rig, single):
    found = calibrated.read(rig)
    with pytest.raises(FlightError, match="no block validation; it has heads, calibration"):
        orient(found, found.flight, "validation")
    with pytest.raises(FlightError, match="images of CAM, not of LEFT, RIGHT; name another"):
        orient(found, found.flight, "calibration")
    unmounted = replace(found, method="refined")
    with pytest.raises(FlightError, match=r"refined has no boresight and no lever arm; .* rig"):
        orient(unmounted, found.flight, "heads")
