"""The metadata of one picture: EXIF and XMP of a TIFF or a JPEG."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from acx4lib.errors import FlightError
from acx4lib.flight.problems import quoted
from acx4lib.production import image_files
from acx4lib.production import tiff as tiff_files
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.xml_tree import Element, tree

READ = frozenset(
    (
        *("Make", "Model", "BlackLevel"),
        *("DateTime", "DateTimeOriginal", "SubsecTime", "SubsecTimeOriginal"),
        *("FocalLength", "FocalLengthIn35mmFilm"),
        *("FocalPlaneXResolution", "FocalPlaneResolutionUnit"),
        *("GPSLatitude", "GPSLongitude", "GPSAltitude"),
        *("GPSLatitudeRef", "GPSLongitudeRef", "GPSAltitudeRef"),
        *("GPSTimeStamp", "PixelXDimension", "PixelYDimension"),
    )
)
"""Tags that are read: thousands of pictures have others as large as 60 kB each."""

_XMP_TAG = 700
_EXIF_HEADER, _XMP_HEADER = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"
_APP1 = 0xE1
BROKEN = (ValueError, TypeError, LookupError, ArithmeticError, RuntimeError, struct.error, OSError)
"""Errors that reading a damaged picture may raise."""


@dataclass(frozen=True, kw_only=True)
class Tags:
    """The metadata of a picture.

    Attributes
    ----------
    path : Path
        Of the picture, for messages.
    width_px, height_px, samples, bits : int
    exif : mapping
        Tags of `READ`, of the picture, of EXIF and of GPS, by their names.
    xmp : mapping of str to tuple of str
        As `properties` has them.
    sha256 : str
        Of the file.
    """

    path: Path
    width_px: int
    height_px: int
    samples: int
    bits: int
    exif: Mapping[str, Any]
    xmp: Properties
    sha256: str

    def text(self, *names: str) -> str:
        """Return the first present of some XMP properties or EXIF tags, else an empty text."""
        for name in names:
            if self.xmp.get(name):
                return self.xmp[name][0]
            if name in self.exif:
                return str(self.exif[name]).strip("\0 ")
        return ""

    def numbers(self, name: str, n: int | None = None) -> tuple[float, ...]:
        """Return the numbers of an XMP property, in a list or with commas; none if it is absent.

        Raises
        ------
        FlightError
            Where they are no finite numbers, or not `n` of them.
        """
        parts = [part for text in self.xmp.get(name, ()) for part in text.split(",")]
        try:
            values = tuple(_fraction(part) for part in parts)
        except (ValueError, ZeroDivisionError):
            raise self.wrong(name, quoted(", ".join(parts)), "must be numbers") from None
        if not np.all(np.isfinite(values)):
            raise self.wrong(name, quoted(", ".join(parts)), "must be finite numbers")
        if values and n is not None and len(values) != n:
            raise self.wrong(name, f"{len(values)} numbers", f"must be {n}")
        return values

    def number(self, name: str) -> float | None:
        """Return the number of an XMP property or a rational EXIF tag; None if it is absent."""
        if name in self.xmp:
            return next(iter(self.numbers(name, 1)), None)
        if name not in self.exif:
            return None
        value = rational(self.exif[name])
        if not np.isfinite(value):
            raise self.wrong(name, quoted(str(self.exif[name])), "must be a number")
        return value

    def wrong(self, name: str, found: str, expected: str) -> FlightError:
        """Return the error for a tag of this picture."""
        return opened.refusal(str(self.path), 1, name, found, expected)


def _fraction(text: str) -> float:
    """Return a number; Parrot writes some as fractions."""
    above, _, below = text.partition("/")
    return float(above) / (float(below) if below else 1.0)


def rational(value: object) -> float:
    """Return a number of EXIF, which has numerator and denominator; NaN for anything else."""
    try:
        if isinstance(value, tuple) and len(value) == 1:
            return float(value[0])
        if isinstance(value, tuple):
            return float(value[0]) / float(value[1]) if len(value) == 2 else float("nan")
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return float("nan")


def read(path: Path) -> Tags:
    """Return the metadata of a picture.

    Parameters
    ----------
    path : Path
        A TIFF or a JPEG.

    Raises
    ------
    FlightError
        For any other file, one that is damaged, or XMP that is no XML.
    """
    source = opened.read(path)
    data = source.data
    try:
        with tiff_files.in_silence():  # the EXIF of a JPEG is a TIFF without an image
            parts_of = _of_jpeg if data[:2] == b"\xff\xd8" else _of_tiff
            size, exif, packet = parts_of(data)
    except BROKEN as error:
        message = str(error) if isinstance(error, ValueError) else "its bytes contradict its header"
        expected = "must be a TIFF or a JPEG that is whole"
        raise source.wrong("file", " ".join(message.split()), expected) from None
    width, height, samples, bits = size
    return Tags(
        path=path,
        width_px=width,
        height_px=height,
        samples=samples,
        bits=bits,
        exif=exif,
        xmp=properties(packet, path) if packet else {},
        sha256=source.sha256,
    )


def _of_tiff(data: bytes) -> tuple[tuple[int, int, int, int], dict[str, Any], bytes]:
    """Return size, tags and XMP of a TIFF's first image."""
    with _opened(data) as tiff:
        page, end = tiff.pages.first, tiff_files.end_of_pixels(tiff)
        if end > len(data):
            raise ValueError(f"is cut off: it has {len(data)} bytes of at least {end}")
        tags = {tag.code: tag for tag in page.tags.values()}
        packet = tags[_XMP_TAG].value if _XMP_TAG in tags else b""
        size = page.imagewidth, page.imagelength, page.samplesperpixel, page.bitspersample
        packet = packet.encode() if isinstance(packet, str) else bytes(packet)
        return (int(size[0]), int(size[1]), int(size[2]), int(size[3])), _flat(page), packet


