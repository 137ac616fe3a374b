"""The metadata of one picture, EXIF and XMP: its time, place, attitude and head, and its camera."""

from __future__ import annotations

import datetime as dt
import io
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from scipy.spatial.transform import Rotation

from acx4files.exchange import lens, safe
from acx4files.exchange.flight_folder import number_of
from acx4files.exchange.lens import FLIP, Left, Pinhole
from acx4files.exchange.safe import Opened, xml_tree
from acx4files.flight.problems import quoted
from acx4files.images import image_files
from acx4files.images import tiff as tiff_files
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera

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

    @property
    def kind(self) -> tuple[int, int, int, int]:
        """Width, height, samples and bits."""
        return self.width_px, self.height_px, self.samples, self.bits

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
            values = (float("nan"),)
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
        return safe.refusal(str(self.path), 1, name, found, expected)


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
    source = safe.read(path)
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
    with tifffile.TiffFile(io.BytesIO(data)) as tiff:
        page, end = tiff.pages.first, tiff_files.end_of_pixels(tiff)
        if end > len(data):
            raise ValueError(f"is cut off: it has {len(data)} bytes of at least {end}")
        tags = {tag.code: tag for tag in page.tags.values()}
        packet = tags[_XMP_TAG].value if _XMP_TAG in tags else b""
        size = page.imagewidth, page.imagelength, page.samplesperpixel, page.bitspersample
        packet = packet.encode() if isinstance(packet, str) else bytes(packet)
        return (int(size[0]), int(size[1]), int(size[2]), int(size[3])), _flat(page), packet


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
            with tifffile.TiffFile(io.BytesIO(part[len(_EXIF_HEADER) :])) as tiff:
                exif = _flat(tiff.pages.first)
        elif marker == _APP1 and part.startswith(_XMP_HEADER) and not packet:
            packet = part[len(_XMP_HEADER) :]
    if not size[0]:
        raise ValueError("no frame header")
    if not image_files.is_whole(data):
        raise ValueError("is cut off: its pixels have no end")
    end = packet.find(b"</x:xmpmeta>")  # some writers leave other bytes behind it
    return size, exif, packet[: end + len(b"</x:xmpmeta>")] if end >= 0 else packet


# --- XMP, the XML packet of a picture, as properties by the vendor's prefix and their own name


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
    root = xml_tree(Opened(file=f"{path} (XMP)", data=packet.strip(b"\0 \t\r\n")))
    found: dict[str, tuple[str, ...]] = {}
    for description in root.iter(f"{RDF} Description"):
        for name, value in description.attrib.items():
            found[_known(name)] = (value.strip(),)
        for child in description:
            items = [item for below in child if below.tag in LISTS for item in below]
            found[_known(child.tag)] = tuple(item.text or "" for item in items or [child])
    found.pop("", None)
    return found


def _known(tag: str) -> str:
    """Return ``prefix:name`` of a name in a known vendor's space; empty for all others."""
    space, _, name = tag.rpartition(" ")
    prefixes = [prefix for part, prefix in FAMILIES.items() if part in space.lower()]
    return f"{prefixes[0]}:{name}" if prefixes and name else ""


# --- What tags say of time, position, attitude and head


CAPTURE = ("MicaSense:CaptureId", "drone-dji:CaptureUUID", "Camera:CaptureUUID")
GIMBAL = tuple(f"drone-dji:Gimbal{name}Degree" for name in ("Roll", "Pitch", "Yaw"))
CAMERA = tuple(f"Camera:{name}" for name in ("Roll", "Pitch", "Yaw"))
LIGHT = tuple(f"DLS:{name}" for name in ("Roll", "Pitch", "Yaw"))
FLIGHT_YAW = "drone-dji:FlightYawDegree"
ABOVE_TAKE_OFF = "drone-dji:RelativeAltitude"
RTK = tuple(f"drone-dji:RtkStd{name}" for name in ("Lon", "Lat", "Hgt"))
ACCURACY = ("Camera:GPSXYAccuracy", "Camera:GPSZAccuracy")

