"""The camera of a picture, by its metadata on the lens and the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.flight.problems import quoted
from acx4lib.geometry.camera import Camera
from acx4tools.exchange import lens_models
from acx4tools.exchange.lens import Left, Pinhole
from acx4tools.exchange.lens_models import Wrong
from acx4tools.exchange.pictures.tags import Tags

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
        return _fisheye(tags, name)
    ways = {DEWARP: _dewarped, FOCAL: _calibrated, DESIGNED: _designed}
    stated = [element for element in ways if element in tags.xmp]
    if {FOCAL, DESIGNED} <= set(stated) and _pixel_mm(tags) is None:
        stated.remove(FOCAL)  # in mm, of pixels that nothing says
    if stated:
        return ways[stated[0]](tags, name)
    return _nominal(tags, name)


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


def _calibrated(tags: Tags, name: str) -> Lens:
    """Return the camera that MicaSense and Parrot write, after the specification of Pix4D."""
    pixel = _pixel_needed(tags)
    f = focal_px(tags, pixel)
    centre = np.array(tags.numbers(POINT, 2) or np.array(_middle(tags)) * pixel) / pixel
    k1, k2, k3, p1, p2 = tags.numbers(DISTORTION, 5) or (0.0,) * 5
    unit = "px" if tags.numbers(FOCAL)[0] > PX_OF_WIDTH * tags.width_px else "mm"
    origin = f"focal length in {unit}, principal point and distortion from XMP, {FOCAL}"
    return _made(tags, name, pixel, (f, f, *centre), (k1, k2, p1, p2, k3), said=origin)


def _fisheye(tags: Tags, name: str) -> Lens:
    """Return the camera nearest to a fisheye lens that Parrot writes."""
    pixel, values = _pixel_needed(tags), {}
    for element, n in ((POLYNOMIAL, None), (MATRIX, 4), (POINT, 2)):
        values[element] = tags.numbers(element, n)
        if not values[element]:
            raise tags.wrong(element, "missing", "a fisheye lens needs it")
    p, (c, d, e, f) = values[POLYNOMIAL], values[MATRIX]
    if len(p) < 2 or p[0] != 0 or p[1] <= 0:
        raise tags.wrong(POLYNOMIAL, quoted(list(p)), "must be 0, a positive number, and others")
    if c <= 0 or f <= 0 or c * f - d * e <= 0:
        expected = "must be C, D, E, F with positive C and F"
        raise tags.wrong(MATRIX, quoted([c, d, e, f]), expected)
    col, row = values[POINT]
    size = (tags.width_px, tags.height_px)
    centre = (col / pixel, row / pixel)
    model = lens_models.fisheye(p, (c, d, e, f), centre, size=size, wrong=_wrong(tags))
    origin = f"fisheye lens from XMP, {POLYNOMIAL} and {MATRIX}"
    return _nearest(model, tags, name, pixel, said=origin)


def _wrong(tags: Tags) -> Wrong:
    return lambda fault, expected: tags.wrong("lens", fault, expected)


def _pixel_needed(tags: Tags) -> float:
    pixel = _pixel_mm(tags)
    if pixel is None:
        raise tags.wrong("FocalPlaneXResolution", "missing", "gives the size of a pixel")
    return pixel


def _dewarped(tags: Tags, name: str) -> Lens:
    """Return the calibrated camera of DJI: fx, fy, cx, cy from the middle, k1, k2, p1, p2, k3."""
    text = tags.text(DEWARP).split(";")[-1]
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise tags.wrong(DEWARP, quoted(text), "must be numbers") from None
    if len(numbers) != 9:
        raise tags.wrong(DEWARP, f"{len(numbers)} numbers", "must be 9")
    fx, fy, cx, cy, *distortion = numbers
    middle = _middle(tags)
    if tags.text("drone-dji:DewarpFlag") == "1":
        distortion = [0.0] * 5
    origin = f"calibration from XMP, {DEWARP}"
    return _made(
        tags,
        name,
        _any_pixel(tags),
        (fx, fy, middle[0] + cx, middle[1] + cy),
        distortion,
        said=origin,
    )


def _designed(tags: Tags, name: str) -> Lens:
    f = tags.numbers(DESIGNED, 1)[0]
    centre = [tags.number(key) for key in CENTRE]
    cx, cy = (m if c is None else c - 0.5 for c, m in zip(centre, _middle(tags), strict=True))
    origin = f"designed focal length from XMP, {DESIGNED}, no distortion"
    return _made(tags, name, _any_pixel(tags), (f, f, cx, cy), (0.0,) * 5, said=origin)


def _nominal(tags: Tags, name: str) -> Lens:
    f_mm, film, pixel = (
        tags.number("FocalLength"),
        tags.number("FocalLengthIn35mmFilm"),
        _pixel_mm(tags),
    )
    if f_mm and pixel:
        f, origin = f_mm / pixel, "focal length and pixel size from EXIF, no distortion"
    elif film:
        f = film / WIDTH_35_MM * tags.width_px
        origin = "focal length of 35 mm film from EXIF, no distortion: approximate by some per cent"
    else:
        expected = (
            "neither XMP nor EXIF says how many pixels the focal length has; the size of a pixel, "
            "--pixel-um, is needed"
        )
        raise tags.wrong("FocalPlaneXResolution, FocalLengthIn35mmFilm", "missing", expected)
    return _made(tags, name, _any_pixel(tags, f), (f, f, *_middle(tags)), (0.0,) * 5, said=origin)


def _any_pixel(tags: Tags, f_px: float | None = None) -> float:
    """Return the size of a pixel, mm; by the focal lengths, or 1 um where nothing says it."""
    pixel, f_mm = _pixel_mm(tags), tags.number("FocalLength")
    f_px = f_px or next(iter(tags.numbers(DESIGNED, 1)), 0.0)
    return pixel or (f_mm / f_px if f_mm and f_px else 1e-3)


def _middle(tags: Tags) -> tuple[float, float]:
    return (tags.width_px - 1) / 2, (tags.height_px - 1) / 2


def _made(
    tags: Tags,
    name: str,
    pixel: float,
    matrix: tuple[float, ...],
    distortion: Sequence[float],
    *,
    said: str,
) -> Lens:
    """Return the camera nearest to an OpenCV camera, whose terms all vendors have."""
    fx, fy, cx, cy = matrix
    try:
        model = lens_models.Lens(
            width_px=tags.width_px,
            height_px=tags.height_px,
            hole=Pinhole(fx=fx, fy=fy, cx=cx, cy=cy),
            distortion=lens_models.OPENCV.distortion(distortion),
            wrong=_wrong(tags),
        )
    except ValueError as error:
        raise tags.wrong("lens", str(error), "must be one of a camera") from None
    return _nearest(model, tags, name, pixel, said=said)


def _nearest(model: lens_models.Lens, tags: Tags, name: str, pixel: float, *, said: str) -> Lens:
    """Return the camera nearest to a lens, with digits that mean something."""
    try:
        camera, left = model.nearest(name, pixel)
    except (ValueError, ArithmeticError) as error:
        raise tags.wrong("lens", str(error), "must be one of a camera") from None
    numbers = {key: float(f"{value:.12g}") for key, value in vars(camera.interior).items()}
    interior = replace(camera.interior, **numbers)
    return Lens(camera=camera.with_interior(interior), said=said, fitted=left)
