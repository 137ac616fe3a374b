"""Compilation of functions, and the cache of compiled code, which is numba's own."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from numba import njit
from numba.core.caching import FunctionCache
from numba.core.runtime.nrt import rtsys

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent
SOURCES = sha256(
    b"".join(
        path.read_bytes()
        for path in (
            _HERE / "geometry" / "collinearity.py",
            *sorted(_HERE.glob("**/compiled.py")),
            *sorted(_HERE.glob("**/compiled/*.py")),
        )
    )
).hexdigest()
"""Digest of all that is compiled, also into functions of other modules."""

_HOW: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    # NaN and infinity keep their meaning, and np.isnan works. np.isfinite does not: it subtracts
    # a number from itself, which "reassoc" replaces by zero
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
}


def compiled(function: F) -> F:
    """Compile a function at its first call, and keep the result for later processes."""
    return _kept(function)


def inlined(function: F) -> F:
    """Compile a function inline into its callers.

    For functions called at every point: passing the arrays would take longer than the work.
    """
    return _kept(function, forceinline=True)


def uncounted(function: F) -> F:
    """Compile a function that makes no arrays and counts no references to its arguments.

    For threads that share arrays and pass them to small functions very often.
    """
    return _kept(function, _nrt=False)


def uncounted_inlined(function: F) -> F:
    """Compile a function as `uncounted` does, inline into its callers."""
    return _kept(function, _nrt=False, forceinline=True)


def load(*functions: Any) -> None:
    """Load compiled functions from the cache now, as the import of an extension module would.

    Loading them at their first calls takes longer than the adjustment of a small block.
    """
    for function in functions:
        if isinstance(function._cache, _Files):
            entries = function._cache._cache_file._load_index()  # type: ignore[no-untyped-call]
            for signature, *_, sources in entries:
                if sources == SOURCES:
                    function.compile(signature)


class _Files(FunctionCache):
    """Numba's cache of a function.

    Numba itself looks at the function's own module only, but functions of other modules are
    compiled into it.
    """

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (*super()._index_key(sig, codegen), SOURCES)  # type: ignore[no-untyped-call] # numba has no types

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the cached code of a signature; None if missing."""
        # numba would first import its whole compiler, which takes longer than many an adjustment;
        # machine code needs only the runtime that counts references
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call] # as above


def _kept(function: F, **how: Any) -> F:
    dispatcher = njit(**_HOW, **how)(function)
    if not NOT_KEPT:
        dispatcher._cache = _Files(function)  # type: ignore[no-untyped-call] # as above
    return dispatcher


try:
    _Files(load)  # type: ignore[no-untyped-call] # as above
    NOT_KEPT = ""
    """Warning that a command prints once; empty where compiled code can be kept."""
except RuntimeError:
    NOT_KEPT = (
        "compiled code cannot be kept: neither the package's folder nor the user's cache can be "
        "written, so every run compiles anew; NUMBA_CACHE_DIR names another folder"
    )