_HEADS_OF_NAME = re.compile(r"(.+?)_\d{1,2}$")


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Roll, pitch and heading, degrees, their sigma, and their origin."""

    roll: float
    pitch: float
    heading: float
    sigma_tilt: float
    sigma_heading: float
    said: str


def key(tags: Tags) -> str:
    """Return the key shared by the pictures of an exposure: an identifier, or a name.

    The name is that of the file, without the number of the head: ``IMG_0688`` of ``IMG_0688_4``.
    """
    return tags.text(*CAPTURE) or f"{tags.path.parent}/{name_of(tags)}"


def name_of(tags: Tags) -> str:
    """Return the name of an exposure, from a picture of it."""
    match = _HEADS_OF_NAME.match(tags.path.stem)
    return match[1] if match else tags.path.stem


def time_of(tags: Tags) -> dt.datetime | None:
    """Return the time of the exposure by EXIF; None where it has none.

    Raises
    ------
    FlightError
        Where it is no time.
    """
    text = tags.text("DateTimeOriginal", "DateTime")
    if not text:
        return None
    try:
        time = dt.datetime.strptime(text[:19], "%Y:%m:%d %H:%M:%S")
    except ValueError:
        expected = "must be a time as 2023:10:14 11:48:22"
        raise tags.wrong("DateTimeOriginal", quoted(text), expected) from None
    digits = tags.text("SubsecTimeOriginal", "SubsecTime")
    sign = -1 if digits.startswith("-") else 1
    part = digits.lstrip("-")
    return time + sign * dt.timedelta(seconds=float(f"0.{part}") if part.isdigit() else 0.0)


def place_of(tags: Tags) -> tuple[float, float, float] | None:
    """Return latitude and longitude, degrees, and height, m; None where there are none.

    0 N 0 E is what receivers write that have no fix, and no position.

    Raises
    ------
    FlightError
        Where one of them is no number, or is nowhere on Earth.
    """
    lat, lon = (_angle(tags, f"GPS{name}") for name in ("Latitude", "Longitude"))
    height = tags.number("GPSAltitude")
    if lat is None or lon is None or height is None or lat == lon == 0:
        return None
    if not (abs(lat) <= 90 and abs(lon) <= 180):
        raise tags.wrong("GPSLatitude, GPSLongitude", f"{lat:g}, {lon:g}", "must be on Earth")
    below = str(tags.exif.get("GPSAltitudeRef", 0)) in ("1", "b'\\x01'", "3")
    return lat, lon, -height if below else height


def _angle(tags: Tags, name: str) -> float | None:
    """Return an angle of EXIF, degrees, minutes and seconds, with its sign."""
    value = tags.exif.get(name)
    if value is None:
        return None
    parts = value if isinstance(value, tuple) else ()
    if len(parts) == 6:
        parts = tuple(rational(parts[i : i + 2]) for i in (0, 2, 4))
    degrees = sum(rational(part) / 60**k for k, part in enumerate(parts))
    if len(parts) != 3 or not np.isfinite(degrees):
        raise tags.wrong(name, quoted(str(value)), "must be three ratios")
    negative = str(tags.exif.get(f"{name}Ref", "")).strip("\0 ").upper() in ("S", "W")
    return -degrees if negative else degrees


def sigma_of(tags: Tags) -> tuple[float, float, float] | None:
    """Return sigma of east, north and height, m; None where the metadata have none."""
    rtk = [tags.number(name) for name in RTK]
    if all(value is not None and value > 0 for value in rtk):
        east, north, up = (float(value or 0) for value in rtk)
        return east, north, up
    plan, height = (tags.number(name) for name in ACCURACY)
    return (plan, plan, height) if plan and height and min(plan, height) > 0 else None


def attitude_of(tags: Tags) -> Attitude | None:
    """Return the attitude of a body whose camera looks down, the top of the image ahead.

    The first that is there: the gimbal's angles of DJI, whose pitch is -90 deg straight down; the
    camera's, after the specification of Pix4D; those of the light sensor of MicaSense, which sits
    on the aircraft and not on the camera.
    """
    ways = (
        (GIMBAL, 1.0, 90.0, (0.5, 3.0), "the gimbal's angles; its pitch is -90° straight down"),
        (CAMERA, 1.0, 0.0, (3.0, 5.0), "the angles Camera:Roll, Pitch and Yaw in degrees"),
        (LIGHT, np.degrees(1.0), 0.0, (10.0, 10.0), "the light sensor's (DLS) angles in radians"),
    )
    for names, unit, level, (tilt, heading), origin in ways:
        values = [tags.number(name) for name in names]
        if all(value is not None for value in values):
            roll, pitch, yaw = (float(unit) * float(value or 0.0) for value in values)
            if abs(roll) > 90.0:  # the same attitude by its other three angles
                roll, pitch, yaw = (
                    roll - np.copysign(180.0, roll),
                    -pitch % 360.0 - 180.0,
                    yaw + 180.0,
                )
            return Attitude(
                roll=roll,
                pitch=pitch + level,
                heading=yaw % 360.0,
                sigma_tilt=tilt,
                sigma_heading=heading,
                said=origin,
            )
    return None


def course(places: Sequence[tuple[float, float, float]]) -> list[float]:
    """Return the course at every exposure, degrees from north, by its neighbours; 0 for one."""
    if len(places) < 2:
        return [0.0] * len(places)
    lat, lon, _ = np.array(places).T
    north, east = np.gradient(lat), np.gradient(lon) * np.cos(np.radians(lat))
    return [float(a) for a in np.degrees(np.arctan2(east, north)) % 360.0]


ANOTHER_COURSE_DEG = 45.0
"""Headings that are farther apart than this are different."""


# --- Which head took a picture, and how the heads of a rig are turned to each other
#
# `RigRelatives` of MicaSense are three angles of every head to its reference. The vendor's own
# software makes Rx(a) Ry(b) Rz(c) of them. This matrix turns a ray of the *head* into the
# reference: the pixels say so (chapter on ten real heads). Camera axes there have y down and z
# ahead.


RELATIVES, REFERENCE = "Camera:RigRelatives", "Camera:RigRelativesReferenceRigCameraIndex"
INDEX, BAND = "Camera:RigCameraIndex", "Camera:BandName"

DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""R_b_c of a camera that looks straight down and whose top of the image is ahead."""


