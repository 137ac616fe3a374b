"""Validation on check points: pairs, differences along the CRS's axes, sigmas, and blunders."""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import stats

import acx4sim
from acx4files.flight import reader
from acx4files.results import sentences
from acx4files.stages import mounting
from acx4files.stages import validation as stages_validation
from acx4lib.block import select_images
from acx4lib.calibration.estimates import given
from acx4lib.calibration.mounting import single_step
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4lib.georeferencing import direct, error_sources, validation
from acx4lib.georeferencing.validation import predict, rays_of_pairs, validate
from acx4lib.least_squares.covariance import WHITE, GaussMarkov
from acx4lib.model import Model
from support import blocks

# --- pairs -----------------------------------------------------------------------------------


def angle_deg(block, point, a, b):
    """The angle at which two images see a check point."""
    (camera,) = block.cameras
    mount = Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None])
    down = block.check.x_m[point] - (block.T_m_b_images @ mount).r[[a, b]]
    u, v = down / np.linalg.norm(down, axis=1, keepdims=True)
    return np.degrees(np.arccos(u @ v))


def pairs_of(block, point):
    """All pairs of images that measure a point, the earlier one first, and their angles."""
    images = np.sort(block.image_points.image_idx[block.image_points.point_idx == point])
    return {(a, b): angle_deg(block, point, a, b) for a, b in combinations(images.tolist(), 2)}


def test_every_pair_of_images_of_a_point_is_intersected_in_order(block, cameras):
    found = validate(block, cameras, method="given")
    angles = {(p, *ab): angle for p in range(4) for ab, angle in pairs_of(block, p).items()}
    listed = [
        (int(p), *map(int, images))
        for p, images in zip(found.pairs.point_idx, found.pairs.image_idx, strict=True)
    ]
    assert listed == sorted(listed)
    assert set(listed) == {key for key, angle in angles.items() if angle >= 2.0}
    assert 0 < found.n_failed == sum(angle < 2.0 for angle in angles.values())
    assert found.method == "given"
    assert np.all(found.pairs.n_images == 2)


def test_points_are_intersected_from_all_their_rays(block, cameras):
    found = validate(block, cameras, method="given")
    assert found.points.point_idx.tolist() == [0, 1, 2, 3]
    assert found.points.n_images.tolist() == block.rays[:4].tolist()
    assert found.n_left_out == 0
    assert found.redundancy == 2 * block.rays[:4].sum() - 12
    assert found.n_observations == 2 * block.rays[:4].sum()


def test_a_point_in_one_image_is_left_out_and_counted(block, cameras):
    points = block.image_points
    first = np.flatnonzero(points.point_idx == 2)
    keep = np.setdiff1d(np.arange(len(points)), first[1:])
    found = validate(replace(block, image_points=points[keep]), cameras, method="given")
    assert found.points.point_idx.tolist() == [0, 1, 3]
    assert 2 not in found.pairs.point_idx
    assert found.n_left_out == 1


def test_without_check_points_there_is_nothing_to_compare(block, cameras):
    none = replace(block, check=block.check[np.zeros(4, dtype=bool)])
    found = validate(none, cameras, method="given")
    assert len(found.pairs) == len(found.points) == 0
    assert found.redundancy == 0
    assert found.sigma0_sq == 1.0
    assert found.chi_square_p == found.joint_chi_square_p == 1.0
    assert np.isnan(found.mean_cov).all()


# --- differences -----------------------------------------------------------------------------


def test_differences_are_estimated_less_surveyed_along_the_axes_of_the_crs(block, cameras):
    by = np.array([0.10, -0.20, 0.30])
    found = validate(blocks.surveyed_off(block, by), cameras, method="given")
    # 900 m above the ellipsoid a metre on the ground is 0.9998 m in the grid: 4e-5 m of 0.2 m
    assert_allclose(found.points.d, -np.tile(by, (4, 1)), atol=5e-5)
    assert_allclose(found.pairs.d, -np.tile(by, (len(found.pairs), 1)), atol=5e-5)


