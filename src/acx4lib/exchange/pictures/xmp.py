"""XMP, the XML packet of a picture, as properties by the vendor's name and their own.

Only what a packet needs is read: a document type, and so every entity, is refused.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

RDF = "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}"
LISTS = (f"{RDF}Seq", f"{RDF}Bag", f"{RDF}Alt")
MOST_BYTES = 1_000_000
"""Largest packet; those of cameras have a few thousand bytes."""

FAMILIES = {
    "pix4d.com": "Camera",
    "micasense.com/micasense": "MicaSense",
    "micasense.com/dls": "DLS",
    "dji.com/drone-dji": "drone-dji",
    "sensefly.com/camera": "Camera",
}
"""Parts of the namespaces of vendors, which changed with their firmware, by the usual prefix."""

Properties = Mapping[str, tuple[str, ...]]
"""By ``prefix:name``: the value, or all of a list."""


def properties(packet: bytes) -> Properties:
    """Return the properties of a packet that known vendors wrote.

    Parameters
    ----------
    packet : bytes

    Raises
    ------
    ValueError
        With what is wrong with the packet.
    """
    if len(packet) > MOST_BYTES:
        msg = f"has {len(packet)} bytes; at most {MOST_BYTES} are read"
        raise ValueError(msg)
    try:
        text = packet.decode("utf-8").strip("\0 \t\r\n\ufeff")
    except UnicodeDecodeError:
        msg = "is not UTF-8"
        raise ValueError(msg) from None
    if "<!" in text.replace("<!--", "").replace("<![CDATA[", ""):
        msg = "has a document type or entities; such XML is not read"
        raise ValueError(msg)
    try:
        root = ET.fromstring(text)  # noqa: S314 entities need the document type refused above
    except ET.ParseError as error:
        msg = f"is no XML: {error}"
        raise ValueError(msg) from None
    return dict(_properties(root))


def _properties(root: ET.Element) -> Iterator[tuple[str, tuple[str, ...]]]:
    for description in root.iter(f"{RDF}Description"):
        for name, value in description.attrib.items():
            if known := _known(name):
                yield known, (value.strip(),)
        for child in description:
            if known := _known(child.tag):
                yield known, _values(child)


def _values(element: ET.Element) -> tuple[str, ...]:
    items = [item for found in LISTS for one in element.iter(found) for item in one]
    return tuple((one.text or "").strip() for one in items or [element])


def _known(tag: str) -> str:
    """Return ``prefix:name`` of a tag in Clark's notation; empty for others' namespaces."""
    space, _, name = tag.removeprefix("{").partition("}")
    found = [prefix for part, prefix in FAMILIES.items() if part in space.lower()]
    return f"{found[0]}:{name}" if found and name else ""
