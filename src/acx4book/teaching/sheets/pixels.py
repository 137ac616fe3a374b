"""Lab 1: from a pixel to a direction, and from a flying height to a scale."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, computed
from acx4book.teaching.grading import named, of_angles, scaled, swapped, wrong_sign
from acx4lib.expected import Array
from acx4lib.geometry.camera import xy_from_colrow
from acx4sim.files import SimulatedFlight

XY = ("x_mm", "y_mm")
OF_HEIGHT = ("height_above_ground_m", "scale_number", "gsd_m", "sigma_ground_m")

QUESTIONS = tuple(
    Question(name=name, unit=unit, asks=asks, digits=digits)
    for name, unit, asks, digits in (
        ("x_mm", "mm", "x of the measured point in the image", 4),
        ("y_mm", "mm", "y of the measured point in the image", 4),
        (
            "off_axis_deg",
            "deg",
            "angle between the ray and the optical axis; principal point and distortion are zero",
            3,
        ),
        ("height_above_ground_m", "m", "height of the IMU above the control point", 2),
        ("scale_number", "", "flying height over focal length", 0),
        ("gsd_m", "m", "side of a pixel on the ground", 4),
        (
            "sigma_ground_m",
            "m",
            "σ of the point on the ground along one axis, from the σ of the measurement alone",
            4,
        ),
    )
)


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly one strip."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE[:1])


def _row(case: Case) -> int:
    """Return the measurement: of the first control point in the first image."""
    points = case.block.image_points
    return int(np.flatnonzero(np.isin(points.point_idx, case.block.control.point_idx))[0])


def _given(case: Case) -> Sequence[str]:
    """Return the student's image and point."""
    points, row = case.block.image_points, _row(case)
    image = case.block.images.names[points.image_idx[row]]
    return [
        f"Your measurement is that of control point `{case.block.points[points.point_idx[row]]}` "
        f"in image `{image}`."
    ]


def _height(case: Case) -> tuple[float, float]:
    """Return the heights of the IMU and of the control point, m."""
    block, row = case.block, _row(case)
    image, point = (a[row] for a in (block.image_points.image_idx, block.image_points.point_idx))
    ground = block.control.x_m[block.control.point_idx == point]
    up = [block.frame.to_grid(x)[0, 2] for x in (block.T_m_b_images.r[[image]], ground)]
    return float(up[0]), float(up[1])


def _of_height(case: Case, height: float) -> dict[str, float]:
    """Return the quantities that depend on the height above ground."""
    camera = case.block.cameras[0]
    pixel_m = 1e-3 * camera.pixel_mm
    scale = height / (1e-3 * camera.interior.f)
    sigma = float(case.block.image_points.sigma_px[_row(case)])
    return named(OF_HEIGHT, np.array([height, scale, scale * pixel_m, sigma * scale * pixel_m]))


def _measured(case: Case) -> Array:
    return case.block.image_points.colrow[_row(case)]


def _off_axis(case: Case, xy: Array) -> float:
    return float(np.degrees(np.arctan2(np.hypot(*xy), case.block.cameras[0].interior.f)))


def _solve(case: Case) -> Rights:
    """Compute everything from the tables of the flight."""
    digits = {question.name: question.digits for question in QUESTIONS}
    xy = xy_from_colrow(case.block.cameras[0], _measured(case)[None])[0]
    over, under = _height(case)
    all_values = {
        **named(XY, xy),
        "off_axis_deg": _off_axis(case, xy),
        **_of_height(case, over - under),
    }
    return {name: computed(value, digits[name]) for name, value in all_values.items()}


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with pixels, angles and heights."""
    camera, colrow = case.block.cameras[0], _measured(case)
    size = np.array([camera.width_px, camera.height_px])
    up = np.array([1.0, -1.0]) * camera.pixel_mm
    yield Mistake(
        says="half a pixel is missing: (0, 0) is the centre of the first pixel, not its corner",
        gives=named(XY, up * (colrow - size / 2)),
    )
    yield Mistake(
        says="the first pixel is counted as 1; it is 0",
        gives=named(XY, up * (colrow - (size + 1) / 2)),
    )
    yield Mistake(says="counted from the corner, not from the middle", gives=_from_corner(case))
    yield wrong_sign(right, XY[1:], "y points up in the image; rows count downwards")
    yield wrong_sign(right, XY, "the signs of x and y are wrong: point less middle")
    yield swapped(right, *XY, "x and y are swapped: x goes with columns")
    yield scaled(right, XY, 1.0 / camera.pixel_mm, "given in pixels; asked for in mm")
    yield scaled(right, XY, 1000.0, "given in µm; asked for in mm")
    yield from of_angles(right, ["off_axis_deg"])
    f = camera.interior.f
    yield Mistake(
        says="this is the angle to the image plane: arctan of distance over f, not of f over it",
        gives={"off_axis_deg": 90.0 - right["off_axis_deg"].value},
    )
    yield Mistake(
        says="only x was used: the distance from the middle is √(x² + y²)",
        gives={"off_axis_deg": float(np.degrees(np.arctan2(abs(right["x_mm"].value), f)))},
    )
    yield from _of_heights(case, right)


def _from_corner(case: Case) -> dict[str, float]:
    return named(XY, _measured(case) * case.block.cameras[0].pixel_mm)


def _of_heights(case: Case, right: Rights) -> Iterator[Mistake]:
    over, under = _height(case)
    yield Mistake(
        says="the ground's height is forgotten: the trajectory has heights above the ellipsoid",
        gives=_of_height(case, over),
    )
    yield Mistake(says="heights are added, not subtracted", gives=_of_height(case, over + under))
    yield Mistake(
        says="the scale is upside down: flying height over focal length",
        gives={"scale_number": 1.0 / right["scale_number"].value},
    )
    yield scaled(right, ["scale_number"], 1e-3, "the focal length is in mm, the height in m")
    yield scaled(right, OF_HEIGHT[2:], 100.0, "given in cm; asked for in m")
    yield scaled(right, OF_HEIGHT[2:], 1000.0, "given in mm; asked for in m")
    yield Mistake(
        says="this is a pixel on the ground: multiply by the σ of the measurement in pixels",
        gives={"sigma_ground_m": right["gsd_m"].value},
    )
    yield scaled(
        right, OF_HEIGHT[3:], 2.0**0.5, "this is the σ of both axes together; asked for along one"
    )


SHEET = Sheet(
    name="lab-1",
    title="Pixels, directions and scale",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
