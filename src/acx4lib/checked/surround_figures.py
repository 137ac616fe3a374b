"""Figures of the surround-view rig; where its photographs are missing, they say so."""

from __future__ import annotations

from matplotlib.figure import Figure

from acx4lib import plot, reference
from acx4lib.checked.surround import AS_PUBLISHED, BEST, FILES, solved
from acx4lib.plot._style import nothing

MISSING = "The photographs are not on this machine: `make reference-data` brings them."


def photographs(*, folder: str = "") -> Figure:
    """Draw the photographs; `folder` has the reference data, or is empty for where they are."""
    with reference.at(folder):
        if not reference.is_here(FILES):
            return nothing(MISSING)
        return plot.surround_photographs(solved().cameras, solved().images)


def ground(*, folder: str = "") -> Figure:
    """Draw the ground as taken, and as one image of refined cameras."""
    with reference.at(folder):
        if not reference.is_here(FILES):
            return nothing(MISSING)
        found = solved()
        return plot.surround_ground(found.refinements[BEST], found.views, found.equalised(BEST))


def enlarged(*, folder: str = "") -> Figure:
    """Draw a piece of every overlap, as published and refined."""
    with reference.at(folder):
        if not reference.is_here(FILES):
            return nothing(MISSING)
        found = solved()
        stages = {name: found.equalised(name) for name in (AS_PUBLISHED, BEST)}
        return plot.surround_enlarged(found.cameras, found.corners, stages)


def misfit_vectors(*, folder: str = "") -> Figure:
    """Draw how far the cameras show the corners apart, for all refinements."""
    with reference.at(folder):
        if not reference.is_here(FILES):
            return nothing(MISSING)
        return plot.surround_misfits(solved().refinements, solved().corners)
