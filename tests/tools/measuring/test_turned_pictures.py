"""Small pictures of a known ground: turned against each other, of other scales and brightness.

They are rendered here, ray by ray on hills with a texture; the flight's attitudes are wrong by 5
degrees in roll and pitch and by 10 in heading, its positions by metres, the height is not known.
"""

import cv2
import numpy as np
import pytest

from acx4lib.flight.block import Block, ImagePoints, Images, Trajectory
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.collinearity import project, rays
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.intersection import intersect
from acx4tools.measuring.orientation import oriented_by_features
from acx4tools.measuring.views import declared_views
from support.helpers import repeats

CAMERA = Camera(
    name="C", width_px=480, height_px=360, pixel_mm=0.01, interior=Interior(f=4.2, k1=-2e-3)
)
HEIGHTS = (100.0, 130.0)
"""Over the ground of neighbours: they differ in scale by 1.3."""

TURNED_DEG, DARKER = 30.0, 0.4
"""Neighbours are turned by this, and as bright as this."""

OFF_DEG = (5.0, -5.0, 10.0)
SIDE_M, CELL_M = 400.0, 0.25
PART = 6
"""Number of pictures of the large part; two more show another ground."""


def hills(xy):
    return 6.0 * np.sin(xy[..., 0] / 23.0) * np.cos(xy[..., 1] / 31.0)


def texture(seed):
    """Return grey values of a square ground, detail of a quarter of a metre to tens of metres."""
    rng, n = np.random.default_rng(seed), int(SIDE_M / CELL_M)
    total = np.zeros((n, n), np.float32)
    for step in (2, 4, 8, 16, 64):
        coarse = rng.normal(size=(n // step + 2, n // step + 2)).astype(np.float32)
        total += cv2.resize(coarse, (n, n), interpolation=cv2.INTER_CUBIC)
    return (total - total.min()) / np.ptp(total)


def poses():
    """Return the true poses: two strips of three, then two pictures beside them."""
    x = np.array([-45, 0, 45, -45, 0, 45, 90, 130], dtype=float)
    y = np.array([-25, -25, -25, 25, 25, 25, 0, 0], dtype=float)
    z = np.array([HEIGHTS[k % 2] for k in range(8)])
    kappa = np.radians(TURNED_DEG) * np.array([0, 1, 0, 1, 0, 1, 0, 1])
    rng = np.random.default_rng(4)
    opk = np.column_stack([np.radians(rng.uniform(-3, 3, (8, 2))), kappa])
    return Pose(R=rotation_from_opk(opk), r=np.column_stack([x, y, z]))


def rendered(T, ground, *, bright, dtype, rng):
    """Return a picture: where the ray of every pixel meets the hills, grey of the texture."""
    col, row = np.meshgrid(np.arange(CAMERA.width_px), np.arange(CAMERA.height_px))
    x = (col - (CAMERA.width_px - 1) / 2) * CAMERA.pixel_mm
    y = ((CAMERA.height_px - 1) / 2 - row) * CAMERA.pixel_mm
    k = 1 - CAMERA.interior.k1 * (x**2 + y**2)  # measured less its distortion
    ahead = np.stack([x * k, y * k, np.full_like(x, -CAMERA.interior.f)], axis=-1) @ T.R.T
    at, z = None, np.zeros(x.shape)
    for _ in range(25):
        at = T.r[:2] + ahead[..., :2] * ((z - T.r[2]) / ahead[..., 2])[..., None]
        z = hills(at)
    u, v = ((at + SIDE_M / 2) / CELL_M).transpose(2, 0, 1).astype(np.float32)
    grey = cv2.remap(ground, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    full = np.iinfo(dtype).max
    noise = rng.normal(0, 0.004, grey.shape)
    return np.clip(full * (bright * (0.1 + 0.8 * grey) + noise), 0, full).astype(dtype)


def flown(folder, *, dtype, n):
    """Write pictures; return them as a block with wrong attitudes, and the true poses."""
    T, rng = poses(), np.random.default_rng(7)
    grounds = texture(1), texture(2)
    paths = []
    for i in range(n):
        picture = rendered(
            Pose(R=T.R[i], r=T.r[i]),
            grounds[i >= PART],
            bright=DARKER if i % 2 else 1.0,
            dtype=dtype,
            rng=rng,
        )
        paths.append(folder / f"P{i}.tif")
        cv2.imwrite(str(paths[-1]), picture)
    signs = np.where(np.arange(n) % 2, 1.0, -1.0)[:, None]
    wrong = rotation_from_opk(np.radians(signs * OFF_DEG))
    block = Block(
        cameras=(CAMERA,),
        images=Images(names=tuple(path.stem for path in paths)),
        points=(),
        image_points=ImagePoints(
            image_idx=np.zeros(0, int),
            point_idx=np.zeros(0, int),
            colrow=np.zeros((0, 2)),
            sigma_px=np.zeros(0),
        ),
        trajectory=Trajectory(
            exposures=tuple(path.stem for path in paths),
            T_m_b=Pose(R=wrong @ T.R[:n], r=T.r[:n] + rng.normal(0, 1.5, (n, 3))),
            sigma_position=np.full((n, 3), 2.0),
        ),
    )
    return block, declared_views(block, paths), T


def errors_px(coarse, T):
    """Return by how much rays of true points miss each other with the poses that were found."""
    rng = np.random.default_rng(9)
    xy = rng.uniform([-60, -40], [60, 40], (200, 2))
    x_m = np.column_stack([xy, hills(xy)])
    number = [int(name[1:]) for name in coarse.block.images.names]
    image, point, colrow = [], [], []
    for k, i in enumerate(number):
        at = project(CAMERA, Pose(R=T.R[i : i + 1], r=T.r[i : i + 1]), x_m)
        seen = ((at > 5) & (at < [474, 354])).all(axis=1)
        image.append(np.full(seen.sum(), k))
        point.append(np.flatnonzero(seen))
        colrow.append(at[seen])
    image, point, colrow = map(np.concatenate, (image, point, colrow))
    found = Pose(
        R=np.concatenate([view.T_m_c.R for view in coarse.views]),
        r=np.concatenate([view.T_m_c.r for view in coarse.views]),
    )
    camera = CAMERA.with_interior(coarse.views[0].camera.interior)
    met = intersect(found.r[image], rays(camera, found[image], colrow), point, len(x_m))
    many = np.bincount(point, minlength=len(x_m))[point] > 1
    seen = project(camera, found[image[many]], met[point[many]])
    return np.linalg.norm(seen - colrow[many], axis=1)


@pytest.mark.parametrize("dtype", [np.uint8, repeats(np.uint16)])
def test_turned_scaled_and_darker_pictures_are_oriented_to_a_pixel(tmp_path, dtype):
    n = PART if dtype == np.uint8 else 8
    block, views, T = flown(tmp_path, dtype=dtype, n=n)
    coarse = oriented_by_features(block, views, executor=None, tell=lambda *_: None)
    assert coarse.block.images.names == tuple(f"P{i}" for i in range(PART))
    off = errors_px(coarse, T)
    assert np.sqrt(np.mean(off**2)) < 1.0
    assert len(off) > 300
    if n == PART:
        assert coarse.apart == ()
        return
    assert sorted(name for part in coarse.apart for name in part) == ["P6", "P7"]
    assert all("not connected with the others" in line for line in coarse.said)
    assert "P6" in " ".join(coarse.said)
