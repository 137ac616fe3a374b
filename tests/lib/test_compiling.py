"""Compiled code is kept only as long as everything that it is compiled from."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

compiling = pytest.importorskip("acx4lib.compiling")
PACKAGE = Path(compiling.__file__).parent
COMPILED = sorted((*PACKAGE.glob("**/compiled.py"), *PACKAGE.glob("**/compiled/*.py")))
CONSTANTS = [PACKAGE / "geometry" / "collinearity.py"]
SOURCES = [PACKAGE / "compiling.py", *CONSTANTS, *COMPILED]


def test_every_module_with_compiled_code_is_among_the_sources():
    users = {path for path in PACKAGE.glob("**/*.py") if "acx4lib.compiling" in path.read_text()}
    assert users <= set(SOURCES)
    assert {"rays.py", "elimination.py"} <= {path.name for path in users}


@pytest.mark.parametrize("source", SOURCES, ids=str)
def test_a_change_of_any_source_is_compiled_anew(source, tmp_path, monkeypatch):
    for path in SOURCES:
        copy = tmp_path / path.relative_to(PACKAGE)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    monkeypatch.setattr(compiling, "_HERE", tmp_path)
    monkeypatch.setattr(compiling, "__file__", str(tmp_path / "compiling.py"))
    before = compiling._folder()
    changed = tmp_path / source.relative_to(PACKAGE)
    changed.write_text(changed.read_text() + "# changed\n")
    assert compiling._folder() != before
    assert compiling._folder().name.startswith("compiled-")


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


def test_functions_are_compiled_with_what_earlier_processes_have_kept(tmp_path):
    one, other = (tmp_path / name / "room" / "compiled" for name in ("one", "other"))
    for folder in (one, other):
        folder.mkdir(parents=True)
        (folder / "functions.py").write_text(
            "from acx4lib.compiling import compiled\n\n"
            "@compiled\ndef twice(x):\n    return 2 * x\n\n"
            "@compiled\ndef more(x):\n    return twice(x) + 1\n"
        )

    def run(call, used, folder):
        script = f"from functions import more, twice; print({call}, len({used}.stats.cache_hits))"
        return process(script, kept=tmp_path / "kept", cwd=folder).stdout.split()

    assert run("twice(3.0)", "twice", one) == ["6.0", "0"]
    assert run("more(3.0)", "twice", one) == ["7.0", "1"]  # compiled with what the first has kept
    assert run("more(3.0)", "more", other) == ["7.0", "1"]  # by a copy of the same sources


def test_kept_code_is_loaded_with_its_module_and_damaged_code_at_the_first_call(tmp_path):
    (tmp_path / "functions.py").write_text(
        "from acx4lib.compiling import load, uncounted\n\n"
        "@uncounted\ndef twice(x):\n    return 2 * x\n\nload(twice)\n"
    )
    kept = tmp_path / "kept"
    script = "from functions import twice; n = len(twice.overloads); print(n, twice(3.0))"

    def run():
        done = process(script, kept=kept, cwd=tmp_path)
        return done.stdout.split(), done.stderr

    assert run() == (["0", "6.0"], "")
    assert run() == (["1", "6.0"], "")
    for kind in ("nbi", "nbc"):
        for file in kept.rglob(f"*.{kind}"):
            file.write_bytes(b"damaged")
        assert run()[0][1] == "6.0"
        assert run() == (["1", "6.0"], "")


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
