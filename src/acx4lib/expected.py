"""Checks of the arguments of functions: types of arrays, and ranges of values.

A wrong argument raises a `ValueError`: its name, what was expected, and what was given.
Values are checked when they are made. Values made from checked ones are not checked again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence, Sized
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


# --- single values ---------------------------------------------------------------------------


def instance(name: str, value: object, kind: type) -> None:
    """Raise where a value is of another type; `name` is the argument's name, here and below."""
    if not isinstance(value, kind):
        _refuse(name, _with_article(kind.__name__), given(value))


def text(name: str, value: object) -> None:
    """Raise where a value is no text."""
    if not isinstance(value, str):
        _refuse(name, "text", given(value))


def path(name: str, value: object) -> Path:
    """Return a value as a path; raise where it is none."""
    if not isinstance(value, str | Path) or value == "":
        _refuse(name, "a path", given(value))
    return Path(value)


def folder(name: str, value: object, what: str) -> Path:
    """Return a value as a folder's path; FlightError if there is none, as users name folders."""
    location = path(name, value)
    if not location.is_dir():
        is_what = "not a folder" if location.exists() else "no such folder"
        raise FlightError([f"{location}: {is_what}; expected {what}"])
    return location


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise where a value is none of those known."""
    known = tuple(known)
    if not _is_of(value, known):
        _refuse(name, f"one of {', '.join(map(str, known))}", given(value))


def whole(name: str, value: object, *, least: int = 1) -> None:
    """Raise where a value is no whole number, or smaller than the least."""
    if not _is_whole(value) or value < least:  # type: ignore[operator]  # a number by now
        _refuse(name, f"a whole number of {least} or more", given(value))


def place(name: str, value: object, n: int) -> None:
    """Raise where a value is no whole number from 0 to n - 1."""
    if not _is_whole(value) or not 0 <= value < n:  # type: ignore[operator]  # a number by now
        _refuse(name, f"a whole number from 0 to {n - 1}", given(value))


def number(name: str, value: object) -> None:
    """Raise where a value is no finite number."""
    if not (_is_number(value) and math.isfinite(value)):  # type: ignore[arg-type]  # by now
        _refuse(name, "a finite number", given(value))


def positive_number(name: str, value: object) -> None:
    """Raise where a value is not a number above zero."""
    if not (_is_number(value) and value > 0):  # type: ignore[operator]  # a number by now
        _refuse(name, "a positive number", given(value))


def size(name: str, value: object) -> None:
    """Raise where a value is neither zero nor a positive number."""
    if not (_is_number(value) and value >= 0):  # type: ignore[operator]  # a number by now
        _refuse(name, "zero or a positive number", given(value))


def probability(name: str, value: object) -> None:
    """Raise where a value is not strictly between zero and one."""
    if not (_is_number(value) and 0 < value < 1):  # type: ignore[operator]  # a number by now
        percent = " (per cent?)" if _is_number(value) and 1 < value <= 100 else ""  # type: ignore[operator]
        _refuse(name, "a probability between 0 and 1", given(value) + percent)


def _is_of(value: object, known: Sequence[object]) -> bool:
    return not isinstance(value, np.ndarray) and value in known


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


# --- several values --------------------------------------------------------------------------


def sequence(name: str, values: object, kind: type) -> None:
    """Raise where values are no sequence of the type `kind`, or are empty."""
    noun = kind.__name__
    if not isinstance(values, Sequence) or isinstance(values, str):
        _refuse(name, f"a sequence of {noun}", given(values))
    for value in values:
        if not isinstance(value, kind):
            _refuse(name, f"a sequence of {noun}", f"one with {given(value)}")
    some(name, values, noun)


def names(name: str, values: object, n: int | None = None) -> None:
    """Raise where values are no sequence of names, or not n of them."""
    if isinstance(values, str):
        _refuse(name, "a sequence of names", f"the text {values!r}")
    if not isinstance(values, Iterable):
        _refuse(name, "a sequence of names", given(values))
    if n is not None and len(values) != n:  # type: ignore[arg-type]  # of a value's fields
        _refuse(name, f"{n} names", f"{len(values)}")  # type: ignore[arg-type]


def names_of(name: str, values: object, known: Iterable[str]) -> None:
    """Raise where values are no sequence of known names."""
    names(name, values)
    known = tuple(known)
    for value in values:  # type: ignore[attr-defined]  # a sequence by now
        if not _is_of(value, known):
            _refuse(name, f"names of {', '.join(known)}", given(value))


def different(name: str, values: Sequence[object], what: str = "names") -> None:
    """Raise where a value occurs twice."""
    if len(set(values)) == len(values):
        return
    seen: set[object] = set()
    for value in values:
        if value in seen:
            _refuse(name, f"different {what}", f"{value!r} twice")
        seen.add(value)


def many(name: str, values: Sized, n: int, what: str) -> None:
    """Raise where the number of values is not n."""
    if len(values) != n:
        _refuse(name, f"{n} {what}", f"{len(values)}")


def some(name: str, values: Sized, what: str) -> None:
    """Raise where there are no values."""
    if len(values) == 0:
        _refuse(name, f"one {what} at least", "none")


def three(name: str, values: object) -> None:
    """Raise where values are no three numbers."""
    if not isinstance(values, Sequence | np.ndarray) or isinstance(values, str):
        _refuse(name, "three numbers", given(values))
    if len(values) != 3:
        _refuse(name, "three numbers", f"{len(values)}")


# --- arrays ----------------------------------------------------------------------------------


def numbers(name: str, values: object, like: Shape) -> Array:
    """Return numbers, also from a list, as an array; raise where its shape is not `like`."""
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        _refuse(name, f"numbers of shape {_said(like)}", given(values))
    shape(name, array, like)
    return array


def shape(name: str, values: object, like: Shape) -> None:
    """Raise where values are no array of numbers with the shape `like`."""
    if not isinstance(values, np.ndarray):
        _refuse(name, f"an array of shape {_said(like)}", given(values))
    if not _is_like(values.shape, like):
        _refuse(name, f"shape {_said(like)}", _said(values.shape))
    if values.dtype.kind not in "fiu":
        _refuse(name, "numbers", f"an array of {values.dtype}")


def whole_numbers(name: str, values: object, like: Shape = ("n",)) -> None:
    """Raise where values are no array of whole numbers with the shape `like`."""
    if isinstance(values, np.ndarray) and values.dtype.kind not in "iu":
        _refuse(name, "whole numbers", f"an array of {values.dtype}")
    shape(name, values, like)


def places(name: str, values: Index, n: int) -> None:
    """Raise where some of these whole numbers do not lie between 0 and n - 1."""
    if len(values) and not (values.min() >= 0 and values.max() < n):
        wrong = (values < 0) | (values >= n)
        _refuse(name, f"whole numbers from 0 to {n - 1}", _first(values, wrong))


def mask(name: str, values: object, n: int) -> None:
    """Raise where values are no mask of length n."""
    wanted = f"a mask of {n} True or False"
    if not isinstance(values, np.ndarray):
        _refuse(name, wanted, given(values))
    if values.dtype != bool:
        _refuse(name, wanted, f"an array of {values.dtype}")
    if values.shape != (n,):
        _refuse(name, wanted, f"{len(values)}" if values.ndim == 1 else f"shape {values.shape}")


def finite(name: str, values: Array) -> None:
    """Raise where numbers are not finite."""
    if not np.isfinite(values).all():
        _refuse(name, "finite numbers", _first(values, ~np.isfinite(values)))


def positive(name: str, values: Array) -> None:
    """Raise where a number is not above zero; infinite ones pass."""
    if not (values > 0).all():
        _refuse(name, "positive numbers", _first(values, ~(values > 0)))


def not_negative(name: str, values: Array) -> None:
    """Raise where a number is below zero, or NaN."""
    if not (values >= 0).all():
        _refuse(name, "zero or positive numbers", _first(values, ~(values >= 0)))


def rotation(name: str, R: Array) -> None:
    """Raise where a matrix, shape (3, 3), is no rotation; NaN passes."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = R.tolist()  # fast: cameras are made often
    crossed = (ay * bz - az * by - cx, az * bx - ax * bz - cy, ax * by - ay * bx - cz)
    squares = (ax * ax + ay * ay + az * az - 1, bx * bx + by * by + bz * bz - 1)
    for error in (*crossed, *squares, ax * bx + ay * by + az * bz):
        if abs(error) > RIGID:
            _refuse(name, "a rotation matrix", "one that does not turn, or mirrors")


