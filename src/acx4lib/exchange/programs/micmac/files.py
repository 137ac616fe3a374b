"""MicMac's XML files, by what they hold: orientations, calibrations, measures, surveyed points."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.exchange.programs.micmac import lens
from acx4lib.exchange.programs.shared import cameras
from acx4lib.exchange.safe import opened, xml_tree
from acx4lib.exchange.safe.opened import Opened, Together
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, Range, quoted
from acx4lib.geometry.frames import Pose

MOST = 100_000
"""Largest number of XML files of a folder."""

ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")

AROUND = ("ExportAPERO", "Global")
"""Outermost elements that hold others."""

SKEW = 1e-6
"""Largest difference of a matrix from a rotation."""


Content = tuple[Any, ...]
"""Text of an element, and tags and contents of those below it."""


@dataclass(kw_only=True)
class Files:
    """The XML files of a folder and of the folders Ori-* in it.

    Attributes
    ----------
    read : list of Opened
    orientations : dict of str to Element
        ``OrientationConique`` by image.
    calibrations : dict of str to Element
        ``CalibrationInternConique`` by the name of the file, and ``Interne`` of orientations.
    interior : dict of str to str
        Name of the calibration of each image whose orientation has it itself.
    measures, surveyed : list of Element
        ``SetOfMesureAppuisFlottants`` and ``DicoAppuisFlottant``.
    others : int
        XML files of another content.
    files : Together
        All that were read.
    """

    read: list[Opened] = field(default_factory=list)
    orientations: dict[str, Element] = field(default_factory=dict)
    calibrations: dict[str, Element] = field(default_factory=dict)
    interior: dict[str, str] = field(default_factory=dict)
    measures: list[Element] = field(default_factory=list)
    surveyed: list[Element] = field(default_factory=list)
    others: int = 0
    files: Together = field(default_factory=Together)
    _by_content: dict[Content, str] = field(default_factory=dict)

    def add(self, path: Path) -> None:
        """Read a file, and put what is in it where it belongs."""
        source = self.files.read(path)
        root = xml_tree.tree(source)
        known = [
            self._is_known(one, path) for one in (root.below if root.tag in AROUND else [root])
        ]
        if any(known):
            self.read.append(source)
        else:
            self.others += 1

    def _is_known(self, content: Element, path: Path) -> bool:
        """Put an element where it belongs; tell whether it belongs anywhere."""
        image = re.fullmatch(r"Orientation-(.+)\.xml", path.name)
        if content.tag == "OrientationConique" and image:
            self.orientations[image[1]] = content
            if (interior := content.maybe("Interne")) is not None:
                self.interior[image[1]] = self._named(interior)
        elif content.tag == "CalibrationInternConique" and path.name not in self.calibrations:
            self.calibrations[path.name] = content
            self._by_content.setdefault(_content(content), path.name)
        elif content.tag == "SetOfMesureAppuisFlottants":
            self.measures.append(content)
        elif content.tag == "DicoAppuisFlottant":
            self.surveyed.append(content)
        else:
            return False
        return True

    def _named(self, interior: Element) -> str:
        """Return the name of a calibration that an orientation holds; equal ones are one."""
        new = f"CAM{len(self.calibrations) + 1}.xml"
        name = self._by_content.setdefault(_content(interior), new)
        self.calibrations.setdefault(name, interior)
        return name


def _content(element: Element) -> Content:
    return element.text, tuple((one.tag, _content(one)) for one in element.below)


def files_of(source: Path) -> Files:
    """Return MicMac's files at a path: a folder, or one file.

    Raises
    ------
    FlightError
        Where there is none, or one is no XML.
    """
    found = Files()
    for path in _paths(source):
        found.add(path)
    if not found.read:
        wanted = "must hold Ori-*/Orientation-*.xml, measures or surveyed points of MicMac"
        raise opened.refusal(str(source), 1, "file", "has no XML of MicMac", wanted)
    return found


def _paths(source: Path) -> Iterable[Path]:
    """Return the XML files of a folder and of its Ori-*, or of an Ori-* and the folder around."""
    if not source.is_dir():
        return [source]
    inside = [one for one in sorted(source.glob("Ori-*")) if one.is_dir()]
    oriented = [one for one in inside if next(one.glob("Orientation-*.xml"), None)]
    if len(oriented) > 1:
        names = ", ".join(one.name for one in oriented)
        found = f"has orientations in {names}"
        raise opened.refusal(str(source), 1, "folder", found, "give one of these folders")
    around = [source.parent] if source.name.startswith("Ori-") else []
    folders = [source, *oriented, *(one for one in inside if one not in oriented), *around]
    paths = [path for folder in folders for path in sorted(folder.glob("*.xml"))]
    if len(paths) > MOST:
        found = f"has {len(paths)} XML files"
        raise opened.refusal(str(source), 1, "folder", found, f"must have at most {MOST}")
    return paths


def pose(orientation: Element) -> Pose:
    """Return T_w_c of an ``OrientationConique`` in the library's camera axes."""
    for place in (("Externe", "KnownConv"), ("ConvOri", "KnownConv")):
        known = orientation.maybe(*place)
        if known is not None and known.text != lens.KNOWN:
            raise known.wrong(quoted(known.text), f"must be {lens.KNOWN}")
    if (turned := orientation.maybe("OrIntImaM2C")) is not None:
        lens.require_plain(turned)
    kind = orientation.maybe("TypeProj")
    if kind is not None and kind.text != "eProjStenope":
        raise kind.wrong(quoted(kind.text), "must be eProjStenope, a central projection")
    rotation = orientation.one("Externe", "ParamRotation", "CodageMatr")
    R_w_v = np.stack([_three(rotation.one(f"L{k}"), ENTRY) for k in (1, 2, 3)])
    if np.abs(R_w_v @ R_w_v.T - np.eye(3)).max() > SKEW or np.linalg.det(R_w_v) < 0:
        raise rotation.wrong("L1, L2, L3 are no rotation", "must be the rows of one")
    return Pose(R=R_w_v @ cameras.FLIP, r=_three(orientation.one("Externe", "Centre"), METRES))


