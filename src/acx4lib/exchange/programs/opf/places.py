"""Coordinates of an OPF project in the flight's own coordinate system.

Every place has a coordinate system of its own, whose order of axes its coordinates follow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4lib.exchange.programs.opf.project import Project
from acx4lib.exchange.programs.shared import crs
from acx4lib.exchange.programs.shared.crs import Chosen
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A place of the project, as its node ``geolocation`` has it.

    Attributes
    ----------
    node : Node
    xyh : ndarray, shape (3,)
        East or longitude first.
    sigma : ndarray, shape (3,)
        East, north, height, m; 0 where it is not given.
    text : str
        Definition of the coordinate system.
    heights : str or float
        As the key of flight.toml.
    """

    node: Node
    xyh: Array
    sigma: Array
    text: str
    heights: str | float


def place(node: Node) -> Place:
    """Return what a node ``geolocation`` says."""
    definition = node.one("crs", "definition")
    text = definition.text()
    try:
        system = crs.parsed(text)
        swap = crs.is_north_first(system)
    except ValueError as error:
        raise definition.wrong(str(error), "must be a coordinate system") from None
    order = [1, 0, 2] if swap else [0, 1, 2]
    sigma = node.maybe("sigmas")
    undulation = node.maybe("crs", "geoid_height")
    return Place(
        node=node,
        xyh=node.one("coordinates").numbers(3, allowed=METRES)[order],
        sigma=np.zeros(3) if sigma is None else np.maximum(sigma.numbers(3), 0.0)[order],
        text=text,
        heights=crs.heights_of(system) if undulation is None else undulation.number(),
    )


def system(
    project: Project, captured: list[Place], surveyed: list[Place], wanted: str | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the project has none on the Earth.

    It is that of the scene reference frame where this is projected, else the UTM zone of the first
    place; heights are those of the control points, else of the captures.
    """
    frame = project.documents.get("scene-reference-frame")
    nodes: list[tuple[Node, Array | None]] = []
    if frame is not None:
        nodes.append((frame.one("crs", "definition"), None))
    nodes += [(one.node.one("crs", "definition"), one.xyh[:2]) for one in (*captured, *surveyed)]
    found, fault = None, None
    for node, at in nodes:
        try:
            found = crs.chosen(node.text(), at, wanted)
        except ValueError as error:
            fault = fault or node.wrong(str(error), "must be one that a flight can have")
        if found is not None:
            break
    if found is None and fault is not None:
        raise fault
    places = (*surveyed, *captured)
    return found if found is None or not places else with_heights(found, places[0].heights)


def with_heights(found: Chosen, heights: str | float) -> Chosen:
    """Return a system with other heights, and what is said of them."""
    said = "above the ellipsoid" if heights == "ellipsoidal" else f"of {heights}"
    if isinstance(heights, float):
        said = f"{heights:g} m less than above the ellipsoid"
    return replace(found, heights=heights, assumed=(*found.assumed[:1], f"Heights are {said}"))


def enh(system: Chosen, one: Place) -> Array:
    """Return east, north, height of a place in the flight's system, shape (3,)."""
    try:
        of_place = replace(system, source=crs.parsed(one.text))
        there = of_place.from_source(one.xyh[None])
        there = crs.with_heights(system, there, one.heights)
    except ValueError as error:
        found = " ".join(str(error).split()).split(" (Error")[0]
        raise one.node.wrong(found, "must be convertible into the flight's system") from None
    if not np.isfinite(there).all():
        raise one.node.wrong("lies outside the flight's system", "must lie inside")
    return np.asarray(there[0])
