"""Names of files made from any name."""

from __future__ import annotations

import pytest

from acx4lib.results.own_folder.file_names import file_stem
from support.flights import payloads

every_name = pytest.mark.parametrize("name", payloads.NAMES.values(), ids=payloads.NAMES)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("H3-04", "H3-04"),
        ("a/b", "a%2Fb"),
        ("..", "%2E%2E"),
        ("Straße 1", "Straße 1"),
        ("a%", "a%25"),
        ("CON", "%43ON"),
        ("lpt1", "%6Cpt1"),
        ("Con 1", "Con 1"),
        ("Son", "Son"),
        ("a\nb", "a%0Ab"),
    ],
)
def test_any_name_makes_a_file_name(name, stem):
    assert file_stem(name) == stem


@every_name
def test_files_of_payloads_lie_in_their_folder(name, tmp_path):
    path = tmp_path / f"{file_stem(name)}_preview.jpg"
    path.write_text("x")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_long_names_have_files_of_their_own(tmp_path):
    names = [300 * "ß" + end for end in "ab"]
    stems = {file_stem(name) for name in names}
    assert len(stems) == 2
    assert all(len(stem.encode()) <= 200 for stem in stems)
