"""The metadata of one picture, EXIF and XMP: its time, place, attitude and head, and its camera."""

from __future__ import annotations

import datetime as dt
import io
import re
import struct
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL.ExifTags import GPSTAGS, IFD, TAGS
from PIL.JpegImagePlugin import JpegImageFile
from PIL.TiffImagePlugin import TiffImageFile
from scipy.spatial.transform import Rotation

from acx4files.exchange import lens, safe
from acx4files.exchange.lens import FLIP, Left, Pinhole
from acx4files.exchange.safe import Opened, xml_tree
from acx4files.flight.problems import quoted
from acx4files.images import head_images
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera

BROKEN = (
    *(ValueError, TypeError, LookupError, ArithmeticError, RuntimeError, AttributeError),
    *(SyntaxError, struct.error, OSError),
)
"""Errors that reading a damaged picture may raise."""

LONGEST = 80
"""Tags with more characters or numbers are not kept: thousands of pictures have large ones."""


@dataclass(frozen=True, kw_only=True)
class Tags:
    """The metadata of a picture.

    Attributes
    ----------
    path : Path
        Of the picture, for messages.
    width_px, height_px, samples, bits : int
    exif : mapping
        Tags of the picture, of EXIF and of GPS, by their names.
    xmp : mapping of str to tuple of str
        As `properties` has them.
    sha256 : str
        Of the file.
    file : str
        Its path below the folder of all pictures.
    """

    path: Path
    width_px: int
    height_px: int
    samples: int
    bits: int
    exif: Mapping[str, Any]
    xmp: Properties
    sha256: str
    file: str = ""

    @cached_property
    def head(self) -> Head:
        """The head that took the picture."""
        return head_of(self)

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
        """Return the numbers of an XMP property or an EXIF tag; none if it is absent.

        A property has them in a list or with commas, after a date and a semicolon if it has one.

        Raises
        ------
        FlightError
            Where they are no finite numbers, or not `n` of them.
        """
        value = self.exif.get(name, ())
        parts: Sequence[Any] = value if isinstance(value, tuple) else (value,)
        if name in self.xmp:
            parts = [p for text in self.xmp[name] for p in text.split(";")[-1].split(",")]
        try:
            values = tuple(_number(part) for part in parts)
        except (TypeError, ValueError, ZeroDivisionError):
            values = (float("nan"),)
        if not np.all(np.isfinite(values)):
            raise self.wrong(name, quoted(", ".join(map(str, parts))), "must be finite numbers")
        if values and n is not None and len(values) != n:
            raise self.wrong(name, f"{len(values)} numbers", f"must be {n}")
        return values

    def number(self, name: str) -> float | None:
        """Return the number of an XMP property or an EXIF tag; None if it is absent."""
        return next(iter(self.numbers(name, 1)), None)

    def wrong(self, name: str, found: str, expected: str) -> FlightError:
        """Return the error for a tag of this picture."""
        return safe.refusal(str(self.path), 1, name, found, expected)


def _number(part: Any) -> float:
    """Return a number of EXIF or XMP; Parrot writes some as fractions."""
    above, _, below = part.partition("/") if isinstance(part, str) else (part, "", "")
    return float(above) / (float(below) if below else 1.0)


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
    is_jpeg = source.data[:2] == b"\xff\xd8"
    try:
        with warnings.catch_warnings(action="ignore"):
            picture = (JpegImageFile if is_jpeg else TiffImageFile)(io.BytesIO(source.data))
            tags = picture.getexif()
            exif = (
                _named(tags, TAGS)
                | _named(tags.get_ifd(IFD.Exif), TAGS)
                | _named(tags.get_ifd(IFD.GPSInfo), GPSTAGS)
            )
            bits = 8 if is_jpeg else np.atleast_1d(tags.get(_BITS, 1))[0]
        width, height = picture.size
    except BROKEN:
        fault, expected = "cannot be read", "must be a TIFF or a JPEG that is whole"
        raise source.wrong("file", fault, expected) from None
    if head_images.is_cut_off(path):
        raise source.wrong("file", "is cut off: its pixels have no end", "must be whole")
    packet = picture.info.get("xmp", b"")
    end = packet.find(b"</x:xmpmeta>")  # some writers leave other bytes behind it
    packet = packet[: end + len(b"</x:xmpmeta>")] if end >= 0 else packet
    return Tags(
        path=path,
        width_px=width,
        height_px=height,
        samples=len(picture.getbands()),
        bits=int(bits),
        exif=exif,
        xmp=properties(packet, path) if packet else {},
        sha256=source.sha256,
    )


