"""Orientations by features, and points of many rays."""

import csv
import re
import shutil

import cv2
import numpy as np
import pytest

from acx4files.measuring.measure import measure_flight, read_unmeasured, views_of
from acx4files.measuring.orientation import oriented_by_features
from acx4files.measuring.oriented import TieRays, approximate, chosen, joined, refined
from acx4files.measuring.pairs import Found
from acx4files.measuring.views import declared_views
from acx4lib.block import Block, ImagePoints, Images, Trajectory, select_images
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.collinearity import project, rays
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.intersection import intersect
from support.helpers import repeats
from support.pictures import measured

OFF = {"C1-04": (4, -5, 10), "C2-04": (-5, 3, -9), "C4-04": (5, 4, 8)}
"""Roll, pitch, heading of three exposures are wrong by these, degrees."""

NINE_M = 8e-5
"""Of latitude, degrees."""


def misled(folder, flight):
    """Copy a flight; its attitudes are wrong, its positions as well, and nothing says a height."""
    own = shutil.copytree(flight, folder / "misled", copy_function=shutil.os.link)
    (own / "control_points.csv").unlink()
    path = own / "calibration" / "trajectory.csv"
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for k, row in enumerate(rows):
        row["lat_deg"] = f"{float(row['lat_deg']) + NINE_M * (-1) ** k:.9f}"
        for name, by in zip(
            ("roll", "pitch", "heading"), OFF.get(row["exposure"], ()), strict=False
        ):
            row[f"{name}_deg"] = f"{float(row[f'{name}_deg']) + by:.6f}"
    path.unlink()
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    return own


def test_wrong_attitudes_and_positions_and_no_height_cost_no_measurement(whole, tmp_path):
    (outcome,) = measure_flight(misled(tmp_path, whole.flight), tmp_path / "measured")
    found = measured.tie_errors(tmp_path / "measured")
    right = measured.tie_errors(whole.measured)
    assert len(found.off) > 0.9 * len(right.off)
    assert found.rms < 0.06
    assert len(outcome.matched.views) == 3
    said = [re.search(r"are off by (\S+), (\S+), (\S+)° on", line) for line in outcome.sentences]
    told = np.array([found.groups() for found in said if found], float)
    # three pictures with positions that are wrong by nine metres are turned by two degrees
    np.testing.assert_allclose(told, list(OFF.values()), atol=3.0)


