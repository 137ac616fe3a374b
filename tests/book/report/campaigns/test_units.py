"""Units for small changes, and labels."""

import pytest

from acx4book.report.campaigns import units
from acx4lib.calibration.estimates import Parameter


def test_changes_have_small_units():
    assert units.scale("mm") == (1e3, "µm")
    assert units.scale("deg") == (3600.0, "″")
    assert units.scale("mm^-2") == (1.0, "mm^-2")


@pytest.mark.parametrize(
    ("unit", "size", "said"),
    [
        ("mm", 2e-3, (1e3, "µm")),
        ("mm^-4", 3e-11, (1e11, "10⁻¹¹ mm⁻⁴")),
        ("1", 0.002, (1e3, "10⁻³")),
        ("mm^-2", 0.0, (1.0, "mm⁻²")),
    ],
)
def test_small_numbers_have_a_power_of_ten_in_their_unit(unit, size, said):
    factor, text = units.fine(unit, size)
    assert (pytest.approx(factor), text) == said


def test_cameras_are_named_where_there_are_several():
    one, other = (
        Parameter(camera=c, name="f_mm", key="f", unit="mm", value=1.0, sigma=1.0) for c in "AB"
    )
    assert units.cameras_to_say((one, other))
    assert not units.cameras_to_say((one, one))
    assert units.label("f_mm", "A*") == "A&#42; $f$"
    assert units.label("f_mm") == "$f$"
