"""Protection from modules, settings and programs in the working folder.

A working folder may be a stranger's. Python's child processes search it for modules, and some
libraries read settings there when they are loaded. A few of these settings name programs to run.
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
    """Keep the content of the working folder out of this process and its children.

    This concerns modules, settings, and programs if PATH has ``.`` or an empty entry.

    To be called before the modules of `SETTINGS` are imported.
    """
    os.environ["PYTHONSAFEPATH"] = "1"  # read by the children of multiprocessing
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    os.environ["PATH"] = os.pathsep.join(filter(os.path.isabs, folders))
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


class _Finder:  # its base in importlib.abc takes long to load
    """Finder of the modules of `SETTINGS`; all others are left to other finders."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a module of `SETTINGS`, to be loaded in another working folder."""
        if fullname not in SETTINGS:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Elsewhere(spec.loader.name, spec.loader.path)
        return spec


class _Elsewhere(SourceFileLoader):
    """Loader that executes a module with the module's folder as working folder."""

    def exec_module(self, module: ModuleType) -> None:
        """Execute the module."""
        with standing_in(Path(self.path).parent):
            super().exec_module(module)
