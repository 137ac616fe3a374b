"""Pictures of a simulated flight, and their scenery."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import tifffile
from numpy.testing import assert_allclose, assert_array_equal
from pyproj import Transformer
from scipy.ndimage import gaussian_filter
from scipy.stats import norm

import acx4sim
from acx4sim import earth, pictures
from acx4sim.designs import acx4_plan
from acx4sim.drawing import GroundWindow, cell_m, draw, fractal, rectangles, shapes, white
from acx4sim.files import photograph
from acx4sim.pictures import (
    Tiles,
    camera_response,
    ground_from_pixels,
    landscape,
    picture,
    pixels_from_ground,
    reduced,
    station,
)
from acx4sim.scenery import Country, Landscape, read_photo
from support.helpers import repeats
from support.pictures.measured import cut_out, middle_of_disc

EXACT = acx4sim.Options(image_noise=0, control_noise=0, blocks=("heads",))
PLAN = acx4_plan()


@pytest.fixture(scope="module")
def at():
    return station(PLAN, "H3-04")


@pytest.fixture(scope="module")
def exact():
    return acx4sim.acx4(seed=1, options=EXACT)


def pixels_of(camera, n, seed=0):
    size = np.array([camera.width_px, camera.height_px])
    return np.random.default_rng(seed).uniform(-0.5, size - 0.5, (n, 2))


class Evenly:
    """A ground of one DN."""

    def __init__(self, dn):
        self.dn = dn

    def paint(self, window):
        return np.full((window.rows, window.cols, 3), self.dn, np.uint16)


class Slopes:
    """A ground whose red says the east and whose green the north, 1000 DN a cell, 60 cells."""

    def paint(self, window):
        dn = np.zeros((window.rows, window.cols, 3), np.uint16)
        dn[..., 0] = (window.col + np.arange(window.cols)) % 60 * 1000
        dn[..., 1] = ((window.row + np.arange(window.rows)) % 60 * 1000)[:, None]
        self.level = window.level
        return dn


# --- geometry --------------------------------------------------------------------------------


@pytest.mark.parametrize("refraction", ["none", "standard"])
@pytest.mark.parametrize("name", ["CAM1", "CAM3", "SYN"])
def test_ground_of_a_pixel_is_seen_in_that_pixel(at, name, refraction):
    """Rays stop when 1e-7 m from the ground, and a pixel is 0.1 m; way back is another code."""
    here = replace(at, plan=replace(PLAN, refraction=refraction))
    camera = PLAN.cameras[name]
    colrow = pixels_of(camera, 500)
    x_g = ground_from_pixels(here, camera, colrow)
    assert_allclose(pixels_from_ground(here, camera, x_g), colrow, atol=1e-5)


def test_ground_lies_on_the_hills_of_the_surveyed_points(at):
    """The terrain's own formula at the points found; rays stop at 1e-7 m."""
    x_g = ground_from_pixels(at, PLAN.cameras["CAM2"], pixels_of(PLAN.cameras["CAM2"], 50))
    llh = earth.Grid(crs=PLAN.crs).geodetic_from_grid(x_g)
    height = earth.terrain_height(llh, PLAN.ground_m, latitude=at.latitude)
    assert_allclose(x_g[:, 2], height, atol=1e-6)
    llh = earth.Grid(crs=PLAN.crs).geodetic_from_grid(at.marks_g)
    marks = earth.terrain_height(llh, PLAN.ground_m, latitude=at.latitude)
    assert_allclose(at.marks_g[:, 2], marks, atol=1e-9)


def test_latitude_and_longitude_of_geocentric_coordinates_are_projs():
    """1e-12 rad is 6 micrometres, as 1e-5 m."""
    rng = np.random.default_rng(0)
    llh = np.column_stack(
        [rng.uniform(-1.4, 1.4, 50), rng.uniform(-3, 3, 50), 4000 * rng.random(50)]
    )
    grid = earth.Grid(crs=PLAN.crs)
    to_ecef = Transformer.from_pipeline("+proj=cart +ellps=GRS80")  # of SIRGAS 2000
    lon, lat = np.degrees(llh[:, 1]), np.degrees(llh[:, 0])
    x_e = np.column_stack(to_ecef.transform(lon, lat, llh[:, 2]))
    found = grid.geodetic_from_ecef(x_e)
    assert_allclose(found[:, :2], llh[:, :2], atol=1e-12)
    assert_allclose(found[:, 2], llh[:, 2], atol=1e-5)


