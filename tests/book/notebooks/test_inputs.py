"""Digests of small houses, and of the notebooks of the book."""

import pytest

from acx4book.notebooks import inputs
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from support.helpers import ROOT, write_notebook


@pytest.fixture
def sources(tmp_path):
    """Two houses: the first loads a room on demand, the second has a module that nobody uses."""
    files = {
        "acx4lib/__init__.py": "if TYPE_CHECKING:\n    from acx4lib.room.on_demand import x\n",
        "acx4lib/room/__init__.py": "from acx4lib.room import near\n",
        "acx4lib/room/near.py": "import numpy\n",
        "acx4lib/room/far.py": "def f():\n    import acx4book.late\n",
        "acx4lib/room/on_demand.py": "",
        "acx4book/__init__.py": "",
        "acx4book/late.py": "",
        "acx4book/unused.py": "",
    }
    for name, text in files.items():
        path = tmp_path / "src" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "src"


def reached(notebook, sources):
    return {str(path.relative_to(sources)) for path in inputs.modules(notebook, sources)}


def test_packages_on_the_way_are_read_and_late_imports_are_followed(tmp_path, sources):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1", "from acx4lib.room.far import f")
    assert reached(notebook, sources) == {
        *("acx4lib/__init__.py", "acx4lib/room/__init__.py", "acx4lib/room/near.py"),
        *("acx4lib/room/far.py", "acx4book/__init__.py", "acx4book/late.py"),
    }


def test_what_a_house_loads_on_demand_is_followed_where_the_house_itself_is_imported(
    tmp_path, sources
):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1", "import acx4lib as acx")
    assert "acx4lib/room/on_demand.py" in reached(notebook, sources)


def test_every_input_changes_the_digest_and_nothing_else_does(tmp_path, sources):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1", "from acx4lib.room import far")
    data = tmp_path / "data.csv"
    data.write_text("1\n")

    def digest():
        return inputs.digest(notebook, sources, [data])

    first = digest()
    (sources / "acx4book" / "unused.py").write_text("x = 1\n")
    assert digest() == first
    seen = {first}
    for path in (data, notebook, sources / "acx4book" / "late.py"):
        path.write_text(path.read_text() + "\n")
        assert digest() not in seen
        seen.add(digest())


def test_a_chapter_depends_on_its_own_room_and_not_on_anothers():
    chapter = NOTEBOOKS_PATH / "16-error-budget.ipynb"
    found = reached(chapter, ROOT / "src")
    assert "acx4book/chapters/beyond/error_budget/tables.py" in found
    assert "acx4lib/bundle/compiled/normals.py" in found
    assert "acx4book/chapters/beyond/rig/figures.py" not in found


def test_a_chapter_depends_on_how_figures_are_shown(tmp_path):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1")
    assert "acx4book/typesetting/drawing/compact.py" in reached(notebook, ROOT / "src")
