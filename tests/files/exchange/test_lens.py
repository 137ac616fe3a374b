"""Lenses of other programs."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4files.exchange import lens
from acx4files.exchange.lens import COLMAP, METASHAPE, OPENSFM, OPF, Lens, Pinhole
from acx4files.exchange.outward.brown import nearest, pinhole_of
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior, correct, xy_from_colrow

# --- lens models -----------------------------------------------------------------------------
#
# Lens models of other programs, held against those programs, OpenCV and their own inverses.


IDEAL = np.random.default_rng(1).uniform(-0.45, 0.45, (60, 2))
HOLE = Pinhole(fx=1000.0, fy=1000.0, cx=500.0, cy=400.0)
SPECIAL = {"FOV": [0.6], "EUCM": [0.55, 1.1]}
TABLES = {"colmap": COLMAP, "opensfm": OPENSFM, "metashape": METASHAPE, "opf": {"perspective": OPF}}
MODELS = [(program, name) for program, table in TABLES.items() for name in table]


def wrong(found, expected):
    return FlightError([f"f:1: camera: {found}; {expected}"])


def lens_models_lens(**wanted):
    plain = {"width_px": 1000, "height_px": 800, "hole": HOLE, "wrong": wrong}
    return Lens(**{**plain, "distortion": lambda points: points, **wanted})


def lens_of(formula, values, **wanted):
    distortion = formula.distortion(values)
    return lens_models_lens(distortion=distortion, is_fisheye=formula.is_fisheye, **wanted)


def parameters(program, name):
    """Return plausible parameters of a model, none of them zero."""
    names = TABLES[program][name].names
    first = names.index("cy") + 1 if "cy" in names else 0
    rest = 0.02 * np.random.default_rng(2).standard_normal(len(names) - first)
    rest[:] = SPECIAL.get(name, rest)
    return (
        [*{3: [1000.0], 4: [1000.0, 1010.0]}.get(first, [])]
        + [510.0, 390.0] * (first > 0)
        + rest.tolist()
    )


def by_opencv(points, coefficients, *, fisheye=False):
    x, zero = np.column_stack([points, np.ones(len(points))])[:, None], np.zeros(3)
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    return project(x, zero, zero, np.eye(3), np.array(coefficients))[0][:, 0]


@pytest.mark.parametrize(("program", "name"), MODELS)
def test_every_model_has_its_inverse(program, name):
    one = lens_of(TABLES[program][name], parameters(program, name), skew=(0.01, -0.02))
    assert_allclose(one.ideal(one.colrow(IDEAL)), IDEAL, atol=1e-12)


@pytest.mark.parametrize("name", COLMAP)
def test_models_of_colmap_are_colmap_s_own(name):
    pycolmap = pytest.importorskip("pycolmap", reason="environment-test.txt has it")
    formula, values = COLMAP[name], parameters("colmap", name)
    camera = pycolmap.Camera(model=name, width=1000, height=800, params=values)
    first = formula.names.index("cx")
    hole = Pinhole(fx=values[0], fy=values[first - 1], cx=values[first], cy=values[first + 1])
    seen = [camera.img_from_cam(np.append(point, 1.0)) for point in IDEAL]
    assert_allclose(lens_of(formula, values, hole=hole).colrow(IDEAL), seen, atol=1e-9)
    assert camera.params_info == ", ".join(formula.names)
    assert int(camera.model) == list(COLMAP).index(name)


@pytest.mark.parametrize(
    ("formula", "values"),
    [
        (METASHAPE["frame"], [-0.05, 0.03, -0.01, 0.0, 3e-4, -2e-4, 0.0, 0.0]),
        (OPENSFM["brown"], [-0.05, 0.03, -0.01, -2e-4, 3e-4]),
        (OPF, [-0.05, 0.03, -0.01, -2e-4, 3e-4]),
    ],
)
def test_perspective_models_are_opencv_s(formula, values):
    """Metashape's p1 and p2 are p2 and p1 of OpenCV."""
    seen = by_opencv(IDEAL, [-0.05, 0.03, -2e-4, 3e-4, -0.01])
    assert_allclose(formula.distortion(values)(IDEAL), seen, atol=1e-12)


