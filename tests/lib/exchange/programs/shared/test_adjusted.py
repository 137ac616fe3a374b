"""A model's own orientations as a trajectory, on the map and in the ECEF frame."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.shared import adjusted
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, mean_origin, rotation_enu_to_ecef

CRS = "EPSG:31982"
OPK = np.radians([[0.5, -1.0, 30.0], [1.0, 2.0, -150.0]])
ENH = np.array([[676000.0, 7184000.0, 1000.0], [676100.0, 7184050.0, 1010.0]])
NAMES = ("a", "a", "b")


def flown(T, **wanted):
    return adjusted.flown(
        Path("m"), NAMES, T[[0, 0, 1]], **{"crs": CRS, "wanted": "adjusted", **wanted}
    )


def test_map_coordinates_are_taken_as_they_are():
    found = flown(Pose(R=rotation_from_opk(OPK), r=ENH))
    assert found.table["exposure"] == ["a", "b"]
    assert found.table["north_m"] == ENH[:, 1].tolist()
    assert_allclose(found.table["kappa_deg"], [30.0, -150.0])
    assert found.settings == {"crs": CRS, "heights": "ellipsoidal"}


def test_the_size_tells_earth_centred_coordinates():
    grid = GridSystem(crs=CRS)
    frame = mean_origin(grid, grid.lonlat_from_grid(ENH[:, :2]))
    T_m = frame.pose_from_grid(ENH, OPK)
    R_e_m = rotation_enu_to_ecef(frame.origin[None])[0]
    x_e = grid.ecef_from_geographic(frame.to_geographic(T_m.r))
    found = flown(Pose(R=R_e_m @ T_m.R, r=x_e))
    assert "earth-centred" in found.assumed[0]
    assert_allclose(found.table["height_m"], ENH[:, 2], atol=1e-5)
    assert_allclose(found.table["omega_deg"], np.degrees(OPK[:, 0]), atol=1e-8)


def test_nothing_is_made_up_that_was_not_asked_for():
    T = Pose(R=rotation_from_opk(OPK), r=ENH)
    assert flown(T, wanted="none").table is None
    assert flown(T, wanted="none", crs=None).settings == {}
    with pytest.raises(FlightError, match="m:1: --crs: missing"):
        flown(T, crs=None)
    with pytest.raises(FlightError, match="is not a projected CRS"):
        flown(T, crs="EPSG:4326")
