"""The sensors of an OPF project, alone or in a rig."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib.exchange.programs.opf.lens import internals
from acx4lib.exchange.programs.opf.project import Project
from acx4lib.exchange.programs.shared.cameras import FLIP, TOP_AHEAD, Lens, turned
from acx4lib.exchange.programs.shared.tables import require_names, without_doubles
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.flight.problems import PIXELS, RANGES
from acx4lib.geometry.frames import Pose, rotation_from_opk


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A sensor of OPF.

    Attributes
    ----------
    name : str
        With its number where two have the same.
    lens : Lens
    is_calibrated : bool
        Whether its lens and its place in the rig are those after the adjustment.
    sigma : str
        Standard deviations of its place in the rig, as a sentence; empty where there are none.
    """

    name: str
    lens: Lens
    is_calibrated: bool
    sigma: str


def sensors(project: Project, *, wanted: str) -> dict[str, Sensor]:
    """Return the sensors of a project by their numbers.

    Parameters
    ----------
    project : Project
        With input cameras, which have the sizes of images and pixels.
    wanted : str
        Lens that is taken where it is there: adjusted or initial.
    """
    given = project.documents.get("input-cameras")
    if given is None:
        source = project.sources[0]
        found = "the project has no input-cameras"
        raise source.wrong("file", found, "required: the sizes of images are there")
    nodes = {one.one("id").text(): one for one in given.one("sensors").each()}
    calibrated = project.documents.get("calibrated-cameras")
    after: dict[str, Node] = {}
    if calibrated is not None and wanted == "adjusted":
        after = {one.one("id").text(): one for one in calibrated.one("sensors").each()}
    ids = list(nodes)
    names, _ = without_doubles(_labels(nodes), ids)
    places = dict(zip(names, nodes.values(), strict=True))
    require_names(names, lambda name, what, expected: places[name].wrong(what, expected))
    return {i: _sensor(name, nodes[i], after.get(i)) for i, name in zip(ids, names, strict=True)}


def _labels(nodes: Mapping[str, Node]) -> list[str]:
    """Return the names of sensors, with their bands where several have one name."""
    found = {}
    for i, node in nodes.items():
        name = node.maybe("name")
        found[i] = i if name is None or not name.text().strip() else name.text().strip()
    often = Counter(found.values())
    return [f"{name} {_bands(nodes[i])}" if often[name] > 1 else name for i, name in found.items()]


def _bands(node: Node) -> str:
    bands = node.maybe("bands")
    listed = [one.maybe("name") for one in bands.each()] if bands is not None else []
    return "+".join(one.text() for one in listed if one is not None)


def _sensor(name: str, given: Node, after: Node | None) -> Sensor:
    source = given if after is None else after
    width, height = (given.one("image_size_px").numbers(2)).tolist()
    for side in (width, height):
        if side not in PIXELS:
            raise given.one("image_size_px").wrong(f"{side:g}", str(PIXELS))
    pixel = given.maybe("pixel_size_um")
    lens = internals(source.one("internals"))
    return Sensor(
        name=name,
        lens=Lens(
            width_px=int(width),
            height_px=int(height),
            pixel_um=0.0 if pixel is None else pixel.number(RANGES["pixel_um"]),
            hole=lens.hole,
            ideal=lens.ideal,
            mount=_mount(source.maybe("rig_relatives") or given.maybe("rig_relatives")),
        ),
        is_calibrated=after is not None,
        sigma=_sigma(given.maybe("rig_relatives")),
    )


def _mount(relatives: Node | None) -> Pose:
    """Return T_b_c from rig relatives, which are input's or calibrated ones."""
    if relatives is None:
        return Pose(R=TOP_AHEAD, r=np.zeros(3))
    shift, turn = relatives.one("translation"), relatives.maybe("rotation")
    if turn is None:
        r, angles = shift.numbers(3), relatives.one("rotation_angles_deg").numbers(3)
    else:
        r, angles = shift.one("values_m").numbers(3), turn.one("angles_deg").numbers(3)
    R_rel = rotation_from_opk(np.radians(angles)[None])[0]  # Rx Ry Rz, as there
    return Pose(R=TOP_AHEAD @ turned(R_rel), r=TOP_AHEAD @ FLIP @ r)


def _sigma(relatives: Node | None) -> str:
    if relatives is None or relatives.maybe("rotation") is None:
        return ""
    turn = relatives.maybe("rotation", "sigmas_deg")
    shift = relatives.maybe("translation", "sigmas_m")
    if turn is None or shift is None:
        return ""
    degrees = ", ".join(f"{value:g}" for value in turn.numbers(3))
    metres = ", ".join(f"{value:g}" for value in shift.numbers(3))
    return f"{degrees} degrees and {metres} m"


def kinds(of: Mapping[str, Sensor], named: set[str]) -> tuple[str, ...]:
    """Return sentences on which lenses were taken, and on rigs."""
    used = [one for one in of.values() if one.name in named]
    after = [one.name for one in used if one.is_calibrated]
    before = [one.name for one in used if not one.is_calibrated]
    return (
        *((f"calibrated internals: {'; '.join(after)}",) if after else ()),
        *((f"initial internals: {'; '.join(before)}",) if before else ()),
        *(
            f"place of {one.name} in the rig before the adjustment, sigma: {one.sigma}"
            for one in used
            if one.sigma
        ),
    )
