"""Figures of part I that the reader moves.

What they show is computed by the library: derivatives, or a covariance at every stop of a slider.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4book.foundations import example
from acx4book.foundations.designs import covariance, lines, planned
from acx4book.foundations.drawings.camera import UM, balance, border, grid
from acx4book.paper import printed
from acx4book.typesetting.moving import (
    Explorer,
    Linear,
    Mark,
    Panel,
    Plane,
    Slider,
    Stops,
)
from acx4lib.expected import Array
from acx4lib.geometry.camera import Interior, colrow_from_xy, distortion
from acx4lib.geometry.collinearity import Measurement, image_derivatives, mounted_jacobian, rays
from acx4lib.geometry.frames import Pose, rotation_from_opk

# --- Effects of the coefficients of a lens on the points of an image


HEAD = "CAM1"
"""The head of Table 1 whose format and focal length are used."""

FLOWN_M = 1600.0
"""Height over ground for effects on the ground: the paper's lower flying height."""

KEYS = {"k1": 1e-6, "k2": 1e-9, "k3": 1e-12, "p1": 1e-6, "p2": 1e-6}
"""Coefficients, and one unit of their sliders, mm^-2, mm^-4, mm^-6, mm^-1 and mm^-1."""

_SLIDERS = (
    Slider(name="k₁", unit="· 10⁻⁶ mm⁻²", low=-4.0, high=4.0, step=0.01),
    Slider(name="k₂", unit="· 10⁻⁹ mm⁻⁴", low=-4.0, high=4.0, step=0.01),
    Slider(name="k₃", unit="· 10⁻¹² mm⁻⁶", low=-4.0, high=4.0, step=0.01),
    Slider(name="p₁", unit="· 10⁻⁶ mm⁻¹", low=-8.0, high=8.0, step=0.01),
    Slider(name="p₂", unit="· 10⁻⁶ mm⁻¹", low=-8.0, high=8.0, step=0.01),
    Slider(name="change of f", unit="µm", low=-300.0, high=300.0, step=5.0),
)

EXAGGERATED = 60.0
"""How many times too long arrows are drawn."""


def _lens(values: Array) -> Interior:
    """Return the lens set by the sliders, without their change of f."""
    named = {key: unit * v for (key, unit), v in zip(KEYS.items(), values, strict=False)}
    return Interior(f=printed.interior(1, HEAD).f, **named)


def _response(xy_mm: Array) -> Array:
    """Return `_moved`, which is linear in the sliders, for one unit of each, (2 n, 6), mm."""
    one_by_one = [_moved(unit, xy_mm).ravel() for unit in np.eye(len(_SLIDERS))]
    return np.stack(one_by_one, axis=1)


def _moved(values: Array, xy_mm: Array) -> Array:
    """Return measured minus ideal points, mm, if the focal length is changed as well."""
    described = _lens(values)
    # with a larger f the ideal point of the same ray lies farther from the middle
    larger = values[-1] / UM / described.f
    change: Array = distortion(described, xy_mm) - larger * xy_mm
    return change


def distortion_explorer() -> Explorer:
    """Return the explorer."""
    corner = printed.corners(HEAD)[0]
    table1 = printed.interior(1, HEAD)
    as_printed = [getattr(table1, key) / unit for key, unit in KEYS.items()]
    return Explorer(
        name="explorer-distortion",
        caption=(
            f"The distortion of a lens with the format of {HEAD}. Left, arrows from the ideal to "
            f"the measured points, {EXAGGERATED:.0f} times too long. Right, the distortion along "
            "the radius, towards the upper right and the lower left corner; p₁ and p₂ separate the "
            "two curves. The table has the length of the distortion, and what it is on the ground "
            f"from {FLOWN_M:.0f} m."
        ),
        sliders=_SLIDERS,
        presets={
            f"{HEAD} of the paper": [*as_printed, 0.0],
            "only k₁": [2.0, 0, 0, 0, 0, 0],
            "k₁, k₂ and k₃ against each other": [2.0, -3.0, 1.5, 0, 0, 0],
            "only decentring": [0, 0, 0, 6.0, -3.0, 0],
            "k₁ and a balanced f": [2.0, 0, 0, 0, 0, _balanced(2e-6)],
        },
        panels=[_vectors(), _curve(corner)],
        columns={"distortion, µm": 1, "px": 1, "on the ground, m": 2},
        rows={
            name: [
                Linear(matrix=factor * _response(np.array([point])))
                for factor in (UM, 1 / printed.pixel_mm(HEAD), FLOWN_M / table1.f)
            ]
            for name, point in (
                ("upper right corner", corner),
                ("lower left corner", -corner),
                ("half way to the upper right", corner / 2),
            )
        },
    )