def rotations(name: str, R: Array) -> None:
    """Raise where one of the matrices, shape (n, 3, 3), is no rotation; NaN passes."""
    errors = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)) > RIGID
    mirrored = np.sum(np.cross(R[..., 0, :], R[..., 1, :]) * R[..., 2, :], axis=-1) < 0
    if errors.any() or mirrored.any():
        row = int(np.argmax(errors.any(axis=(-2, -1)) | mirrored))
        _refuse(name, "rotation matrices", f"one that does not turn, or mirrors, in row {row}")


def square(name: str, cov: Array) -> None:
    """Raise where an array does not hold square matrices."""
    shape(name, cov, (..., "n", "n"))
    if cov.shape[-1] != cov.shape[-2]:
        _refuse(name, "shape (..., n, n)", _said(cov.shape))


def symmetric(name: str, cov: Array) -> None:
    """Raise where a square matrix is not symmetric."""
    if cov.size and np.abs(cov - cov.T).max() > 1e-6 * np.abs(cov).max():
        _refuse(name, "a symmetric matrix", "one that is not")


def _is_like(actual: tuple[int, ...], like: Shape) -> bool:
    if like[0] is ...:
        like = like[1:]
        actual = actual[-len(like) :]
    if len(actual) != len(like):
        return False
    for n, wanted in zip(actual, like, strict=True):  # a plain loop is fast; it runs very often
        if n != wanted and not isinstance(wanted, str):
            return False
    return True


def _said(like: Shape) -> str:
    axes = ["..." if axis is ... else str(axis) for axis in like]
    return f"({axes[0]},)" if len(axes) == 1 else f"({', '.join(axes)})"


def _first(values: Array | Index, wrong: Mask) -> str:
    """Return the first of the wrong values, and its row."""
    index = tuple(np.argwhere(wrong)[0])
    return f"{values[index].item()!r}" + (f" in row {index[0]}" if index else "")


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


# --- sentences -------------------------------------------------------------------------------


def given(value: object) -> str:
    """Describe a value in a few words, for a message."""
    if value is None or isinstance(value, str | bool | int | float | np.generic):
        return repr(value.item() if isinstance(value, np.generic) else value)
    if isinstance(value, np.ndarray):
        return "an array" if value.ndim else repr(value.item())
    return _with_article(type(value).__name__)


def _with_article(noun: str) -> str:
    return f"{'an' if noun[0] in 'AEIOUaeiou' else 'a'} {noun}"


def _refuse(name: str, what: str, got: str) -> NoReturn:
    raise ValueError(f"{name}: expected {what}, got {got}")
