"""What a command does not take from its working folder: modules, settings and programs.

A working folder may be a stranger's. Python's child processes look there for modules, and some
libraries for settings when they are loaded, a few of which name programs to run.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType

from acx4lib.system import standing_in

SETTINGS = frozenset({"matplotlib", "numba.core.config"})
"""Modules that read settings from the working folder when they are loaded."""


def shut_out() -> None:
    """Keep what is in the working folder out of this process and its children.

    Modules, settings, and programs, where PATH names the folder as ``.`` or by an empty entry.

    To be called before the modules of `SETTINGS` are imported.
    """
    os.environ["PYTHONSAFEPATH"] = "1"  # which the children of multiprocessing read
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    os.environ["PATH"] = os.pathsep.join(filter(os.path.isabs, folders))
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


class _Finder:  # its base in importlib.abc takes long to load
    """Finds the modules of `SETTINGS`, and leaves all others to other finders."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to load a module of `SETTINGS` while the process stands elsewhere."""
        if fullname not in SETTINGS:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Elsewhere(spec.loader.name, spec.loader.path)
        return spec


class _Elsewhere(SourceFileLoader):
    """Loads a module while the process stands in the folder of the module."""

    def exec_module(self, module: ModuleType) -> None:
        """Execute the module."""
        with standing_in(Path(self.path).parent):
            super().exec_module(module)
