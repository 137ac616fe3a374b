import cv2
import numpy as np
import pytest

from acx4files.measuring.measure import read_unmeasured
from acx4files.measuring.targets import (
    Candidate,
    Measured,
    discs,
    elected,
    find_surveyed,
    find_targets,
    places_in_other_views,
)
from support.pictures import measured


def picture(col, row, radius, *, bright=40000.0, dark=3000.0, rng=None, noise=0.0):
    """A disc drawn sixteen times too large, blurred as by a lens, and averaged."""
    size = 41
    k = 16
    y, x = (np.mgrid[: size * k, : size * k] + 0.5) / k - 0.5
    fine = np.where(np.hypot(x - col, y - row) < radius, bright, dark).astype(np.float32)
    fine = cv2.GaussianBlur(fine, (0, 0), 0.4 * k)
    out = cv2.resize(fine, (size, size), interpolation=cv2.INTER_AREA)
    return out if rng is None else out + rng.normal(0, noise, out.shape).astype(np.float32)


@pytest.mark.parametrize("radius", [0.8, 1.2, 2.0, 3.3, 6.0])
@pytest.mark.parametrize("place", [(20.0, 20.0), (20.5, 20.5), (19.7, 20.2)])
def test_a_disc_is_centred_to_hundredths_of_a_pixel(radius, place, rng):
    disc = discs(picture(*place, radius, rng=rng, noise=300.0))[0]
    assert np.hypot(disc.col - place[0], disc.row - place[1]) < 0.04
    assert disc.radius_px == pytest.approx(radius, abs=0.4)  # blur and radius of small ones mix
    assert 0.01 < disc.sigma_px < 0.06


def test_errors_have_the_size_of_their_sigma(rng):
    z = []
    for _ in range(40):
        place = rng.uniform(19.5, 20.5, 2)
        disc = discs(picture(*place, 1.5, rng=rng, noise=1500.0))[0]
        z.append((np.array([disc.col, disc.row]) - place) / disc.sigma_px)
    assert 0.3 < np.mean(np.square(z)) < 1.6  # chi-square of 80 over 80, and the model's 0.02 px


def test_an_edge_and_noise_are_no_discs(rng):
    edge = np.where(np.arange(41) < 20, 3000.0, 40000.0).astype(np.float32)
    assert discs(np.tile(edge, (41, 1))) == []
    assert len(discs(rng.normal(9000, 300, (41, 41)).astype(np.float32))) <= 1
    assert discs(np.full((41, 41), 7.0, np.float32)) == []


def spot(point, view, east, *, radius=0.3, bright=True, correlation=0.9):
    return Candidate(
        point=point,
        view=view,
        at_m=(100.0 * point, 0.0),
        offset_m=(east, 0.0),
        pixel_m=0.2,
        radius_m=radius,
        bright=bright,
        correlation=correlation,
        colrow=(1.0, 2.0),
        sigma_px=0.02,
    )


def test_a_target_is_off_alike_in_all_pictures_and_at_other_points():
    true = [spot(point, view, 0.5) for view in range(3) for point in range(3)]
    false = [spot(0, 0, 3.0, correlation=0.99), spot(0, 1, -2.0), spot(0, 2, 5.0)]
    assert elected([*false, *true]) == true


def test_a_bright_stone_is_in_all_pictures_but_not_beside_every_point():
    stone = [spot(0, view, 2.5, correlation=0.99) for view in range(4)]
    true = [spot(point, view, 0.5) for view in range(2) for point in range(4)]
    assert elected([*stone, *true]) == true


def test_a_point_in_one_picture_needs_others_beside_it():
    far = [spot(3, 1, 9.0), spot(4, 1, -9.0)]
    assert elected([spot(0, 0, 0.5), spot(1, 1, 0.6), *far]) == []
    assert len(elected([spot(0, 0, 0.5), *(spot(k, 1, 0.6) for k in (1, 2)), *far])) == 3


def test_targets_are_found_to_a_twentieth_of_a_pixel(whole):
    found = measured.target_errors(whole.measured, whole.truth)
    assert len(found.off) >= 4
    assert np.max(np.hypot(*found.off.T)) < 0.2
    assert np.sqrt(np.mean(found.off**2)) < 0.05
    assert np.mean(found.z**2) < 2.5


def test_where_no_target_is_nothing_is_found(views, surface):
    x, y = np.meshgrid(np.linspace(-150, 150, 3), np.linspace(-150, 150, 3))
    xy = views[0].T_m_c.r[0, :2] + np.column_stack([x.ravel(), y.ravel()]) + 7.0
    nowhere = np.column_stack([xy, surface.heights(xy)])
    assert len(find_targets(views, nowhere)) <= 2  # a bright spot or two by chance


def test_a_tie_point_is_found_again_between_the_pixels(whole):
    """A corner of one picture is carried from there into those in which it was matched."""
    matched = whole.outcome.matched
    rays = matched.rays
    off = []
    for point in np.unique(rays.point)[:60]:
        own = rays[rays.point == point]
        others = [matched.views[v] for v in own.view[1:]]
        view = matched.views[own.view[0]]
        which, places, sigma = places_in_other_views(view, others, matched.surface, own.colrow[0])
        off += list(np.hypot(*(places - own.colrow[1:][which]).T))
        assert np.all(sigma > 0)
    assert len(off) > 80
    assert np.median(off) < 0.1


@pytest.fixture
def control(whole):
    unmeasured = read_unmeasured(whole.flight)
    table = unmeasured.tables["calibration"].control
    frame = unmeasured.flight.calibration.frame
    return table.text["point"], frame.from_grid(table.stack("east_m", "north_m", "height_m"))


def test_found_and_not_found_are_all_that_pictures_show(whole, views, surface, control):
    surveyed = whole.outcome.surveyed
    pairs = {(row.image, row.point) for row in surveyed.rows}
    lacking = {(image, p) for p, images in surveyed.not_found.items() for image in images}
    assert not pairs & lacking
    assert len(pairs) == len(surveyed.rows)


def test_a_point_measured_once_is_matched_and_not_looked_for(whole, views, surface, control):
    row = max(whole.outcome.surveyed.rows, key=lambda one: one.image == "C1-04")
    given = Measured(**{**row.__dict__, "sigma_px": 0.8})
    found = find_surveyed(views, surface, *control, [given])
    own = [one for one in found.rows if one.point == row.point]
    assert own
    before = {one.image: one for one in whole.outcome.surveyed.rows if one.point == row.point}
    for one in own:
        assert one.image != given.image
        assert one.sigma_px >= 0.8  # that of the given measurement is in it
        if one.image in before:
            seen = before[one.image]
            off = np.hypot(one.col_px - seen.col_px, one.row_px - seen.row_px)
            assert off < 4.0  # half a pixel of these pictures
