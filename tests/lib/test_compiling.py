"""Compiled code is kept only as long as everything that it is compiled from."""

import grp
import os
import pwd
import shutil
import stat
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


def test_a_folder_that_the_user_names_is_used(monkeypatch, tmp_path):
    monkeypatch.setattr(compiling._CONFIG, "CACHE_DIR", str(tmp_path))
    assert compiling._folder().parent == tmp_path


def test_a_relative_name_of_a_folder_is_not_used(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compiling._CONFIG, "CACHE_DIR", "kept")
    assert compiling._folder().parent != tmp_path / "kept"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o707, 0o702])
def test_a_folder_that_others_can_write_is_not_the_users_own(tmp_path, mode):
    folder = tmp_path / "kept"
    folder.mkdir()
    assert compiling._is_own(folder)
    folder.chmod(mode)
    assert not compiling._is_own(folder)


def test_a_folder_that_others_can_exchange_is_not_the_users_own(tmp_path):
    above = tmp_path / "above"
    assert compiling._is_own(above / "kept")
    above.chmod(0o777)
    assert not compiling._is_own(above / "kept")
    above.chmod(0o1777)  # as /tmp: what lies there stays
    assert compiling._is_own(above / "kept")
    above.chmod(0o755)
    link = tmp_path / "link"
    link.symlink_to(above)
    assert compiling._is_own(link / "kept")
    tmp_path.chmod(0o777)
    assert not compiling._is_own(link / "kept")


@pytest.mark.skipif(os.getuid() != 0, reason="only the administrator can give a folder away")
@pytest.mark.parametrize("which", ["kept", "."])
def test_a_folder_of_another_user_is_not_the_users_own(tmp_path, which):
    folder = tmp_path / "above" / "kept"
    assert compiling._is_own(folder)
    os.chown(tmp_path / "above" / which, 4711, 4711)
    assert not compiling._is_own(folder)


def test_only_the_users_private_group_counts_as_the_user(tmp_path):
    folder = tmp_path / "kept"
    assert compiling._is_own(folder)
    folder.chmod(0o770)
    user, group = pwd.getpwuid(os.getuid()), grp.getgrgid(folder.stat().st_gid)
    private = group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}
    assert compiling._is_own(folder) == private


def test_a_new_folder_is_closed_to_others(tmp_path):
    before = os.umask(0)
    try:
        assert compiling._is_own(tmp_path / "kept")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "kept").stat().st_mode) == 0o700


def test_decorating_leaves_the_configuration_as_it_was():
    before = compiling._CONFIG.CACHE_DIR

    @compiling.compiled
    def twice(x):
        return 2 * x

    assert twice(3.0) == 6.0
    assert before == compiling._CONFIG.CACHE_DIR


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


@pytest.mark.repeats
def test_kept_code_is_loaded_without_all_that_numba_compiles_with(tmp_path):
    """Importing that takes longer than the adjustment of a small block."""
    script = (
        "import sys; import numpy as np; from acx4lib.bundle.compiled import packing; "
        "one = np.zeros(1, dtype=np.int64); starts, _, _ = packing._sorted(one, one, 1, 1); "
        "print(starts.tolist(), 'numba.np.linalg' in sys.modules)"
    )
    for has_all in (True, False):  # the first process compiles
        done = process(script, kept=tmp_path)
        assert done.stdout.split("]") == ["[0, 1", f" {has_all}\n"]


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


@pytest.mark.repeats
def test_code_kept_for_another_processor_is_not_loaded(tmp_path):
    script = (
        "from acx4lib.bundle.compiled import packing; import numpy as np; "
        "n = len(packing._mark.overloads); one = np.zeros(2, dtype=np.int64); "
        "packing._mark(one, one, np.zeros((1, 1))); print(n)"
    )
    for processor, loaded in (("", "0"), ("x86-64", "0"), ("x86-64", "1"), ("", "1")):
        named = {"NUMBA_CPU_NAME": processor} if processor else {}
        done = process(script, kept=tmp_path, **named)
        assert done.stdout.split() == [loaded]


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
