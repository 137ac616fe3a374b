"""Values show themselves: each in a line or two, and those with numbers as tables."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from IPython.lib.pretty import pretty
from numpy.testing import assert_allclose

import acx4 as acx
import acx4sim
from acx4files.stages import Failed, attempt
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.reliability import reliability
from acx4lib.bundle.variance_components import components
from acx4lib.calibration.estimates import from_bundle, given, parameters
from acx4lib.calibration.heads import calibrate_heads, relative_orientation
from acx4lib.calibration.mounting import single_step, two_step, two_step_gnss, weighted
from acx4lib.errors import AdjustmentError
from acx4lib.georeferencing.direct import Rays, intersect_rays
from acx4lib.georeferencing.validation import validate
from acx4lib.model import Model
from acx4lib.synthetic_image.transferred_points import transfer
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import overlaps, refine_by_mean_differences, shared_points
from support.flights import in_heads

FREE = ("f", "xp", "yp", "k1")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp("in_heads") / "flight"
    acx4sim.write(in_heads.small(), path)
    return acx.read(path)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)
    return acx.read(path)


@pytest.fixture(scope="module")
def open_heads(flown):
    """Return the outcome of every open call on heads and their tie points."""
    fits = calibrate_heads(flown.heads, flown.head_names, Model(free=flown.estimate_heads))
    oriented = relative_orientation(fits, flown.synthetic_camera)
    ties = shared_points(flown.heads, oriented)
    turned = refine_by_rotations(oriented, ties)
    return [
        *(fits, *fits.bundles.values(), oriented, ties, turned),
        refine_by_mean_differences(oriented, ties),
        transfer(flown.calibration, oriented, flown.synthetic_camera),
        *overlaps(ties, oriented),
    ]


@pytest.fixture(scope="module")
def open_mounting(alone):
    """Return the outcome of every open call on one camera's block."""
    block, free = alone.calibration, alone.estimate_mounting
    single = single_step(block, Model(free=free, gnss=("shift",)))
    solution = single.bundle.solution
    checked = validate(alone.validation, single.calibration, method="single_step")
    found = checked.georeferenced
    points = alone.validation.image_points[:3]
    rays = Rays(
        image_idx=points.image_idx,
        group=np.arange(3),
        colrow=points.colrow,
        sigma_px=points.sigma_px,
    )
    return [
        *(alone, block, block.cameras[0], block.cameras[0].interior, block.T_m_b_images),
        *(block.cameras[0].T_b_c, block.images, block.image_points, block.control),
        *(block.trajectory, mounted_orientation(block, Model(free=free)), single, single.bundle),
        *(single.calibration, single.bundle.state, single.bundle.network.layout, solution),
        reliability(solution.group("image_point")),
        two_step(block, Model(free=free), after=single),
        two_step_gnss(block, Model(free=free), after=single),
        weighted(block, Model(free=free), weights="estimated")[0],
        components(single.bundle),
        attempt(two_step, replace(block, control=block.control[:1]), Model(free=free)),
        acx.calibrate(alone),
        acx.calibrate(alone),
        given(block.cameras),
        *(checked, checked.pairs, found, rays, intersect_rays(alone.validation, found, rays)),
    ]


def assert_short(value):
    for text in (repr(value), pretty(value)):
        lines = text.splitlines()
        assert len(lines) <= 2, text
        assert all(0 < len(line) <= 120 for line in lines), text


def test_values_show_themselves_in_a_line_or_two(open_heads, open_mounting):
    for value in (*open_heads, *open_mounting):
        assert_short(value)


# --- tables ----------------------------------------------------------------------------------


def test_a_table_has_every_parameter_with_its_unit_and_sigma(alone):
    found = single_step(alone.calibration, Model(free=FREE))
    table = found.table()
    assert table.index.names == ["parameter", "unit"]
    assert table.columns.tolist() == ["value", "sigma"]
    assert table.index.tolist() == [
        *(("f", "mm"), ("xp", "mm"), ("yp", "mm"), ("k1", "mm⁻²")),
        *(("lever x", "m"), ("lever y", "m"), ("lever z", "m")),
        *(("boresight ω", "°"), ("boresight φ", "°"), ("boresight κ", "°")),
    ]
    listed = parameters(found.calibration)
    assert_allclose(table["value"], [p.value for p in listed], rtol=0)
    assert_allclose(table["sigma"], [p.sigma for p in listed], rtol=0)
    assert [dtype.kind for dtype in table.dtypes] == ["f", "f"]


def test_what_is_left_open_has_an_infinite_sigma(noisy_block):
    trajectory = noisy_block.trajectory
    never = replace(trajectory, sigma_position=np.full((len(trajectory), 3), np.inf))
    network = mounted_orientation(replace(noisy_block, trajectory=never), Model(free=("xp", "yp")))
    found = from_bundle(adjust(network)).table()
    open_ones = found.index[np.isinf(found["sigma"])].get_level_values("parameter")
    assert open_ones.tolist() == ["lever x", "lever y", "lever z"]


def test_a_validation_has_mean_scatter_and_rms_of_pairs_and_points(alone):
    fit = single_step(alone.calibration, Model(free=alone.estimate_mounting))
    found = validate(alone.validation, fit.calibration, method="single_step")
    table = found.table()
    assert table.index.names == ["of", "coordinate", "unit"]
    for of, d, sigma in (
        ("pairs", found.pairs.d, found.pairs.sigma),
        ("points", found.points.d, found.points.sigma),
    ):
        rows = table.loc[of]
        assert rows["n"].tolist() == [len(d)] * 3
        assert_allclose(rows["mean"], np.mean(d, axis=0), rtol=1e-12)
        assert_allclose(rows["scatter"], np.std(d, axis=0, ddof=1), rtol=1e-12)
        assert_allclose(rows["RMS"], np.sqrt(np.mean(d**2, axis=0)), rtol=1e-12)
        assert_allclose(rows["expected RMS"], np.sqrt(np.mean(sigma**2, axis=0)), rtol=1e-12)


def test_values_show_themselves_in_a_line_without_pandas():
    code = (
        "import sys, numpy as np; from acx4lib.geometry.camera import Camera, Interior;"
        "repr(Camera(name='A', width_px=9, height_px=9, pixel_mm=0.01, interior=Interior(f=50.0)));"
        "print('pandas' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"


# --- A method is tried: its outcome, or why it has none --------------------------------------


def half(n, *, of=2):
    if n % of:
        raise AdjustmentError(f"{n} is odd\nand so on")
    return n // of


def test_what_is_not_determined_is_a_value_that_is_false_and_says_why():
    failed = attempt(half, 5)
    assert isinstance(failed, Failed)
    assert not failed
    assert failed.reason == "5 is odd\nand so on"
    assert repr(failed) == "Failed half: 5 is odd and so on"


def test_a_failure_of_linear_algebra_is_one_of_the_data():
    failed = attempt(np.linalg.inv, np.zeros((2, 2)))
    assert failed.reason.startswith("the equations cannot be solved (Singular matrix)")
