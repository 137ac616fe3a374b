"""Compiled code is kept only as long as everything that it is compiled from."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

compiling = pytest.importorskip("acx4lib.compiling")
PACKAGE = Path(compiling.__file__).parent
COMPILED = sorted((*PACKAGE.glob("**/compiled.py"), *PACKAGE.glob("**/compiled/*.py")))


def test_every_module_with_compiled_code_is_among_the_sources():
    users = {path for path in PACKAGE.glob("**/*.py") if "acx4lib.compiling" in path.read_text()}
    assert users <= {PACKAGE / "compiling.py", *COMPILED}
    assert {"rays.py", "elimination.py"} <= {path.name for path in users}


def process(script, *, kept, cwd=None, **environment):
    """Run Python, with compiled code kept in a folder."""
    return subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(kept), **environment},
        cwd=cwd,
    )


FUNCTIONS = """\
from acx4lib import compiling

@compiling.compiled
def twice(x):
    return 2 * x

@compiling.uncounted
def more(x):
    return twice(x) + 1

compiling.load(more)
n = len(more.overloads)
print(more(3.0), n, compiling.NOT_KEPT[:13])
"""


def test_code_is_kept_until_any_source_changes(tmp_path):
    (tmp_path / "functions.py").write_text(FUNCTIONS)
    changed = "from acx4lib import compiling; compiling.SOURCES = 'other'; import functions"
    for script, loaded in [("import functions", 0), ("import functions", 1), (changed, 0)]:
        done = process(script, kept=tmp_path / "kept", cwd=tmp_path)
        assert done.stdout.split() == ["7.0", str(loaded)]


def test_where_nothing_can_be_written_it_is_compiled_and_a_reason_given(tmp_path):
    (tmp_path / "functions.py").write_text(FUNCTIONS)
    hidden = "import os; os.makedirs = lambda *a, **k: (_ for _ in ()).throw(OSError()); "
    done = process(f"{hidden}import functions", kept="/dev/null/kept", cwd=tmp_path)
    assert done.stdout.split() == ["7.0", "0", "compiled", "code"]


def test_what_is_not_a_number_is_found_in_a_sum():
    @compiling.compiled
    def unknown(a, b):
        return np.isnan(a + b)

    assert unknown(np.nan, 1.0)
    assert not unknown(np.inf, 1.0)


@pytest.mark.parametrize(
    "source", [path for path in COMPILED if "acx4lib.compiling" in path.read_text()], ids=str
)
def test_no_compiled_module_asks_for_finite_numbers(source):
    """In compiled code of a sum the answer is always yes."""
    assert "isfinite" not in source.read_text(encoding="utf-8")
