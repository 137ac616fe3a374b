"""When, where and how a camera was held, from the metadata of one of its pictures."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.flight.problems import quoted
from acx4tools.exchange.pictures.tags import Tags, rational

CAPTURE = ("MicaSense:CaptureId", "drone-dji:CaptureUUID", "Camera:CaptureUUID")
GIMBAL = tuple(f"drone-dji:Gimbal{name}Degree" for name in ("Roll", "Pitch", "Yaw"))
CAMERA = tuple(f"Camera:{name}" for name in ("Roll", "Pitch", "Yaw"))
LIGHT = tuple(f"DLS:{name}" for name in ("Roll", "Pitch", "Yaw"))
RTK = tuple(f"drone-dji:RtkStd{name}" for name in ("Lon", "Lat", "Hgt"))
ACCURACY = ("Camera:GPSXYAccuracy", "Camera:GPSZAccuracy")

_HEADS_OF_NAME = re.compile(r"(.+?)_\d{1,2}$")


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Roll, pitch and heading, degrees, sigma of them, and what they are from."""

    roll: float
    pitch: float
    heading: float
    sigma_tilt: float
    sigma_heading: float
    said: str


def key(tags: Tags) -> str:
    """Return what the pictures of one exposure have in common: an identifier, or their name.

    The name is that of the file, without the number of the head: ``IMG_0688`` of ``IMG_0688_4``.
    """
    stem = tags.path.stem
    found = _HEADS_OF_NAME.match(stem)
    return tags.text(*CAPTURE) or f"{tags.path.parent}/{found[1] if found else stem}"


def name_of(tags: Tags) -> str:
    """Return the name of an exposure by that of one of its files."""
    found = _HEADS_OF_NAME.match(tags.path.stem)
    return found[1] if found else tags.path.stem


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
    for names, unit, level, (tilt, heading), said in ways:
        values = [tags.number(name) for name in names]
        if all(value is not None for value in values):
            roll, pitch, yaw = (float(unit) * float(value or 0.0) for value in values)
            return Attitude(
                roll=roll,
                pitch=pitch + level,
                heading=yaw % 360.0,
                sigma_tilt=tilt,
                sigma_heading=heading,
                said=said,
            )
    return None


def course(places: Sequence[tuple[float, float, float]]) -> list[float]:
    """Return the course at every exposure, degrees from north, by its neighbours; 0 for one."""
    if len(places) < 2:
        return [0.0] * len(places)
    lat, lon, _ = np.array(places).T
    north, east = np.gradient(lat), np.gradient(lon) * np.cos(np.radians(lat))
    return [float(a) for a in np.degrees(np.arctan2(east, north)) % 360.0]
