"""The rules of the houses that a machine can check, besides the contracts of imports."""

import ast
import re

from support.helpers import ROOT, parsed

SRC = ROOT / "src"
MODULES = sorted(SRC.glob("acx4*/**/*.py"))


def named(path):
    return str(path.relative_to(ROOT))


def test_modules_name_what_they_import_and_read_no_letters_of_a_key():
    wrong = re.compile(r"^\s*from \S+ import \*|startswith\(\W*two_step", re.MULTILINE)
    assert not [named(path) for path in MODULES if wrong.search(path.read_text("utf-8"))]


def test_a_cellar_is_entered_from_its_own_room_alone():
    cellars = sorted((*SRC.glob("**/compiled"), *SRC.glob("**/compiled.py")))
    assert len(cellars) >= 3
    for cellar in cellars:
        name = ".".join(cellar.relative_to(SRC).with_suffix("").parts)
        others = [path for path in MODULES if cellar.parent not in path.parents]
        assert not [named(path) for path in others if name in path.read_text("utf-8")], cellar


# --- names that docstrings refer to ----------------------------------------------------------

REFERRED = re.compile(r"(?<!`)`(\w+)\.(\w+)`(?!`)")
ELSEWHERE = {"os", "itertools", "Figure"}
"""Of other libraries."""

FILES = {"toml", "csv", "json", "md", "zip"}
"""What follows the point in the name of a file."""


def names_of(tree):
    """Return the names that a module or a class has, and those of its imports."""
    defined = (ast.FunctionDef, ast.ClassDef)
    names = {node.name for node in tree.body if isinstance(node, defined)}
    names |= {
        name.id
        for node in tree.body
        if not isinstance(node, defined)
        for name in ast.walk(node)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    }
    imports = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    return names | {alias.asname or alias.name for node in imports for alias in node.names}


def test_what_a_docstring_names_exists():
    known, trees = {}, {}
    for path in (ROOT / "src").rglob("*.py"):
        trees[path] = tree = parsed(path)
        name, inside = path.stem, set()
        if name == "__init__":
            name, inside = path.parent.name, {other.stem for other in path.parent.iterdir()}
        known.setdefault(name, set()).update(names_of(tree), inside)
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                known.setdefault(node.name, set()).update(names_of(node))
    stale = []
    for path, tree in trees.items():
        unknown = [
            f"{of}.{name}"
            for of, name in REFERRED.findall(path.read_text("utf-8"))
            if of not in ELSEWHERE and name not in FILES and name not in known.get(of, ())
        ]
        nodes = ast.walk(tree) if unknown else ()
        arguments = {node.arg for node in nodes if isinstance(node, ast.arg)} | {"inverse"}
        stale += [f"{path}: {one}" for one in unknown if one.partition(".")[0] not in arguments]
    assert stale == []
