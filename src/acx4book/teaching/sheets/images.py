"""Labs 1 to 3, on images and rays: pixels, rotations, intersection.

Lab 1 goes from a pixel to a direction, and from a flying height to a scale; lab 2 from roll, pitch
and heading to omega, phi and kappa; lab 3 from two images to a point, with standard deviations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, computed, estimated
from acx4book.teaching.grading import (
    named,
    of_angles,
    of_rotation,
    scaled,
    swapped,
    too_small,
    values,
    variances,
    wrong_sign,
)
from acx4lib.block import Block
from acx4lib.calibration.estimates import given as as_given
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.geometry.collinearity import directions
from acx4lib.geometry.frames import (
    Pose,
    opk_from_rotation,
    rotation_from_opk,
    rotation_from_rph,
    transform,
    turn,
)
from acx4lib.geometry.intersection import largest_angles
from acx4lib.georeferencing import direct
from acx4lib.least_squares.covariance import propagate
from acx4sim.files import SimulatedFlight

# --- lab 1: from a pixel to a direction, from a flying height to a scale ---------------------


XY = ("x_mm", "y_mm")
OF_HEIGHT = ("height_above_ground_m", "scale_number", "gsd_m", "sigma_ground_m")

QUESTIONS_PIXELS = tuple(
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


def _fly_pixels(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly one strip."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE[:1])


def _row(case: Case) -> int:
    """Return the measurement: of the first control point in the first image."""
    points = case.block.image_points
    return int(np.flatnonzero(np.isin(points.point_idx, case.block.control.point_idx))[0])


def _given_pixels(case: Case) -> Sequence[str]:
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


def _solve_pixels(case: Case) -> Rights:
    """Compute everything from the tables of the flight."""
    digits = {question.name: question.digits for question in QUESTIONS_PIXELS}
    xy = xy_from_colrow(case.block.cameras[0], _measured(case)[None])[0]
    over, under = _height(case)
    all_values = {
        **named(XY, xy),
        "off_axis_deg": _off_axis(case, xy),
        **_of_height(case, over - under),
    }
    return {name: computed(value, digits[name]) for name, value in all_values.items()}


def _mistakes_pixels(case: Case, right: Rights) -> Iterator[Mistake]:
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


LAB_1 = Sheet(
    name="lab-1",
    title="Pixels, directions and scale",
    fly=_fly_pixels,
    questions=QUESTIONS_PIXELS,
    given=_given_pixels,
    solve=_solve_pixels,
    mistakes=_mistakes_pixels,
)


# --- lab 2: the attitude of one exposure, by other angles ------------------------------------


GAMMA = "convergence_deg"
BODY = ("body_omega_deg", "body_phi_deg", "body_kappa_deg")
CAMERA = ("camera_omega_deg", "camera_phi_deg", "camera_kappa_deg")
IMAGE = 1
"""Index of the exposure: the second."""

NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""North, east, down to east, north, up."""

FRD = np.diag([1.0, -1.0, -1.0])
"""Forward, right, down to forward, left, up."""

GREEK = ("ω", "φ", "κ")

QUESTIONS_ROTATIONS = (
    Question(
        name=GAMMA,
        unit="deg",
        asks="meridian convergence at the exposure, true azimuth minus grid azimuth",
        digits=4,
    ),
    *(
        Question(name=name, unit="deg", asks=f"{angle} of the IMU's body, on the grid", digits=3)
        for name, angle in zip(BODY, GREEK, strict=True)
    ),
    *(
        Question(name=name, unit="deg", asks=f"{angle} of the camera, on the grid", digits=3)
        for name, angle in zip(CAMERA, GREEK, strict=True)
    ),
)


