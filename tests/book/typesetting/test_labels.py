"""Tables show values to the digits that their standard deviations support."""

import numpy as np
import pytest

from acx4book.paper import printed
from acx4book.typesetting import labels


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (74.44038, 0.00104, "74.4404 ± 0.0010"),
        (-0.3987, 0.0262, "-0.399 ± 0.026"),
        (2.42e-7, 2.04e-8, "2.42·10⁻⁷ ± 2.0·10⁻⁸"),
        (12.3, 45.0, "12 ± 45"),
        (-0.001, 0.10, "0.00 ± 0.10"),
        (74.0, 0.0, "74"),
        (np.nan, 1.0, ""),
    ],
)
def test_a_value_is_rounded_to_two_digits_of_its_sigma(value, sigma, text):
    assert labels.value_and_sigma(value, sigma) == text


def test_every_printed_parameter_has_a_label():
    for number in (1, 2, 3, 4):
        assert set(printed.table(number)["parameter"]) <= set(labels.LABELS)
