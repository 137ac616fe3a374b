"""Words for columns."""

import pytest

from acx4tools.exchange.trajectories.columns import Column, column, declared


@pytest.mark.parametrize(
    ("word", "name", "unit"),
    [
        ("Omega", "omega", ""),
        ("kappa_gon", "kappa", "gon"),
        ("Roll [rad]", "roll", "rad"),
        ("X", "east", ""),
        ("north_m", "north", ""),
        ("azimuth", "heading", ""),
        ("sigma_roll_arcmin", "sigma_roll", "arcmin"),
        ("time_s", "time", ""),
        ("photoID", "image", ""),
    ],
)
def test_a_word_has_a_name_and_may_have_a_unit(word, name, unit):
    assert column(word) == Column(name=name, unit=unit)


def test_borea_letters_and_repeated_words():
    names = [one.name for one in declared("N X Y Z O P K C S S")]
    expected = "image east north height omega phi kappa camera skip skip"
    assert names == expected.split()
    assert column("temperature") is None
    with pytest.raises(ValueError, match="stands twice"):
        declared("x y x")