_BITS = 258


def _named(tags: Mapping[int, Any], names: Mapping[int, str]) -> dict[str, Any]:
    """Return tags by their names; large ones are left out."""
    return {
        names[code]: value
        for code, value in tags.items()
        if code in names and not (hasattr(value, "__len__") and len(value) > LONGEST)
    }


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
ACCURACY = ("Camera:GPSXYAccuracy", "Camera:GPSXYAccuracy", "Camera:GPSZAccuracy")

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
    part = tags.text("SubsecTimeOriginal", "SubsecTime")
    if not text:
        return None
    try:
        time = dt.datetime.strptime(text[:19], "%Y:%m:%d %H:%M:%S")
    except ValueError:
        expected = "must be a time as 2023:10:14 11:48:22"
        raise tags.wrong("DateTimeOriginal", quoted(text), expected) from None
    return time + dt.timedelta(seconds=float(f"0.{part}") if part.isdigit() else 0.0)


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
    below = str(tags.exif.get("GPSAltitudeRef", 0)) in ("1", "b'\\x01'")
    return lat, lon, -height if below else height


def _angle(tags: Tags, name: str) -> float | None:
    """Return an angle of EXIF, degrees, minutes and seconds, with its sign."""
    parts = tags.numbers(name, 3)
    degrees = sum(part / 60**k for k, part in enumerate(parts))
    negative = tags.text(f"{name}Ref").upper() in ("S", "W")
    return (-degrees if negative else degrees) if parts else None


def sigma_of(tags: Tags) -> tuple[float, float, float] | None:
    """Return sigma of east, north and height, m; None where the metadata have none."""
    for names in (RTK, ACCURACY):
        east, north, up = (tags.number(name) or 0.0 for name in names)
        if min(east, north, up) > 0:
            return east, north, up
    return None


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
        if any(value is None for value in values):
            continue
        roll, pitch, yaw = (float(unit) * float(value or 0.0) for value in values)
        if abs(roll) > 90.0:  # the same attitude by its other three angles
            roll, pitch, yaw = roll - np.copysign(180.0, roll), -pitch % 360.0 - 180.0, yaw + 180.0
        return Attitude(
            roll=roll,
            pitch=pitch + level,
            heading=yaw % 360.0,
            sigma_tilt=tilt,
            sigma_heading=heading,
            said=origin,
        )
    return None


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

    @property
    def is_unturned(self) -> bool:
        """Whether it has angles, and all of them are zero."""
        return len(self.relatives_deg) > 0 and not any(self.relatives_deg)


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
    by_number = sorted(heads, key=lambda head: (head.index, head.name))
    named = [head.reference for head in heads if head.reference is not None]
    leading = [h for h in by_number if (h.index == named[0] if named else h.is_unturned)]
    first = (leading or by_number)[0]
    return [first, *(head for head in by_number if head is not first)]


def sentence(heads: Sequence[Head]) -> str:
    """Return a sentence on the assumed rotations of the heads."""
    if not any(head.relatives_deg for head in heads):
        return "the heads look in one direction: the metadata have no RigRelatives"
    names = {head.index: head.name for head in heads}
    references = dict.fromkeys(h.reference for h in heads if h.reference is not None)
    first = in_order(heads)[0]
    why = "whose own angles are zero" if first.is_unturned else "the first"
    which = " or ".join(names.get(r, f"head {r}") for r in references)
    apart = "; no angles join the rigs, whose references look in one direction at first"
    return (
        "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
        f"reference, {which or f'which no file names: {first.name}, {why}'}; y down, z ahead"
        f"{apart if len(references) > 1 else ''}"
    )