@pytest.mark.parametrize(
    ("formula", "more"),
    [(OPENSFM["fisheye_opencv"], 0), (OPENSFM["fisheye62"], 4), (METASHAPE["fisheye"], 4)],
)
def test_fisheyes_are_opencv_s_with_more_terms(formula, more):
    k = [-0.02, 0.01, 0.003, -0.002]
    seen = lens_of(formula, [*k, *[0.0] * more], hole=Pinhole(fx=1.0, fy=1.0, cx=0.0, cy=0.0))
    assert_allclose(seen.colrow(IDEAL), by_opencv(IDEAL, k, fisheye=True), atol=1e-12)


def test_a_fisheye624_is_the_sum_of_its_three_parts_at_the_angle():
    """OpenSfM's order of steps, written out in polar coordinates."""
    angle, azimuth = np.arctan(np.hypot(*IDEAL.T)), np.arctan2(*IDEAL.T[::-1])
    c, s = np.cos(azimuth), np.sin(azimuth)
    radial = angle + sum(0.01 * i * angle ** (2 * i + 1) for i in range(1, 7))
    across = angle**2 * (2e-3 * 2 * s * c + 3e-3 * (1 + 2 * c * c)) + 4e-3 * angle**2
    down = angle**2 * (2e-3 * (1 + 2 * s * s) + 3e-3 * 2 * s * c) + 6e-3 * angle**2
    expected = np.stack(
        [radial * c + across + 5e-3 * angle**4, radial * s + down + 7e-3 * angle**4], axis=1
    )
    values = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 7e-3]
    seen = lens_of(OPENSFM["fisheye624"], values, hole=Pinhole(fx=1.0, fy=1.0, cx=0.0, cy=0.0))
    assert_allclose(seen.colrow(IDEAL), expected, atol=1e-14)


def test_a_dual_lens_is_between_perspective_and_fisheye():
    for weight, kind in ((1.0, "perspective"), (0.0, "fisheye")):
        dual = lens_of(OPENSFM["dual"], [-0.02, 0.01, weight])
        assert_allclose(
            dual.colrow(IDEAL), lens_of(OPENSFM[kind], [-0.02, 0.01]).colrow(IDEAL), atol=1e-12
        )


def test_a_fisheye_of_pix4d_counts_angles_in_right_angles():
    """Pix4D's page on internal camera parameters, written out."""
    r = np.hypot(*IDEAL.T)
    t = 2 / np.pi * np.arctan(r)
    rho = 1.3 * t + 0.0152646 * t**2 - 0.161096 * t**3
    polynomial, affine = [0.0, 1.3, 0.0152646, -0.161096], (1674.33, 0.4, -0.3, 1670.1)
    one = lens.fisheye(polynomial, affine, (500.0, 400.0), size=(1000, 800), wrong=wrong)
    expected = (rho / r)[:, None] * IDEAL @ np.reshape(affine, (2, 2)).T + [500, 400]
    assert_allclose(one.colrow(IDEAL), expected, atol=1e-8)
    assert_allclose(one.ideal(one.colrow(IDEAL)), IDEAL, atol=1e-12)


def test_skew_adds_the_other_coordinate():
    moved = lens_models_lens(skew=(0.003, 0.002)).colrow(IDEAL) - lens_models_lens().colrow(IDEAL)
    assert_allclose(moved, np.stack([3.0 * IDEAL[:, 1], 2.0 * IDEAL[:, 0]], axis=1), atol=1e-9)


# --- lenses refitted, held against OpenCV's own functions and closed forms -------------------