@dataclass(frozen=True, kw_only=True)
class Head:
    """One head of a camera.

    Attributes
    ----------
    name : str
        Number and band: ``2 Green``; of a camera without bands, its model.
    index : int
        Its number in the rig; -1 where it has none.
    reference : int or None
        Number of the head to which its angles are; None where it has none.
    relatives_deg : tuple of float
        Its angles a, b, c; none where it has none.
    """

    name: str
    index: int
    reference: int | None
    relatives_deg: tuple[float, ...]


def head_of(tags: Tags) -> Head:
    """Return the head that took a picture.

    Raises
    ------
    FlightError
        Where numbers in the metadata are none.
    """
    number, reference = tags.number(INDEX), tags.number(REFERENCE)
    index, band = -1 if number is None else int(number), tags.text(BAND, "drone-dji:BandName")
    model = tags.text("Model", "Make") or "camera"
    relatives = tags.numbers(RELATIVES, 3)
    name = " ".join(filter(None, [str(index + 1) if index >= 0 else "", band])) or model
    return Head(
        name=name,
        index=index,
        reference=int(reference) if relatives and reference is not None else None,
        relatives_deg=relatives,
    )


def rotation(relatives_deg: Sequence[float]) -> Array:
    """Return R_ref_h of a head, the library's axes: from the head's to those of its reference.

    Parameters
    ----------
    relatives_deg : sequence of float
        `RigRelatives`: a, b, c.
    """
    flip = np.diag([*FLIP, -1.0])
    turned = Rotation.from_euler("XYZ", relatives_deg, degrees=True).as_matrix()
    return np.asarray(flip @ turned @ flip)


def in_order(heads: Sequence[Head]) -> list[Head]:
    """Return the heads by number, but first the reference of all angles.

    It is the one that a head names before all others; where none names any, the one whose own
    angles are zero.
    """
    sorted_heads = sorted(heads, key=lambda head: (head.index, head.name))
    named = [head.reference for head in heads if head.reference is not None]
    leading = [h for h in sorted_heads if (h.index == named[0] if named else is_unturned(h))]
    first = (leading or sorted_heads)[0]
    return [first, *(head for head in sorted_heads if head is not first)]


def is_unturned(head: Head) -> bool:
    """Tell whether a head has angles, and all of them are zero."""
    return len(head.relatives_deg) > 0 and not any(head.relatives_deg)


def sentence(heads: Sequence[Head]) -> str:
    """Return a sentence on the assumed rotations of the heads."""
    if not any(head.relatives_deg for head in heads):
        return "the heads look in one direction: the metadata have no RigRelatives"
    names = {head.index: head.name for head in heads}
    references = dict.fromkeys(h.reference for h in heads if h.reference is not None)
    first = in_order(heads)[0]
    why = "whose own angles are zero" if is_unturned(first) else "the first"
    which = " or ".join(names.get(r, f"head {r}") for r in references)
    text = (
        "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
        f"reference, {which or f'which no file names: {first.name}, {why}'}; y down, z ahead"
    )
    if len(references) > 1:
        text += "; no angles join the rigs, whose references look in one direction at first"
    return text


