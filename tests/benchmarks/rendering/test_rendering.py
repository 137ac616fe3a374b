"""The parts of the benchmark of rendering: the same samples for all, true to known values."""

import importlib.util
import subprocess

import cv2
import numpy as np
import pytest
import tifffile
from numpy.testing import assert_allclose, assert_array_equal

from acx4files.images.head_images import HeadImages
from acx4lib.synthetic_image.frame import synthetic_from_head
from acx4lib.synthetic_image.rendering import render
from acx4lib.synthetic_image.response import OverlapResponse, Response, ResponseFit
from benchmarks.rendering import matching, peers, rendering, run, truth
from benchmarks.rendering.scene import (
    PATCH_PX,
    WINDOW_PX,
    Scene,
    patches,
    pieces,
    samples_per_pixel,
    window_of_head,
)
from support.pictures import exact_rendering, taken

pytestmark = [pytest.mark.slow, pytest.mark.repeats]

K = 16


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Table 1's heads over a far plane, in files as in memory."""
    orientation, synthetic = taken.heads(K), taken.synthetic(K)
    rng = np.random.default_rng(5)
    ground = taken.texture(1024, rng, finest=0.1)
    images = taken.pictures(orientation, synthetic, ground, rng)
    folder = tmp_path_factory.mktemp("heads")
    files = tuple(folder / f"{k}.tif" for k in range(len(images)))
    for path, image in zip(files, images, strict=True):
        tifffile.imwrite(path, image, photometric="rgb")
    return Scene(
        files=files,
        heads=HeadImages(images=tuple(images), reduction=K),
        orientation=orientation,
        synthetic=synthetic,
    )


@pytest.fixture(scope="module")
def positions(scene):
    window = (0, scene.synthetic.height_px, 0, scene.synthetic.width_px)
    return exact_rendering.exact_positions(scene.orientation, scene.synthetic, window)


def response(scene):
    return Response(coefficients=np.zeros((len(scene.heads.images), 3, 3)))


def counted(scene, positions, feather_px):
    """Tell which heads have a weight at each pixel: their images in turn bright, others dark."""
    seen = []
    for bright in range(len(positions)):
        flat = [np.full_like(im, 60000 * (k == bright)) for k, im in enumerate(scene.heads.images)]
        seen.append(exact_rendering.blended(flat, positions, feather_px=feather_px)[..., 0] > 0)
    return np.stack(seen)


# --- the samples ---------------------------------------------------------------------------------


@pytest.mark.parametrize("feather", [0.0, None])
def test_samples_of_a_pixel_are_those_that_have_a_weight(scene, positions, feather):
    feather_px = scene.feather_px if feather is None else feather
    plan = scene.plan(feather_px=feather_px)
    every = counted(scene, positions, feather_px).sum(axis=0).mean()
    # counted at each 64th pixel only: some thousand of them
    assert_allclose(samples_per_pixel(plan), every, atol=0.01)
    assert every == 1 or feather is None


def test_pieces_hold_every_sample_that_the_image_needs(scene, positions):
    plan = scene.plan()
    needed = counted(scene, positions, scene.feather_px)
    given = np.zeros(needed.shape, int)
    for k, (r0, r1, c0, c1) in pieces(plan):
        given[k, r0:r1, c0:c1] += 1
    assert given.max() == 1  # none twice
    # the line where a weight begins goes through cells none of whose nodes has any
    assert np.mean(needed & (given == 0)) < 1e-3
    assert given.sum() < 1.3 * needed.sum()


