"""The cameras of a chunk, which are images: sensor, rig, pose and measured reference of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib.exchange.programs.metashape.sensors import Sensor
from acx4lib.exchange.programs.shared.cameras import FLIP, is_rotation
from acx4lib.exchange.programs.shared.tables import require_names, without_doubles
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.expected import Array
from acx4lib.flight.problems import Range, quoted
from acx4lib.geometry.frames import Pose

ANGLES = ("yaw", "pitch", "roll")
VALUES = Range(-1e9, 1e9)
LOCATION = ("x", "y", "z")
TOGETHER = {
    "x": ("sxy", "sxyz"),
    "y": ("sxy", "sxyz"),
    "z": ("sxyz",),
    **dict.fromkeys(ANGLES, ("sypr", "syawpitchroll")),
}
"""Attributes with the accuracy of several values of a reference, the narrowest first."""

LARGEST = 1e9
"""Largest coordinate of a chunk, or of the place where it lies."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """An image.

    Attributes
    ----------
    name, camera, exposure : str
        As images.csv has them.
    sensor : Sensor
    enabled : bool
    T_c : Pose or None
        The camera's pose in the chunk, the library's camera axes; a slave's is its master's,
        turned by its sensor's rotation.
    reference : Element or None
        What was measured of it; only masters have that.
    component : str
        The part of the chunk that it was aligned in.
    """

    name: str
    exposure: str
    sensor: Sensor
    enabled: bool
    T_c: Pose | None
    reference: Element | None
    component: str

    @property
    def camera(self) -> str:
        """Name of its camera."""
        return self.sensor.name


def shots(root: Element, sensors: Mapping[str, Sensor]) -> tuple[dict[str, Shot], int]:
    """Return the images of a chunk by their numbers, and how many labels stand twice."""
    elements = {}
    for element in root.one("cameras").everywhere("camera"):
        i = element.attribute("id")
        if i in elements:
            raise element.wrong(f"{quoted(i)} is there twice", "must be unique", attribute="id")
        if element.attribute("sensor_id") not in sensors:
            given = quoted(element.attribute("sensor_id"))
            raise element.wrong(given, "must be a sensor's id", attribute="sensor_id")
        elements[i] = element
    labels = [one.attribute("label").strip() for one in elements.values()]
    names, doubled = without_doubles(labels, list(elements))
    places = dict(zip(names, elements.values(), strict=True))
    require_names(
        names, lambda name, found, expected: places[name].wrong(found, expected, attribute="label")
    )
    named = dict(zip(elements, names, strict=True))
    return {i: _shot(element, elements, named, sensors) for i, element in elements.items()}, doubled


def _shot(
    element: Element,
    elements: Mapping[str, Element],
    named: Mapping[str, str],
    sensors: Mapping[str, Sensor],
) -> Shot:
    i = element.attribute("id")
    leader = element.attributes.get("master_id", i)
    if leader not in elements:
        raise element.wrong(quoted(leader), "must be a camera's id", attribute="master_id")
    master = elements[leader]
    sensor = sensors[element.attribute("sensor_id")]
    return Shot(
        name=named[i],
        exposure=named[leader],
        sensor=sensor,
        enabled=is_on(element) and is_on(master),
        T_c=_pose(master, sensor, sensors[master.attribute("sensor_id")]),
        reference=element.maybe("reference") if i == leader else None,
        component=master.attributes.get("component_id", ""),
    )


def _pose(master: Element, sensor: Sensor, of_master: Sensor) -> Pose | None:
    """Return a camera's pose in the chunk."""
    transform = master.maybe("transform")
    if transform is None:
        return None
    values = transform.numbers(16).reshape(4, 4)
    R = values[:3, :3]
    if not is_rotation(R) or np.abs(values[:3, 3]).max() > LARGEST:
        raise transform.wrong("does not turn", "must be a rotation and a place, row by row")
    u, _, v = np.linalg.svd(R)
    R_master_c = of_master.lens.mount.R.T @ sensor.lens.mount.R
    return Pose(R=u @ v @ FLIP @ R_master_c, r=values[:3, 3])


def location(reference: Element) -> Array | None:
    """Return x, y, z of a reference, shape (3,); None where one is absent."""
    return _three(reference, LOCATION)


def rotation(reference: Element) -> Array | None:
    """Return yaw, pitch, roll of a reference, degrees, shape (3,); None where one is absent."""
    return _three(reference, ANGLES)


def accuracy(reference: Element, names: tuple[str, str, str]) -> Array:
    """Return the sigmas of three values, shape (3,); NaN where a value has none that is positive.

    An attribute names the values that it is of: ``sx``, ``sxy``, ``sxyz``, ``syaw``, ``sypr``. That
    of the fewest values counts.
    """
    sigma = np.full(3, np.nan)
    for k, name in enumerate(names):
        for attribute in (f"s{name}", *TOGETHER[name]):
            if attribute in reference.attributes:
                value = reference.number(attribute, VALUES)
                sigma[k] = value if value > 0 else np.nan
                break
    return sigma


def measured_place(reference: Element) -> Array | None:
    """Return the location of a reference, as `location`; None where it is switched off."""
    return location(reference) if is_on(reference) else None


def measured_rotation(reference: Element) -> Array | None:
    """Return the rotation of a reference, as `rotation`; None where it is switched off."""
    switched_on = is_on(reference) and is_on(reference, "rotation_enabled")
    return rotation(reference) if switched_on else None


def _three(element: Element, names: tuple[str, ...]) -> Array | None:
    if any(name not in element.attributes for name in names):
        return None
    return np.array([element.number(name, VALUES) for name in names])


def is_on(element: Element, switch: str = "enabled") -> bool:
    """Tell whether an image, or its reference, takes part in Metashape's adjustment."""
    return element.attributes.get(switch, "true") not in ("false", "0")