def test_differences_are_as_large_as_their_sigmas_say(block, cameras):
    """60 noisy copies: the squared normalised differences average to one.

    The points of a copy share the trajectory's errors; were they one, sampling would leave
    sqrt(2 / 60) = 0.18.
    """
    z = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        survey = rng.normal(size=(4, 3)) * block.check.sigma_m
        noisy = blocks.surveyed_off(blocks.noisy(block, rng), survey)
        points = validate(noisy, cameras, method="given").points
        z.append(points.d / points.sigma)
    assert np.mean(np.square(z)) == pytest.approx(1.0, abs=0.3)
    assert np.all(np.abs(z) < 5)


# --- all differences together ----------------------------------------------------------------


def calibrated_and_checked(seed):
    """Calibrate on one noisy flight, validate it on another with twelve check points."""
    rng = np.random.default_rng(seed)
    flown = blocks.noisy(blocks.standard(), rng)
    calibration = single_step(flown, Model(free=("f", "xp", "yp", "k1", "p1", "p2"))).calibration
    points = blocks.terrain(12, half_m=300.0, seed=8)
    other = blocks.noisy(blocks.simulate(blocks.fly(seed=9), check=points), rng)
    survey = rng.normal(size=(12, 3)) * other.check.sigma_m
    return validate(blocks.surveyed_off(other, survey), calibration, method="single_step")


@pytest.fixture(scope="module")
def flights():
    return [calibrated_and_checked(seed) for seed in range(60)]


@pytest.mark.slow
def test_joint_p_values_of_60_flights_are_uniform(flights):
    p = [found.joint_chi_square_p for found in flights]
    assert {found.joint_dof for found in flights} == {36}
    assert stats.kstest(p, "uniform").pvalue > 0.01
    summed = sum(found.joint_chi_square for found in flights)
    assert 0.005 < stats.chi2.cdf(summed, 60 * 36) < 0.995


@pytest.mark.slow
def test_the_mean_has_its_sigma_which_is_twice_that_of_independent_points(flights):
    """Of 60 flights and 3 axes, a spread of 1 is found to sqrt(1 / 360) = 0.05."""
    mean = np.array([found.points.d.mean(axis=0) for found in flights])
    sigma = np.array([np.sqrt(np.diag(found.mean_cov)) for found in flights])
    as_if_independent = [
        np.sqrt(np.sum(found.points.sigma**2, axis=0)) / len(found.points) for found in flights
    ]
    assert np.sqrt(np.mean((mean / sigma) ** 2)) == pytest.approx(1.0, abs=0.15)
    assert np.sqrt(np.mean((mean / as_if_independent) ** 2)) > 1.6


@pytest.mark.slow
def test_slow_errors_of_40_flights_have_their_chi_square_and_are_no_white_ones(block, cameras):
    """Two-sided bounds of 99 %, of all differences and of their mean."""
    process = GaussMarkov(share=0.95, time_constant_s=600.0)
    timed = blocks.in_strips(block, 3)
    own = replace(timed.trajectory, slow_positions=process, slow_attitudes=process)
    chi_square, mean = {"slow": 0.0, "white": 0.0}, {"slow": 0.0, "white": 0.0}
    for seed in range(40):
        rng = np.random.default_rng(seed)
        survey = rng.normal(size=(4, 3)) * block.check.sigma_m
        flown = blocks.surveyed_off(blocks.noisy(replace(timed, trajectory=own), rng), survey)
        white = replace(
            own, T_m_b=flown.trajectory.T_m_b, slow_positions=WHITE, slow_attitudes=WHITE
        )
        for kind, of in {"slow": flown, "white": replace(flown, trajectory=white)}.items():
            found = validate(of, cameras, method="given")
            d = found.points.d.mean(axis=0)
            chi_square[kind] += found.joint_chi_square
            mean[kind] += d @ np.linalg.solve(found.mean_cov, d)
    assert 0.005 < stats.chi2.cdf(chi_square["slow"], 40 * 12) < 0.995
    assert 0.005 < stats.chi2.cdf(mean["slow"], 40 * 3) < 0.995
    assert not 0.005 < stats.chi2.cdf(chi_square["white"], 40 * 12) < 0.995
    assert not 0.005 < stats.chi2.cdf(mean["white"], 40 * 3) < 0.995


# --- blunders --------------------------------------------------------------------------------


