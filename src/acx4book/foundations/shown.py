"""Vectors and matrices as mathematics, with their numbers."""

from __future__ import annotations

import numpy as np
from IPython.display import Markdown
from numpy.typing import ArrayLike


def matrix(name: str, values: ArrayLike, *, digits: int, unit: str = "") -> Markdown:
    """Return ``name = (values) unit`` as an equation without a number.

    Parameters
    ----------
    name : str
        LaTeX.
    values : array_like, shape (n,) or (n, m)
        A vector stands upright, as a column.
    digits : int
        After the decimal point.
    unit : str
        Behind the bracket, upright.
    """
    rows = np.atleast_2d(np.asarray(values, dtype=float).T).T
    body = r" \\ ".join(
        " & ".join(f"{v + 0.0:.{digits}f}" for v in row) for row in rows.round(digits)
    )
    behind = rf"\ \mathrm{{{unit}}}" if unit else ""
    return Markdown(  # type: ignore[no-untyped-call] # untyped
        rf"$${name} = \begin{{pmatrix}} {body} \end{{pmatrix}}{behind}$$"
    )
