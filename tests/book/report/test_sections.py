"""Sections of the report: who, which values, where residuals were measured."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.report.describe import identification
from acx4book.report.material import image_residuals
from acx4book.report.sections import method_table, parameter_table
from acx4lib.results import folder as results
from support.run_results import SINGLE


def test_the_identification_names_flight_camera_system_and_software(run):
    said = identification(run).set_index("Item")["Statement"]
    assert said["Flight"] == run.flight.name
    assert "pixels of 4.6 µm; declared focal length 50 mm" in said["Camera CAM"]
    assert said["Coordinate system"] == "WGS 84 / UTM zone 33N (EPSG:32633)"
    assert said["Stages computed"] == "mounting and validation"
    assert said["Data, SHA-256"] == f"`{run.provenance.digest}`"
    assert "acx4lib " in said["Software"]


def test_parameters_stand_with_their_sigma(run):
    table = parameter_table(run).set_index("Parameter")
    rows = results.parameters(run.found, SINGLE, "CAM")
    value, sigma = table.loc["$f$ (mm)", "Value and σ"].split(" ± ")
    assert_allclose(float(value), rows.loc["f_mm", "value"], atol=1e-4)
    assert_allclose(float(sigma), rows.loc["f_mm", "sigma"], rtol=0.05)
    assert len(table) == len(rows)
    methods = method_table(run).set_index("Parameter")
    assert methods.loc["lever arm $x$ (m)", "Two-step, GNSS positions"] == "held"


def test_residuals_stand_where_they_were_measured(run):
    table = image_residuals(run, SINGLE)
    block = run.flight.calibration
    one = table.iloc[7]
    i = block.images.names.index(one["image"])
    k = block.points.index(one["point"])
    seen = block.image_points
    row = np.flatnonzero((seen.image_idx == i) & (seen.point_idx == k))
    assert_allclose(seen.colrow[row[0]], [one["col_px"], one["row_px"]])
    rows = run.residuals[SINGLE]
    own = rows[(rows["image_or_exposure"] == one["image"]) & (rows["point"] == one["point"])]
    assert list(own["v"]) == [one["v_col"], one["v_row"]]