# --- Grey values by the metadata: dark level and vignetting. Nothing is applied to
# pixels


VIGNETTING_CENTRE, VIGNETTING_POLYNOMIAL = "Camera:VignettingCenter", "Camera:VignettingPolynomial"
DARK = "BlackLevel"


@dataclass(frozen=True, kw_only=True)
class Vignetting:
    """The factory's vignetting of a head: grey values are divided by it.

    Attributes
    ----------
    centre_px : tuple of float
        col, row.
    coefficients : tuple of float
        Of r, r^2, …; the constant is one.
    """

    centre_px: tuple[float, float]
    coefficients: tuple[float, ...]

    def at(self, colrow: Array) -> Array:
        """Return the vignetting at pixels (..., 2): one in the middle, less outside."""
        r = np.hypot(*np.moveaxis(np.asarray(colrow, float) - self.centre_px, -1, 0))
        return np.asarray(np.polyval([*self.coefficients[::-1], 1.0], r))


def vignetting(tags: Tags) -> Vignetting | None:
    """Return the vignetting by XMP, as MicaSense's own software reads it; None without it.

    Raises
    ------
    FlightError
        Where the numbers are none.
    """
    centre, coefficients = tags.numbers(VIGNETTING_CENTRE, 2), tags.numbers(VIGNETTING_POLYNOMIAL)
    if not (centre and coefficients):
        return None
    return Vignetting(centre_px=(centre[0], centre[1]), coefficients=coefficients)


def dark_level(tags: Tags) -> float | None:
    """Return the grey value of darkness by the TIFF's `DARK`; None without it."""
    value = tags.exif.get(DARK)
    if value is None:
        return None
    levels = np.atleast_1d(np.asarray(value, float))
    return float(levels.mean()) if levels.size and np.all(np.isfinite(levels)) else None


def sentences(pictures: Sequence[Tags]) -> list[str]:
    """Return sentences on the grey values of heads, from one picture each."""
    texts = []
    dark = [level for level in map(dark_level, pictures) if level is not None]
    falls = [(tags, falloff) for tags in pictures if (falloff := vignetting(tags)) is not None]
    if dark:
        texts.append(f"dark level {min(dark):g} to {max(dark):g}, not subtracted")
    if falls:
        corner = [
            float(falloff.at(np.array([[0, 0], [t.width_px, 0], [0, t.height_px]])).min())
            for t, falloff in falls
        ]
        texts.append(
            f"vignetting of {number_of(len(falls), 'heads')}, corners with {min(corner):.2f} to "
            f"{max(corner):.2f} of the middle, not applied"
        )
    return texts


# --- The camera of a picture, by what its tags say of the lens and the sensor


FOCAL, UNITS = "Camera:PerspectiveFocalLength", "Camera:PerspectiveFocalLengthUnits"
POINT, DISTORTION = "Camera:PrincipalPoint", "Camera:PerspectiveDistortion"
DEWARP, DESIGNED = "drone-dji:DewarpData", "drone-dji:CalibratedFocalLength"
POLYNOMIAL, MATRIX = "Camera:FisheyePolynomial", "Camera:FisheyeAffineMatrix"
CENTRE = ("drone-dji:CalibratedOpticalCenterX", "drone-dji:CalibratedOpticalCenterY")
WIDTH_35_MM = 36.0
PX_OF_WIDTH = 0.1
"""Focal lengths in pixels are more than this share of the width in pixels; in mm they are less."""

