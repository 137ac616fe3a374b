"""Flights that were never flown, for tests, for the book, and for planning.

Exact geometry in ECEF over hills, with an implementation of its own of everything that the
library computes: rotations, ellipsoid, lens. Nothing is shared, so that no sign can cancel.
Conventions are those of the flight-data contract: body forward, left, up; boresight camera to
body; distortion a function of the measured point.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from acx4sim.designs import acx4_plan, single_head_plan
from acx4sim.files.flights import SimulatedFlight, photograph, simulate_plan
from acx4sim.files.writer import TRUTH_MARK, truth_path, write
from acx4sim.pictures.ground_rays import (
    Station,
    ground_from_pixels,
    pixels_from_ground,
    reduced,
    station,
)
from acx4sim.pictures.photography import landscape
from acx4sim.pictures.pictures import Tiles, camera_response, head_images, picture
from acx4sim.plan import GrossErrors, Options, SlowErrors
from acx4sim.scenery.photo import read_photo

__all__ = [
    "DESIGNS",
    "TRUTH_MARK",
    "GrossErrors",
    "Options",
    "SimulatedFlight",
    "SlowErrors",
    "Station",
    "Tiles",
    "acx4",
    "acx4_plan",
    "camera_response",
    "ground_from_pixels",
    "head_images",
    "landscape",
    "photograph",
    "picture",
    "pixels_from_ground",
    "read_photo",
    "reduced",
    "simulate_plan",
    "single_head",
    "single_head_plan",
    "station",
    "truth_path",
    "write",
]


def acx4(*, seed: int = 1, options: Options = Options()) -> SimulatedFlight:  # noqa: B008 frozen
    """Simulate the paper's flight: four heads, a synthetic camera, three blocks.

    Parameters
    ----------
    seed : int
        The same seed gives the same bytes.
    options : Options
        Noise, tie points, GNSS errors, blocks.
    """
    return simulate_plan(acx4_plan(), seed, options)


def single_head(*, seed: int = 1, options: Options = Options()) -> SimulatedFlight:  # noqa: B008 frozen
    """Simulate a flight of one ordinary camera, turned by 90 degrees on its mount.

    Parameters
    ----------
    seed : int
        The same seed gives the same bytes.
    options : Options
        Noise, tie points, GNSS errors, blocks.
    """
    return simulate_plan(single_head_plan(), seed, options)


DESIGNS: Mapping[str, Callable[..., SimulatedFlight]] = MappingProxyType(
    {"acx4": acx4, "single-head": single_head}
)