def test_pictures_without_anything_in_common_are_refused(whole, tmp_path):
    own = misled(tmp_path, whole.flight)
    rng = np.random.default_rng(5)
    for path in sorted((own / "calibration" / "images").glob("*.tif"))[1:]:
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        path.unlink()
        noise = rng.integers(0, 255, picture.shape).astype(picture.dtype)
        cv2.imwrite(str(path), noise, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    with pytest.raises(FlightError, match="features in common"):
        measure_flight(own, tmp_path / "out")


# --- Oriented


AT = [np.array([[100, 100], [300, 100]]), np.array([[50, 60]]), np.zeros((0, 2), np.intp)]


def found(which, colrow, sigma):
    n = len(which)
    return Found(
        which=np.array(which, np.intp),
        colrow=np.array(colrow, float).reshape(n, 2),
        sigma_px=np.array(sigma, float).reshape(n, 2),
    )


ONE_CAMERA = np.zeros(3, np.intp)


def three_views(camera=ONE_CAMERA):
    nothing = found([], [], [])
    return joined(
        AT,
        {
            (0, 1): (found([0, 1], [[90, 95], [280, 90]], [[0.2, 0.1], [0.2, 0.1]]), nothing),
            (0, 2): (found([0], [[80, 90]], [[0.4, 0.3]]), nothing),
            (1, 2): (found([0], [[31, 41]], [[0.1, 0.1]]), nothing),
        },
        camera,
    )


def test_a_corner_and_its_places_are_one_point():
    rays = three_views()
    assert rays.point.tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert rays.view.tolist() == [0, 1, 2, 0, 1, 1, 2]
    np.testing.assert_array_equal(rays.colrow[:3], [[100, 100], [90, 95], [80, 90]])


def test_half_of_the_variance_of_a_difference_belongs_to_either_picture():
    rays = three_views()
    # the corner's own: the mean of its two differences
    expected = np.sqrt([(0.2**2 + 0.4**2) / 4, 0.1**2 / 2, 0.3**2 / 2])
    np.testing.assert_allclose(rays.sigma_px[:3], expected)


def test_three_rays_are_needed_only_where_three_pictures_show_the_place():
    rays = three_views()
    shown = np.array([3, 3, 3, 3, 3, 2, 2])
    assert set(chosen(rays, shown, apart_px=5).point) == {0, 2}


def test_of_two_points_on_the_same_texture_the_one_with_more_rays_stays():
    rays = three_views()
    moved = rays.colrow.copy()
    moved[5] = [97, 103]  # beside the point 0 in view 1
    near = type(rays)(point=rays.point, view=rays.view, colrow=moved, sigma_px=rays.sigma_px)
    shown = np.full(7, 2)
    assert set(chosen(near, shown, apart_px=10).point) == {0, 1}
    assert set(chosen(near, shown, apart_px=2).point) == {0, 1, 2}


def block_and_views(whole):
    flight = read_unmeasured(whole.flight).flight
    files = flight.image_files["calibration"]
    keep = np.array([path is not None for path in files])
    block = select_images(flight.calibration, keep)
    return block, views_of(flight, block, [path for path in files if path is not None])


def test_a_ray_that_misses_the_others_is_rejected(whole):
    block, views = block_and_views(whole)
    rays = whole.outcome.matched.rays
    many = np.flatnonzero(np.bincount(rays.point)[rays.point] == 3)[7]
    colrow = rays.colrow.copy()
    colrow[many] += [4.0, 12.0]
    spoilt = TieRays(point=rays.point, view=rays.view, colrow=colrow, sigma_px=rays.sigma_px)
    found = refined(approximate(block, 600.0), views, spoilt)
    assert not found.kept[many]
    assert np.mean(found.kept) > 0.97


def test_orientation_and_ground_come_near_the_truth(whole):
    block, views = block_and_views(whole)
    found = refined(approximate(block, 600.0), views, whole.outcome.matched.rays)
    camera = whole.truth["cameras"]["CAM"]
    interior = found.views[0].camera.interior
    assert abs(interior.k1 - camera["k1"]) < 1e-6
    turned = views[0].T_m_c.R[0].T @ found.views[0].T_m_c.R[0]
    assert 0.1 < np.degrees(np.arccos((np.trace(turned) - 1) / 2)) < 0.8  # a boresight of 0.4
    heights = found.surface.z
    control = block.frame.from_grid(np.array(list(whole.truth["control_points"].values())))
    assert abs(np.median(heights) - np.median(control[:, 2])) < 20


# --- Small pictures of a known ground: turned against each other, of other scales and brightness


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


def strip():
    """Return the true poses of four exposures of one strip; only neighbours overlap."""
    x = np.array([-75, -25, 25, 75], dtype=float)
    rng = np.random.default_rng(6)
    opk = np.column_stack([np.radians(rng.uniform(-3, 3, (4, 2))), np.zeros(4)])
    return Pose(R=rotation_from_opk(opk), r=np.column_stack([x, 0 * x, np.full(4, HEIGHTS[0])]))


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


def flown(folder, T, *, dtype, n, off_m=1.5):
    """Write pictures; return them as a block with wrong attitudes, and the true poses."""
    rng = np.random.default_rng(7)
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
            T_m_b=Pose(R=wrong @ T.R[:n], r=T.r[:n] + rng.normal(0, off_m, (n, 3))),
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
    block, views, T = flown(tmp_path, poses(), dtype=dtype, n=n)
    coarse = oriented_by_features(block, views, executor=None, tell=lambda *_: None)
    assert coarse.block.images.names == tuple(f"P{i}" for i in range(PART))
    off = errors_px(coarse, T)
    assert np.sqrt(np.mean(off**2)) < 1.0
    assert len(off) > 300
    if n == PART:
        assert coarse.apart == ()
        return
    assert sorted(coarse.apart) == ["P6", "P7"]


def test_a_strip_with_twofold_overlap_stands_upright(tmp_path):
    """Positions of four metres turn it no better than attitudes of ten degrees."""
    block, views, T = flown(tmp_path, strip(), dtype=np.uint8, n=4, off_m=4.0)
    coarse = oriented_by_features(block, views, executor=None, tell=lambda *_: None)
    assert len(coarse.views) == 4
    assert np.sqrt(np.mean(errors_px(coarse, T) ** 2)) < 1.0
    found = np.concatenate([view.T_m_c.R for view in coarse.views])
    np.testing.assert_array_less(np.arccos(np.sum(found[:, :, 2] * T.R[:, :, 2], 1)), np.radians(6))
