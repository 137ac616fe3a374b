"""Tables of parameters: the values of the results, with their sigma."""

from numpy.testing import assert_allclose

from acx4book.report.material import read
from acx4book.report.parameters.tables import heads_sentence, method_table, parameter_table
from acx4lib.results import folder as results
from support.run_results import SINGLE, edit_summary


def test_parameters_stand_with_their_sigma(run):
    table = parameter_table(run).set_index("Parameter")
    rows = results.parameters(run.found, SINGLE, "CAM")
    value, sigma = table.loc["$f$ (mm)", "Value and σ"].split(" ± ")
    assert_allclose(float(value), rows.loc["f_mm", "value"], atol=1e-4)
    assert_allclose(float(sigma), rows.loc["f_mm", "sigma"], rtol=0.05)
    assert len(table) == len(rows)
    methods = method_table(run).set_index("Parameter")
    assert methods.loc["lever arm $x$ (m)", "Two-step, GNSS positions"] == "held"


def test_what_errors_of_the_heads_add_is_told_in_multiples_of_sigma(folder):
    assert heads_sentence(read(folder)) == ""
    sigma = results.parameters(read(folder).found, SINGLE, "CAM")["sigma"]
    told = {f"CAM/{name}": 0.25 * s for name, s in sigma.items()} | {
        "CAM/f_mm": 1.5 * sigma["f_mm"]
    }
    edit_summary(folder, SINGLE, sigma_of_heads=told)
    said = heads_sentence(read(folder))
    assert "They add 0.25 to 1.5 times these σ, most to $f$;" in said