def _opened(data: bytes) -> tifffile.TiffFile:
    """Return a TIFF, or the EXIF of a JPEG, whose tags take no more memory than it has bytes."""
    fault = tiff_files.fault(io.BytesIO(data), len(data), below=True)
    if fault:
        raise ValueError(fault)
    return tiff_files.opened(io.BytesIO(data))


def _flat(page: Any) -> dict[str, Any]:
    """Return the tags of `READ` of a picture, of its EXIF and of GPS by their names."""
    tags = {t.name: t.value for t in page.tags.values() if t.name in (*READ, "ExifTag", "GPSTag")}
    parts = [part for part in (tags.pop("ExifTag", 0), tags.pop("GPSTag", 0)) if part]
    below = {name: part[name] for part in parts for name in part if name in READ}
    return {**tags, **below}


def _of_jpeg(data: bytes) -> tuple[tuple[int, int, int, int], dict[str, Any], bytes]:
    """Return size, tags and XMP of a JPEG."""
    exif: dict[str, Any] = {}
    size, packet = (0, 0, 0, 0), b""
    for marker, part in image_files.segments(data):
        if marker in image_files.FRAMES:
            bits, height, width, samples = struct.unpack(">BHHB", part[:6])
            size = (width, height, samples, bits)
        elif marker == _APP1 and part.startswith(_EXIF_HEADER) and not exif:
            with _opened(part[len(_EXIF_HEADER) :]) as tiff:
                exif = _flat(tiff.pages.first)
        elif marker == _APP1 and part.startswith(_XMP_HEADER) and not packet:
            packet = part[len(_XMP_HEADER) :]
    if not size[0]:
        raise ValueError("no frame header")
    if not image_files.is_whole(data):
        raise ValueError("is cut off: its pixels have no end")
    return size, exif, _cut(packet)


def _cut(packet: bytes) -> bytes:
    """Return an XMP packet up to its end; some writers leave other bytes behind it."""
    end = packet.find(b"</x:xmpmeta>")
    return packet[: end + len(b"</x:xmpmeta>")] if end >= 0 else packet


# --- XMP, the XML packet of a picture, as properties by the vendor's prefix and their own name


RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
LISTS = tuple(f"{RDF} {name}" for name in ("Seq", "Bag", "Alt"))

FAMILIES = {
    "pix4d.com": "Camera",
    "sensefly.com/camera": "Camera",
    "sensefly.com/sensefly": "senseFly",
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
    items = [item for child in element.below if child.tag in LISTS for item in child.below]
    return tuple(item.text for item in items or [element])


def _known(tag: str) -> str:
    """Return ``prefix:name`` of a name in a known vendor's space; empty for all others."""
    space, _, name = tag.rpartition(" ")
    prefixes = [prefix for part, prefix in FAMILIES.items() if part in space.lower()]
    return f"{prefixes[0]}:{name}" if prefixes and name else ""
