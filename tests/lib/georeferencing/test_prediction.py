"""Exposures that took no part in a calibration are predicted by it, or are not."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4lib.calibration.mounting import single_step
from acx4lib.flight import reader
from acx4lib.flight.block import select_images
from acx4lib.georeferencing.prediction import predict
from acx4lib.stages import mounting, validation


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
def cameras(flight):
    calibration = flight.block("calibration")
    return single_step(calibration, free=flight.estimate_mounting).calibration.cameras


def test_a_right_calibration_predicts_the_other_exposures(flight, cameras):
    block = flight.block("validation")
    found = predict(block, cameras, method="single_step")
    assert 0.01 < found.chi_square_p < 0.99
    solution, sigma = found.bundle.solution, block.image_points.sigma_px.mean()
    left = sigma * np.sqrt(solution.redundancy / solution.n_observations)
    assert found.rays_rms_px == pytest.approx(left, rel=0.1)
    stated = np.sqrt(np.mean(block.trajectory.sigma_position**2, axis=0))
    assert np.all(np.array(found.position_rms_m) < 1.5 * stated)


@pytest.mark.parametrize("wrong", [{"p1": 5e-5}, {"k1": 2e-5}])
def test_a_wrong_one_does_not(flight, cameras, wrong):
    (camera,) = cameras
    off = camera.with_interior(replace(camera.interior, **wrong))
    found = predict(flight.block("validation"), [off], method="single_step")
    assert found.chi_square_p < 1e-6


def test_the_summary_has_it_where_there_are_no_check_points(flight, tmp_path):
    mounting.run(flight, tmp_path)
    validation.run(flight, tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    entry = summary["validation/single_step"]
    assert entry["n_points"] == 0
    assert entry["n_exposures"] == len(flight.block("validation").trajectory)
    assert 0.01 < entry["chi_square_p"] < 0.99
    assert len(entry["position_rms_m"]) == 3
    assert any(f"rays meet within {entry['rays_rms_px']:.2f} px" in n for n in entry["notes"])


def test_exposures_of_which_nothing_is_measured_do_not_make_the_others_better(flight, cameras):
    block = flight.block("validation")
    keep = block.images.exposure_idx % 3 > 0
    part = select_images(block, keep)
    found = predict(part, cameras, method="single_step")
    n = len(np.unique(part.images.exposure_idx))
    assert f"{n} exposures that took no part" in found.sentence
    observed, r = found.bundle.network.observed, found.bundle.state.T_m_b.r
    off = (r - observed.T_m_b.r)[np.unique(part.images.exposure_idx)]
    total = np.sqrt(np.mean(np.sum(off**2, axis=1)))
    assert np.hypot.reduce(found.position_rms_m) == pytest.approx(total)