def _balanced(k1: float) -> float:
    """Return the stop of the last slider that is nearest to the balanced focal length, µm."""
    change = UM * printed.interior(1, HEAD).f * balance(k1, border(HEAD))
    step = _SLIDERS[-1].step
    return float(step * round(change / step))


def _vectors() -> Panel:
    half = printed.corners(HEAD)[0]
    limits = 1.12 * half
    size = (360.0, 290.0)
    plane = Plane(x=(-limits[0], limits[0]), y=(-limits[1], limits[1]), size=size)
    xy = grid(HEAD, 9, 7)
    outline = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    response = Linear(matrix=_response(xy))
    return Panel(
        title="over the image",
        alt="A rectangle, the image, with arrows outwards that are longest in the corners.",
        size=size,
        fixed=plane.line(outline) + plane.line([(-1, 0), (1, 0)]) + plane.line([(0, -1), (0, 1)]),
        marks=[
            Mark("arrows", "blue", plane, response, at=xy, times=EXAGGERATED),
        ],
    )


def _curve(corner: Array) -> Panel:
    far = border(HEAD)
    size = (360.0, 290.0)
    plane = Plane(x=(0.0, 35.0), y=(-100.0, 150.0), size=size, margin=(44.0, 8.0, 26.0, 40.0))
    r = np.linspace(0, far, 29)
    along = corner / np.linalg.norm(corner)
    marks = []
    for way, colour in ((1, "blue"), (-1, "orange")):
        radial = np.einsum(
            "nks,k->ns", _response(way * np.outer(r, along)).reshape(len(r), 2, -1), way * along
        )
        matrix = np.stack([np.zeros_like(radial), UM * radial], axis=1).reshape(2 * len(r), -1)
        at = np.column_stack([r, np.zeros_like(r)])
        marks.append(Mark("curve", colour, plane, Linear(matrix=matrix), at=at))
    return Panel(
        title="along the diagonal",
        alt="Two curves over the radius, which rise with its third power, one above the other.",
        size=size,
        fixed=plane.axes(
            [0, 10, 20, 30],
            [-100, -50, 0, 50, 100, 150],
            labels=("radius, mm", "distortion outwards, µm"),
        )
        + plane.line([(0, 0), (35, 0)])
        + "".join(
            plane.line([(20, y), (22, y)], colour)
            + plane.text((22.8, y), f"to the {where}", "start", shift=(0, 4))
            for y, colour, where in ((142, "blue", "upper right"), (125, "orange", "lower left"))
        ),
        marks=marks,
    )


# --- Effects of a wrong mounting on the ground, in strips of four directions


SLIDERS = (
    *(Slider(name=f"boresight {o}", unit="°", low=-0.1, high=0.1, step=0.005) for o in "ωφκ"),
    *(Slider(name=f"lever arm {x}", unit="m", low=-1.0, high=1.0, step=0.01) for x in "xyz"),
)
"""Errors of the mounting; the axes of the lever arm are forward, left and up."""

UNITS = np.array([*np.full(3, np.pi / 180), 1.0, 1.0, 1.0])
"""One unit of each slider in rad and m."""

STRIPS = {
    "east": (90.0, "blue"),
    "west": (270.0, "orange"),
    "north": (0.0, "teal"),
    "south": (180.0, "plum"),
}
"""Directions of flight: azimuth in degrees, and colour."""

HEIGHT_M, HIGHER_M = 500.0, 1000.0
"""Heights over flat ground; only the lower one is drawn."""

HALF_MM = example.PIXEL_MM * np.array([example.WIDTH_PX, example.HEIGHT_PX]) / 2
"""Half of the image."""

AROUND = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
"""Corners, in halves of the image."""

POINTS_MM = HALF_MM * np.array(
    [[x, y] for y in (-0.8, -0.27, 0.27, 0.8) for x in (-0.8, -0.4, 0, 0.4, 0.8)]
)
"""Points of the image that have an arrow."""

_EXAGGERATED = 80.0
"""How many times too long displacements are drawn."""


