"""Campaigns of a camera whose truth is known at every date."""

import numpy as np

from acx4book.chapters.beyond.stability import history
from acx4lib.results.campaigns import comparison as compared


def test_the_true_camera_follows_temperature_and_repair():
    cold, late = history.HISTORY[0], history.HISTORY[-1]
    a, b = (history.plan_of(flown).cameras[history.CAMERA] for flown in (cold, late))
    degrees = late.temperature_c - cold.temperature_c
    assert np.isclose(b.f_mm - a.f_mm, degrees * history.UM_PER_DEGREE / 1000)
    assert np.allclose(np.subtract(b.boresight_deg, a.boresight_deg), history.REPAIR_DEG)


def test_estimates_are_near_the_truth(every):
    for i, flown in enumerate(history.HISTORY):
        true = history.plan_of(flown).cameras[history.CAMERA]
        truth = {"f_mm": true.f_mm, "xp_mm": true.xp_mm, "lever_z_m": true.lever_m[2]}
        truth["boresight_kappa_deg"] = true.boresight_deg[2]
        for k, p in enumerate(every.parameters):
            if p.name in truth:
                sigma = np.sqrt(every.covs[i, k, k])
                assert abs(every.values[i, k] - truth[p.name]) < 4 * sigma


def test_before_the_repair_the_campaigns_lie_on_lines_and_with_it_they_do_not(every, before):
    lines = [compared.trend(one, compared.temperatures(one)) for one in (before, every)]
    assert lines[0].scatter.p > 1e-3
    assert lines[1].scatter.p < 1e-6
    assert compared.stability(before).p < 1e-6
