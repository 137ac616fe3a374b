"""Checks of arguments at public doors: shapes of arrays, and ranges of values.

A wrong argument raises a `ValueError`: its name, what was expected, and what was given.
Values are checked when they are made. Values made from checked ones are not checked again.
Types are mypy's to check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from types import EllipsisType
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from acx4lib.errors import FlightError

Array = NDArray[np.floating[Any]]
Index = NDArray[np.integer[Any]]
Mask = NDArray[np.bool_]
Raster = NDArray[np.unsignedinteger[Any]]

T = TypeVar("T")

# Lengths of axes: a name stands for any length, ``...`` in front for any further axes.
Shape = tuple[int | str | EllipsisType, ...]

RIGID = 1e-5
"""Tolerance for products of a rotation matrix's columns; five printed digits are enough."""


# --- values ----------------------------------------------------------------------------------


def folder(value: str | Path, what: str) -> Path:
    """Return a value as a folder's path; FlightError if there is none, as users name folders."""
    location = Path(value)
    if not location.is_dir():
        is_what = "not a folder" if location.exists() else "no such folder"
        raise FlightError([f"{location}: {is_what}; expected {what}"])
    return location


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise where a value is none of those known; `name` is the argument's, here and below."""
    known = tuple(known)
    if value not in known:
        _refuse(name, f"one of {', '.join(map(str, known))}", repr(value))


def names_of(name: str, values: Iterable[object], known: Iterable[str]) -> None:
    """Raise where one of the values is no known name."""
    known = tuple(known)
    for value in [values] if isinstance(values, str) else values:
        if value not in known:
            _refuse(name, f"names of {', '.join(known)}", repr(value))


def different(name: str, values: Sequence[object], what: str = "names") -> None:
    """Raise where a value occurs twice."""
    if len(set(values)) < len(values):
        twice = next(value for k, value in enumerate(values) if value in values[:k])
        _refuse(name, f"different {what}", f"{twice!r} twice")


def whole(name: str, value: object, *, least: int = 1) -> None:
    """Raise where a value is no whole number, or smaller than the least."""
    if not isinstance(value, int | np.integer) or value < least:
        _refuse(name, f"a whole number of {least} or more", repr(value))


# --- arrays ----------------------------------------------------------------------------------


def numbers(name: str, values: object, like: Shape) -> Array:
    """Return numbers, also from a list, as an array; raise where its shape is not `like`."""
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        _refuse(name, f"numbers of shape {_said(like)}", type(values).__name__)
    shape(name, array, like)
    return array


def shape(name: str, values: NDArray[Any], like: Shape = ("n",)) -> None:
    """Raise where an array does not have the shape `like`."""
    if not _is_like(np.shape(values), like):
        _refuse(name, f"shape {_said(like)}", _said(np.shape(values)))


def places(name: str, values: Index | int, n: int) -> None:
    """Raise where some of these whole numbers do not lie between 0 and n - 1."""
    _all(name, values, f"whole numbers from 0 to {n - 1}", lambda v: (v >= 0) & (v < n))


def finite(name: str, values: Array) -> None:
    """Raise where numbers are not finite."""
    _all(name, values, "finite numbers", np.isfinite)


def positive(name: str, values: Array | float, *, zero: bool = False) -> None:
    """Raise where a number is not above zero, on request zero itself; infinite ones pass."""
    if zero:
        _all(name, values, "zero or positive numbers", lambda v: v >= 0)
    else:
        _all(name, values, "positive numbers", lambda v: v > 0)


def rotations(name: str, R: Array) -> None:
    """Raise where one of the matrices, shape (..., 3, 3), is no rotation; NaN passes."""
    turned = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)) > RIGID
    mirrored = np.sum(np.cross(R[..., 0, :], R[..., 1, :]) * R[..., 2, :], axis=-1) < 0
    wrong = np.atleast_1d(turned.any(axis=(-2, -1)) | mirrored)
    if wrong.any():
        row = f" in row {np.argmax(wrong)}" if R.ndim > 2 else ""
        _refuse(name, "rotation matrices", f"one that does not turn, or mirrors{row}")


def _all(name: str, values: Any, what: str, is_right: Callable[[Any], Any]) -> None:
    """Raise with the first of the values that is not right, and its row."""
    values = np.asarray(values)
    wrong = ~np.asarray(is_right(values))
    if wrong.any():
        index = tuple(np.argwhere(wrong)[0])
        row = f" in row {index[0]}" if index else ""
        _refuse(name, what, f"{values[index].item()!r}{row}")


def _is_like(actual: tuple[int, ...], like: Shape) -> bool:
    if like[0] is ...:
        like = like[1:]
        actual = actual[-len(like) :]
    return len(actual) == len(like) and all(
        isinstance(wanted, str) or n == wanted for n, wanted in zip(actual, like, strict=True)
    )


def _said(like: Shape) -> str:
    axes = ["..." if axis is ... else str(axis) for axis in like]
    return f"({axes[0]},)" if len(axes) == 1 else f"({', '.join(axes)})"


def _refuse(name: str, what: str, got: str) -> NoReturn:
    raise ValueError(f"{name}: expected {what}, got {got}")


# --- parts -----------------------------------------------------------------------------------


def part_of(whole: T, keep: Index | Mask | slice) -> T:
    """Return some rows of a value whose fields are all arrays, without a new check."""
    part: T = object.__new__(type(whole))
    for field in fields(whole):  # type: ignore[arg-type]  # a dataclass
        object.__setattr__(part, field.name, getattr(whole, field.name)[keep])
    return part


NOT_GIVEN: Any = None
"""Stands for a field whose default depends on other fields."""


def default(value: object, name: str, made: Callable[[], object]) -> None:
    """Fill in a field of a frozen value that was not given."""
    if getattr(value, name) is NOT_GIVEN:
        object.__setattr__(value, name, made())
