"""Metadata of one picture: its time, position, attitude and head."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.expected import Array
from acx4lib.flight.problems import quoted
from acx4tools.exchange.flight_folder import number_of
from acx4tools.exchange.lens import FLIP
from acx4tools.exchange.pictures.tags import Tags, rational

CAPTURE = ("MicaSense:CaptureId", "drone-dji:CaptureUUID", "Camera:CaptureUUID")
GIMBAL = tuple(f"drone-dji:Gimbal{name}Degree" for name in ("Roll", "Pitch", "Yaw"))
CAMERA = tuple(f"Camera:{name}" for name in ("Roll", "Pitch", "Yaw"))
LIGHT = tuple(f"DLS:{name}" for name in ("Roll", "Pitch", "Yaw"))
FLIGHT_YAW = "drone-dji:FlightYawDegree"
SENSEFLY = ("senseFly:Roll", "senseFly:Pitch", "senseFly:Heading")
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
    stem = tags.path.stem
    match = _HEADS_OF_NAME.match(stem)
    return tags.text(*CAPTURE) or f"{tags.path.parent}/{match[1] if match else stem}"


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
    above = ellipsoidal(tags)
    if above is not None:
        return lat, lon, above
    return lat, lon, -height if below else height


def ellipsoidal(tags: Tags) -> float | None:
    """Return senseFly's height above the ellipsoid; None where there is none."""
    for name in tags.xmp:
        kind = name.lower()
        if kind.startswith("sensefly:") and "alt" in kind and "wgs84" in kind:
            return tags.number(name)
    return None


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
        (_of_sensefly(tags), 1.0, 0.0, (3.0, 5.0), "senseFly's roll, pitch and heading in degrees"),
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


def _of_sensefly(tags: Tags) -> tuple[str, ...]:
    """Return the names of senseFly's angles as a file writes them, whatever their capitals."""
    by_lower_case = {name.lower(): name for name in tags.xmp}
    roll, pitch, heading = (by_lower_case.get(name.lower(), name) for name in SENSEFLY)
    return roll, pitch, by_lower_case.get("sensefly:yaw", heading)


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
    """Return the heads by number, but first the reference that a head names before all others."""
    sorted_heads = sorted(heads, key=lambda head: (head.index, head.name))
    named = [head.reference for head in heads if head.reference is not None]
    first = next((h for h in sorted_heads if named and h.index == named[0]), sorted_heads[0])
    return [first, *(head for head in sorted_heads if head is not first)]


def sentence(heads: Sequence[Head]) -> str:
    """Return a sentence on the assumed rotations of the heads."""
    names = {head.index: head.name for head in heads}
    references = dict.fromkeys(h.reference for h in heads if h.reference is not None)
    turned = [h for h in heads if h.relatives_deg]
    if turned and not references:
        return (
            "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
            f"reference, which no file names: {in_order(heads)[0].name}, the first; y down, z ahead"
        )
    if not references:
        return "the heads look in one direction: the metadata have no RigRelatives"
    text = (
        "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
        f"reference, {' or '.join(names.get(r, f'head {r}') for r in references)}; y down, z ahead"
    )
    if len(references) > 1:
        text += "; no angles join the rigs, whose references look in one direction at first"
    return text


# --- Grey values by the metadata: dark level and vignetting. Nothing is applied to
# pixels


CENTRE, POLYNOMIAL = "Camera:VignettingCenter", "Camera:VignettingPolynomial"
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
    centre, coefficients = tags.numbers(CENTRE, 2), tags.numbers(POLYNOMIAL)
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
