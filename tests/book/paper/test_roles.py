"""Every printed number has one of four roles, and pages say how many have which."""

import numpy as np
import pandas as pd
import pytest

from acx4book.paper import printed, roles


@pytest.fixture(scope="module")
def numbers():
    """Return every printed number of the tables with its role."""
    rows = []
    for number in (1, 2, 3, 4):
        for row in printed.table(number).itertuples():
            said = ((row.parameter, row.value, row.role), ("sigma", row.sigma, row.sigma_role))
            for what, value, role in said:
                if np.isfinite(value):
                    rows.append((number, row.parameter, what, row.column, role))
                else:
                    assert role == "", row
    return pd.DataFrame(rows, columns=["table", "parameter", "what", "column", "role"])


def test_each_of_the_172_numbers_has_one_of_four_roles(numbers):
    assert len(numbers) == 172
    assert set(numbers["role"]) == set(roles.ROLES)


def test_22_sigmas_of_table_3_were_chosen_for(numbers):
    """Those of the two-step boresight were not: they are scatters, and do not agree."""
    sigmas = numbers[(numbers["table"] == 3) & (numbers["what"] == "sigma")]
    assert (sigmas["role"] == "chosen").sum() == 22
    others = sigmas[sigmas["role"] != "chosen"]
    assert set(others["role"]) == {"independent"}
    assert set(others["parameter"]) == {f"boresight_{a}_deg" for a in ("omega", "phi", "kappa")}
    assert set(others["column"]) == {"two_step"}


def test_single_step_is_given_and_only_three_two_step_values_are_independent(numbers):
    values = numbers[(numbers["table"] == 3) & (numbers["what"] != "sigma")]
    values = values[values["parameter"] != "sigma0_squared"].set_index("column")
    assert set(values.loc["single_step", "role"]) == {"given"}
    two = values.loc["two_step"].set_index("parameter")["role"]
    assert {*two[two == "independent"].index} == {*roles.STRONG}


def test_a_number_and_its_percentage_are_not_counted_twice(numbers):
    role = numbers[numbers["what"] != "sigma"].set_index(["parameter", "column"])["role"]
    for column in printed.METHODS:
        assert role["rms_east_m", column] == "independent"
        assert role["rms_east_px", column] == "follows"
        assert role["n_within_3_gsd", column] == "independent"
        assert role["within_3_gsd_percent", column] == "follows"
        assert role["n_fail", column] == role["fail_percent", column] == "chosen"


def test_the_sentence_counts_and_names_the_strong_evidence(numbers):
    card = pd.DataFrame(
        {
            "table": numbers["table"],
            "quantity": numbers["parameter"].where(numbers["what"] != "sigma", "sigma"),
            "column": numbers["column"],
            "role": numbers["role"],
            "verdict": "agrees",
        }
    )
    said = roles.sentence(card)
    assert "172 numbers" in said
    assert f"{(numbers['role'] == 'given').sum()} were *given*" in said
    assert "6 are means of differences at check points" in said
    assert "Evidence about the study are the 3 others" in said
