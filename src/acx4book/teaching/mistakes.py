"""Mistakes that are made with numbers of every kind: sign, unit, order, a transposed matrix."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from acx4book.teaching.case import Mistake, Rights
from acx4lib.expected import Array
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk

GON = 400.0 / 360.0
RADIAN = float(np.pi / 180.0)


def named(names: Sequence[str], values: Array) -> dict[str, float]:
    """Return values by the names of their questions."""
    return dict(zip(names, np.asarray(values, dtype=float).ravel().tolist(), strict=True))


def values(right: Rights, names: Sequence[str]) -> Array:
    """Return right answers, shape (n,)."""
    return np.array([right[name].value for name in names])


def scaled(right: Rights, names: Sequence[str], factor: float, says: str) -> Mistake:
    """Return numbers in another unit, their standard deviations with them."""
    sigma = {name: right[name].sigma for name in names}
    return Mistake(
        says=says,
        gives=named(names, factor * values(right, names)),
        gives_sigma={name: factor * s for name, s in sigma.items() if s is not None},
        scale=max(1.0, abs(factor)),
    )


def wrong_sign(right: Rights, names: Sequence[str], says: str = "the sign is wrong") -> Mistake:
    """Return numbers with the other sign."""
    return Mistake(says=says, gives=named(names, -values(right, names)))


def swapped(right: Rights, first: str, second: str, says: str) -> Mistake:
    """Return two answers, each in the place of the other."""
    return Mistake(says=says, gives={first: right[second].value, second: right[first].value})


def of_angles(right: Rights, names: Sequence[str]) -> Iterator[Mistake]:
    """Yield angles in gon and in radians."""
    yield scaled(right, names, GON, "given in gon; asked for in degrees")
    yield scaled(right, names, RADIAN, "given in radians; asked for in degrees")


def of_rotation(right: Rights, opk: Sequence[str]) -> Iterator[Mistake]:
    """Yield what is done wrong with omega, phi and kappa of one rotation."""
    R = rotation_from_opk(np.radians(values(right, opk)))
    yield Mistake(
        says="the rotation is transposed: it takes the other frame's axes; transpose the matrix",
        gives=named(opk, np.degrees(opk_from_rotation(R.T))),
    )
    yield wrong_sign(right, opk, "the signs of the angles are wrong: positive turns are taken back")
    yield swapped(right, opk[0], opk[1], "omega and phi are swapped: x and y axes")
    yield from of_angles(right, opk)


def variances(right: Rights) -> Mistake:
    """Return variances in the place of standard deviations."""
    return Mistake(
        says="σ is a variance: take the square root",
        gives_sigma={name: r.sigma**2 for name, r in right.items() if r.sigma is not None},
    )


def too_small(right: Rights, n: Mapping[str, int], what: str) -> Mistake:
    """Return standard deviations that were divided by √n, though the errors are shared."""
    return Mistake(
        says=f"σ is too small by √n: the {what} are not independent, they share errors",
        gives_sigma={
            name: sigma / count**0.5
            for name, count in n.items()
            if (sigma := right[name].sigma) is not None
        },
    )
