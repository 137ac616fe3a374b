"""The pages of the programming interface: every room has one, cellars have none."""

import re

from acx4book.pages import api
from support.helpers import ROOT

HOUSES = ("acx4lib", "acx4tools", "acx4sim")


def test_every_room_has_a_page_in_the_book():
    toc = (ROOT / "book" / "_toc.yml").read_text("utf-8")
    listed = re.findall(r"_generated/api/([\w/]+)", toc)
    rooms = [
        path.parent for house in HOUSES for path in (ROOT / "src" / house).glob("*/__init__.py")
    ]
    assert sorted(listed) == sorted([*HOUSES, *(f"{r.parent.name}/{r.name}" for r in rooms)])


def test_modules_stand_in_the_order_of_the_docstring_and_cellars_are_left_out():
    names = [name.rpartition(".")[2] for name in api.contents("acx4lib.bundle")]
    assert names[0] == "network"
    assert "compiled" not in names


def test_a_page_has_the_docstring_a_table_and_a_section_for_every_module():
    page = "\n".join(api.page("acx4lib.bundle"))
    assert page.startswith("# bundle\n")
    assert ".. automodule:: acx4lib.bundle\n   :no-members:\n" in page
    assert ".. autosummary:: \n   \n   network\n" in page
    assert "\n## adjust\n" in page
    assert "\n## gross_errors\n" in page
    assert "compiled" not in page


def test_a_house_refers_to_its_rooms_and_shows_its_own_modules(tmp_path):
    (tmp_path / "_generated").mkdir()
    (tmp_path / "_generated" / "_toc.yml").write_text(
        "- file: _generated/api/acx4sim\n- file: _generated/api/acx4sim/scenery"
    )
    api.write(tmp_path)
    folder = tmp_path / "_generated" / "api"
    assert (folder / "acx4sim" / "scenery.md").is_file()
    house = (folder / "acx4sim.md").read_text("utf-8")
    assert "\n   scenery\n" in house
    assert "\n## scenery\n" not in house
    assert "\n## designs\n" in house


def test_modules_for_users_show_their_functions_and_others_what_they_are_for():
    assert ".. automodule:: acx4lib.bundle.adjust\n```" in "\n".join(api.page("acx4lib.bundle"))
    exchange = "\n".join(api.page("acx4tools.exchange"))
    assert ".. automodule:: acx4tools.exchange.opencv\n```" in exchange
    assert ".. automodule:: acx4tools.exchange.safe.text_lines\n   :no-members:\n" in exchange