def spoilt(block, row, by):
    change = np.zeros((len(block.image_points), 2))
    change[row] = by
    return blocks.changed(block, "image_point", change)


def test_a_measurement_that_does_not_fit_the_others_is_taken_out(block, cameras):
    noisy = blocks.noisy(block, np.random.default_rng(2))
    row = 9
    found = validate(spoilt(noisy, row, [0.0, 60.0]), cameras, method="given")
    assert [(r.kind, r.row, r.component) for r in found.rejected] == [("image_point", row, -1)]
    assert found.rejected[0].statistic > 3.9
    point, image = block.image_points.point_idx[row], block.image_points.image_idx[row]
    own = found.pairs.point_idx == point
    assert image not in found.pairs.image_idx[own]
    assert found.points.n_images[point] == block.rays[point] - 1
    assert np.all(np.abs(found.points.d) < 4 * found.points.sigma)


def test_clean_measurements_stay(block, cameras):
    for seed in range(5):
        noisy = blocks.noisy(block, np.random.default_rng(seed))
        assert validate(noisy, cameras, method="given").rejected == ()


def test_the_trajectorys_sigma_is_part_of_the_test(block, cameras):
    """An attitude error of its own size is no gross error of the image points."""
    rng = np.random.default_rng(0)
    shaken = block
    for kind in ("gnss", "attitude"):
        sigma = blocks.observed_sigmas(block)[kind]
        shaken = blocks.changed(shaken, kind, sigma * rng.normal(size=sigma.shape))
    sharp = replace(
        shaken,
        image_points=replace(shaken.image_points, sigma_px=np.full(len(shaken.image_points), 0.01)),
    )
    assert validate(sharp, cameras, method="given").rejected == ()


def test_a_pair_whose_rays_meet_behind_the_cameras_is_no_row(block, cameras):
    """A point taken for another: the rays part, and no number may come of it."""
    points, (camera,) = block.image_points, block.cameras
    a, b = max(pairs_of(block, 0), key=lambda pair: pairs_of(block, 0)[pair])
    T_m_c = block.T_m_b_images @ Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None])
    aside = T_m_c.r[b] - T_m_c.r[a]
    aside *= 120 / np.hypot(*aside[:2])
    outwards = T_m_c.r[[a, b]] + [[-aside[0], -aside[1], -1000.0], [aside[0], aside[1], -1000.0]]
    keep = (points.point_idx != 0) | np.isin(points.image_idx, [a, b])
    points = points[keep]
    colrow = points.colrow.copy()
    rows = [
        int(np.flatnonzero((points.point_idx == 0) & (points.image_idx == i))[0]) for i in (a, b)
    ]
    colrow[rows] = project(camera, T_m_c[np.array([a, b])], outwards)
    parted = replace(block, image_points=replace(points, colrow=colrow))
    before, found = (
        validate(block, cameras, method="given"),
        validate(parted, cameras, method="given"),
    )
    assert np.isfinite(found.pairs.d).all()
    assert np.isfinite(found.points.d).all()
    assert 0 not in found.pairs.point_idx
    lost = sum(angle < 2.0 for angle in pairs_of(block, 0).values())
    assert found.n_failed == before.n_failed - lost + 1


def test_a_singular_joint_covariance_is_an_error_of_linear_algebra(block, cameras):
    points = validate(block, cameras, method="given").points
    without = replace(
        points.sources,
        image=0 * points.sources.image,
        survey=0 * points.sources.survey,
        by_body=0 * points.sources.by_body,
        by_parameters=0 * points.sources.by_parameters,
    )
    with pytest.raises(np.linalg.LinAlgError):
        error_sources.chi_square(without, points.d)


# --- Differences along the axes of the CRS, their sigma, and the errors that they share


def test_the_sources_of_a_difference_add_up_to_its_sigma(block, cameras):
    found = validate(block, cameras, method="given")
    for differences in (found.pairs, found.points):
        variance = np.diagonal(differences.sources.cov, axis1=1, axis2=2)
        assert_allclose(np.sqrt(variance), differences.sigma, rtol=1e-9)


