"""The rules of the three houses that a machine can check."""

import ast
import re

import pytest

from support.helpers import ROOT

SRC, TESTS = ROOT / "src", ROOT / "tests"
HOUSES = {"lib": "acx4lib", "sim": "acx4sim", "book": "acx4book"}
"""Folders of tests, and whose modules they mirror."""

NOT_MIRRORING = ("benchmarks", "built_book", "project", "whole", "lib/calibration/geometries")
LIBRARY = SRC / "acx4lib"
MODULES = sorted(SRC.glob("acx4*/**/*.py"))
PACKAGES = sorted({path.parent for path in MODULES})


def entries(folder):
    left_out = ("__pycache__", ".hypothesis")
    return sorted(path for path in folder.iterdir() if path.name not in left_out)


def named(path):
    return str(path.relative_to(ROOT))


def folders():
    sources = [path for path in (*PACKAGES, TESTS, *TESTS.rglob("*")) if path.is_dir()]
    return [p for p in sources if p not in (LIBRARY, TESTS / "lib") and p.name != "__pycache__"]


@pytest.mark.parametrize("folder", folders(), ids=named)
def test_a_folder_has_at_most_twelve_entries(folder):
    assert len(entries(folder)) <= 12


@pytest.mark.parametrize("folder", [LIBRARY, TESTS / "lib"], ids=named)
def test_the_library_has_at_most_fifteen_rooms_and_five_files(folder):
    rooms = [path for path in entries(folder) if path.is_dir()]
    assert len(rooms) <= 15
    assert len(entries(folder)) - len(rooms) <= 5


@pytest.mark.parametrize("package", PACKAGES, ids=named)
def test_a_package_says_what_it_is_for(package):
    said = ast.get_docstring(ast.parse((package / "__init__.py").read_text("utf-8"))) or ""
    assert said.endswith(".")
    assert len(said.splitlines()) <= 10 or package.parent == SRC
    if package.parent.name in ("acx4lib", "acx4book"):  # a room
        assert len(said.splitlines()) >= 2


@pytest.mark.parametrize("module", MODULES, ids=named)
def test_a_module_is_short_names_what_it_imports_and_reads_no_letters_of_a_key(module):
    text = module.read_text("utf-8")
    assert len(text.splitlines()) <= 350
    assert not re.search(r"^\s*from \S+ import \*|startswith\(\W*two_step", text, re.MULTILINE)


@pytest.mark.parametrize("cellar", sorted(SRC.glob("**/compiled")), ids=named)
def test_a_cellar_is_entered_from_its_own_room_alone(cellar):
    name = ".".join(cellar.relative_to(SRC).parts)
    others = [path for path in MODULES if cellar.parent not in path.parents]
    assert not [named(path) for path in others if name in path.read_text("utf-8")]


def mirrors():
    alone = [TESTS / folder for folder in NOT_MIRRORING]
    return [p for p in sorted(TESTS.rglob("test_*.py")) if not set(alone) & set(p.parents)]


@pytest.mark.parametrize("path", mirrors(), ids=named)
def test_a_test_file_is_found_from_the_name_of_its_module(path):
    folder, *rooms = path.parent.relative_to(TESTS).parts
    module = SRC.joinpath(HOUSES[folder], *rooms, path.stem.removeprefix("test_"))
    assert module.with_suffix(".py").is_file() or module.is_dir()
