"""XMP, the XML packet of a picture, as properties by the vendor's prefix and their own name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.xml_tree import Element, tree

RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
LISTS = tuple(f"{RDF} {name}" for name in ("Seq", "Bag", "Alt"))

FAMILIES = {
    "pix4d.com": "Camera",
    "sensefly.com/camera": "Camera",
    "micasense.com/micasense": "MicaSense",
    "micasense.com/dls": "DLS",
    "dji.com/drone-dji": "drone-dji",
}
"""Parts of the name spaces of vendors, which changed with their firmware, by the usual prefix."""

Properties = Mapping[str, tuple[str, ...]]
"""By ``prefix:name``: the value, or all of a list."""


def properties(packet: bytes, path: Path) -> Properties:
    """Return the properties of a packet that known vendors wrote.

    Parameters
    ----------
    packet : bytes
    path : Path
        Of the picture, for messages.

    Raises
    ------
    FlightError
        Where the packet is no XML, or has a document type.
    """
    root = tree(Opened(file=f"{path} (XMP)", data=packet.strip(b"\0 \t\r\n")))
    return dict(_properties(root))


def _properties(root: Element) -> Iterator[tuple[str, tuple[str, ...]]]:
    for description in root.everywhere(f"{RDF} Description"):
        for name, value in description.attributes.items():
            if known := _known(name):
                yield known, (value.strip(),)
        for child in description.below:
            if known := _known(child.tag):
                yield known, _values(child)


def _values(element: Element) -> tuple[str, ...]:
    items = [item for one in element.below if one.tag in LISTS for item in one.below]
    return tuple(one.text for one in items or [element])


def _known(tag: str) -> str:
    """Return ``prefix:name`` of a name in a known vendor's space; empty for all others."""
    space, _, name = tag.rpartition(" ")
    found = [prefix for part, prefix in FAMILIES.items() if part in space.lower()]
    return f"{found[0]}:{name}" if found and name else ""
