"""The sensors of a chunk: cameras with a calibration, alone or as slaves of a rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.exchange.programs.metashape import lens
from acx4lib.exchange.programs.metashape.lens import Calibration
from acx4lib.exchange.programs.shared.cameras import TOP_AHEAD, Lens, is_rotation, turned
from acx4lib.exchange.programs.shared.tables import require_names, without_doubles
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.expected import Array
from acx4lib.flight.problems import PIXELS, RANGES, Range, quoted
from acx4lib.geometry.frames import Pose

POSITIVE = Range(1e-9, 1e9, "must be positive")


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A sensor of Metashape.

    Attributes
    ----------
    name : str
        Its label; with its number where two have the same.
    lens : Lens
    kind : str
        Which calibration was taken: adjusted, initial, or nominal.
    master : str
        Number of the master sensor of a rig; its own, where it is no slave.
    """

    name: str
    lens: Lens
    kind: str
    master: str


def sensors(root: Element, *, wanted: str) -> dict[str, Sensor]:
    """Return the sensors that a chunk's images have by their numbers; all, where it has no image.

    Parameters
    ----------
    root : Element
        The chunk.
    wanted : str
        Calibration that is taken where it is there: adjusted or initial.
    """
    elements = list(root.each("sensors", "sensor"))
    if not elements:
        raise root.wrong("has no <sensor>", "must have one")
    ids = [one.attribute("id") for one in elements]
    labels = [one.attributes.get("label", "").strip() or "unknown" for one in elements]
    names, _ = without_doubles(labels, ids)
    places = dict(zip(names, elements, strict=True))
    require_names(
        names, lambda name, found, expected: places[name].wrong(found, expected, attribute="label")
    )
    found = {}
    images = [one for listed in root.each("cameras") for one in listed.everywhere("camera")]
    used = {one.attributes.get("sensor_id") for one in images} or set(ids)
    for i, name, element in zip(ids, names, elements, strict=True):
        if i in found:
            raise element.wrong(f"{quoted(i)} is there twice", "must be unique", attribute="id")
        master = element.attributes.get("master_id", i)
        if master not in ids:
            raise element.wrong(quoted(master), "must be a sensor's id", attribute="master_id")
        if i in used:
            found[i] = _sensor(element, name, master, wanted=wanted, is_slave=master != i)
    return found


def _sensor(element: Element, name: str, master: str, *, wanted: str, is_slave: bool) -> Sensor:
    calibration, kind = _chosen(element, wanted)
    lens = Lens(
        width_px=calibration.width_px,
        height_px=calibration.height_px,
        pixel_um=1000 * (_property(element, "pixel_width") or 0.0),
        hole=calibration.hole,
        ideal=calibration.ideal,
        mount=Pose(R=TOP_AHEAD @ _rotation(element, is_slave=is_slave), r=np.zeros(3)),
    )
    return Sensor(name=name, lens=lens, kind=kind, master=master)


def _rotation(element: Element, *, is_slave: bool) -> Array:
    """Return R_master_slave in the library's camera axes; what is written is slave to master."""
    rotation = element.maybe("rotation")
    if rotation is None or not is_slave:
        return np.eye(3)
    R = rotation.numbers(9).reshape(3, 3)
    if not is_rotation(R, 1e-5):
        raise rotation.wrong("is no rotation", "must be a rotation matrix, row by row")
    return np.asarray(turned(R))


def _chosen(element: Element, wanted: str) -> tuple[Calibration, str]:
    """Return a sensor's calibration, and which it is."""
    found = {one.attributes.get("class", "adjusted"): one for one in element.each("calibration")}
    if wanted in found:
        return calibration(found[wanted]), wanted
    if "initial" in found:
        return calibration(found["initial"]), "initial"
    focal, pixel = (_property(element, name) for name in ("focal_length", "pixel_width"))
    if not focal or not pixel:
        raise element.wrong(
            f"has no {wanted} calibration", "must have one, or focal_length and pixel_width"
        )
    width, height = _resolution(element)
    plain = Calibration(type=_type(element), width_px=width, height_px=height, f=focal / pixel)
    return plain, "nominal"


def calibration(element: Element) -> Calibration:
    """Return what an element ``calibration`` says, of a sensor or of a file of its own."""
    if element.maybe("fx") is not None:
        raise element.wrong(
            "has <fx>: PhotoScan before 1.2 wrote it, whose p1 and p2 mean other things",
            "must have <f>; open and save the project with a newer version",
        )
    width, height = _resolution(element)
    values = {
        one.tag: one.number() for one in element.below if one.tag in (*lens.NAMES, "cx", "cy")
    }
    cx, cy = values.pop("cx", 0.0), values.pop("cy", 0.0)
    f = element.one("f").number(allowed=POSITIVE)
    others = {name: value for name, value in values.items() if value}
    if f + others.get("b1", 0.0) <= 0:
        raise element.wrong("f + b1 is not positive", "must be a focal length in px")
    return Calibration(
        type=_type(element), width_px=width, height_px=height, f=f, cx=cx, cy=cy, others=others
    )


def _type(element: Element) -> str:
    alone = element.maybe("projection")
    kind = element.attributes.get("type", "frame") if alone is None else alone.text
    if kind not in lens.TYPES:
        expected = f"must be one of {', '.join(lens.TYPES)}"
        if alone is not None:
            raise alone.wrong(quoted(kind), expected)
        raise element.wrong(quoted(kind), expected, attribute="type")
    return kind


def _resolution(element: Element) -> tuple[int, int]:
    if element.maybe("width") is not None:
        width, height = (element.one(side).number(allowed=PIXELS) for side in ("width", "height"))
    else:
        size = element.one("resolution")
        width, height = (size.number(side, PIXELS) for side in ("width", "height"))
    return int(width), int(height)


def _property(element: Element, name: str) -> float | None:
    """Return a sensor's property in mm; None where it is absent or zero."""
    for one in element.each("property"):
        if one.attributes.get("name") == name:
            value = one.number("value")
            if value == 0:
                return None
            in_um = RANGES["pixel_um"]
            if name == "pixel_width" and 1000 * value not in in_um:
                raise one.wrong(f"{value:g} mm", f"{in_um} µm", attribute="value")
            return value
    return None
