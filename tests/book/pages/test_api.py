"""The pages of the programming interface: every room has one, cellars have none."""

import re

import pytest

from acx4book.pages import build
from support.helpers import ROOT

HOUSES = ("acx4lib", "acx4tools", "acx4sim")


def test_every_room_has_a_page_in_the_book():
    toc = (ROOT / "book" / "_toc.yml").read_text("utf-8")
    listed = re.findall(r"_generated/api/([\w/]+)", toc)
    rooms = [
        path.parent for house in HOUSES for path in (ROOT / "src" / house).glob("*/__init__.py")
    ]
    assert sorted(listed) == sorted([*HOUSES, *(f"{r.parent.name}/{r.name}" for r in rooms)])


@pytest.fixture
def written(tmp_path):
    """Return what writes the pages of some houses and rooms, and reads the first."""

    def pages(*names):
        files = [name.replace(".", "/") for name in names]
        (tmp_path / "_generated").mkdir()
        contents = "\n".join(f"- file: _generated/api/{file}" for file in files)
        (tmp_path / "_generated" / "_toc.yml").write_text(contents)
        build.write_api(tmp_path)
        texts = [(tmp_path / "_generated/api" / f"{file}.md").read_text("utf-8") for file in files]
        return texts[0]

    return pages


def test_a_page_has_the_docstring_a_table_and_a_section_for_every_module(written):
    """In the order of the room's docstring; cellars are left out."""
    page = written("acx4lib.bundle")
    assert page.startswith("# bundle\n")
    assert ".. automodule:: acx4lib.bundle\n   :no-members:\n" in page
    assert ".. autosummary:: \n   \n   network\n" in page
    assert "\n## adjust\n" in page
    assert "\n## gross_errors\n" in page
    assert page.index("\n## network\n") < page.index("\n## adjust\n")
    assert "compiled" not in page


def test_a_house_refers_to_its_rooms_and_shows_its_own_modules(written):
    house = written("acx4sim", "acx4sim.scenery")
    assert "\n   scenery\n" in house
    assert "\n## scenery\n" not in house
    assert "\n## designs\n" in house


def test_modules_for_users_show_their_functions_and_others_what_they_are_for(written):
    exchange = written("acx4tools.exchange")
    assert ".. automodule:: acx4tools.exchange.opencv\n```" in exchange
    assert ".. automodule:: acx4tools.exchange.safe.text_lines\n   :no-members:\n" in exchange