_PER_MM = {2: 1 / 25.4, 3: 1 / 10, 4: 1.0, 5: 1000.0}
"""Lengths per mm of EXIF's units: inch, cm, mm, micrometre."""


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A camera and where its numbers are from.

    Attributes
    ----------
    camera : Camera
        Without mounting.
    said : str
        What it was made of, for the user.
    fitted : Left
        Distances to the lens of the metadata.
    """

    camera: Camera
    said: str
    fitted: Left


def lens_of(tags: Tags, name: str, *, known_pixel_mm: float | None = None) -> Lens:
    """Return the camera of a picture.

    Parameters
    ----------
    tags : Tags
    name : str
        Name of the camera.
    known_pixel_mm : float, optional
        Size of a pixel where the metadata do not have it.

    Raises
    ------
    FlightError
        Where the metadata have no focal length, contradict themselves, or state a model that is
        neither a perspective nor a fisheye.

    Notes
    -----
    The first that is there: the calibration of the vendor in XMP (DJI: `DEWARP`; MicaSense, Parrot:
    `FOCAL`, which multispectral cameras of DJI have as well), the designed focal length of DJI,
    EXIF's focal length with the pixel size, EXIF's focal length of 35 mm film, here over the width
    of the picture.
    """
    model = tags.text("Camera:ModelType") or "perspective"
    if model not in ("perspective", "fisheye"):
        raise tags.wrong("Camera:ModelType", quoted(model), "must be perspective or fisheye")
    if known_pixel_mm and _pixel_mm(tags) is None:
        known = {"FocalPlaneXResolution": 1 / known_pixel_mm, "FocalPlaneResolutionUnit": 4}
        tags = replace(tags, exif={**tags.exif, **known})
    if model == "fisheye":
        pixel, shape, said = _fisheye(tags)
    else:
        if DEWARP in tags.xmp:
            way = _dewarped
        elif FOCAL in tags.xmp and (DESIGNED not in tags.xmp or _pixel_mm(tags) is not None):
            way = _calibrated
        else:  # beside a designed one, FOCAL is in mm, of pixels that nothing says
            way = _designed if DESIGNED in tags.xmp else _nominal
        pixel, matrix, distortion, said = way(tags)
        shape = _opencv(tags, matrix, distortion)
    try:
        camera, left = shape.nearest(name, pixel)
    except (ValueError, ArithmeticError) as error:
        raise tags.wrong("lens", str(error), "must be one of a camera") from None
    numbers = {key: float(f"{value:.12g}") for key, value in vars(camera.interior).items()}
    interior = replace(camera.interior, **numbers)  # digits that mean something
    return Lens(camera=camera.with_interior(interior), said=said, fitted=left)


def _opencv(tags: Tags, matrix: tuple[float, ...], distortion: Sequence[float]) -> lens.Lens:
    """Return a camera of OpenCV, whose terms all vendors have."""
    fx, fy, cx, cy = matrix
    try:
        hole = Pinhole(fx=fx, fy=fy, cx=cx, cy=cy)
    except ValueError as error:
        raise tags.wrong("lens", str(error), "must be one of a camera") from None
    return lens.Lens(
        width_px=tags.width_px,
        height_px=tags.height_px,
        hole=hole,
        distortion=lens.OPENCV.distortion(distortion),
        wrong=lambda fault, expected: tags.wrong("lens", fault, expected),
    )


Stated = tuple[float, tuple[float, ...], Sequence[float], str]
"""Size of a pixel, mm; fx, fy, cx, cy, px; k1, k2, p1, p2, k3; where they are from."""


def _pixel_mm(tags: Tags) -> float | None:
    """Return the pixel size, mm, by EXIF's resolution of the focal plane; None without it."""
    resolution = tags.number("FocalPlaneXResolution")
    unit = int(tags.number("FocalPlaneResolutionUnit") or 2)
    if resolution is None or resolution <= 0:
        return None
    if unit not in _PER_MM:
        raise tags.wrong("FocalPlaneResolutionUnit", str(unit), "must be 2 to 5")
    size = 1 / (resolution * _PER_MM[unit])
    if not 2e-4 < size < 0.1:
        raise tags.wrong("FocalPlaneXResolution", str(resolution), "means no size of a pixel")
    return float(f"{size:.6g}")


def focal_px(tags: Tags, pixel: float) -> float:
    """Return the focal length of `FOCAL` in pixels; older firmware has pixels there, newer mm.

    Raises
    ------
    FlightError
        Where `UNITS` contradicts the size of the number.
    """
    value, unit = tags.numbers(FOCAL, 1)[0], tags.text(UNITS).lower()
    is_px = value > PX_OF_WIDTH * tags.width_px
    if unit and (unit == "mm") == is_px:
        raise tags.wrong(FOCAL, f"{value:g} {unit}", "cannot be the focal length in this unit")
    if value <= 0:
        raise tags.wrong(FOCAL, f"{value:g}", "must be positive")
    return value if is_px else value / pixel


def _calibrated(tags: Tags) -> Stated:
    """Return the camera that MicaSense and Parrot write, after the specification of Pix4D."""
    pixel = _pixel_needed(tags)
    f = focal_px(tags, pixel)
    cx, cy = np.array(tags.numbers(POINT, 2) or np.array(_middle(tags)) * pixel) / pixel
    k1, k2, k3, p1, p2 = tags.numbers(DISTORTION, 5) or (0.0,) * 5
    unit = "px" if tags.numbers(FOCAL)[0] > PX_OF_WIDTH * tags.width_px else "mm"
    origin = f"focal length in {unit}, principal point and distortion from XMP, {FOCAL}"
    return pixel, (f, f, cx, cy), (k1, k2, p1, p2, k3), origin


