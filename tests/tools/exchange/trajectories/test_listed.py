"""Words for columns."""

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories.listed import Column, column, declared, left_out, read_list


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


# --- Rows with declared columns


NUMBERS = ("east", "omega")


def read(text, columns="", separator=""):
    source = Opened(file="a.txt", data=text.encode())
    return read_list(source, columns, separator=separator, numbers=NUMBERS)


def test_a_heading_with_tabs_over_rows_with_spaces():
    found = read("NOM\tX\tY\nA   1.0  2.0\nB   3.0  4.0\n")
    assert found.names("image") == ["A", "B"]
    assert found.numbers("north").tolist() == [2.0, 4.0]


def test_quoted_cells_may_hold_a_separator():
    found = read("image camera x\nA 'c 1, d' 1\n")
    assert found.names("camera") == ["c 1, d"]
    assert read('image,x\n"A, B",1\n').names("image") == ["A, B"]
    assert read("image,x\nA,1\n", separator="comma").numbers("east").tolist() == [1.0]


def test_declared_columns_with_and_without_a_heading():
    assert len(read("a,b,c\nA,1,2\n", "image x y").rows) == 1
    assert len(read("A,1,2\n", "image x y").rows) == 1


def test_a_heading_of_which_two_columns_may_be_one_is_refused():
    with pytest.raises(FlightError, match="two columns may be 'height'"):
        read("image x y z altitude\nA 1 2 3 4\n")


SITE = (
    "CHANTIER : PARIS - 2015\nDATE : 12/06/2015\nSYSTEME : LAMBERT 93\n\n"
    "NOM X Y OMEGA\nA 1.0 2.0 0.5\nB 3.0 4.0 0.6\n"
)


@pytest.mark.parametrize("columns", ["", "image x y omega"])
def test_lines_before_a_heading_are_counted_and_not_read(columns):
    found = read(SITE, columns)
    assert found.names("image") == ["A", "B"]
    assert found.numbers("north").tolist() == [2.0, 4.0]
    assert found.before == 4
    assert found.rows[0].number == 6


def test_rows_before_a_second_heading_are_rows():
    with pytest.raises(FlightError, match="x"):
        read("A 1.0 2.0 0.5\nNOM X Y OMEGA\nB 3.0 4.0 0.6\n", "image x y omega").numbers("east")


@pytest.mark.parametrize("row", ["A nan nan 1", "A 1,5 2,5 1", "A - - 1", "A *** 2.0 1"])
def test_a_first_row_of_spoilt_numbers_is_no_heading(row):
    with pytest.raises(FlightError, match=r"a.txt:1"):
        read(f"{row}\nB 1.0 2.0 1\n", "image x y omega", "space").numbers("east")


def test_a_heading_beside_declared_columns_is_told_and_where_it_contradicts_them():
    (same,) = left_out(read("image x y\nA 1 2\n", "image x y"), "orientation")
    assert same == "The heading in line 1, since the columns are declared."
    (other,) = left_out(read("image y x\nA 1 2\n", "image x y"), "orientation")
    assert "contradicts the declared columns: 'y' over east, 'x' over north" in other