SIZE = {"name": "C", "width_px": 4000, "height_px": 3000, "pixel_mm": 0.004}
HOLE_LENS = Pinhole(fx=4100.0, fy=4103.0, cx=2011.0, cy=1490.0)
BROWN = np.array([-0.06, 0.03, 4e-4, -3e-4, -0.01])
COLROW = np.array([[0.0, 0.0], [3999.0, 10.0], [2000.0, 2999.0], [777.0, 888.0]])


def matrix(hole):
    return np.array([[hole.fx, 0.0, hole.cx], [0.0, hole.fy, hole.cy], [0.0, 0.0, 1.0]])


def undistorted(colrow):
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    return cv2.undistortPoints(
        colrow[:, None], matrix(HOLE_LENS), BROWN, None, None, None, criteria
    )[:, 0]


def fisheye(colrow):
    return cv2.fisheye.undistortPoints(colrow[:, None], matrix(HOLE_LENS), np.zeros(4))[:, 0]


def by_brown(ideal):
    points, zero = np.column_stack([ideal, np.ones(len(ideal))]), np.zeros(3)
    return cv2.projectPoints(points, zero, zero, matrix(HOLE_LENS), BROWN)[0][:, 0]


def by_fisheye(ideal):
    return cv2.fisheye.distortPoints(ideal[:, None], matrix(HOLE_LENS), np.zeros(4))[:, 0]


@pytest.mark.parametrize(
    ("ideal", "pixels"), [(undistorted, by_brown), (fisheye, by_fisheye)], ids=["brown", "fisheye"]
)
def test_a_refitted_camera_has_the_rays_of_the_lens(ideal, pixels):
    """As closely in the image as it says; the fisheye is 30 degrees wide on each side."""
    camera, left = lens.camera_of(ideal, HOLE_LENS, **SIZE)
    found = correct(camera.interior, xy_from_colrow(camera, COLROW)) / camera.interior.f
    apart = np.hypot(*(pixels(found * [1, -1]) - COLROW).T)
    assert apart.max() <= 1.01 * left.largest_px
    assert left.rms_px < left.largest_px < 0.15  # of more than 50 px of distortion
    assert_allclose(camera.interior.f, 4103 * 0.004)


@pytest.mark.parametrize("skew", [0.0, 2.5])
def test_focal_lengths_principal_point_and_skew_come_back(skew):
    hole = replace(HOLE_LENS, skew=skew)
    camera, _ = lens.camera_of(
        lambda colrow: undistorted(HOLE_LENS.colrow(hole.points(colrow))), hole, **SIZE
    )
    back = pinhole_of(camera)
    found = [back.fx, back.fy, back.cx, back.cy, back.skew]
    assert_allclose(found, [4100, 4103, 2011, 1490, skew], atol=1e-9)


def test_skew_is_b2_and_a_pixel_at_the_corner_is_what_the_formulas_say():
    """By Metashape's formula: u = cx + x f + x b1 + y b2, of an ideal point x, y."""
    hole = replace(HOLE_LENS, skew=2.5)
    camera, left = lens.camera_of(hole.points, hole, **SIZE)
    assert left.largest_px < 1e-9
    assert_allclose(camera.interior.b2, 2.5 / 4100, rtol=1e-12)
    x, y = -0.4, 0.3
    u, v = 2011 + 4103 * x - 3 * x + 2.5 * y, 1490 + 4103 * y
    ideal = correct(camera.interior, xy_from_colrow(camera, np.array([[u, v]])))
    assert_allclose(ideal / camera.interior.f, [[x, -y]], atol=1e-12)