# --- Grey values by the metadata: dark level and vignetting. Nothing is applied to pixels


VIGNETTING_CENTRE, VIGNETTING_POLYNOMIAL = "Camera:VignettingCenter", "Camera:VignettingPolynomial"


def vignetting(tags: Tags, colrow: Array) -> Array | None:
    """Return the factory's vignetting of a head at pixels: one in the middle, less outside.

    Parameters
    ----------
    tags : Tags
    colrow : ndarray, shape (..., 2)

    Returns
    -------
    ndarray, shape (...), or None
        Grey values are to be divided by it, as MicaSense's own software does; None where XMP has
        none.
    """
    centre, coefficients = tags.numbers(VIGNETTING_CENTRE, 2), tags.numbers(VIGNETTING_POLYNOMIAL)
    if not (centre and coefficients):
        return None
    r = np.hypot(*np.moveaxis(np.asarray(colrow, float) - centre, -1, 0))
    return np.asarray(np.polyval([*coefficients[::-1], 1.0], r))


def dark_level(tags: Tags) -> float | None:
    """Return the grey value of darkness by the TIFF's `BlackLevel`; None without it."""
    levels = tags.numbers("BlackLevel")
    return float(np.mean(levels)) if levels else None


# --- The camera of a picture, by what its tags say of the lens and the sensor


FOCAL, UNITS = "Camera:PerspectiveFocalLength", "Camera:PerspectiveFocalLengthUnits"
POINT, DISTORTION = "Camera:PrincipalPoint", "Camera:PerspectiveDistortion"
DEWARP, DESIGNED = "drone-dji:DewarpData", "drone-dji:CalibratedFocalLength"
POLYNOMIAL, MATRIX = "Camera:FisheyePolynomial", "Camera:FisheyeAffineMatrix"
RESOLUTION, RESOLUTION_UNIT = "FocalPlaneXResolution", "FocalPlaneResolutionUnit"
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
    pixel = _pixel_mm(tags) or known_pixel_mm
    shape, said, f_px = (_fisheye if model == "fisheye" else _perspective)(tags, pixel)
    f_mm = tags.number("FocalLength")
    with safe.told(partial(tags.wrong, "lens"), "must be one of a camera"):
        # without the size of a pixel: by the focal lengths, or 1 um where nothing says it
        camera, left = shape.nearest(name, pixel or (f_mm / f_px if f_mm and f_px else 1e-3))
    numbers = {key: float(f"{value:.12g}") for key, value in vars(camera.interior).items()}
    interior = replace(camera.interior, **numbers)  # digits that mean something
    return Lens(camera=camera.with_interior(interior), said=said, fitted=left)


def _pixel_mm(tags: Tags) -> float | None:
    """Return the pixel size, mm, by EXIF's resolution of the focal plane; None without it."""
    resolution, unit = tags.number(RESOLUTION), int(tags.number(RESOLUTION_UNIT) or 2)
    if resolution is None or resolution <= 0:
        return None
    if unit not in _PER_MM:
        raise tags.wrong(RESOLUTION_UNIT, str(unit), "must be 2 to 5")
    size = 1 / (resolution * _PER_MM[unit])
    if not 2e-4 < size < 0.1:
        raise tags.wrong(RESOLUTION, str(resolution), "means no size of a pixel")
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