def test_the_rays_of_a_pair_are_where_its_two_images_show_the_point(block, cameras):
    found = validate(block, cameras, method="given")
    k = len(found.pairs) - 1
    rays = rays_of_pairs(block, found.pairs, [k])
    assert rays.image_idx.tolist() == found.pairs.image_idx[k].tolist()
    point = block.check.x_m[found.pairs.point_idx[k]]
    (camera,) = found.georeferenced.cameras
    for i, colrow in zip(rays.image_idx, rays.colrow, strict=True):
        shown = project(camera, found.georeferenced.T_m_c[[i]], point[None])
        assert_allclose(colrow, shown[0], atol=1e-6)  # measured without noise


# --- Tests of the rays of a point, with independent exposures and with slow errors


CHECK = 6


@pytest.fixture(scope="module")
def many_rays():
    """Six points in up to twelve images, whose exposures follow each other within seconds."""
    points = blocks.terrain(CHECK, half_m=150.0, seed=8)
    return blocks.in_strips(blocks.simulate(blocks.fly(), check=points), 3)


def slow(block, share):
    process = GaussMarkov(share=share, time_constant_s=60.0)
    own = replace(block.trajectory, slow_positions=process, slow_attitudes=process)
    return replace(block, trajectory=own)


def rays(block):
    points = block.image_points
    rows = np.lexsort((points.image_idx, points.point_idx))
    return direct.Rays(
        image_idx=points.image_idx[rows],
        group=points.point_idx[rows],
        colrow=points.colrow[rows],
        sigma_px=points.sigma_px[rows],
    )


def w_of(block, cameras):
    return validation.normalised_residuals(block, direct.georeference(block, cameras), rays(block))


def cost(block, cameras):
    return validation.cost(block, direct.georeference(block, cameras), rays(block))


def agreement(flights, cameras, share):
    """Return the p of chi-square for the costs of flights whose errors change slowly, or not."""
    costs = [cost(slow(flight, share), cameras) for flight in flights]
    dof = 2 * len(flights[0].image_points) - 3 * CHECK
    return stats.kstest(costs, stats.chi2(dof).cdf).pvalue


def test_cost_has_its_chi_square_where_errors_change_slowly(many_rays, cameras):
    """If their correlation is known: otherwise not."""
    flights = [
        blocks.noisy(slow(many_rays, 0.98), np.random.default_rng(seed)) for seed in range(60)
    ]
    assert agreement(flights, cameras, 0.98) > 0.01
    assert agreement(flights, cameras, 0.0) < 0.01


def test_costs_spread_as_chi_square_where_rays_share_exposures(many_rays, cameras):
    """Each image shows several points: taken for independent, costs spread too widely."""
    flights = [blocks.noisy(many_rays, np.random.default_rng(seed)) for seed in range(100)]
    assert agreement(flights, cameras, 0.0) > 0.01


def test_a_wrong_ray_is_found_sooner_by_its_neighbours_slow_errors(many_rays, cameras):
    points, row = many_rays.image_points, 4
    by = np.zeros((len(points), 2))
    by[row] = [3.0, 0.0]
    wrong = blocks.changed(many_rays, "image_point", by)
    order = np.lexsort((points.image_idx, points.point_idx))
    for w in (w_of(wrong, cameras), w_of(slow(wrong, 0.98), cameras)):
        assert order[np.argmax(w)] == row
    assert w_of(slow(wrong, 0.98), cameras).max() > 1.1 * w_of(wrong, cameras).max()


