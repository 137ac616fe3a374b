"""What stops or fails is explained by the reading of the flight that fits."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acx4lib.conventions.search import Found
from acx4lib.errors import AdjustmentError
from acx4lib.results.adjustments import of_failure
from acx4lib.stages import explained

PITCH = Found(name="pitch of opposite sign", quantity="attitude", given=0.61, found=0.006, unit="°")
SAID = "with pitch of opposite sign the residuals of attitude fall from 0.61° to 0.006°"


@pytest.fixture(params=[PITCH, None], ids=["another fits", "none fits"])
def best(request, monkeypatch):
    monkeypatch.setattr(explained.search, "best_reading", lambda _flight, _block: request.param)
    return request.param


def failed():
    return of_failure("mounting", "single_step", "no start", summary_key="mounting/single_step")


def test_an_adjustment_that_failed_says_which_reading_fits(best):
    (record,) = explained.explained([failed()], None, "calibration")
    expected = f"no start; {SAID}" if best else "no start"
    assert record.summary["mounting/single_step"]["not_determined"] == [expected]


def test_what_only_is_not_determined_is_left_as_it_is(best):
    entry = {**failed().summary["mounting/single_step"], "converged": True}
    weak = replace(failed(), summary={"mounting/single_step": entry})
    assert explained.explained([weak], None, "calibration") == [weak]


def test_an_error_that_ends_the_stage_does_as_well(best):
    expected = f"no start; {SAID}" if best else "no start"
    with pytest.raises(AdjustmentError) as raised, explained.explaining(None, "calibration"):
        raise AdjustmentError("no start")
    assert str(raised.value) == expected


def test_a_failure_of_linear_algebra_names_the_exposures_that_stand_out(exact_block):
    trajectory = exact_block.trajectory
    r = trajectory.T_m_b.r.copy()
    r[2, 0] += 1e7
    away = replace(trajectory, T_m_b=replace(trajectory.T_m_b, r=r))
    block = replace(exact_block, trajectory=away)
    flight = SimpleNamespace(block=lambda _name: block)
    with pytest.raises(AdjustmentError) as raised, explained.solving(flight, "calibration"):
        np.linalg.inv(np.zeros((2, 2)))
    assert str(raised.value) == (
        f"the equations of block 'calibration', in which exposure {trajectory.exposures[2]} stand "
        "out, cannot be solved (Singular matrix): one number is so far from the others that "
        "nothing can be computed with both; look at coordinates, angles and sigma"
    )
