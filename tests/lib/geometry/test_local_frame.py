"""A frame on no map: its coordinates are the grid's."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from acx4lib.calibration import mounting
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.geometry.local_frame import LocalFrame
from acx4lib.results import rows
from support import blocks

X_M = np.array([[1.0, 2.0, 3.0], [-4e5, 7e6, 12.5]])
OPK = np.radians([[1.0, -2.0, 170.0], [0.0, 3.0, 4.0]])


def test_coordinates_and_attitudes_stay_as_they_are():
    frame = LocalFrame()
    assert_array_equal(frame.from_grid(X_M), X_M)
    assert_array_equal(frame.to_grid(X_M), X_M)
    assert_array_equal(frame.pose_from_grid(X_M, OPK).R, rotation_from_opk(OPK))
    enh, opk = frame.pose_to_grid(frame.pose_from_grid(X_M, OPK))
    assert_array_equal(enh, X_M)
    np.testing.assert_allclose(opk, OPK, atol=1e-15)


def test_there_is_a_height_but_no_longitude():
    assert_array_equal(
        LocalFrame().to_geographic(X_M), [[np.nan, np.nan, 3], [np.nan, np.nan, 12.5]]
    )
    with pytest.raises(ValueError, match="lies on no map"):
        LocalFrame().from_geographic(X_M)


def test_a_block_on_no_map_is_calibrated_as_one_on_a_map_and_reported():
    """East, north and height are then x, y and z."""
    block = blocks.balanced()
    local = replace(block, frame=LocalFrame())
    fits = [mounting.single_step(b, free=("f", "xp", "yp")) for b in (block, local)]
    values = [fit.calibration.cameras[0].interior.to_array() for fit in fits]
    np.testing.assert_allclose(*values, rtol=0, atol=1e-9)
    table = rows.bundle_tables("mounting", "single_step", fits[1].bundle, fits[1].calibration)
    place = table["exterior_orientation"][["east_m", "north_m", "height_m"]].to_numpy()
    assert_array_equal(place, fits[1].bundle.T_m_c.r)