def _fly_rotations(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly one strip with a known camera."""
    camera = flights.drawn_camera(truth)
    known = flights.certificate(camera)
    return flights.fly(errors, title, camera, flights.WHOLE[:1], known=known)


def _given_rotations(case: Case) -> Sequence[str]:
    """Return the student's exposure."""
    return [
        f"Your exposure is `{case.block.images.names[IMAGE]}`. The boresight is known: the "
        "`mount_*` angles in `flight.toml`."
    ]


def _gamma(case: Case) -> float:
    """Return the convergence, radians."""
    frame = case.block.frame
    return float(frame.grid.convergence(_place(case)[None, :2])[0])


def _place(case: Case) -> Array:
    """Return longitude and latitude, degrees, and height of the exposure."""
    return case.block.frame.to_geographic(case.block.T_m_b_images.r[[IMAGE]])[0]


def _rph(case: Case) -> Array:
    """Return roll, pitch and heading as the trajectory has them, radians."""
    table = case.flight.trajectories["calibration"]
    exposure = case.block.trajectory.exposures[case.block.images.exposure_idx[IMAGE]]
    row = table.text["exposure"].index(exposure)
    return np.radians(table.stack("roll_deg", "pitch_deg", "heading_deg")[row])


def _body(case: Case, *, gamma: float, rph: Array | None = None) -> Array:
    """Return R_g_b: body axes to the grid's."""
    R_n_b = rotation_from_rph(_rph(case) if rph is None else rph)
    R_g_b: Array = turn(2, gamma) @ NED @ R_n_b @ FRD
    return R_g_b


def _opk_deg(R: Array) -> Array:
    return np.degrees(opk_from_rotation(R))


def _solve_rotations(case: Case) -> Rights:
    """Turn the body's attitude, then the camera's."""
    block = case.block
    R_g_m = block.trajectory.R_g_m[block.images.exposure_idx[IMAGE]]
    R_g_b = R_g_m @ block.T_m_b_images[IMAGE].R
    R_b_c = block.cameras[0].T_b_c.R
    angles = {
        GAMMA: float(np.degrees(_gamma(case))),
        **named(BODY, _opk_deg(R_g_b)),
        **named(CAMERA, _opk_deg(R_g_b @ R_b_c)),
    }
    digits = {question.name: question.digits for question in QUESTIONS_ROTATIONS}
    return {name: computed(value, digits[name]) for name, value in angles.items()}


def _mistakes_rotations(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with attitudes."""
    yield wrong_sign(right, [GAMMA], "the convergence has the wrong sign: true minus grid azimuth")
    yield from of_angles(right, [GAMMA])
    for names in (BODY, CAMERA):
        yield from of_rotation(right, names)
    R_b_c = case.block.cameras[0].T_b_c.R
    for says, R_g_b in _wrong_bodies(case):
        gives = {**named(BODY, _opk_deg(R_g_b)), **named(CAMERA, _opk_deg(R_g_b @ R_b_c))}
        yield Mistake(says=says, gives=gives)
    yield Mistake(
        says="the convergence is not zero: it is zero on the central meridian of the map alone",
        gives={GAMMA: 0.0},
    )
    yield Mistake(
        says="κ is the heading: that turns clockwise from north, κ counter-clockwise from east",
        gives={BODY[2]: float(np.degrees(_rph(case)[2]))},
    )
    yield from _wrong_cameras(right, R_b_c)


def _wrong_bodies(case: Case) -> Iterator[tuple[str, Array]]:
    """Yield wrong R_g_b by common mistakes."""
    gamma, rph = _gamma(case), _rph(case)
    yield (
        "the meridian convergence is forgotten: heading counts from true north, κ on the grid",
        _body(case, gamma=0.0),
    )
    yield "the meridian convergence has the wrong sign", _body(case, gamma=-gamma)
    yield "roll and pitch are swapped", _body(case, gamma=gamma, rph=rph[[1, 0, 2]])
    yield (
        "the body's axes are forward, right, down; here they are forward, left, up",
        _body(case, gamma=gamma) @ FRD,
    )
    yield (
        "90° are missing: heading counts from north, κ from east",
        turn(2, -np.pi / 2) @ _body(case, gamma=gamma),
    )


def _wrong_cameras(right: Rights, R_b_c: Array) -> Iterator[Mistake]:
    """Yield wrong angles of the camera by common mistakes."""
    body = values(right, BODY)
    R_g_b = rotation_from_opk(np.radians(body))
    yield Mistake(
        says="these are the body's angles: multiply by the boresight",
        gives=named(CAMERA, body),
    )
    yield Mistake(
        says="these are the camera's angles; asked for the body's",
        gives=named(BODY, values(right, CAMERA)),
    )
    yield Mistake(
        says="the boresight is transposed: it takes camera axes to the body's",
        gives=named(CAMERA, _opk_deg(R_g_b @ R_b_c.T)),
    )
    yield Mistake(
        says="the matrices are multiplied in the wrong order: inner letters must touch",
        gives=named(CAMERA, _opk_deg(R_b_c @ R_g_b)),
    )
    yield Mistake(
        says="angles are added: rotations are multiplied as matrices",
        gives=named(CAMERA, body + _opk_deg(R_b_c)),
    )


LAB_2 = Sheet(
    name="lab-2",
    title="Rotations: the attitude of one exposure",
    fly=_fly_rotations,
    questions=QUESTIONS_ROTATIONS,
    given=_given_rotations,
    solve=_solve_rotations,
    mistakes=_mistakes_rotations,
)


# --- lab 3: a point on the ground from two images --------------------------------------------


POINT = ("east_m", "north_m", "height_m")
GEOID_M = 45.3
"""Height of the geoid above the ellipsoid on the sheet, m."""

ABOVE_GEOID = "height_above_geoid_m"

QUESTIONS_INTERSECTION = (
    *(
        Question(name=name, unit="m", asks=f"{axis} of the point", digits=3, with_sigma=True)
        for name, axis in zip(POINT, ("east", "north", "ellipsoidal height"), strict=True)
    ),
    Question(
        name=ABOVE_GEOID,
        unit="m",
        asks=f"height above the geoid, which lies {GEOID_M} m above the ellipsoid",
        digits=3,
        with_sigma=True,
    ),
    Question(name="angle_deg", unit="deg", asks="angle at which the two rays meet", digits=2),
)


def _fly_intersection(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly one strip with a known camera; the target with most rays is not surveyed."""
    camera = flights.drawn_camera(truth)
    known = flights.certificate(camera)
    flight = flights.fly(errors, title, camera, flights.WHOLE[:1], known=known)
    survey, measured = (
        flight.tables[f"{name}.csv"] for name in ("control_points", "calibration/image_points")
    )
    rays = survey["point"].map(measured["point"].value_counts()).fillna(0)
    unknown = survey["point"][int(np.argmax(rays))]
    surveyed = survey[survey["point"] != unknown]
    return replace(flight, tables={**flight.tables, "control_points.csv": surveyed})


def _unknown(case: Case) -> tuple[str, Index]:
    """Return the name of the unsurveyed target, and the rows of its first and last measurement."""
    known = {case.block.points[i] for i in case.block.control.point_idx}
    names = [name for name in case.truth["control_points"] if name not in known]
    name = next(name for name in names if name in case.block.points)
    rows = np.flatnonzero(case.block.image_points.point_idx == case.block.points.index(name))
    return name, rows[[0, -1]]


def _given_intersection(case: Case) -> Sequence[str]:
    """Return the student's point and images."""
    name, rows = _unknown(case)
    first, last = (case.block.images.names[i] for i in case.block.image_points.image_idx[rows])
    return [
        f"Your point is `{name}`, from the images `{first}` and `{last}`. The camera is known: "
        "`flight.toml` has its interior orientation, boresight (`mount_*`) and lever arm "
        "(`lever_*`)."
    ]


def _rays(case: Case, block: Block) -> direct.Rays:
    points, (_, rows) = block.image_points, _unknown(case)
    return direct.Rays(
        image_idx=points.image_idx[rows],
        group=np.zeros(2, dtype=np.intp),
        colrow=points.colrow[rows],
        sigma_px=points.sigma_px[rows],
    )


def _intersected(case: Case, block: Block) -> tuple[Array, direct.Intersections, float]:
    """Return east, north, height, the intersection, and the angle of the rays in degrees."""
    georeferenced = direct.georeference(block, as_given(block.cameras))
    rays = _rays(case, block)
    intersection = direct.intersect_rays(block, georeferenced, rays)
    towards = directions(direct.measured(block, georeferenced, rays))
    angle = float(np.degrees(largest_angles(towards, rays.group, 1)[0]))
    return block.frame.to_grid(intersection.x_m)[0], intersection, angle


def _solve_intersection(case: Case) -> Rights:
    """Intersect the two rays."""
    enh, intersection, angle = _intersected(case, case.block)
    axes = case.block.frame.grid_axes(intersection.x_m)
    sigma = np.sqrt(np.diagonal(propagate(axes, intersection.cov)[0]))
    true = case.truth["control_points"][_unknown(case)[0]]
    point = {
        name: estimated(float(enh[k]), float(sigma[k]), true[k]) for k, name in enumerate(POINT)
    }
    height = point["height_m"]
    return {
        **point,
        ABOVE_GEOID: replace(height, value=height.value - GEOID_M, truth=height.truth - GEOID_M),
        "angle_deg": computed(angle, 2),
    }


def _mistakes_intersection(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with two rays."""
    for says, block in _wrong_blocks(case):
        enh, _, angle = _intersected(case, block)
        gives = named((*POINT, ABOVE_GEOID, "angle_deg"), np.array([*enh, enh[2] - GEOID_M, angle]))
        yield Mistake(says=says, gives=gives)
    yield swapped(right, *POINT[:2], "east and north are swapped")
    height = right["height_m"].value
    yield Mistake(
        says="this is the height above the geoid; asked for the ellipsoidal height",
        gives={"height_m": height - GEOID_M},
    )
    yield Mistake(
        says="the ellipsoidal height is given; the geoid's height is to be taken off",
        gives={ABOVE_GEOID: height},
    )
    yield Mistake(
        says="the geoid's height is added; it is to be taken off",
        gives={ABOVE_GEOID: height + GEOID_M},
    )
    yield scaled(right, ["angle_deg"], float(np.pi / 180), "given in radians; asked for in degrees")
    yield scaled(right, ["angle_deg"], 400 / 360, "given in gon; asked for in degrees")
    yield variances(right)
    yield too_small(right, dict.fromkeys((*POINT, ABOVE_GEOID), 2), "two rays")
    yield Mistake(
        says="σ is of the image points alone: the trajectory's errors belong to it",
        gives_sigma=named(POINT, _of_images(case)),
    )


def _of_images(case: Case) -> Array:
    """Return the standard deviations from image points alone, m."""
    block = case.block
    exact = replace(
        block.trajectory,
        sigma_position=np.zeros((len(block.trajectory), 3)),
        sigma_attitude=np.zeros((len(block.trajectory), 3)),
    )
    _, intersection, _ = _intersected(case, replace(block, trajectory=exact))
    return np.sqrt(
        np.diagonal(propagate(block.frame.grid_axes(intersection.x_m), intersection.cov)[0])
    )


def _wrong_blocks(case: Case) -> Iterator[tuple[str, Block]]:
    """Yield the block with one mistake each."""
    block = case.block
    T = block.cameras[0].T_b_c

    def mounted(T_b_c: Pose) -> Block:
        return _with_camera(block, replace(block.cameras[0], T_b_c=T_b_c))

    yield "the lever arm is forgotten", mounted(Pose(R=T.R, r=np.zeros(3)))
    yield "the lever arm has the wrong sign", mounted(Pose(R=T.R, r=-T.r))
    yield (
        "the boresight is taken as 90° about z: its small angles are forgotten",
        mounted(Pose(R=turn(2, np.pi / 2), r=T.r)),
    )
    bare = replace(block.cameras[0].interior, k1=0.0, k2=0.0, k3=0.0, p1=0.0, p2=0.0)
    yield "the distortion is forgotten", _with_camera(block, block.cameras[0].with_interior(bare))
    inner = block.cameras[0].interior
    other = replace(inner, xp=-inner.xp, yp=-inner.yp)
    yield (
        "the principal point has the wrong sign",
        _with_camera(block, block.cameras[0].with_interior(other)),
    )
    yield "the lever arm is in mapping axes: turn it by the attitude, eq. (14)", _lever_on_map(case)
    yield "the meridian convergence is forgotten", _turned(case)


def _with_camera(block: Block, camera: Camera) -> Block:
    return replace(block, cameras=(camera,))


def _turned(case: Case) -> Block:
    """Return the block with bodies turned as if headings counted from grid north."""
    block = case.block
    trajectory, T = block.trajectory, block.trajectory.T_m_b
    gamma = block.frame.grid.convergence(block.frame.to_geographic(T.r)[:, :2])
    R_m_g = np.swapaxes(trajectory.R_g_m, -1, -2)
    R = R_m_g @ turn(2, -gamma) @ trajectory.R_g_m @ T.R
    return replace(block, trajectory=replace(trajectory, T_m_b=Pose(R=R, r=T.r)))


def _lever_on_map(case: Case) -> Block:
    """Return the block with the lever arm added without rotation."""
    block = case.block
    lever = block.cameras[0].T_b_c.r
    trajectory, T = block.trajectory, block.trajectory.T_m_b
    R_m_g = np.swapaxes(trajectory.R_g_m, -1, -2)
    moved = T.r + transform(R_m_g, lever[None]) - transform(T.R, lever[None])
    return replace(block, trajectory=replace(trajectory, T_m_b=Pose(R=T.R, r=moved)))


LAB_3 = Sheet(
    name="lab-3",
    title="A point from two images",
    fly=_fly_intersection,
    questions=QUESTIONS_INTERSECTION,
    given=_given_intersection,
    solve=_solve_intersection,
    mistakes=_mistakes_intersection,
)
