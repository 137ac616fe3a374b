"""The few names that `import acx4lib as acx` gives."""

import subprocess
import sys

import pytest

import acx4lib as acx


def test_nothing_is_loaded_before_it_is_used():
    code = "import sys, acx4lib; print([m for m in sys.modules if m.startswith(('acx4', 'numpy'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "['acx4lib']\n"


def test_what_a_notebook_tries_a_method_with_loads_no_tables_and_no_stage():
    loaded = "[m for m in sys.modules if m.startswith(('acx4lib.', 'pandas', 'scipy', 'numba'))]"
    code = f"import sys; from acx4lib.stages import attempt; print(sorted({loaded}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = [f"acx4lib.{name}" for name in ("attempts", "errors", "shown", "stages")]
    assert done.stdout == f"{modules}\n"


def test_five_functions_are_known_before_they_are_loaded():
    assert acx.__all__ == ["calibrate", "from_tables", "georeference", "read", "render"]
    assert set(acx.__all__) < set(dir(acx))
    assert all(callable(getattr(acx, name)) for name in acx.__all__)


def test_rooms_are_reached_by_their_names():
    assert acx.flight.read is acx.read
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = acx.nothing
