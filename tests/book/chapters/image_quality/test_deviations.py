"""Points of a synthetic image against an ideal one, and what calibrating it by itself takes up."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import ndimage

from acx4book.chapters.image_quality import deviations, figures
from acx4book.chapters.image_quality import examined as images
from acx4book.chapters.image_quality.deviations import (
    LENS,
    Deviations,
    consistent,
    every_refinement,
    measure,
    one_image_block,
    residuals_px,
    self_calibrate,
)
from acx4book.chapters.image_quality.examined import (
    border_distortion_of_targets,
    drawn_calibration,
    drawn_errors,
    errors_of,
    examine_all,
    frame_deviations,
    geometry_errors,
    measured_ties,
)
from acx4book.paper import printed
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.calibration.heads import radial_profile
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.synthetic_image.frame import synthetic_from_head
from acx4lib.synthetic_image.rendering import FEATHER_PX
from acx4sim.pictures import pixels_from_ground
from support.blocks import FRAME
from support.pictures.known import known
from support.pictures.known import response as response_of

SYN = Camera(
    name="SYN", width_px=12000, height_px=16200, pixel_mm=0.0056, interior=Interior(f=74.0)
)
POSE = Pose(R=rotation_from_opk(np.radians([1.0, -2.0, 28.0])), r=np.array([40.0, -25.0, 2500.0]))
"""Where the camera of `seen_ground` stands: 1600 m over the ground."""


# --- measured --------------------------------------------------------------------------------


def texture(shape=(260, 300), *, seed=1):
    """Return smooth noise, three bands, that no sampling harms."""
    noise = np.random.default_rng(seed).normal(size=shape)
    smooth = ndimage.gaussian_filter(noise, 2.0)
    return 20_000 + 4000 * smooth / smooth.std()


def bands(grey):
    return np.clip(np.rint(grey), 0, 65535).astype(np.uint16)[..., None].repeat(3, axis=2)


def moved(grey, by):
    """Return a picture whose points stand at colrow + by(colrow)."""
    row, col = np.indices(grey.shape).astype(float)
    dx, dy = by(col, row)
    return ndimage.map_coordinates(grey, [row - dy, col - dx], order=5, mode="nearest")


def test_a_known_motion_is_measured_to_a_hundredth_of_a_pixel():
    """Rounded to 16 bit and interpolated by splines, such smooth pictures lose no more."""

    def by(col, row):
        return 0.37 + 1e-3 * (col - 150), -1.21 + 5e-4 * (row - 130)

    grey = texture()
    found = measure(bands(moved(grey, by)), bands(grey))
    assert len(found) >= 30  # of 48 cells; those at the border have less room
    # the inverse motion is evaluated at the moved place; it differs by 1e-3 of a pixel
    expected = np.column_stack(by(*found.ideal.T))
    assert_allclose(found.d_px, expected, atol=0.01)
    assert np.median(found.sigma_px) < 0.01


def test_sigma_is_the_size_of_the_errors_that_noise_makes():
    grey = texture()
    noisy = grey + np.random.default_rng(2).normal(0, 400, grey.shape)
    found = measure(bands(noisy), bands(grey))
    normalised = found.d_px / found.sigma_px[:, None]
    # about 60 coordinates know their RMS to a tenth; windows of neighbours share no pixels
    assert 0.7 < np.sqrt(np.mean(normalised**2)) < 1.3


def test_points_that_stand_out_from_those_around_are_told_and_a_smooth_field_is_not():
    rng = np.random.default_rng(3)
    ideal = rng.uniform(0, 1000, (600, 2))
    d = 0.01 * ideal + rng.normal(0, 0.05, ideal.shape)  # ten pixels over the frame
    wrong = rng.choice(600, 12, replace=False)
    d[wrong] += 1.0
    keep = consistent(Deviations(ideal=ideal, d_px=d, sigma_px=np.full(600, 0.05)))
    assert not keep[wrong].any()
    assert np.sum(~keep) <= 15


# --- calibrated by itself --------------------------------------------------------------------


def seen_ground(interior, *, relief_m=60.0, n=400, seed=4):
    """Return pixels all over the frame, and the ground that they see by eqs (7)-(11) as printed."""
    rng = np.random.default_rng(seed)
    colrow = rng.uniform(0, [11999, 16199], (n, 2))
    x = (colrow[:, 0] - 5999.5) * 0.0056 - interior.xp
    y = (8099.5 - colrow[:, 1]) * 0.0056 - interior.yp
    r2 = x**2 + y**2
    radial = interior.k1 * r2 + interior.k2 * r2**2 + interior.k3 * r2**3
    dx = x * radial + interior.p1 * (r2 + 2 * x**2) + 2 * interior.p2 * x * y
    dy = y * radial + interior.p2 * (r2 + 2 * y**2) + 2 * interior.p1 * x * y
    rays = np.column_stack([x - dx, y - dy, np.full(n, -interior.f)]) @ POSE.R.T
    height = 900.0 + relief_m * rng.uniform(-1, 1, n)
    x_m = POSE.r + rays * ((height - POSE.r[2]) / rays[:, 2])[:, None]
    start = Pose(
        R=POSE.R @ rotation_from_opk(np.full(3, 1e-4)), r=POSE.r + np.array([1.0, -2.0, 1.5])
    )
    return colrow, start, x_m


def seen_block(colrow, start, x_m):
    found = Deviations(
        ideal=colrow, d_px=np.zeros(colrow.shape), sigma_px=np.full(len(colrow), 0.1)
    )
    return one_image_block(SYN, FRAME, start, x_m, found)


def calibrated(interior, free, **options):
    return self_calibrate(seen_block(*seen_ground(interior, **options)), free=free)


def test_a_lens_inserted_is_found():
    true = Interior(f=74.0, k1=2.4e-8, k2=-9e-12, k3=2e-15, p1=1.7e-7, p2=-2e-7)
    fit = calibrated(true, LENS)
    found = {p.name: p.value for p in parameters(from_bundle(fit))}
    # exact but for where the adjustment stops, 1e-5 of the sigma of 400 points of 0.1 px
    assert_allclose(
        [found[name] for name in LENS], [getattr(true, name) for name in LENS], rtol=1e-3
    )
    assert_allclose(residuals_px(fit), 0, atol=1e-5)
    r = np.hypot(6000, 8100) * 0.0056
    corner_px = r**3 * (true.k1 + true.k2 * r**2 + true.k3 * r**4) / 0.0056
    assert_allclose(radial_profile(fit)[1][-1], corner_px, rtol=1e-4)


def test_relief_tells_f_from_the_flying_height():
    true = Interior(f=74.05, xp=0.03, yp=-0.02)
    fit = calibrated(true, ("f", "xp", "yp"), relief_m=60.0)
    found = {p.name: p.value for p in parameters(from_bundle(fit))}
    assert_allclose([found[f"{n}_mm"] for n in ("f", "xp", "yp")], [74.05, 0.03, -0.02], atol=1e-5)


# --- A synthetic image whose every pixel is known: geometry, pixels and self-calibration agree
#
# The simulator shares no code with what is tested here: neither lens nor rotations nor rendering.


REDUCE = 16

MATCHING_PX = 0.012
"""RMS of a coordinate in pictures of waves, px of the picture: rounding, noise, interpolation."""


@pytest.fixture(scope="module")
def exposure():
    return known(REDUCE)


@pytest.fixture(scope="module")
def response(exposure):
    return response_of(exposure)


@pytest.fixture(scope="module")
def wrong(exposure):
    return drawn_calibration(exposure.orientation, seed=1, angle_deg=0.01)


def predicted(known, orientation, colrow):
    """Return the deviations of known points that geometry alone predicts for a synthetic image.

    Ground points are seen by the simulated heads, and put into the synthetic image through the
    given orientation; where heads are blended, so are they.
    """
    x_g = deviations.seen_ground(known, colrow)
    places, depth = [], []
    for k, camera in enumerate(orientation.heads):
        colrow_head = pixels_from_ground(known.at, known.at.plan.cameras[camera.name], x_g)
        places.append(synthetic_from_head(orientation, k, colrow_head))
        depth.append(border_depth(camera, colrow_head))
    weight = blend(np.stack(depth))
    blended = np.einsum("kn,kni->ni", weight, np.nan_to_num(np.stack(places)))
    return colrow_from_xy(known.synthetic, blended) - colrow


def border_depth(camera, colrow):
    """Return the distance of a pixel from the border of a head, px; negative outside."""
    size = np.array([camera.width_px, camera.height_px])
    inner = np.min(np.minimum(colrow + 0.5, size - 0.5 - colrow), axis=1)
    return np.nan_to_num(inner, nan=-1.0)


def blend(depth):
    """Return the weights of heads, shape (n_heads, n), as the renderer blends them."""
    ahead = depth.max(axis=0) - FEATHER_PX
    weight = np.maximum(np.minimum(depth, depth - ahead), 0.0)
    return weight / np.maximum(weight.sum(axis=0), np.finfo(float).tiny)


@pytest.fixture(scope="module")
def heads(exposure, wrong):
    """The true heads, wrong ones, and these refined in every way by what their pictures show."""
    ties = measured_ties(exposure, wrong)
    return {"true": exposure.orientation, **every_refinement(wrong, ties)}


@pytest.fixture(scope="module")
def examined(exposure, response, heads):
    return examine_all(exposure, heads, response)


@pytest.fixture(scope="module")
def true_image(examined):
    return examined["true"]


@pytest.fixture(scope="module")
def wrong_image(examined):
    return examined["before"]


# --- pixels ----------------------------------------------------------------------------------


def test_points_of_the_rendered_image_are_where_geometry_puts_them(exposure, true_image):
    """To a hundredth of a pixel of the picture each, and to a thousandth on average."""
    found = true_image.found
    left = found.d_px - predicted(exposure, exposure.orientation, found.ideal)
    assert len(left) > 400
    assert images.rms_of_coordinates(left) < MATCHING_PX * REDUCE
    # the mean of n points is known to 1/sqrt(n) of that; four sigma
    assert np.abs(left.mean(axis=0)).max() < 4 * MATCHING_PX * REDUCE / np.sqrt(len(left))


def test_errors_of_a_calibration_are_measured_as_large_as_they_are(exposure, wrong, wrong_image):
    found = wrong_image.found.d_px
    geometry = predicted(exposure, wrong, wrong_image.found.ideal)
    assert np.hypot(*geometry.T).max() > 3
    slope = np.sum(found * geometry) / np.sum(geometry**2)
    noise = MATCHING_PX * REDUCE / np.sqrt(np.sum(geometry**2))
    assert abs(slope - 1) < 4 * noise + 0.002  # correlation over steps between heads
    # windows that lie across a seam of wrong heads see both
    assert images.rms_of_coordinates(found - geometry) < 1.5 * MATCHING_PX * REDUCE


def test_the_parallax_of_the_true_heads_is_that_of_their_bases_over_the_relief(exposure):
    """f B dh / (H (H - dh)), of a lens 8 cm aside in both directions."""
    cols, rows = np.linspace(-0.5, 11999.5, 22), np.linspace(-0.5, 16199.5, 30)
    places = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)[1:-1]
    shift = np.hypot(*predicted(exposure, exposure.orientation, places).T)
    dh = deviations.seen_ground(exposure, places)[:, 2] - (
        exposure.at.track.x_g[0, 2] - exposure.height_m
    )
    H, f_px = exposure.height_m, 74.0 / 0.0056
    largest = f_px * 0.08 * np.sqrt(2) * np.abs(dh) / (H * (H - dh))
    # heads are blended, and a tilt of 2 degrees changes depths at the border by some metres
    tilt_m = np.radians(2) * np.hypot(6000, 8100) / f_px * H
    assert np.all(shift < largest + f_px * 0.08 * np.sqrt(2) * tilt_m / H**2)
    assert shift.max() > 0.5 * largest.max()


def test_tie_points_of_the_pictures_repair_a_calibration(exposure, wrong, heads):
    found = {
        name: errors_of(frame_deviations(one, exposure), exposure) for name, one in heads.items()
    }
    assert found["true"]["largest_px"] < 1e-9
    assert found["rotations"]["oriented_px"] < 0.2 * found["before"]["oriented_px"]
    assert found["rotations"]["oriented_px"] < found["mean shift"]["oriented_px"]
    assert_allclose(heads["mean shift"].xyz_mm[0], wrong.xyz_mm[0])
    assert_allclose(heads["rotations"].xyz_mm, wrong.xyz_mm)


def test_the_ways_are_tabled_with_pixels_beside_geometry(exposure, heads, examined):
    table = figures.way_table(examined, geometry_errors(exposure, heads))
    for column, least in (("RMS (px)", 1.0), ("Oriented (px)", 0.5), ("Calibrated (px)", 0.5)):
        pixels, exact = table.loc["as calibrated", column]
        assert exact > least
        assert pixels == pytest.approx(exact, rel=0.03)


# --- geometry --------------------------------------------------------------------------------


def test_drawn_errors_have_the_size_of_table_1s_sigma(exposure):
    """Of 240 normal numbers a standard deviation is known to a twentieth."""
    true, draws = exposure.orientation, range(15)
    drawn = [drawn_calibration(true, seed=i, angle_deg=0.01) for i in draws]
    normalised = [
        (getattr(head.interior, name) - getattr(right.interior, name))
        / printed.sigma(1, key, head.name)
        for one in drawn
        for head, right in zip(one.heads, true.heads, strict=True)
        for name, key in (("xp", "xp_mm"), ("yp", "yp_mm"), ("k1", "k1"), ("p2", "p2"))
    ]
    assert_allclose(np.mean(normalised), 0, atol=0.25)
    assert_allclose(np.std(normalised), 1, atol=0.2)
    turns = np.degrees([one.opk - true.opk for one in drawn])
    assert_allclose(turns[:, 0], 0, atol=1e-12)
    assert_allclose(np.std(turns[:, 1:]), 0.01, rtol=0.25)
    assert all(
        head.interior.f == right.interior.f
        for one in drawn
        for head, right in zip(one.heads, true.heads, strict=True)
    )


def test_a_lens_takes_up_what_an_orientation_does_not(exposure):
    draws = drawn_errors(exposure, 4, seed=3, angle_deg=0.01)
    assert set(draws["refinement"]) == {"before", "mean shift", "rotations", "six"}
    assert np.all(draws["oriented_px"] <= draws["rms_px"])
    assert np.all(draws["calibrated_px"] <= draws["oriented_px"])
    left = draws.groupby("refinement")["oriented_px"].median()
    assert left["rotations"] < left["mean shift"] / 2 < left["before"]


def test_measuring_errors_of_targets_invent_distortion_in_proportion(exposure):
    fine, coarse = (
        border_distortion_of_targets(exposure, 8, sigma_px=s, seed=5) for s in (0.05, 0.5)
    )
    assert fine.n_targets == coarse.n_targets > 10
    # so far as the adjustment is linear
    assert_allclose(coarse.radial_px, 10 * fine.radial_px, rtol=0.02)