def test_windows_of_heads_show_one_head_alone(scene, positions):
    needed = counted(scene, positions, scene.feather_px)
    for k in range(len(positions)):
        r0, r1, c0, c1 = window_of_head(scene, k, WINDOW_PX // scene.reduction)
        assert needed[k, r0:r1, c0:c1].all()
        assert needed[:, r0:r1, c0:c1].sum() == (r1 - r0) * (c1 - c0)


def test_patches_lie_in_the_image(scene):
    for r0, r1, c0, c1 in patches(scene):
        assert (r1 - r0, c1 - c0) == (PATCH_PX,) * 2
        assert min(r0, c0) >= 0
        assert r1 <= scene.synthetic.height_px
        assert c1 <= scene.synthetic.width_px


# --- the renderers -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n in peers.PEERS if n != "remap_cubic"])
def test_others_sample_a_plane_of_grey_values_where_they_are_told(name):
    if peers.missing(name):
        pytest.skip(f"{peers.MODULES[name]} is not installed")
    rows, cols = np.mgrid[0:90, 0:120]
    plane = 1000 + 40 * cols[..., None] + 300 * rows[..., None] + np.array([0, 7, 90])
    at = np.stack(np.meshgrid(np.linspace(5, 110, 60), np.linspace(4, 80, 50)), axis=-1)
    part, places = peers.cut(plane.astype(np.uint16), at)
    true = 1000 + at @ [40, 300] + np.array([[[0]], [[7]], [[90]]])
    found = peers.PEERS[name](part, places)()
    # rounded; pyvips knows a position to 1/64 px or so
    assert_allclose(np.moveaxis(found, -1, 0), true, atol=3.0 if name == "pyvips" else 0.6)


@pytest.mark.parametrize("what", run.RUNS)
def test_every_run_tells_its_times_and_samples(scene, what):
    if peers.missing(what):
        pytest.skip(f"{what} is not installed")
    found = run.RUNS[what](scene, response(scene))
    assert set(found) == {"wall_s", "cpu_s", "pixels", "samples"}
    assert found["samples"] >= found["pixels"]


@pytest.mark.slow
def test_errors_are_those_of_a_rounded_image_on_smooth_ground(scene):
    own = truth.rendered(scene, response(scene))
    assert 0.25 < own["ours_1"]["rms_dn"] < 0.45  # the root of 1/12 is rounding
    assert own["ours_1"]["rms_dn"] < own["ours_1"]["p999_dn"] < own["ours_1"]["max_dn"]
    others = truth.sampled(scene)
    assert_allclose(others["scipy"]["rms_dn"], 12**-0.5, rtol=0.01)
    assert others["scipy"]["max_dn"] <= 0.5 + 1e-6


def test_positions_are_as_far_off_as_their_map_allows(scene):
    found = truth.position_errors(scene)
    assert 0 < found["rms"] < found["max"] < 0.0025


def test_the_spread_of_known_differences():
    differences = [np.array([3.0, -4.0]), np.zeros((1, 2))]
    found = truth.spread(differences)
    assert_allclose(found["rms_dn"], 2.5)
    assert found["max_dn"] == 4.0


def test_disagreement_is_told_from_the_noise_of_samples():
    none = np.zeros(3, int)
    bands = {"n_used": none, "n_saturated": none, "n_dark": none}
    overlaps = tuple(
        OverlapResponse(
            head_a=0,
            head_b=k,
            before=np.array([0.1, 0.2, np.nan]) / k,
            after=np.array([0.05, 0.01, np.nan]) / k,
            floor=np.array([0.03, 0.012, np.nan]) / k,
            **bands,
        )
        for k in (1, 2)
    )
    fit = ResponseFit(
        response=Response(coefficients=np.zeros((3, 3, 3))),
        sigma=np.zeros((3, 3, 3)),
        overlaps=overlaps,
    )
    found = truth.disagreement(fit)
    expected = {"before": 0.2, "after": 0.05, "floor": 0.03, "systematic": 0.04}  # 3, 4, 5
    assert found == pytest.approx(expected)


# --- files and commands --------------------------------------------------------------------------


def test_a_project_looks_where_the_middle_of_the_head_looks(scene):
    f = scene.synthetic.interior.f
    for k, head in enumerate(scene.orientation.heads):
        yaw, pitch, _ = np.radians(peers.angles_deg(scene, k))
        middle = np.array([[head.width_px - 1, head.height_px - 1]]) / 2
        x, y = synthetic_from_head(scene.orientation, k, middle)[0]
        assert_allclose(f * np.tan(yaw), x)
        assert_allclose(f * np.tan(pitch) / np.cos(yaw), y)


@pytest.mark.skipif("nona" not in peers.installed(), reason="nona is not installed")
def test_nona_makes_the_same_image_from_it(scene, tmp_path):
    """But for its lens, some pixels at full size: so layers are like ours, and not shifted."""
    project = tmp_path / "project.pto"
    project.write_text(peers.project(scene), encoding="utf-8")
    subprocess.run(peers.nona(project, tmp_path), check=True, capture_output=True)
    ours = render(scene.plan(), scene.heads.images).astype(float)
    layers = sorted(tmp_path.glob("layer*.tif"))
    assert len(layers) == len(scene.files)
    for path in layers:
        with tifffile.TiffFile(path) as tiff:
            page = tiff.pages.first
            layer = page.asarray().astype(float)
            col, row = (
                round(np.divide(*page.tags[tag].value) * np.divide(*page.tags[per].value))
                for tag, per in (("XPosition", "XResolution"), ("YPosition", "YResolution"))
            )
        own = ours[row : row + layer.shape[0], col : col + layer.shape[1]]
        seen = layer[..., 3] > 0
        assert seen.any()
        assert np.corrcoef(own[seen][:, 0], layer[seen][:, 0])[0, 1] > 0.9


# --- results -------------------------------------------------------------------------------------

TRUTH = {
    "reduction": 2,
    "width_px": 600,
    "height_px": 800,
    "position_px": {"max": 0.002, "rms": 0.001},
    "grey": {"ours_1": {"rms_dn": 0.4, "p999_dn": 3.0, "max_dn": 9.0}},
}
ROW = {"run": 1, "wall_s": 1.0, "cpu_s": 2.0, "peak_mb": 3.0}


def test_rows_get_sizes_and_errors_of_who_made_them():
    rows = [
        {"what": "ours_1", "reduction": 2, "pixels": 480_000, "samples": 500_000, **ROW},
        {"what": "nona", "reduction": 8, **ROW},
    ]
    ours, nona = rendering.with_errors(rows, TRUTH)
    assert tuple(ours) == rendering.COLUMNS
    assert (ours["samples"], ours["rms_dn"], ours["position_px"]) == (500_000, 0.4, 0.002)
    assert (nona["width_px"], nona["height_px"], nona["pixels"]) == (150, 200, 30_000)
    assert nona["rms_dn"] is nona["samples"] is None


def test_what_is_missing_is_what_cannot_be_found():
    lacking = rendering.missing()
    for name, needs in lacking.items():
        assert name in (*run.RUNS, *rendering.COMMANDS)
        assert importlib.util.find_spec(needs) is None
    assert not {"ours_1", "remap_linear", "scipy", "acx4_render"} & set(lacking)


def test_opencv_is_one_that_does_not_round_positions():
    """From OpenCV 5 on: before, they were held to 1/32 px, and remap was another's measure."""
    ramp = np.arange(0, 64000, 1000, np.uint16)[None].repeat(4, axis=0)
    at = np.float32([[10.01, 10.02, 10.03]])
    found = cv2.remap(ramp, at, np.ones_like(at), cv2.INTER_LINEAR)
    assert_array_equal(found, [[10010, 10020, 10030]])


# --- the benchmark of tie points at a small size; truth by the simulator's own geometry --------


@pytest.fixture(scope="module")
def rows():
    return {row["method"]: row for row in matching.measure(matching.simulated(8))}


def test_ties_of_simulated_pictures_are_true_to_hundredths_of_a_pixel(rows):
    """Goals of full-size images, less the points: an eighth of the size has fewer cells."""
    ours = rows["corners + least-squares matching"]
    assert ours["rms_px"] < 0.04
    assert ours["within_0.1_px"] > 0.98
    assert ours["within_1_px"] == 1.0
    assert ours["points"] > 800


def test_they_are_three_times_as_good_as_those_of_sift(rows):
    ours, sift = rows["corners + least-squares matching"], rows["SIFT + brute force"]
    assert ours["rms_px"] < sift["rms_px"] / 3
    assert sift["cpu_by_sift"] == 1.0
