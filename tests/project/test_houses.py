"""The rules of the houses that a machine can check, besides the contracts of imports."""

import ast
import re

import pytest

from support.helpers import ROOT

SRC = ROOT / "src"
MODULES = sorted(SRC.glob("acx4*/**/*.py"))
PACKAGES = sorted({path.parent for path in MODULES})


def named(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("package", PACKAGES, ids=named)
def test_a_package_says_what_it_is_for(package):
    said = ast.get_docstring(ast.parse((package / "__init__.py").read_text("utf-8"))) or ""
    assert said.endswith(".")
    if package.parent.name in ("acx4lib", "acx4tools", "acx4book"):  # a room
        assert len(said.splitlines()) >= 2


@pytest.mark.parametrize("module", MODULES, ids=named)
def test_a_module_names_what_it_imports_and_reads_no_letters_of_a_key(module):
    text = module.read_text("utf-8")
    assert not re.search(r"^\s*from \S+ import \*|startswith\(\W*two_step", text, re.MULTILINE)


@pytest.mark.parametrize("cellar", sorted(SRC.glob("**/compiled")), ids=named)
def test_a_cellar_is_entered_from_its_own_room_alone(cellar):
    name = ".".join(cellar.relative_to(SRC).parts)
    others = [path for path in MODULES if cellar.parent not in path.parents]
    assert not [named(path) for path in others if name in path.read_text("utf-8")]
