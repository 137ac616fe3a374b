"""A method is tried: its outcome, or why it has none."""

import numpy as np
import pandas as pd
import pytest

from acx4lib.errors import AdjustmentError
from acx4lib.stages import Failed, attempt


def half(n, *, of=2):
    if n % of:
        raise AdjustmentError(f"{n} is odd\nand so on")
    return n // of


def test_what_has_an_outcome_returns_it():
    assert attempt(half, 6) == 3
    assert attempt(half, 6, of=3) == 2


def test_what_is_not_determined_is_a_value_that_is_false_and_says_why():
    failed = attempt(half, 5)
    assert isinstance(failed, Failed)
    assert not failed
    assert failed.reason == "5 is odd\nand so on"
    assert repr(failed) == "Failed half: 5 is odd and so on"


def test_a_failure_of_linear_algebra_is_one_of_the_data():
    failed = attempt(np.linalg.inv, np.zeros((2, 2)))
    assert failed.reason.startswith("the equations cannot be solved (Singular matrix)")


def test_a_wrong_call_is_an_error():
    with pytest.raises(TypeError):
        attempt(half)


def test_a_failure_stands_beside_outcomes_in_a_table():
    index = pd.MultiIndex.from_tuples([("f", "mm"), ("xp", "mm")], names=["parameter", "unit"])
    found = pd.DataFrame({"value": [74.0, 0.1], "sigma": [0.01, 0.02]}, index=index)
    joined = pd.concat({"a": found, "b": attempt(half, 5).table()}, axis=1)
    assert joined["a"].equals(found)
    assert joined["b"].isna().all(axis=None)
    assert list(joined["b"].columns) == ["value", "sigma"]
