"""Points that are measured in one picture, carried into all others by matching."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib.expected import Array, Index
from acx4tools.measuring.pictures.ground import Surface
from acx4tools.measuring.pictures.pairs import MatchOptions, found_in
from acx4tools.measuring.pictures.views import View, transferred

NATURAL = MatchOptions(search_px=8)


def carried(
    view: View, others: Sequence[View], surface: Surface, colrow: Array
) -> tuple[Index, Array, Array]:
    """Return where other pictures show a point that one picture shows.

    Parameters
    ----------
    view : View
        The picture in which it is measured.
    others : sequence of View
    surface : Surface
    colrow : ndarray, shape (2,)
        Its place there.

    Returns
    -------
    which : ndarray, shape (n,)
        Numbers of the other pictures that show it.
    colrow : ndarray, shape (n, 2)
    sigma_px : ndarray, shape (n,)
        Of the matching; that of the given measurement is not in it.
    """
    middle = np.rint(colrow).astype(np.intp)
    which, places, sigmas = [], [], []
    for k, other in enumerate(others):
        found = found_in(view, other, surface, middle[None], NATURAL)
        if len(found):
            here = transferred(view, other, surface, np.stack([middle.astype(float), colrow]))
            which.append(k)
            places.append(found.colrow[0] + (here[1] - here[0]))
            sigmas.append(found.sigma_px[0, 1])
    return np.array(which, np.intp), np.array(places).reshape(-1, 2), np.array(sigmas)
