"""The kinds of exports, by the names that ``acx4 export --to`` has for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from acx4tools.exchange.outward import (
    colmap,
    flight_toml,
    metashape,
    micasense,
    micmac,
    opencv,
    opensfm,
    opf,
    orientations,
    pix4d,
)
from acx4tools.exchange.outward.calibrated import Calibrated
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import Taken


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of export.

    Attributes
    ----------
    cameras : callable or None
        Makes the files of the cameras; None where the kind has orientations alone.
    oriented : callable or None
        Makes the files of cameras with oriented images; None where the kind has no place for them.
    heads : bool
        Whether it is for several heads only.
    on_map : bool
        Whether its orientations need a place on the Earth.
    """

    cameras: Callable[[Calibrated], Taken] | None = None
    oriented: Callable[[Calibrated, Oriented], Taken] | None = None
    heads: bool = False
    on_map: bool = False


KINDS: Mapping[str, Kind] = {
    "toml": Kind(cameras=flight_toml.take),
    "opencv": Kind(cameras=opencv.cameras),
    "metashape": Kind(cameras=metashape.cameras, oriented=metashape.images, on_map=True),
    "colmap": Kind(cameras=colmap.cameras, oriented=colmap.images),
    "opensfm": Kind(cameras=opensfm.cameras, oriented=opensfm.images, on_map=True),
    "opf": Kind(cameras=opf.cameras, oriented=opf.images, on_map=True),
    "micasense": Kind(cameras=micasense.cameras, heads=True),
    "pix4d": Kind(cameras=pix4d.cameras, oriented=pix4d.images),
    "micmac": Kind(cameras=micmac.cameras, oriented=micmac.images),
    "opk": Kind(oriented=lambda _, oriented: orientations.opk(oriented)),
    "opk-topocentric": Kind(
        oriented=lambda _, oriented: orientations.topocentric_table(oriented), on_map=True
    ),
    "rph": Kind(oriented=lambda _, oriented: orientations.rph(oriented), on_map=True),
}