def _three(element: Element, allowed: Range) -> Array:
    return _within(element, element.numbers(3), allowed)


def _pixel(element: Element) -> Array:
    return _within(element, element.numbers(2), METRES)


def _within(element: Element, values: Array, allowed: Range) -> Array:
    if not all(value in allowed for value in values):
        raise element.wrong(quoted(element.text), str(allowed))
    return values


def own_points(orientation: Element) -> tuple[Array, Array]:
    """Return what MicMac itself computed of an image: object points (n, 3), and pixels (n, 2)."""
    pairs = [
        (_three(one.one("Ter"), METRES), _pixel(one.one("Im")))
        for one in orientation.each("Verif", "Appuis")
    ]
    x_w, colrow = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    return x_w.reshape(-1, 3), colrow.reshape(-1, 2)


def measured(sets: Iterable[Element]) -> Iterator[tuple[Element, str, str, Array]]:
    """Yield the element, image, point and pixel of every measurement."""
    for one in sets:
        for image in one.each("MesureAppuiFlottant1Im"):
            name = image.one("NameIm").text
            for point in image.each("OneMesureAF1I"):
                yield point, name, point.one("NamePt").text, _pixel(point.one("PtIm"))


def surveyed(dictionaries: Iterable[Element]) -> Iterator[tuple[Element, str, Array, Array]]:
    """Yield the element, name, coordinates and sigma of every surveyed point."""
    for one in dictionaries:
        for point in one.each("OneAppuisDAF"):
            sigma = point.maybe("Incertitude")
            values = np.full(3, np.nan) if sigma is None else _three(sigma, METRES)
            yield point, point.one("NamePt").text, _three(point.one("Pt"), METRES), values