@pytest.mark.parametrize("share", [0.0, 0.9])
def test_cost_is_that_of_the_joint_covariance_of_all_rays(rig, calibration, share):
    """Against dense matrices: rays share the errors of their exposures and of the calibration."""
    timed = blocks.in_strips(rig, 2) if share else rig
    block = slow(blocks.noisy(timed, np.random.default_rng(4)), share)
    posed = direct.georeference(block, calibration)
    posed = replace(posed, cov_parameters=25.0 * posed.cov_parameters)
    selected = rays(block)
    at = direct.intersect_rays(block, posed, selected)
    n, exposure = len(selected.group), block.images.exposure_idx[selected.image_idx]
    cov = np.diag(np.repeat(selected.sigma_px**2, 2))
    points = np.zeros((2 * n, 3 * selected.n_groups))
    for i in range(n):
        points[2 * i : 2 * i + 2, 3 * selected.group[i] :][:, :3] = at.by_point[i]
        for j in range(n):
            body = posed.cov_body[exposure[i]] * (exposure[i] == exposure[j])
            if share and exposure[i] != exposure[j]:
                body = posed.shared.between(exposure[[i]], exposure[[j]])[0]
            D = [at.by_parameters[k] for k in (i, j)]
            both = at.by_body[i] @ body @ at.by_body[j].T + D[0] @ posed.cov_parameters @ D[1].T
            cov[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] += both
    root = np.linalg.inv(np.linalg.cholesky(cov))
    right, left = root @ at.v.ravel(), root @ points
    solved = np.linalg.lstsq(left, right, rcond=None)[0]
    least = np.sum((right - left @ solved) ** 2)
    assert validation.cost(block, posed, selected) == pytest.approx(least, rel=1e-6)
    held = replace(posed, cov_parameters=0.0 * posed.cov_parameters)
    assert least < 0.999 * validation.cost(block, held, selected)


# --- Exposures that took no part in a calibration are predicted by it, or are not


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A flight of one camera whose validation block has tie points and nothing surveyed."""
    path = tmp_path_factory.mktemp("predicted") / "flight"
    options = acx4sim.Options(tie_points={"calibration": 100, "validation": 100})
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=2, options=options), path)
    own = path / "validation" / "control_points.csv"
    names = pd.read_csv(own, dtype=str)["point"]
    own.write_text(own.read_text().splitlines()[0] + "\n")
    points = path / "validation" / "image_points.csv"
    seen = pd.read_csv(points, dtype=str)
    seen[~seen["point"].isin(names)].to_csv(points, index=False)
    return path


@pytest.fixture(scope="module")
def flight(folder):
    return reader.read(folder)


@pytest.fixture(scope="module")
def calibrated(flight):
    return single_step(
        flight.block("calibration"), Model(free=flight.estimate_mounting)
    ).calibration


def test_a_right_calibration_predicts_the_other_exposures(flight, calibrated):
    block = flight.block("validation")
    found = predict(block, calibrated, method="single_step")
    assert 0.01 < found.chi_square_p < 0.99
    solution, sigma = found.bundle.solution, block.image_points.sigma_px.mean()
    left = sigma * np.sqrt(solution.redundancy / solution.n_observations)
    assert found.rays_rms_px == pytest.approx(left, rel=0.1)
    stated = np.sqrt(np.mean(block.trajectory.sigma_position**2, axis=0))
    assert np.all(np.array(found.position_rms_m) < 1.5 * stated)


@pytest.mark.parametrize("wrong", [{"p1": 5e-5}, {"k1": 2e-5}])
def test_a_wrong_one_does_not(flight, calibrated, wrong):
    (camera,) = calibrated.cameras
    off = camera.with_interior(replace(camera.interior, **wrong))
    found = predict(flight.block("validation"), given([off]), method="single_step")
    assert found.chi_square_p < 1e-6


def test_the_summary_has_it_where_there_are_no_check_points(flight, tmp_path):
    mounting.run(flight, tmp_path)
    stages_validation.run(flight, tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    entry = summary["validation/single_step"]
    assert entry["n_points"] == 0
    assert entry["n_exposures"] == len(flight.block("validation").trajectory)
    assert 0.01 < entry["chi_square_p"] < 0.99
    assert len(entry["position_rms_m"]) == 3
    assert any(f"rays meet within {entry['rays_rms_px']:.2f} px" in n for n in entry["notes"])


def test_exposures_of_which_nothing_is_measured_do_not_make_the_others_better(flight, calibrated):
    block = flight.block("validation")
    keep = block.images.exposure_idx % 3 > 0
    part = select_images(block, keep)
    found = predict(part, calibrated, method="single_step")
    n = len(np.unique(part.images.exposure_idx))
    assert f"{n} exposures that took no part" in sentences.prediction(found)
    observed, r = found.bundle.network.observed, found.bundle.state.T_m_b.r
    off = (r - observed.T_m_b.r)[np.unique(part.images.exposure_idx)]
    total = np.sqrt(np.mean(np.sum(off**2, axis=1)))
    assert np.hypot.reduce(found.position_rms_m) == pytest.approx(total)
