"""One verdict on the two methods, from a run and from stored flights."""

import json

import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import study
from acx4book.pages import methods
from acx4lib.results import folder
from support import run_results


def test_the_verdict_has_the_ratios_of_standard_deviations(tmp_path):
    results = run_results.leave_results(tmp_path)[1]
    found = folder.read(results)
    said = methods.page(found, "CAM", study.STORED)
    sigma = {
        m: folder.parameters(found, f"mounting/{m}", "CAM")["sigma"]
        for m in ("two_step", "single_step")
    }
    ratio = sigma["two_step"]["f_mm"] / sigma["single_step"]["f_mm"]
    assert f"{ratio:.0f} times smaller" in said
    rms = json.loads((results / "summary.json").read_text())["validation/single_step"]
    assert f"{rms['points']['rms'][2]:.2f} m in height with the single step" in said


def test_slow_errors_are_those_of_all_stored_flights():
    errors = pd.read_csv(study.STORED / "slow_errors.csv")
    said = methods.slow_errors(study.STORED)
    assert f"Over {errors['seed'].nunique()} flights" in said
    assert "2.3 to 4.9 times its standard deviation" in said


def test_without_a_two_step_method_there_is_no_verdict(tmp_path):
    found = folder.read(run_results.leave_results(tmp_path)[1])
    del found.summary["mounting/two_step"]
    assert methods.page(found, "CAM", study.STORED) == ""
