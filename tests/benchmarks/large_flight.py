"""Flights of thousands of images by one camera, to time commands on.

The library's own projection makes them: they serve to take time, not to test signs.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.geometry.camera import Camera, Interior, inside
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose, exp, rotation_from_opk, transform
from acx4lib.geometry.geodesy import GridSystem, MappingFrame

FRAME = MappingFrame(grid=GridSystem(crs="EPSG:31982"), origin=np.array([-49.3, -25.4]))
GROUND_M, HEIGHT_M = 900.0, 1300.0
BASE_M, ASIDE_M = 250.0, 1109.0
IMAGES_PER_STRIP, TIES_PER_IMAGE = 40, 179
CONTROL = (6, 6)
"""Rows and columns of the control points."""

TRUTH = Camera(  # Table 3, single-step method
    name="SYN",
    width_px=12000,
    height_px=16200,
    pixel_mm=0.0056,
    interior=Interior(
        f=74.4404,
        xp=0.0569,
        yp=0.0063,
        k1=2.42e-7,
        k2=-9.30e-11,
        k3=2.06e-14,
        p1=1.70e-6,
        p2=2.03e-7,
    ),
    T_b_c=Pose(
        R=rotation_from_opk(np.radians([0.49665, -1.59457, 0.07984])),
        r=np.array([0.223, -0.399, -0.201]),
    ),
)
SIGMA_PX = 0.003 / 5.6e-3  # 3 micrometres
SIGMA_CONTROL_M = np.array([0.01, 0.01, 0.02])
SIGMA_POSITION_M = np.array([0.05, 0.05, 0.10])
SIGMA_ATTITUDE = np.radians([0.005, 0.005, 0.008])

FLIGHT_TOML = f"""\
name = "A long flight, simulated"
crs = "{FRAME.grid.crs}"
heights = "ellipsoidal"

[cameras.SYN]
width_px = {TRUTH.width_px}
height_px = {TRUTH.height_px}
pixel_um = {1000 * TRUTH.pixel_mm}
focal_mm = 74.0

[apriori]
image_point_px = {SIGMA_PX}
gnss_horizontal_m = {SIGMA_POSITION_M[0]}
gnss_vertical_m = {SIGMA_POSITION_M[2]}
roll_pitch_deg = {np.degrees(SIGMA_ATTITUDE[0])}
heading_deg = {np.degrees(SIGMA_ATTITUDE[2])}

[stages.mounting]
estimate = ["f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2"]
fix = []
"""


def write(folder: Path, n_images: int) -> None:
    """Write a flight of strips with overlaps of 80 and 30 %, flown to and fro.

    Parameters
    ----------
    folder : Path
        It is made; its files are replaced.
    n_images : int
        A multiple of `IMAGES_PER_STRIP`.
    """
    rng = np.random.default_rng(1)
    n_strips = n_images // IMAGES_PER_STRIP
    T_m_b = _fly(n_strips, rng)
    half = np.array([BASE_M * (IMAGES_PER_STRIP - 1) / 2, ASIDE_M * (n_strips - 1) / 2])
    lines = (share * np.linspace(-1, 1, n) for share, n in zip(half, CONTROL, strict=True))
    control = _on_ground(np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2), rng)
    ties = TIES_PER_IMAGE * n_images
    strewn = (half + 400.0) * rng.uniform(-1, 1, (2 * ties + 100, 2))
    x_m = np.concatenate([control, _on_ground(strewn, rng)])
    points = pd.DataFrame(_seen(T_m_b @ TRUTH.T_b_c, x_m))
    rays = np.bincount(points["point"], minlength=len(x_m))
    kept = (rays >= 2) | (np.arange(len(x_m)) < len(control))
    kept &= np.cumsum(kept) <= len(control) + ties
    points = points[kept[points["point"]]]
    points["point"] = (np.cumsum(kept) - 1)[points["point"]]
    points[["col_px", "row_px"]] += SIGMA_PX * rng.standard_normal((len(points), 2))
    points = points[inside(TRUTH, points[["col_px", "row_px"]].to_numpy())]
    names = np.array([f"E{i}" for i in range(n_images)])
    (folder / "calibration").mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(FLIGHT_TOML, encoding="utf-8")
    for file, table, decimals in (
        ("control_points", _surveyed(control, rng), 6),
        (
            "calibration/images",
            {
                "image": names,
                "camera": TRUTH.name,
                "exposure": names,
                "strip": 1 + np.arange(n_images) // IMAGES_PER_STRIP,
            },
            0,
        ),
        ("calibration/trajectory", {"exposure": names, **_recorded(T_m_b, rng)}, 10),
        (
            "calibration/image_points",
            points.assign(image=names[points["image"]], point="P" + points["point"].astype(str)),
            6,
        ),
    ):
        pd.DataFrame(table).round(decimals).to_csv(folder / f"{file}.csv", index=False)


def _fly(n_strips: int, rng: np.random.Generator) -> Pose:
    """Return true body poses: planned, with some wind."""
    R, r = [], []
    for i in range(n_strips):
        n, forward = IMAGES_PER_STRIP, (-1.0) ** i
        along = forward * BASE_M * (np.arange(n) - (n - 1) / 2)
        aside = np.full_like(along, ASIDE_M * (i - (n_strips - 1) / 2))
        places = np.column_stack([along, aside, np.full_like(along, GROUND_M + HEIGHT_M)])
        r.append(places + np.clip(rng.standard_normal(places.shape), -2, 2) * [6.0, 8.0, 5.0])
        heading = rotation_from_opk(np.array([0.0, 0.0, np.pi * (i % 2)]))
        R.append(heading @ exp(np.radians(np.clip(rng.standard_normal((n, 3)), -2, 2))))
    return Pose(R=np.concatenate(R), r=np.concatenate(r))


def _on_ground(xy: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return points on waves of 30 m with 2 m of roughness."""
    height = 30 * np.sin(xy[:, 0] / 300) * np.cos(xy[:, 1] / 400)
    return np.column_stack([xy, GROUND_M + height + 2 * rng.standard_normal(len(xy))])