def _perspective(tags: Tags, pixel: float | None) -> tuple[lens.Lens, str, float]:
    """Return the lens of a perspective, where it is from, and its designed focal length, px."""
    col, row = (tags.width_px - 1) / 2, (tags.height_px - 1) / 2
    designed = next(iter(tags.numbers(DESIGNED, 1)), 0.0)
    distortion: Sequence[float] = (0.0,) * 5
    if DEWARP in tags.xmp:
        fx, fy, cx, cy, *distortion = tags.numbers(DEWARP, 9)
        matrix, said = (fx, fy, col + cx, row + cy), f"calibration from XMP, {DEWARP}"
        if tags.text("drone-dji:DewarpFlag") == "1":  # it is taken out already
            distortion = (0.0,) * 5
    elif FOCAL in tags.xmp and (pixel or not designed):  # beside a designed one it is in mm
        if pixel is None:
            raise tags.wrong(RESOLUTION, "missing", "gives the size of a pixel")
        f = focal_px(tags, pixel)
        cx, cy = np.array(tags.numbers(POINT, 2) or (col * pixel, row * pixel)) / pixel
        k1, k2, k3, p1, p2 = tags.numbers(DISTORTION, 5) or distortion
        matrix, distortion = (f, f, cx, cy), (k1, k2, p1, p2, k3)
        unit = "px" if f == tags.numbers(FOCAL)[0] else "mm"
        said = f"focal length in {unit}, principal point and distortion from XMP, {FOCAL}"
    elif designed:
        matrix = (designed, designed, col, row)
        said = f"designed focal length from XMP, {DESIGNED}, no distortion"
    else:
        designed, said = _nominal(tags, pixel)
        matrix = (designed, designed, col, row)
    with safe.told(partial(tags.wrong, "lens"), "must be one of a camera"):
        hole = Pinhole(**dict(zip(("fx", "fy", "cx", "cy"), matrix, strict=True)))
    shape = lens.Lens(
        width_px=tags.width_px,
        height_px=tags.height_px,
        hole=hole,
        distortion=lens.OPENCV.distortion(distortion),
        wrong=lambda fault, expected: tags.wrong("lens", fault, expected),
    )
    return shape, said, designed


def _nominal(tags: Tags, pixel: float | None) -> tuple[float, str]:
    """Return the focal length by EXIF, px, and where it is from."""
    f_mm, film = tags.number("FocalLength"), tags.number("FocalLengthIn35mmFilm")
    if f_mm and pixel:
        return f_mm / pixel, "focal length and pixel size from EXIF, no distortion"
    if film:
        said = "focal length of 35 mm film from EXIF, no distortion: approximate by some per cent"
        return film / WIDTH_35_MM * tags.width_px, said
    expected = (
        "neither XMP nor EXIF says how many pixels the focal length has; the size of a pixel, "
        "--pixel-um, is needed"
    )
    raise tags.wrong("FocalPlaneXResolution, FocalLengthIn35mmFilm", "missing", expected)


def _fisheye(tags: Tags, pixel: float | None) -> tuple[lens.Lens, str, float]:
    """Return the fisheye lens that Parrot writes, where it is from, and no focal length."""
    p, matrix, point = tags.numbers(POLYNOMIAL), tags.numbers(MATRIX, 4), tags.numbers(POINT, 2)
    for name, value in ((RESOLUTION, pixel), (POLYNOMIAL, p), (MATRIX, matrix), (POINT, point)):
        if not value:
            raise tags.wrong(name, "missing", "a fisheye lens needs it")
    c, d, e, f = matrix
    if len(p) < 2 or p[0] != 0 or p[1] <= 0:
        raise tags.wrong(POLYNOMIAL, quoted(list(p)), "must be 0, a positive number, and others")
    shape = lens.fisheye(
        p,
        (c, d, e, f),
        (point[0] / float(pixel or 0), point[1] / float(pixel or 0)),
        size=(tags.width_px, tags.height_px),
        wrong=lambda fault, expected: tags.wrong("lens", fault, expected),
    )
    return shape, f"fisheye lens from XMP, {POLYNOMIAL} and {MATRIX}", 0.0