def test_reduced_camera_sees_the_middle_of_the_sensor(at):
    camera = PLAN.cameras["CAM2"]
    small = reduced(camera, 4)
    assert (small.width_px, small.height_px) == (2246, 1683)
    # 8984 = 4 x 2246 and 6732 = 4 x 1683: a small pixel's middle is between four large ones
    ground = ground_from_pixels(at, small, np.array([[0.0, 0.0], [100.0, 7.0]]))
    same = ground_from_pixels(at, camera, np.array([[1.5, 1.5], [401.5, 29.5]]))
    assert_allclose(ground, same, atol=1e-6)


@pytest.mark.parametrize(("name", "reduce"), [("CAM1", 8), ("CAM4", 16), ("SYN", 16)])
def test_every_pixel_sees_its_ground_to_a_thousandth(at, name, reduce):
    """2 x 2 exact rays per pixel against what the picture of two slopes says.

    Not near the steps between slopes. A cell is about half a pixel; 1e-3 px is 2 DN.
    """
    camera, ground = reduced(PLAN.cameras[name], reduce), Slopes()
    found = np.concatenate(
        [
            np.c_[_grid(rows, cols), dn.reshape(-1, 3)[:, :2]]
            for rows, cols, dn in pictures.parts(at, camera, ground)
        ]
    )
    found = found[:: max(len(found) // 3000, 1)]
    cells = (
        np.stack(
            [
                ground_from_pixels(at, camera, found[:, :2] + [dx, dy])[:, :2]
                for dx in (-0.25, 0.25)
                for dy in (-0.25, 0.25)
            ]
        )
        / cell_m(ground.level)
        - 0.5
    )
    on_slope = np.all((cells % 60 > 4) & (cells % 60 < 55), axis=(0, 2))
    assert on_slope.sum() > 500
    error = found[:, 2:] / 1000 - cells.mean(axis=0) % 60
    assert np.abs(error[on_slope]).max() < 1e-3


def _grid(rows, cols):
    grid = np.stack(
        np.meshgrid(np.arange(cols.start, cols.stop), np.arange(rows.start, rows.stop)), -1
    )
    return grid.reshape(-1, 2)


@pytest.mark.parametrize("name", ["CAM1", repeats("CAM2"), repeats("CAM3"), repeats("CAM4")])
def test_painted_points_are_where_the_flight_measures_them(exact, at, name):
    """Centroids of the white discs against exact image_points.csv.

    Taken with pixels of a quarter of the size: the centroid of a disc of 4 px is no better than
    0.02 px, whoever takes the picture. Oblique perspective moves it by less than 0.001 px.
    """
    measured = exact.tables["heads/image_points.csv"].set_index(["image", "point"])
    colrow = measured.loc[f"H3-04_{name}"].filter(regex="^P", axis=0).to_numpy()[:5]
    assert len(colrow) > 2
    ground = landscape(at)
    for col, row in colrow:
        left, top = int(col) - 12, int(row) - 12
        part = cut_out(PLAN.cameras[name], left, top, 25, 25)
        fine = replace(part, width_px=100, height_px=100, pixel_um=part.pixel_um / 4)
        grey = picture(at, fine, ground).astype(float).mean(axis=2)
        middle = middle_of_disc(grey, np.array([49.5, 49.5]), 4 * 3.4)
        assert_allclose((middle + 0.5) / 4 - 0.5, [col - left, row - top], atol=0.003)


def test_pictures_of_one_place_agree_whatever_camera_takes_them(at, tmp_path):
    """A head's picture and one of a camera that looks down, at the same ground points.

    Spots whose sigma is 10 m in pixels of 2 m: 40 counts of 110 DN change by
    40 x 110 x 2 / 10 = 880 a pixel, and rounding to the nearest pixel leaves 880 x 0.29 on
    either axis. An error of one pixel would leave 880.
    """
    spots = gaussian_filter(np.random.default_rng(0).standard_normal((512, 512, 3)), (80, 80, 0))
    counts = np.clip(128 + 40 * spots / spots.std(), 0, 255).astype(np.uint8)
    tifffile.imwrite(tmp_path / "spots.tif", counts, photometric="rgb")
    ground = Tiles(ground=read_photo(tmp_path / "spots.tif"))
    head, down = (reduced(PLAN.cameras[name], 16) for name in ("CAM1", "SYN"))
    grid = np.stack(np.meshgrid(np.arange(100, 400, 3), np.arange(100, 300, 3)), -1).reshape(-1, 2)
    seen = pixels_from_ground(at, down, ground_from_pixels(at, head, grid))
    size = np.array([down.width_px, down.height_px])
    inside = np.all((seen > 0) & (seen < size - 1), axis=1)
    assert inside.sum() > 1000
    a = picture(at, PLAN.cameras["CAM1"], ground, reduce=16)
    b = picture(at, PLAN.cameras["SYN"], ground, reduce=16)
    (col_a, row_a), (col_b, row_b) = grid[inside].T, np.rint(seen[inside]).astype(int).T
    error = a[row_a, col_a].astype(float) - b[row_b, col_b]
    assert error.std() < 600
    assert a.std() > 5000


# --- radiometry ------------------------------------------------------------------------------


def test_shot_noise_is_half_the_root_and_falls_with_the_reduction(at):
    """40 000 values: a standard deviation is known to 0.35 %, five sigma are 2 %."""
    for reduce in (1, 3):
        part = cut_out(PLAN.cameras["CAM1"], 4000, 3000, 240 * reduce, 60 * reduce)
        image = picture(at, part, Evenly(20_000), reduce=reduce, noise=np.random.default_rng(1))
        expected = np.hypot(0.5 * np.sqrt(20_000) / reduce, np.sqrt(1 / 12))
        assert_allclose(image.std(), expected, rtol=0.02)
        assert_allclose(image.mean(), 20_000, atol=5 * expected / np.sqrt(image.size))


def test_light_falls_off_with_the_cosine_by_20_to_25_percent(at):
    for name in ("CAM1", "CAM2", "CAM3", "CAM4"):
        camera, responds = PLAN.cameras[name], camera_response(name, 1)
        image = picture(at, camera, Evenly(40_000), reduce=32, responds=responds)
        rows, cols = image.shape[:2]
        middle, corner = image[rows // 2, cols // 2], image[0, 0]
        assert_allclose(middle / 40_000, responds.gain, atol=1e-3)  # two pixels off the middle
        slant = np.array([cols - 1, rows - 1]) / 2 * 32 * camera.pixel_um / 1000
        cosine = np.cos(np.arctan(np.hypot(*slant) / camera.f_mm))
        assert_allclose(
            corner, 40_000 * np.array(responds.gain) * cosine ** np.array(responds.cosine), atol=1
        )
        assert np.all((corner / middle > 0.74) & (corner / middle < 0.82))
        assert np.all(np.abs(np.array(responds.gain) - 1) <= 0.05)


# --- files -----------------------------------------------------------------------------------

FEW = acx4sim.Options(blocks=("heads",), tie_points={"heads": 0})
REDUCE = 48


@pytest.fixture(scope="module")
def photo(tmp_path_factory):
    path = tmp_path_factory.mktemp("photo") / "photo.tif"
    counts = np.random.default_rng(0).integers(20, 200, (64, 96, 3), dtype=np.uint8)
    tifffile.imwrite(path, counts, photometric="rgb")
    return path


def with_pictures(folder, photo, name="acx4", exposures=("H3-04",), options=FEW):
    flight = acx4sim.DESIGNS[name](seed=2, options=options)
    acx4sim.write(photograph(flight, exposures, reduce=REDUCE, photo=photo), folder)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory, photo):
    return with_pictures(tmp_path_factory.mktemp("pictures") / "flight", photo)


def test_every_head_has_its_file_and_images_csv_names_it(folder):
    images = pd.read_csv(folder / "heads/images.csv", dtype=str, keep_default_na=False)
    named = images[images["file"] != ""]
    assert set(named["exposure"]) == {"H3-04"}
    assert named["file"].tolist() == [f"images/{image}.tif" for image in named["image"]]
    for file in named["file"]:
        image = tifffile.memmap(folder / "heads" / file, mode="r")  # contiguous, uncompressed
        assert image.shape == (6732 // REDUCE, 8984 // REDUCE, 3)
        assert image.dtype == np.uint16
        assert 8_500 < image.mean() < 12_500  # 110 counts, less towards the edges
    assert len(list((folder / "heads/images").iterdir())) == 4


def test_same_seed_gives_the_same_pictures(folder, photo, tmp_path):
    again = with_pictures(tmp_path / "flight", photo)
    for path in (folder / "heads/images").iterdir():
        assert (again / "heads/images" / path.name).read_bytes() == path.read_bytes()


def test_blocks_that_are_measured_in_heads_have_pictures_of_their_own(tmp_path, photo):
    options = acx4sim.Options(tie_points={"heads": 0, "calibration": 0})
    folder = with_pictures(tmp_path / "f", photo, "acx4", ["H3-04", "calibration/C2-05"], options)
    for block, exposure in (("heads", "H3-04"), ("calibration", "C2-05")):
        images = pd.read_csv(folder / block / "images.csv", dtype=str, keep_default_na=False)
        named = images[images["file"] != ""]
        assert set(named["exposure"]) == {exposure}
        assert all((folder / block / file).is_file() for file in named["file"])
        assert len(list((folder / block / "images").iterdir())) == 4


def test_photo_keeps_its_left_and_right(tmp_path):
    """Its first row is the north; it is mirrored at the edge of the grid's first quadrant."""
    photo = np.zeros((8, 8, 3), np.uint8)
    photo[:4, :4] = 255
    tifffile.imwrite(tmp_path / "photo.png.tif", photo, photometric="rgb")
    ground = read_photo(tmp_path / "photo.png.tif")
    window = pictures.GroundWindow(level=2, row=-4, col=0, rows=4, cols=4)
    assert_array_equal(
        ground.paint(window)[..., 0] > 20_000, [[False] * 4] * 2 + [[True, True, False, False]] * 2
    )


# --- The procedural landscape: one and the same wherever and however finely one looks


MIDDLE = (671_000.0, 7_189_500.0)
COUNTRY = Country(seed=1, middle=MIDDLE)


def window_at(east_m, north_m, level, size):
    """Return a window around a place given from the middle."""
    cell = cell_m(level)
    col, row = int((MIDDLE[0] + east_m) / cell), int((MIDDLE[1] + north_m) / cell)
    return GroundWindow(level=level, row=row - size // 2, col=col - size // 2, rows=size, cols=size)


def part(window, row, col, rows, cols):
    return GroundWindow(
        level=window.level, row=window.row + row, col=window.col + col, rows=rows, cols=cols
    )


@pytest.fixture(scope="module")
def plain():
    return Landscape(country=COUNTRY)


VILLAGE = (-470.0, 250.0)


@pytest.mark.parametrize("place", [VILLAGE, (150.0, -80.0), (20.0, -380.0)])
def test_edges_stand_where_they_are_in_cells_of_every_size(plain, place):
    """How far parts of 32 x 32 cells have moved against cells of half the size."""
    for level in (0, 1):
        window = window_at(*place, level, 1024)
        window = replace(window, row=window.row // 2 * 2, col=window.col // 2 * 2)
        fine = plain.paint(window)[..., 1].reshape(512, 2, 512, 2).mean(axis=(1, 3))
        coarse = plain.paint(
            GroundWindow(
                level=level + 1, row=window.row // 2, col=window.col // 2, rows=512, cols=512
            )
        )[..., 1]
        moved = np.linalg.norm(shifts(fine, coarse.astype(float)), axis=1)
        assert len(moved) > 50
        assert np.sqrt(np.mean(moved**2)) < 0.1
        assert np.quantile(moved, 0.95) < 0.2


def shifts(one, other, size=32):
    """Return how far parts of an image moved, by least squares; only where there is structure."""
    down, along = np.gradient((one + other) / 2)
    found = []
    for row in range(0, len(one) - size + 1, size):
        for col in range(0, len(one) - size + 1, size):
            at = np.s_[row : row + size, col : col + size]
            A = np.column_stack([-along[at].ravel(), -down[at].ravel(), np.ones(size**2)])
            if np.linalg.eigvalsh(A.T[:2] @ A[:, :2])[0] > 2e8:
                found.append(np.linalg.lstsq(A, (other - one)[at].ravel(), rcond=None)[0][:2])
    return np.array(found)


@pytest.mark.parametrize("size_m", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 45.0])
def test_a_polygon_covers_its_area_in_cells_of_every_size(size_m, angle_deg):
    middle, angle = np.array([[4.03, 3.98]]), np.radians([angle_deg])
    drawn = shapes(rectangles(middle, 1.5 * size_m, size_m, angle), (200, 200, 200, 200))
    for level in range(-2, 4):
        if size_m < 3 * cell_m(level):
            continue
        n = int(32 / cell_m(level))
        window = GroundWindow(level=level, row=-n // 4, col=-n // 4, rows=n, cols=n)
        canvas = np.zeros((n, n, 4), np.uint8)
        draw(canvas, window, drawn)
        east, north = window.en()
        share = canvas[..., 0] / 200
        found = np.array([share.sum(axis=0) @ east, share.sum(axis=1) @ north]) / share.sum()
        edge_m = (np.sqrt(share.sum() / 1.5) * cell_m(level) - size_m) / 2
        assert abs(edge_m) < 0.12 * cell_m(level)
        assert np.all(np.abs(found - middle[0]) < 0.2 * cell_m(level))


def test_marks_are_discs_of_60_cm_on_dark_squares():
    """Area and middle of the white, from cells that the edge covers in part."""
    mark = np.add(MIDDLE, (20.013, -380.027))
    ground = Landscape(country=COUNTRY, marks=mark[None])
    window = window_at(20.0, -380.0, -1, 64)
    dn = ground.paint(window).astype(float).mean(axis=2)
    share = (dn - 3200) / (46_000 - 3200)
    share[np.hypot(*(np.indices(share.shape) - 32)) > 20] = 0
    cell = window.cell_m
    assert_allclose(share.sum() * cell**2, np.pi * 0.3**2, rtol=0.01)
    east, north = window.en()
    middle = [(share.sum(axis=0) * east).sum(), (share.sum(axis=1) * north).sum()] / share.sum()
    assert_allclose(middle, mark, atol=1e-3)  # 8 x 8 places in a cell of 3 cm
    assert_allclose(dn[32 - 24 : 32 + 24, 32 - 24], 3200, atol=1)


def test_white_noise_is_independent_and_of_unit_variance():
    """Means over 250 000 values, at five sigma."""
    window = GroundWindow(level=0, row=-123, col=10_000_000, rows=500, cols=500)
    noise = white(window, 5)
    bound = -norm.ppf(2.9e-7) / 500
    assert abs(noise.mean()) < bound
    assert abs((noise**2).mean() - 1) < bound
    for other in (np.roll(noise, 1, axis=0), np.roll(noise, 1, axis=1), white(window, 6)):
        assert abs((noise * other).mean()) < bound


def test_fractal_noise_does_not_depend_on_where_a_window_begins():
    """float32 of numbers about one."""
    window = GroundWindow(level=0, row=-77, col=1013, rows=120, cols=90)
    amplitudes = dict.fromkeys(range(8), 0.3)
    whole = fractal(window, amplitudes, 1)
    assert_allclose(
        fractal(part(window, 13, 24, 50, 31), amplitudes, 1), whole[13:63, 24:55], atol=1e-5
    )
