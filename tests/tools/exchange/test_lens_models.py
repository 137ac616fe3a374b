"""Lens models of other programs, held against those programs, OpenCV and their own inverses."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange import lens_models
from acx4tools.exchange.lens import Pinhole
from acx4tools.exchange.lens_models import COLMAP, METASHAPE, OPENSFM, OPF, Lens

IDEAL = np.random.default_rng(1).uniform(-0.45, 0.45, (60, 2))
HOLE = Pinhole(fx=1000.0, fy=1000.0, cx=500.0, cy=400.0)
SPECIAL = {"FOV": [0.6], "EUCM": [0.55, 1.1]}
TABLES = {"colmap": COLMAP, "opensfm": OPENSFM, "metashape": METASHAPE, "opf": {"perspective": OPF}}
MODELS = [(program, name) for program, table in TABLES.items() for name in table]


def wrong(found, expected):
    return FlightError([f"f:1: camera: {found}; {expected}"])


def lens(**wanted):
    plain = {"width_px": 1000, "height_px": 800, "hole": HOLE, "wrong": wrong}
    return Lens(**{**plain, "distortion": lambda points: points, **wanted})


def lens_of(formula, values, **wanted):
    distortion = formula.distortion(values)
    return lens(distortion=distortion, is_fisheye=formula.is_fisheye, **wanted)


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


@pytest.mark.parametrize(("program", "name"), MODELS)
def test_every_parameter_moves_something(program, name):
    formula, values = TABLES[program][name], parameters(program, name)
    plain = lens_of(formula, values).colrow(IDEAL)
    first = formula.names.index("cy") + 1 if "cy" in formula.names else 0
    for k in range(first, len(values)):
        other = [value + 0.01 * (i == k) for i, value in enumerate(values)]
        assert np.abs(lens_of(formula, other).colrow(IDEAL) - plain).max() > 1e-4


@pytest.mark.parametrize("name", COLMAP)
def test_models_of_colmap_are_colmap_s_own(name):
    pycolmap = pytest.importorskip("pycolmap", reason="environment-bench.txt has it")
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
    one = lens_models.fisheye(polynomial, affine, (500.0, 400.0), size=(1000, 800), wrong=wrong)
    expected = (rho / r)[:, None] * IDEAL @ np.reshape(affine, (2, 2)).T + [500, 400]
    assert_allclose(one.colrow(IDEAL), expected, atol=1e-8)
    assert_allclose(one.ideal(one.colrow(IDEAL)), IDEAL, atol=1e-12)


def test_skew_adds_the_other_coordinate():
    moved = lens(skew=(0.003, 0.002)).colrow(IDEAL) - lens().colrow(IDEAL)
    assert_allclose(moved, np.stack([3.0 * IDEAL[:, 1], 2.0 * IDEAL[:, 0]], axis=1), atol=1e-9)


def test_a_pixel_size_is_that_of_the_file_or_of_the_user_or_nominal():
    known = lens(pixel_um=3.7500001)
    assert known.refitted("a").table["pixel_um"] == 3.75
    assert lens().refitted("b").table["pixel_um"] == 5.0
    assert lens().refitted("b", 2.0).table["focal_mm"] == 2.0


def test_what_is_zero_is_not_written():
    assert lens().refitted("a").table == {
        "width_px": 1000,
        "height_px": 800,
        "pixel_um": 5.0,
        "focal_mm": 5.0,
        "xp_mm": 0.0025,
        "yp_mm": -0.0025,
    }


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"distortion": lambda at: np.full_like(at, np.nan)}, "lens: expected a ray"),
        ({"pixel_um": 0.5}, "focal_mm 0.5 must lie between 1 and 10000"),
    ],
)
def test_what_no_flight_has_is_told(wanted, message):
    with pytest.raises(ValueError, match=message):
        replace(lens(), **wanted).refitted("a")