def on_ground(azimuth_deg: float, height_m: float, xy_mm: Array, mounting: Array) -> Array:
    """Return image points on flat ground, computed with a wrong mounting, eq. (14).

    Parameters
    ----------
    azimuth_deg, height_m : float
        Of a level flight; the IMU is above the origin.
    xy_mm : ndarray, shape (n, 2)
        Image points.
    mounting : ndarray, shape (6,)
        Errors in the units of `SLIDERS`, in their order; the true mounting is zero.

    Returns
    -------
    ndarray, shape (n, 2)
        East and north, m.
    """
    opk, lever = (UNITS * mounting)[:3], (UNITS * mounting)[3:]
    T_m_c = _body(azimuth_deg, height_m) @ Pose(R=rotation_from_opk(opk[None]), r=lever[None])
    camera = example.camera()
    ray = rays(camera, T_m_c, colrow_from_xy(camera, xy_mm))
    down = T_m_c.r[:, 2:] / -ray[:, 2:]
    met: Array = (T_m_c.r + down * ray)[:, :2]
    return met


def _derivatives(azimuth_deg: float, height_m: float, xy_mm: Array) -> Array:
    """Return the derivatives of `on_ground` at the true mounting, m per unit of each slider."""
    # the image point is fixed: its derivatives by the ground point and by the mounting must cancel
    n = len(xy_mm)
    T_m_b = _body(azimuth_deg, height_m)[np.zeros(n, dtype=np.intp)]
    level = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    x_m = np.column_stack([on_ground(azimuth_deg, height_m, xy_mm, np.zeros(6)), np.zeros(n)])
    camera = example.camera()
    measurement = Measurement(
        cameras=(camera,),
        camera_idx=np.zeros(n, dtype=np.intp),
        T_m_c=T_m_b @ level,
        colrow=colrow_from_xy(camera, xy_mm),
    )
    _, _, by_pose, by_point = image_derivatives(measurement, x_m)
    by_lever_and_turn = by_pose @ mounted_jacobian(T_m_b, level)[1]
    moved: Array = -np.linalg.solve(by_point[:, :, :2], by_lever_and_turn)
    return moved[:, :, [3, 4, 5, 0, 1, 2]] * UNITS


def boresight_explorer() -> Explorer:
    """Return the explorer."""
    middle = np.zeros((1, 2))
    rows = {
        f"flown {name}": [
            Linear(matrix=100 * _derivatives(azimuth, height, middle)[0, [axis]])
            for height in (HEIGHT_M, HIGHER_M)
            for axis in (0, 1)
        ]
        for name, (azimuth, _) in STRIPS.items()
    }
    return Explorer(
        name="explorer-boresight",
        caption=(
            "What a wrong mounting does to points on flat ground, in strips of four directions "
            f"(north is up). Each rectangle is the footprint of an image from {HEIGHT_M:.0f} m; "
            "arrows go from the true points to the computed ones, "
            f"{_EXAGGERATED:.0f} times too long. The table has the error in the middle "
            "of the image, in centimetres, from two heights."
        ),
        sliders=SLIDERS,
        presets={
            "only φ": [0, 0.05, 0, 0, 0, 0],
            "only lever arm x": [0, 0, 0, 0.44, 0, 0],
            f"both cancel at {HEIGHT_M:.0f} m": [0, 0.05, 0, 0.44, 0, 0],
            "only κ": [0, 0, 0.1, 0, 0, 0],
        },
        panels=[_panel(name, azimuth, colour) for name, (azimuth, colour) in STRIPS.items()],
        columns={
            f"{height:.0f} m: {axis}": 0
            for height in (HEIGHT_M, HIGHER_M)
            for axis in ("east", "north")
        },
        rows=rows,
    )


