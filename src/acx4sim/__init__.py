"""Flights that were never flown, for tests, for the book, and for planning.

Exact geometry in ECEF over hills, with an implementation of its own of everything that the library
computes: rotations, `earth`, lens. Nothing is shared, so that no sign can cancel. The conventions
are those of a flight's folder: body forward, left, up; boresight camera to body; distortion a
function of the measured point. `designs` are three flights, each a `plan`; `fly` is where the
aircraft truly is, and what is measured; `optics`, `scenery`, `pictures` and `files` do the rest.
Begin with `designs`, whose `simulate` writes one of them.
"""

from acx4sim.designs import DESIGNS, acx4, acx4_ideal, simulate
from acx4sim.files import write
from acx4sim.plan import Options

__all__ = ["DESIGNS", "Options", "acx4", "acx4_ideal", "simulate", "write"]
