"""How functions are compiled, and where the result is kept."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numba.core.config
from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent
_CONFIG: Any = numba.core.config

_SOURCES = (
    "compiling.py",
    "collinearity.py",
    "small_products.py",
    "rays.py",
    "packing.py",
    "image_kernel.py",
    "image_quality.py",
    "reduction.py",
    "spline_kernel.py",
    "correlation_kernel.py",
    "matching_kernel.py",
    "memory_hints.py",
    "pixel_lanes.py",
    "blend_weights.py",
    "resampling_kernel.py",
)
"""Modules with compiled functions, and with what these are compiled from."""

_HOW: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    # NaN and infinity stay what they are, and np.isnan finds them; np.isfinite does not, being a
    # difference of equal numbers that "reassoc" takes for zero
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
}


def compiled(function: F) -> F:
    """Compile a function at its first call, and keep the result for later processes."""
    return _kept(function, **_HOW)


def inlined(function: F) -> F:
    """Compile a function into those that call it.

    For what is called at every point: handing over the arrays would cost more than the work.
    """
    return _kept(function, forceinline=True, **_HOW)


def uncounted(function: F) -> F:
    """Compile a function that makes no arrays, and counts no references to those it is given.

    For threads that share arrays and hand them to small functions all the time.
    """
    return _kept(function, _nrt=False, **_HOW)


def uncounted_inlined(function: F) -> F:
    """Compile such a function into those that call it."""
    return _kept(function, _nrt=False, forceinline=True, **_HOW)


def _folder() -> Path:
    """Return a folder of its own for every state of the sources.

    A compiled function is kept under the date of its own module only, though what it calls in
    other modules is compiled into it.
    """
    sources = b"".join((_HERE / name).read_bytes() for name in _SOURCES)
    root = Path(_CONFIG.CACHE_DIR) if _CONFIG.CACHE_DIR else _HERE / "__pycache__"
    return root / f"compiled-{sha256(sources).hexdigest()[:16]}"


_FOLDER = _folder()


def _kept(function: F, **how: Any) -> F:
    given = _CONFIG.CACHE_DIR
    _CONFIG.CACHE_DIR = str(_FOLDER)  # read where a function is decorated; elsewhere if read-only
    try:
        return njit(**how)(function)
    finally:
        _CONFIG.CACHE_DIR = given
