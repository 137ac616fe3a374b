"""The markers of a chunk: surveyed points, and where they are in images.

Only a location with ``pinned="true"`` was measured. The others are where Metashape expects the
marker: they follow from its own adjustment and say nothing that is new.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib.exchange.programs.metashape.files import Chunk
from acx4lib.exchange.programs.metashape.shots import LOCATION, Shot, accuracy, location
from acx4lib.exchange.programs.shared.tables import require_names
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.expected import Array, Mask
from acx4lib.flight.problems import RANGES, quoted

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in Metashape."""


@dataclass(frozen=True, kw_only=True)
class Surveyed:
    """A marker with coordinates.

    Attributes
    ----------
    xyh : ndarray, shape (3,)
        In the chunk's own coordinate system.
    sigma : ndarray, shape (3,)
        NaN where the marker has none of its own.
    is_check : bool
        Whether it takes no part in Metashape's adjustment.
    """

    xyh: Array
    sigma: Array
    is_check: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Locations:
    """Where markers are in images.

    Attributes
    ----------
    shots : tuple of Shot
    points : tuple of str
        Labels of markers.
    colrow : ndarray, shape (n, 2)
        The library's pixels.
    measured : ndarray of bool, shape (n,)
    lost : int
        Locations in cameras that are not in the chunk.
    """

    shots: tuple[Shot, ...]
    points: tuple[str, ...]
    colrow: Array
    measured: Mask
    lost: int


def labels(root: Element) -> dict[str, str]:
    """Return the labels of markers by their numbers."""
    found: dict[str, str] = {}
    places: dict[str, Element] = {}
    for marker in root.each("markers", "marker"):
        label = marker.attribute("label").strip()
        if label in places:
            raise marker.wrong(
                f"{quoted(label)} is there twice", "must be unique", attribute="label"
            )
        places[label] = marker
        found[marker.attribute("id")] = label
    require_names(
        list(places),
        lambda name, what, expected: places[name].wrong(what, expected, attribute="label"),
    )
    return found


def surveyed(root: Element) -> dict[str, Surveyed]:
    """Return the markers with coordinates by their labels."""
    found = {}
    for marker in root.each("markers", "marker"):
        reference = marker.maybe("reference")
        if reference is None or (xyh := location(reference)) is None:
            continue
        found[marker.attribute("label").strip()] = Surveyed(
            xyh=xyh,
            sigma=accuracy(reference, LOCATION),
            is_check=reference.attributes.get("enabled", "true") in ("false", "0"),
        )
    return found


def locations(chunk: Chunk, shots: Mapping[str, Shot], names: Mapping[str, str]) -> Locations:
    """Return all locations of markers in the images of a chunk's first frame."""
    in_shots, points, colrow, measured, lost = [], [], [], [], 0
    seen = set()
    for marker in chunk.frame.each("markers", "marker") if chunk.frame else ():
        i = marker.attribute("marker_id")
        if i not in names:
            raise marker.wrong(quoted(i), "must be a marker's id", attribute="marker_id")
        for place in marker.each("location"):
            camera = place.attribute("camera_id")
            if camera not in shots:
                lost += 1
                continue
            if (i, camera) in seen:
                raise place.wrong(f"marker {names[i]} is twice in one camera", "must be there once")
            seen.add((i, camera))
            in_shots.append(shots[camera])
            points.append(names[i])
            x, y = (place.number(axis, RANGES["col_px"]) for axis in ("x", "y"))
            colrow.append((x - HALF, y - HALF))
            measured.append(place.attributes.get("pinned") in ("true", "1"))
    return Locations(
        shots=tuple(in_shots),
        points=tuple(points),
        colrow=np.array(colrow, dtype=float).reshape(-1, 2),
        measured=np.array(measured, dtype=bool),
        lost=lost,
    )
