import pytest

from acx4lib.geometry.parameters import MOUNT
from acx4lib.model import Model


@pytest.mark.parametrize(
    ("fix", "names"),
    [
        ((), MOUNT),
        (("lever_arm",), MOUNT[3:]),
        (("boresight",), MOUNT[:3]),
        (("lever_arm", "boresight"), ()),
    ],
)
def test_what_is_not_fixed_of_the_mounting_is_estimated(fix, names):
    assert Model(fix=fix).mount == names


def test_the_height_of_the_shift_is_held_where_the_lever_arms_is_free():
    assert Model(gnss=("shift", "drift")).shift == ("east", "north")
    assert Model(gnss=("shift",), fix=("lever_arm",)).shift == ("east", "north", "height")
    assert Model(gnss=("drift",), fix=("lever_arm",)).shift == ()


@pytest.mark.parametrize(
    ("choice", "says"),
    [
        ({"free": ("f", "k4")}, "free: expected names of .*, got 'k4'"),
        ({"fix": ("mounting",)}, "fix: expected names of lever_arm, boresight, got 'mounting'"),
        ({"refraction": "high"}, "refraction: expected one of none, standard, got 'high'"),
        ({"gnss": ("offset",)}, "gnss: expected names of shift, drift, delay, deviation, got"),
    ],
)
def test_an_unknown_name_is_named(choice, says):
    with pytest.raises(ValueError, match=says):
        Model(**choice)
