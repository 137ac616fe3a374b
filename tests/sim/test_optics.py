"""The simulator's own earth, optics and files."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pyproj import Transformer

import acx4sim
from acx4sim import earth, optics
from acx4sim.designs import SYNTHETIC, acx4_plan, single_head_plan

# --- the lens of the simulator: inverted exactly, or not at all ------------------------------


@pytest.mark.parametrize(
    "camera", [*acx4_plan().cameras.values(), single_head_plan().cameras["CAM"]]
)
def test_distortion_is_inverted_to_1e_12_mm(camera):
    half = camera.pixel_um / 2000 * np.array([camera.width_px, camera.height_px])
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    ideal = half * np.column_stack([x.ravel(), y.ravel()])
    xy = optics.measured_from_ideal(camera, ideal)
    dxy, _ = optics.correction(camera, xy)
    assert_allclose(xy - dxy, ideal, atol=1e-12, rtol=0)


def test_a_lens_that_folds_is_refused():
    fold = replace(SYNTHETIC, k1=1e-3)
    with pytest.raises(ValueError, match="cannot be inverted"):
        optics.measured_from_ideal(fold, np.array([[30.0, 40.0]]))


# --- Refraction against the tabulated standard atmosphere


BLOCK = ("calibration",)

EXACT = {"image_noise": 0, "control_noise": 0, "gnss_noise": 0, "attitude_noise": 0}


def acx4(**options):
    return acx4sim.acx4_ideal(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def test_a_ray_is_bent_as_the_tabulated_atmosphere_bends_it():
    """The mean density of a layer is the difference of its pressures over g times its height.

    Pressures and density are the ICAO table's at 1000 m and 5000 m, geopotential.
    """
    mean = (89874.6 - 54019.9) / (9.80665 * 4000.0)
    expected = 2.7769e-4 * (mean - 0.736116) / 1.2250  # rad per tangent, n - 1 of 0.56 um
    for tangent in (0.1, 1.0, 3.0):
        ray = np.array([[4000.0 * tangent, 0.0, -4000.0]])
        bent = optics.bent(ray, np.array([[0.0, 0.0, 1.0]]), np.array([1000.0]))
        turned = np.arctan2(bent[0, 0], 4000.0) - np.arctan(tangent)
        # the table has six digits; the bend is not quite proportional to the tangent
        assert turned == pytest.approx(expected * tangent, rel=5e-4)


def test_refraction_moves_image_points_outward_by_k_tan_of_the_angle():
    """K is 12e-6 and 17e-6 at 1000 m and 1500 m over ground at 900 m, and images are tilted."""
    straight = acx4(**EXACT)
    bent = acx4(**EXACT, refraction="standard")
    names = ["image", "point"]
    a, b = (f.tables["calibration/image_points.csv"] for f in (straight, bent))
    both = a.merge(b, on=names, suffixes=("", "_bent"))
    xy = both[["col_px", "row_px"]].to_numpy() - [5999.5, 8099.5]
    moved = both[["col_px_bent", "row_px_bent"]].to_numpy() - both[["col_px", "row_px"]].to_numpy()
    r = np.hypot(*xy.T)
    outward = np.sum(moved * xy, axis=1) / r
    tangent = r * 0.0056 / 74.44
    K = outward * 0.0056 / 74.44 / (tangent * (1 + tangent**2))
    far = r > 4000  # px: near the middle a tilted image hides which way is outward
    assert np.all(outward[far] > 0)
    assert 12e-6 < np.median(K[far]) < 17e-6
    assert tomllib.loads(bent.toml)["refraction"] == "standard"
    assert "refraction" not in tomllib.loads(straight.toml)
    assert bent.truth["cameras"] == straight.truth["cameras"]


# --- the earth: geocentric coordinates and grid attitudes are the published ones -------------


def test_published_vector_of_a_grid_attitude():
    """A worked example on GRS80 near Curitiba, computed in two other ways.

    Its body is forward-right-down and its angles are the camera's, its lever arm of
    (0.223, -0.399, -0.201) therefore (0.223, 0.399, 0.201) in the contract's axes.
    """
    grid = earth.Grid(crs="EPSG:31982")
    llh = np.array([[np.radians(-25.45), np.radians(-49.25), 2250.0]])
    gamma = grid.convergence(llh)
    assert_allclose(np.degrees(gamma), -0.7522096122, atol=1e-9)
    R_enu_b = earth.attitude_from_rph(np.radians([[1.25, -2.5, 37.0]]))
    R_b_c = earth.rotation_from_opk_deg((0.49665, -1.59457, 0.07984))
    opk = np.degrees(earth.opk_from_attitude(R_enu_b * R_b_c, gamma))
    assert_allclose(opk, [[0.354061763548, 1.934249251200, 52.259248857567]], atol=2e-9)
    x_g = grid.grid_from_geodetic(llh)
    assert_allclose(x_g, [[675960.7544160, 7184067.8846027, 2250.0]], atol=1e-6)
    lever = R_enu_b.apply([0.223, 0.399, 0.201])
    assert_allclose(lever[0, 2], 0.1997297, atol=1e-6)


def test_ecef_is_projs():
    grid = earth.Grid(crs="EPSG:31982")
    llh = np.array([[-0.44, -0.86, 1234.5], [0.1, 0.2, 0.0]])
    geocentric = Transformer.from_crs("EPSG:4989", "EPSG:4988", always_xy=True)
    expected = geocentric.transform(np.degrees(llh[:, 1]), np.degrees(llh[:, 0]), llh[:, 2])
    assert_allclose(grid.ecef_from_geodetic(llh), np.column_stack(expected), atol=1e-8)


# --- written flights: the same bytes, whole or not at all, the truth beside them -------------


def all_bytes(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.mark.parametrize("name", acx4sim.DESIGNS)
def test_same_seed_gives_the_same_bytes(name, tmp_path):
    for folder in ("a", "b"):
        acx4sim.write(acx4sim.DESIGNS[name](seed=7), tmp_path / folder / "flight")
    assert all_bytes(tmp_path / "a") == all_bytes(tmp_path / "b")
    acx4sim.write(acx4sim.DESIGNS[name](seed=8), tmp_path / "c" / "flight")
    a, c = all_bytes(tmp_path / "a"), all_bytes(tmp_path / "c")
    differing = {name for name in a if a[name] != c[name]}
    assert all(name in differing for name in a if "image_points" in name or "trajectory" in name)


def test_truth_lies_beside_the_flight_and_never_inside(flight, tmp_path):
    acx4sim.write(flight, tmp_path / "my_flight")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["my_flight", "my_flight.truth.json"]
    assert not [path for path in all_bytes(tmp_path / "my_flight") if "truth" in path]
    truth = json.loads((tmp_path / "my_flight.truth.json").read_text())
    assert truth["seed"] == 1
    assert truth["cameras"]["SYN"]["lever_y_m"] == -0.399
    assert tuple(truth["heads_in_synthetic_frame"]["CAM2"].values()) == (
        optics.HEADS["CAM2"].boresight_deg
    )
    assert truth["rendered_boresight"]["boresight_phi_deg"] == -1.6
    assert len(truth["exposures"]["validation"]) == 268
    assert len(truth["control_points"]) == 56 + 36


@pytest.mark.parametrize("content", ["file", "folder"])
def test_an_existing_flight_is_not_touched(flight, tmp_path, content):
    target = tmp_path / "f"
    if content == "file":
        target.write_text("mine")
    else:
        target.mkdir()
        (target / "mine.txt").write_text("mine")
    before = all_bytes(tmp_path)
    with pytest.raises(FileExistsError, match="exists already and is not an empty folder"):
        acx4sim.write(flight, target)
    assert all_bytes(tmp_path) == before


def test_a_failure_while_writing_leaves_nothing(flight, tmp_path):
    broken = replace(flight, truth={"not JSON": object()})
    with pytest.raises(TypeError):
        acx4sim.write(broken, tmp_path / "f")
    assert list(tmp_path.iterdir()) == []