def _fisheye(tags: Tags) -> tuple[float, lens.Lens, str]:
    """Return the size of a pixel and the fisheye lens that Parrot writes."""
    pixel, values = _pixel_needed(tags), {}
    for element, n in ((POLYNOMIAL, None), (MATRIX, 4), (POINT, 2)):
        values[element] = tags.numbers(element, n)
        if not values[element]:
            raise tags.wrong(element, "missing", "a fisheye lens needs it")
    p, (c, d, e, f), (col, row) = (values[element] for element in (POLYNOMIAL, MATRIX, POINT))
    if len(p) < 2 or p[0] != 0 or p[1] <= 0:
        raise tags.wrong(POLYNOMIAL, quoted(list(p)), "must be 0, a positive number, and others")
    if c <= 0 or f <= 0 or c * f - d * e <= 0:
        expected = "must be C, D, E, F with positive C and F"
        raise tags.wrong(MATRIX, quoted([c, d, e, f]), expected)
    shape = lens.fisheye(
        p,
        (c, d, e, f),
        (col / pixel, row / pixel),
        size=(tags.width_px, tags.height_px),
        wrong=lambda fault, expected: tags.wrong("lens", fault, expected),
    )
    return pixel, shape, f"fisheye lens from XMP, {POLYNOMIAL} and {MATRIX}"


def _pixel_needed(tags: Tags) -> float:
    pixel = _pixel_mm(tags)
    if pixel is None:
        raise tags.wrong("FocalPlaneXResolution", "missing", "gives the size of a pixel")
    return pixel


def _dewarped(tags: Tags) -> Stated:
    """Return the calibrated camera of DJI: fx, fy, cx, cy from the middle, k1, k2, p1, p2, k3."""
    text = tags.text(DEWARP).split(";")[-1]
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise tags.wrong(DEWARP, quoted(text), "must be numbers") from None
    if len(numbers) != 9:
        raise tags.wrong(DEWARP, f"{len(numbers)} numbers", "must be 9")
    fx, fy, cx, cy, *distortion = numbers
    col, row = _middle(tags)
    if tags.text("drone-dji:DewarpFlag") == "1":
        distortion = [0.0] * 5
    matrix = (fx, fy, col + cx, row + cy)
    return _any_pixel(tags), matrix, distortion, f"calibration from XMP, {DEWARP}"


def _designed(tags: Tags) -> Stated:
    f = tags.numbers(DESIGNED, 1)[0]
    centre = [tags.number(key) for key in CENTRE]
    cx, cy = (m if c is None else c - 0.5 for c, m in zip(centre, _middle(tags), strict=True))
    origin = f"designed focal length from XMP, {DESIGNED}, no distortion"
    return _any_pixel(tags), (f, f, cx, cy), (0.0,) * 5, origin


def _nominal(tags: Tags) -> Stated:
    f_mm, pixel = tags.number("FocalLength"), _pixel_mm(tags)
    if f_mm and pixel:
        f, origin = f_mm / pixel, "focal length and pixel size from EXIF, no distortion"
    elif film := tags.number("FocalLengthIn35mmFilm"):
        f = film / WIDTH_35_MM * tags.width_px
        origin = "focal length of 35 mm film from EXIF, no distortion: approximate by some per cent"
    else:
        expected = (
            "neither XMP nor EXIF says how many pixels the focal length has; the size of a pixel, "
            "--pixel-um, is needed"
        )
        raise tags.wrong("FocalPlaneXResolution, FocalLengthIn35mmFilm", "missing", expected)
    return _any_pixel(tags, f), (f, f, *_middle(tags)), (0.0,) * 5, origin


def _any_pixel(tags: Tags, f_px: float | None = None) -> float:
    """Return the size of a pixel, mm; by the focal lengths, or 1 um where nothing says it."""
    pixel, f_mm = _pixel_mm(tags), tags.number("FocalLength")
    f_px = f_px or next(iter(tags.numbers(DESIGNED, 1)), 0.0)
    return pixel or (f_mm / f_px if f_mm and f_px else 1e-3)


def _middle(tags: Tags) -> tuple[float, float]:
    return (tags.width_px - 1) / 2, (tags.height_px - 1) / 2
