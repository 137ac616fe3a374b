"""The bundle with further columns: derivatives, recovery, and equality with the library's own."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.chapters.beyond.distortion_models import candidates
from acx4book.chapters.beyond.distortion_models.families import MODELS
from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.uses import mounted_orientation

BY_NAME = {model.name: model for model in MODELS}


def test_brown_is_what_the_library_adjusts(decentred):
    own = candidates.single_step(decentred.calibration, BY_NAME["Brown"])
    library = adjust(mounted_orientation(decentred.calibration, free=BY_NAME["Brown"].free))
    assert own.bundle.solution.cost == pytest.approx(library.solution.cost, rel=1e-9)
    assert_allclose(own.camera.interior.to_array(), library.cameras[0].interior.to_array(), 1e-6)


@pytest.mark.parametrize("name", ["Ebner", "radial + Fourier"])
def test_derivatives_by_coefficients_are_those_of_differences(decentred, name):
    model = BY_NAME[name]
    network = mounted_orientation(decentred.calibration, free=model.free)
    candidate = candidates.Candidate(network=network, model=model)
    at = np.random.default_rng(2).normal(0, 1e-3, model.n_terms)
    A = candidate.equations((network.start, at))[0].A[:, :, -model.n_terms :]
    for i in range(model.n_terms):
        step = np.eye(model.n_terms)[i] * 1e-3
        up, down = (candidate.equations((network.start, at + s))[0].v for s in (step, -step))
        assert_allclose((up - down) / 2e-3, A[:, :, i], atol=1e-6)


def planted(case, model, coefficients):
    """Return the block whose measurements a model with these coefficients corrects."""
    block = case.calibration
    points, camera = block.image_points, block.cameras[0]
    colrow = points.colrow.copy()
    for _ in range(20):  # the correction is a function of the measured point
        shift = candidates.by_coefficient(model, camera, colrow) @ coefficients
        colrow = points.colrow + shift
    return replace(block, image_points=replace(points, colrow=colrow))


def test_planted_coefficients_are_found_within_their_covariance(decentred):
    model = BY_NAME["radial + Fourier"]
    truth = np.random.default_rng(3).normal(0, 2e-3, model.n_terms)
    clean = candidates.single_step(decentred.calibration, model)
    found = candidates.single_step(planted(decentred, model, truth), model)
    # the noise is the same: what is planted comes back nearly exactly on top of it
    assert_allclose(found.coefficients - clean.coefficients, truth, atol=2e-5)
    joint, p = found.significance(found.distortion_columns[3:], found.estimates[3:])
    assert joint > 10
    assert p < 1e-6


def test_parameters_that_are_zero_give_the_chi_square_of_chance(stored):
    own = stored.rows[(stored.rows["case"] == "symmetric") & (stored.rows["model"] == "Brown")]
    chi_square = float(2 * own["joint"].sum())  # p1 and p2
    low, high = stats.chi2.ppf([0.001, 0.999], 2 * len(own))
    assert low < chi_square < high
