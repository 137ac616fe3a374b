"""Figures of the surround-view rig; if its photographs are missing, a sentence says so."""

from __future__ import annotations

from matplotlib.figure import Figure

from acx4book.reference import data
from acx4book.reference.surround.comparisons import AS_PUBLISHED, BEST, FILES, solved
from acx4book.reference.surround.figures import (
    surround_enlarged,
    surround_ground,
    surround_misfits,
    surround_photographs,
)
from acx4book.typesetting.style import nothing

MISSING = "The photographs are not on this machine: `make reference-data` brings them."


def photographs(*, folder: str = "") -> Figure:
    """Draw the photographs; `folder` has the reference data, the usual folder if empty."""
    with data.at(folder):
        if not data.is_here(FILES):
            return nothing(MISSING)
        return surround_photographs(solved().cameras, solved().images)


def ground(*, folder: str = "") -> Figure:
    """Draw the ground in the original views, and as one image of refined cameras."""
    with data.at(folder):
        if not data.is_here(FILES):
            return nothing(MISSING)
        found = solved()
        return surround_ground(found.refinements[BEST], found.views, found.equalised(BEST))


def enlarged(*, folder: str = "") -> Figure:
    """Draw a part of every overlap, with published and with refined cameras."""
    with data.at(folder):
        if not data.is_here(FILES):
            return nothing(MISSING)
        found = solved()
        stages = {name: found.equalised(name) for name in (AS_PUBLISHED, BEST)}
        return surround_enlarged(found.cameras, found.corners, stages)


def misfit_vectors(*, folder: str = "") -> Figure:
    """Draw the distances between corners in neighbouring cameras, for all refinements."""
    with data.at(folder):
        if not data.is_here(FILES):
            return nothing(MISSING)
        return surround_misfits(solved().refinements, solved().corners)
