"""Calibrations whose values are known, in results folders, to be taken out."""

import pytest

from support.run_results import estimated, leave_calibration


@pytest.fixture(scope="session")
def single(tmp_path_factory):
    """Results of one camera, CAM, with blocks calibration and validation."""
    return leave_calibration(tmp_path_factory.mktemp("single"), estimated("CAM"))


@pytest.fixture(scope="session")
def rig(tmp_path_factory):
    """Results of two heads, LEFT and RIGHT, by method rig."""
    at = tmp_path_factory.mktemp("rig")
    return leave_calibration(at, estimated("LEFT", "RIGHT"), method="rig")
