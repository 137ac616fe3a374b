"""Lab 3: a point on the ground from two images, with its standard deviations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, computed, estimated
from acx4book.teaching.grading import named, scaled, swapped, too_small, variances
from acx4lib.calibration.estimates import given as as_given
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import directions
from acx4lib.geometry.frames import Pose, transform, turn
from acx4lib.geometry.intersection import largest_angles
from acx4lib.georeferencing import direct
from acx4lib.least_squares.covariance import propagate
from acx4sim.files import SimulatedFlight

POINT = ("east_m", "north_m", "height_m")
GEOID_M = 45.3
"""Height of the geoid above the ellipsoid on the sheet, m."""

ABOVE_GEOID = "height_above_geoid_m"

QUESTIONS = (
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


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
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


def _given(case: Case) -> Sequence[str]:
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


def _solve(case: Case) -> Rights:
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


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
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


SHEET = Sheet(
    name="lab-3",
    title="A point from two images",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