def _panel(name: str, azimuth_deg: float, colour: str) -> Panel:
    size = (172.0, 172.0)
    plane = Plane(x=(-260.0, 260.0), y=(-260.0, 260.0), size=size)
    points, outline = (
        on_ground(azimuth_deg, HEIGHT_M, xy, np.zeros(6)) for xy in (POINTS_MM, HALF_MM * AROUND)
    )
    azimuth = np.radians(azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    moved = _derivatives(azimuth_deg, HEIGHT_M, POINTS_MM).reshape(-1, len(SLIDERS))
    response = Linear(matrix=moved)
    arrows = Mark("arrows", colour, plane, response, at=points, times=_EXAGGERATED)
    return Panel(
        title=f"flown {name}",
        alt=f"The footprint of an image flown {name}; its points move against the flight.",
        size=size,
        fixed=plane.line(outline) + plane.arrow(205 * forward, 250 * forward),
        marks=[arrows],
    )


def _body(azimuth_deg: float, height_m: float) -> Pose:
    kappa = np.radians(90.0 - azimuth_deg)
    return Pose(
        R=rotation_from_opk(np.array([[0.0, 0.0, kappa]])), r=np.array([[0.0, 0.0, height_m]])
    )


# --- A second flying height: standard deviations at every ratio of two heights


LOWER_M = 500.0
"""Height over ground of the lower lines."""

RATIO = Slider(name="second height over first", unit="", low=1.0, high=3.0, step=0.05)

SHOWN = {
    "f, mm": ("f, µm", 1000.0),
    "lever z, m": ("lever arm z, cm", 100.0),
    "lever x, m": ("lever arm x, cm", 100.0),
    "xp, mm": ("xₚ, µm", 1000.0),
    "φ, °": ("φ, 0.001°", 1000.0),
}
"""Unknowns of `designs.SHOWN`: as they are shown, with the factor to the unit there."""


def two_heights_explorer() -> Explorer:
    """Return the explorer."""
    cov = _covariances(RATIO.stops)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    share = sigma / sigma[0]
    rows = {
        f"σ of {name}": [Stops(sliders=[RATIO], table=column[:, [k]]) for column in (sigma, share)]
        for k, (name, _) in enumerate(SHOWN.values())
    }
    correlation = cov[:, [0], 1] / (sigma[:, [0]] * sigma[:, [1]])
    rows["correlation of f and z"] = [Stops(sliders=[RATIO], table=correlation)]
    return Explorer(
        name="explorer-two-heights",
        caption=(
            f"Opposite lines at {LOWER_M:.0f} m and at a second height: the standard ellipse of "
            "the errors of f and of the lever arm's z. With equal heights it is a long line that "
            "leaves the drawing, since the two can be exchanged for each other. The table has "
            "each standard deviation, and its share of what it is with equal heights."
        ),
        sliders=[RATIO],
        presets={f"{ratio:.1f}": [ratio] for ratio in (1.5, 1.0, 1.1, 2.0, 3.0)},
        panels=[_ellipse(cov[:, :2, :2])],
        columns={"value": 2, "share of σ at equal heights": 3},
        rows=rows,
    )


def _covariances(ratios: Sequence[float] | Array) -> Array:
    """Return covariances of the unknowns in the units of `SHOWN`, shape (n_ratios, 5, 5)."""
    names, scale = [*SHOWN], np.array([factor for _, factor in SHOWN.values()])
    covariances = []
    for ratio in ratios:
        flown = lines(90, 270, height_m=LOWER_M) + lines(90, 270, height_m=LOWER_M * ratio)
        cov = covariance(planned(flown), free=["f", "xp", "yp"], gnss=["shift"])
        covariances.append(cov.loc[names, names].to_numpy())
    return np.array(covariances) * np.outer(scale, scale)


def _ellipse(cov: Array) -> Panel:
    size, limit = (360.0, 300.0), 40.0
    plane = Plane(x=(-limit, limit), y=(-limit, limit), size=size, margin=(44.0, 12.0, 26.0, 40.0))
    response = Stops(sliders=[RATIO], table=_ellipses(cov).reshape(len(cov), -1))
    ticks = [-40, -20, 0, 20, 40]
    return Panel(
        title="errors of f and z together",
        alt="A narrow ellipse that rises to the right, in a plane of errors of f and of z.",
        size=size,
        fixed=plane.axes(ticks, ticks, labels=("error of f, µm", "error of lever arm z, cm"))
        + plane.line([(-limit, 0), (limit, 0)], dash="2 3")
        + plane.line([(0, -limit), (0, limit)], dash="2 3"),
        marks=[Mark("curve", "blue", plane, response)],
    )


def _ellipses(cov: Array) -> Array:
    """Return points on the standard ellipses of covariances, shape (len(cov), n + 1, 2)."""
    angle = np.linspace(0, 2 * np.pi, 36 + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    values, axes = np.linalg.eigh(cov)
    points: Array = np.einsum("rij,rj,nj->rni", axes, np.sqrt(values), circle)
    return points