def _seen(T_m_c: Pose, x_m: np.ndarray) -> dict[str, np.ndarray]:
    """Return which image sees which point where, without noise, image by image."""
    image, point, colrow = zip(*_by_image(T_m_c, x_m), strict=True)
    col, row = np.concatenate(colrow).T
    whole = {"image": np.concatenate(image), "point": np.concatenate(point)}
    return whole | {"col_px": col, "row_px": row}


def _by_image(T_m_c: Pose, x_m: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    by_y = np.argsort(x_m[:, 1])
    y = x_m[by_y, 1]
    for image in range(len(T_m_c)):
        T = T_m_c[image]
        reach = 0.9 * (T.r[2] - GROUND_M)  # half an image's diagonal on the ground, with tilt
        near = by_y[np.searchsorted(y, T.r[1] - reach) : np.searchsorted(y, T.r[1] + reach)]
        near = np.sort(near[np.abs(x_m[near, 0] - T.r[0]) < reach])
        poses = Pose(R=np.broadcast_to(T.R, (len(near), 3, 3)), r=T.r[None])
        colrow = project(TRUTH, poses, x_m[near])
        on = inside(TRUTH, np.nan_to_num(colrow, nan=-1e9))
        yield np.full(on.sum(), image), near[on], colrow[on]


def _surveyed(x_m: np.ndarray, rng: np.random.Generator) -> dict[str, object]:
    noise = SIGMA_CONTROL_M * rng.standard_normal(x_m.shape)
    axes = FRAME.grid_axes(x_m).reshape(-1, 3, 3)
    enh = FRAME.to_grid(x_m + transform(np.swapaxes(axes, 1, 2), noise))
    sigma = zip(("east_m", "north_m", "height_m"), SIGMA_CONTROL_M, strict=True)
    return {
        "point": [f"P{i}" for i in range(len(x_m))],
        **dict(zip(("east_m", "north_m", "height_m"), enh.T, strict=True)),
        **{f"sigma_{axis}": value for axis, value in sigma},
    }


def _recorded(T_m_b: Pose, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return grid coordinates and angles with the noise of GNSS and IMU."""
    axes = FRAME.grid_axes(T_m_b.r)
    shift = SIGMA_POSITION_M * rng.standard_normal((len(T_m_b), 3))
    turn = exp(SIGMA_ATTITUDE * rng.standard_normal((len(T_m_b), 3)))
    T = Pose(R=T_m_b.R @ turn, r=T_m_b.r + transform(np.swapaxes(axes, 1, 2), shift))
    enh, opk = FRAME.pose_to_grid(T)
    names = ("east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg")
    return dict(zip(names, np.column_stack([enh, np.degrees(opk)]).T, strict=True))
