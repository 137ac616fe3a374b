"""Tables for programs: the numbers of the values that they are made of, and clear mistakes."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration import estimates
from acx4lib.errors import FlightError
from acx4lib.georeferencing.direct import georeference
from acx4lib.results import rows, tables
from support import blocks

PAIR = blocks.pair()
CALIBRATION = blocks.calibrated(PAIR)
IMAGES = PAIR.images.names[:2]
PIXELS = {"image": IMAGES, "col_px": [2000.0, 10.0], "row_px": [1500, 20], "height_m": [900.0] * 2}


def test_parameters_and_covariance_are_those_of_the_results_folder():
    found, cov = tables.parameters(CALIBRATION), tables.covariance(CALIBRATION)
    kept = rows.calibration_tables("mounting", "single_step", CALIBRATION)["parameters"]
    columns = ["camera", "parameter", "value", "sigma", "unit"]
    determined = found.loc[found["determined"], columns].reset_index(drop=True)
    pd.testing.assert_frame_equal(determined, kept[columns])
    assert cov.index.tolist() == cov.columns.tolist()
    assert cov.index[0] == "CAM/f_mm"
    assert_allclose(np.sqrt(np.diag(cov)), found["sigma"])


def test_an_undetermined_parameter_has_a_row_that_says_so():
    loose = blocks.calibrated(PAIR)
    loose.cov[:, :] *= 1e6
    found = tables.parameters(loose)
    assert not found.loc[found["parameter"] == "lever_x_m", "determined"].any()


def test_pixels_on_the_ground_have_sigma_that_grow_with_what_errs():
    sigma = ["sigma_east_m", "sigma_north_m", "sigma_height_m"]
    poses = georeference(PAIR, CALIBRATION)
    exact = georeference(PAIR, estimates.given(PAIR.cameras))
    found = tables.ground_points(PAIR, poses, PIXELS)
    rough = tables.ground_points(PAIR, poses, {**PIXELS, "sigma_px": np.full(2, 5.0)})
    assert found.columns.tolist() == [
        *("image", "col_px", "row_px", "east_m", "north_m", "height_m"),
        *sigma,
    ]
    assert_allclose(found["height_m"], 900.0, atol=1e-5)
    assert (rough[sigma[:2]] > found[sigma[:2]]).all(axis=None)
    assert (found[sigma[:2]] > tables.ground_points(PAIR, exact, PIXELS)[sigma[:2]]).all(axis=None)
    assert_allclose(found["sigma_height_m"], 0.0, atol=1e-7)
    uncertain = pd.DataFrame(PIXELS).assign(sigma_height_m=[0.5, 0.2])
    assert_allclose(tables.ground_points(PAIR, poses, uncertain)["sigma_height_m"], [0.5, 0.2])


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"image": ["0_CAM", "0_TAIL"]}, "pixels, row 1: image: '0_TAIL' is unknown"),
        ({"height_m": 900.0}, "pixels: height_m: the single value 900.0; must be one for each row"),
        ({"height_m": [900.0, np.nan]}, "pixels, row 1: height_m: 'nan'; must be a finite number"),
        ({"sigma_px": np.zeros(2)}, "pixels, row 0: sigma_px: 0.0; must be positive"),
    ],
)
def test_a_wrong_table_of_pixels_is_told_by_row_and_column(columns, says):
    poses = georeference(PAIR, CALIBRATION)
    with pytest.raises(FlightError) as caught:
        tables.ground_points(PAIR, poses, {**PIXELS, **columns})
    assert caught.value.problems[0].startswith(says)
