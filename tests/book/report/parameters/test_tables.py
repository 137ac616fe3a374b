"""Tables of parameters: the values of the results, with their sigma."""

from numpy.testing import assert_allclose

from acx4book.report.parameters.tables import method_table, parameter_table
from acx4lib.results import folder as results
from support.run_results import SINGLE


def test_parameters_stand_with_their_sigma(run):
    table = parameter_table(run).set_index("Parameter")
    rows = results.parameters(run.found, SINGLE, "CAM")
    value, sigma = table.loc["$f$ (mm)", "Value and σ"].split(" ± ")
    assert_allclose(float(value), rows.loc["f_mm", "value"], atol=1e-4)
    assert_allclose(float(sigma), rows.loc["f_mm", "sigma"], rtol=0.05)
    assert len(table) == len(rows)
    methods = method_table(run).set_index("Parameter")
    assert methods.loc["lever arm $x$ (m)", "Two-step, GNSS positions"] == "held"
