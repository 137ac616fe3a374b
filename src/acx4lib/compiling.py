"""Compilation of functions, and the cache of compiled code."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numba.core.config
from llvmlite import binding, ir
from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.runtime.nrt import rtsys

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent
_CONFIG: Any = numba.core.config
_CONFIG._config_fname = ""  # it would read settings from the working folder at each compiling

_HOW: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    # NaN and infinity keep their meaning, and np.isnan works. np.isfinite does not: it subtracts
    # a number from itself, which "reassoc" replaces by zero
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
}


def compiled(function: F) -> F:
    """Compile a function at its first call, and keep the result for later processes."""
    return _kept(function, **_HOW)


def inlined(function: F) -> F:
    """Compile a function inline into its callers.

    For functions called at every point: passing the arrays would take longer than the work.
    """
    return _kept(function, forceinline=True, **_HOW)


def uncounted(function: F) -> F:
    """Compile a function that makes no arrays and counts no references to its arguments.

    For threads that share arrays and pass them to small functions very often.
    """
    return _kept(function, _nrt=False, **_HOW)


def uncounted_inlined(function: F) -> F:
    """Compile a function as `uncounted` does, inline into its callers."""
    return _kept(function, _nrt=False, forceinline=True, **_HOW)


def load(*functions: Callable[..., Any]) -> None:
    """Load compiled functions from the cache now, as the import of an extension module would.

    Loading them at their first calls takes as long as the adjustment of a small block.
    """
    for function in functions:
        kept = getattr(function, "_cache", None)
        for signature in kept.signatures(function) if isinstance(kept, _Files) else ():
            function.compile(signature)  # type: ignore[attr-defined] # numba has no types


def _folder() -> Path | None:
    """Return the cache folder of the present sources; None where no folder can be written.

    Every state of the sources has its own folder: numba checks the date of a function's own
    module only, but functions of other modules are compiled into it.
    """
    cellars = sorted((*_HERE.glob("**/compiled.py"), *_HERE.glob("**/compiled/*.py")))
    used = [Path(__file__), _HERE / "geometry" / "collinearity.py", *cellars]
    sources = b"".join(str(p.relative_to(_HERE)).encode() + p.read_bytes() for p in used)
    name = f"compiled-{sha256(sources).hexdigest()[:16]}"
    cache = _user_folder("XDG_CACHE_HOME", ".cache")
    roots = [_HERE / "__pycache__", *([cache / "acx4lib"] if cache else [])]
    named = Path(_CONFIG.CACHE_DIR)
    if named.is_absolute():
        roots.insert(0, named)
    return next((root / name for root in roots if _is_writable(root / name)), None)


def _is_writable(folder: Path) -> bool:
    """Tell whether this user can write files in a folder; a missing one is made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _user_folder(variable: str, default: str) -> Path | None:
    """Return a folder of the user; None where there is no home."""
    named = Path(os.environ.get(variable) or os.path.expanduser(f"~/{default}"))  # noqa: PTH111 Path's raises
    return named if named.is_absolute() else None


_FOLDER = _folder()

NOT_KEPT = (
    ""
    if _FOLDER
    else (
        "compiled code cannot be kept: neither the package's folder nor the user's cache can be "
        "written, so every run compiles anew; NUMBA_CACHE_DIR names another folder"
    )
)
"""Warning that a command prints once; empty where compiled code can be kept."""

_DAMAGED = (
    *(pickle.UnpicklingError, EOFError, LookupError, ValueError, TypeError, AttributeError),
    *(ImportError, MemoryError, RuntimeError, OSError),
)
"""Errors that truncated, overwritten or unreadable files of compiled code raise."""


class _Place(UserProvidedCacheLocator):
    """The folder of a module's code in the cache: the same for all copies of the same sources.

    Numba's own has the path of the module in its name.
    """

    def ensure_cache_path(self) -> None:
        """Make the folder, in one that is known to be writable."""
        Path(self.get_cache_path()).mkdir(exist_ok=True)  # type: ignore[no-untyped-call] # as below

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Return the room and the folder of a module."""
        return "-".join(Path(py_file).parts[-3:-1])


class _Kept(CompileResultCacheImpl):
    """Cached machine code; the intermediate code, for compiling callers, is stored beside it.

    Numba reads all intermediate code at once, only to list the names of functions. That takes
    longer than a small adjustment, and is needed only where a caller is compiled anew.
    """

    _locator_classes: list[type[object]] = [_Place]  # noqa: RUF012 as numba declares it

    def reduce(self, data: Any) -> Any:
        """Return the cache entry of a compiled function."""
        (name, kind, (machine, linked)), *others = super().reduce(data)  # type: ignore[no-untyped-call] # numba has no types
        return ((name, kind, (machine, _names_alone(linked))), *others), linked

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the compiled function."""
        kept, linked = payload
        rebuilt = super().rebuild(target_context, kept)  # type: ignore[no-untyped-call] # as above
        rebuilt.library._get_module_for_linking = cache(lambda: binding.parse_bitcode(linked))
        return rebuilt


def _names_alone(code: bytes) -> bytes:
    """Return code that only defines the names of the functions in `code`."""
    full, out = binding.parse_bitcode(code), ir.Module()
    for named in full.functions:
        if not named.is_declaration:
            ir.GlobalVariable(out, ir.IntType(8), named.name).initializer = ir.IntType(8)(0)
    return binding.parse_assembly(str(out)).as_bitcode()


class _Files(FunctionCache):
    """Compiled code on disk; a file that cannot be read or written counts as missing."""

    _impl_class = _Kept

    counts = True
    """Whether the code counts references."""

    def signatures(self, dispatcher: Any) -> list[Any]:
        """Return the signatures with cached code for this processor."""
        codegen = dispatcher.targetctx.codegen()
        try:
            kept = self._cache_file._load_index()  # type: ignore[no-untyped-call] # as above
            return [key[0] for key in kept if key == self._index_key(key[0], codegen)]  # type: ignore[no-untyped-call]
        except _DAMAGED:
            return []

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the cached code of a signature; None if missing or unusable."""
        # numba would first import its whole compiler, which takes longer than many an adjustment;
        # machine code needs only the runtime that counts references, if it does
        if self.counts:
            rtsys.initialize(target_context)
        try:
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except _DAMAGED:
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call] # numba has no types
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep compiled code, where that is possible."""
        with suppress(*_DAMAGED):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call] # as above


def _kept(function: F, **how: Any) -> F:
    dispatcher = njit(**how)(function)
    # extensions of numba by other packages are not used here, and the search for them takes a while
    dispatcher._compilation_chain_init_hook = lambda: None
    configured = _CONFIG.CACHE_DIR
    _CONFIG.CACHE_DIR = str(_FOLDER)  # numba reads it when it looks for files
    try:
        if _FOLDER:
            dispatcher._cache = files = _Files(function)  # type: ignore[no-untyped-call] # as above
            files.counts = how.get("_nrt", True)
    except RuntimeError:  # the folder was writable a moment ago
        pass
    finally:
        _CONFIG.CACHE_DIR = configured
    return dispatcher