def test_a_lens_without_skew_tells_what_b2_leaves():
    """A shear is half a turn, which no pinhole has: b2 times half the height at the most."""
    camera = Camera(**SIZE, interior=Interior(f=16.0, xp=0.1, yp=-0.2, b2=1e-3))
    found = nearest(camera, "plain")
    hole, left = found.hole, found.left
    assert hole.skew == 0.0
    assert 0.5 < left.largest_px < 1e-3 * (1500 + 0.2 / 0.004 + 20)
    nodes = lens.nodes(4000, 3000)
    ideal = correct(camera.interior, xy_from_colrow(camera, nodes)) / 16.0 * [1, -1]
    by_role = dict(zip(lens.BROWN, found.coefficients, strict=True))
    apart = np.hypot(*(hole.colrow(ideal + lens.effects(ideal, by_role)) - nodes).T)
    assert_allclose(apart.max(), left.largest_px, rtol=1e-6)


def test_focal_length_principal_point_and_b1_are_fitted_where_that_leaves_less():
    """Decentring that changes with the distance, and skew, as Metashape has them."""
    values = {"k1": -0.1, "k2": 0.05, "k4": 0.3, "u": 4e-3, "v": -3e-3, "m1": 2.0}

    def distorted(at):
        moved = at + lens.effects(at, values)
        return moved + np.stack([5e-4 * moved[:, 1], np.zeros(len(at))], axis=1)

    def ideal(colrow):
        at = HOLE_LENS.points(colrow)
        return lens.inverse(distorted, at, at)

    camera, left = lens.camera_of(ideal, HOLE_LENS, **SIZE)
    nodes = lens.nodes(4000, 3000)
    rays = correct(camera.interior, xy_from_colrow(camera, nodes)) / camera.interior.f * [1, -1]
    apart = np.hypot(*(HOLE_LENS.colrow(distorted(rays)) - nodes).T)
    assert_allclose(
        [apart.max(), np.sqrt(np.mean(apart**2))], [left.largest_px, left.rms_px], rtol=0.05
    )
    coefficients, _ = lens.brown(
        HOLE_LENS.points(nodes), ideal(nodes) - HOLE_LENS.points(nodes), HOLE_LENS.fy
    )
    own = pinhole_of(camera)
    assert np.hypot(own.cx - HOLE_LENS.cx, own.cy - HOLE_LENS.cy) > 1
    held = _held(ideal, nodes, coefficients)
    assert left.rms_px < 0.9 * held


def _held(ideal, nodes, coefficients):
    """Return the rms, px, of the nearest lens with the pinhole held."""
    at = HOLE_LENS.points(nodes)
    effects = lens.effects(at, dict(zip(lens.BROWN, coefficients, strict=True)))
    return float(
        np.sqrt(np.mean(np.sum((HOLE_LENS.fy * (at + effects - ideal(nodes))) ** 2, axis=1)))
    )


@pytest.mark.parametrize("holes", ["skewed", "plain", "square"])
def test_a_camera_without_distortion_is_the_same_to_any_model(holes):
    plain = Camera(
        **SIZE, interior=Interior(f=16.0, xp=0.1, yp=-0.2, b1=1e-3 * (holes != "square"))
    )
    found = nearest(plain, holes)
    assert found.left.largest_px < 1e-8
    assert_allclose(found.coefficients, 0.0, atol=1e-8)
    refitted, left = lens.camera_of(found.hole.points, found.hole, **SIZE)
    assert left.largest_px < 1e-9
    assert_allclose(refitted.interior.to_array(), plain.interior.to_array(), atol=1e-9)


def test_an_inverse_is_that_of_a_closed_form():
    wanted = np.array([[0.3, 0.4], [-0.2, 0.1], [0.0, 0.0]])
    assert_allclose(lens.inverse(np.sinh, wanted, wanted), np.arcsinh(wanted), atol=1e-14)


def test_a_lens_that_turns_back_has_no_inverse_beyond():
    def back(points):
        return points * (1 - np.sum(points**2, axis=1, keepdims=True))

    wanted = np.array([[0.3, 0.0], [0.5, 0.0]])  # the largest radius is 0.385
    found = lens.inverse(back, wanted, wanted)
    assert_allclose(back(found[:1]), wanted[:1], atol=1e-14)
    assert np.isnan(found[1]).all()
