"""What the data say of held values, in a report on made-up summaries."""

import json

import numpy as np
import pytest

from acx4book.report import findings, held, verdict
from acx4book.report.material import read
from support.run_results import SINGLE, edit_summary, state

QUESTION = "Held values"


def told(*, p=0.5, cost=0.4, moves=None, value=25.0, estimate=25.4, sigma=0.05):
    return {
        "value": value,
        "estimate": estimate,
        "sigma": sigma,
        "cost": cost,
        "p": p,
        "moves": moves or {},
    }


def hold(folder, name, values, rejected=(), **more):
    edit_summary(folder, name, held=values, held_rejected=list(rejected), **more)


@pytest.fixture
def single(folder):
    """Results whose single step holds b1 and b2 at zero, and the data agree."""
    hold(folder, SINGLE, {"CAM/b1": told(), "CAM/b2": told(p=0.3)})
    return folder


def test_values_that_the_data_do_not_reject_hold(single):
    said = "The data reject no value at which an adjustment holds a parameter."
    assert state(single, QUESTION) == ("holds", said)


def test_values_of_which_the_data_tell_nothing_are_not_tested(single):
    hold(single, SINGLE, {"CAM/b1": told(p=None)})
    assert state(single, QUESTION) == ("untested", "The data cannot tell any of them.")


def test_results_of_an_earlier_version_say_that_they_have_no_test(folder):
    summary = json.loads((folder / "summary.json").read_text())
    for entry in summary.values():
        entry.pop("held", None)
    (folder / "summary.json").write_text(json.dumps(summary))
    found, answer = state(folder, QUESTION)
    assert found == "untested"
    assert answer == findings.AGAIN


@pytest.mark.parametrize(("move", "expected"), [(0.9, "minor"), (-3.2, "fails")])
def test_a_rejected_value_matters_where_it_moves_another_estimate(single, move, expected):
    """By a sigma or more, whatever its sign."""
    f = told(p=1e-9, cost=40.0, moves={"CAM/lever_z_m": move})
    hold(single, SINGLE, {"CAM/f_mm": f, "CAM/b1": told()}, ["CAM/f_mm"])
    found, answer = state(single, QUESTION)
    assert found == expected
    assert answer.startswith(
        "f of CAM is held at 25, and 25.400 ± 0.050 if it is free, which moves"
    )
    assert f"lever arm z by {move:+.1f} σ" in answer
    assert f"; {abs(move):.2g} σ, limit 1 σ)" in answer
    assert '[stages.mounting] estimate = ["f_mm", "xp_mm"' in answer
    failures = verdict.statement(findings.findings(read(single)))["failures"]
    assert [f["question"] for f in failures] == ([QUESTION] if expected == "fails" else [])


@pytest.mark.parametrize(("ratio", "expected"), [(0.45, "minor"), (0.47, "fails")])
def test_a_rejected_value_matters_where_it_moves_the_ground(single, ratio, expected):
    """A displacement of 0.458 sigma makes errors a tenth larger."""
    f = told(p=1e-9, cost=40.0)
    effect = [0.0, 0.1, ratio]
    hold(single, SINGLE, {"CAM/f_mm": f}, ["CAM/f_mm"], held_effect_sigma=effect)
    assert state(single, QUESTION)[0] == expected


@pytest.mark.parametrize(
    ("key", "cost", "first"),
    [("CAM/f_mm", 900.0, True), ("CAM/f_mm", 400.0, False), ("gnss_shift_east_m", 900.0, False)],
)
def test_a_value_that_explains_most_of_the_misfit_is_named_before_what_it_makes_fail(
    single, key, cost, first
):
    """v'Pv exceeds its expectation by (2 - 1) x 1000; a shift may be a wrong datum as well."""
    group = f"{SINGLE}: data snooping would reject 36 of 37 GNSS positions (height)"
    values = {key: told(p=1e-9, cost=cost, moves={"CAM/lever_z_m": 9.0})}
    fit = {"sigma0_squared": 2.0, "redundancy": 1000, "stopped": [group]}
    hold(single, SINGLE, values, [key], **fit)
    found = findings.findings(read(single))
    other = "Observations agree with each other"
    worst = verdict.statement(found)["failures"][0]["question"]
    assert worst == (QUESTION if first else other)
    assert (next(verdict.rows(found))["question"] == QUESTION) == first


def test_the_value_that_costs_most_stands_first(single):
    values = {"CAM/b1": told(p=1e-4, cost=15.0), "CAM/f_mm": told(p=1e-9, cost=40.0)}
    hold(single, SINGLE, values, ["CAM/b1", "CAM/f_mm"])
    assert held.rejected(read(single), [SINGLE]) == ["CAM/f_mm", "CAM/b1"]


def test_a_shift_and_a_held_lever_arm_are_freed_by_their_own_lines(run):
    names = ["CAM/f_mm", "CAM/b1", "gnss_shift_east_m"]
    estimate, gnss = held.freeing(run, "mounting", names)
    assert estimate.startswith('[stages.mounting] estimate = ["f_mm", "xp_mm", "yp_mm", "k1"')
    assert estimate.endswith('"f_mm", "b1"]')
    assert gnss == '[stages.mounting] gnss = ["shift"]'


# --- heads, whose values are used for relative orientation and synthetic image alone


HEADS = {f"heads/bundle/CAM{k}": (k, cost) for k, cost in enumerate((36.3, 8.1, 9.7, 30.0), 1)}


@pytest.fixture
def four(folder):
    """The single step's results with those of four heads, as in the study's flight."""
    summary = json.loads((folder / "summary.json").read_text())
    p = {36.3: 1.8e-9, 8.1: 0.0044, 9.7: 0.0018, 30.0: 4.3e-8}
    for name, (k, cost) in HEADS.items():
        key = f"CAM{k}/f_mm"
        f = told(value=74.0, estimate=74.0 + cost / 90, sigma=0.067, p=p[cost], cost=cost)
        f["moves"] = {f"CAM{k}/xp_mm": -17.1, f"CAM{k}/yp_mm": 3.0}
        summary[name] = {**summary[SINGLE], "held": {key: f, f"CAM{k}/b1": told()}}
        summary[name]["held_rejected"] = [key]
    summary["heads/relative_orientation"] = {"converged": True}
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def judged(folder, monkeypatch, sigma_px=0.5):
    """Judge the question, with a standard deviation of image points that is given."""
    monkeypatch.setattr(held, "sigma_px", lambda *_: sigma_px)
    monkeypatch.setattr(type(read(folder)), "decisive", (SINGLE, *HEADS))
    run = read(folder)
    (found,) = verdict.judged(findings._held(run))
    return found


@pytest.mark.parametrize(
    ("effect", "expected"), [({"CAM1": 0.05, "CAM4": 0.22}, "minor"), ({"CAM1": 0.33}, "fails")]
)
def test_heads_hold_where_the_synthetic_image_takes_up_what_they_hold(
    four, monkeypatch, effect, expected
):
    edit_summary(four, "heads/relative_orientation", held_effect_px=effect)
    found = judged(four, monkeypatch)
    assert found.state == expected
    for k, cost in HEADS.values():
        estimate = 74.0 + cost / 90
        assert f"of CAM{k} is held at 74, and {estimate:.3f} ± 0.067 if" in found.answer
    assert "xₚ by -17.1 σ" in found.answer
    assert '[stages.heads] estimate = ["' in found.answer
    assert bool(verdict.statement([found])["restrictions"]) == (expected == "minor")
    assert f"{max(effect.values()):.2g} px, limit 0.32 px)" in found.answer


def test_heads_without_a_synthetic_image_cannot_be_shown_to_hold(four, monkeypatch):
    found = judged(four, monkeypatch)
    assert found.state == "fails"
    assert "whose effect on a synthetic image is not known" in found.answer


def test_p_of_many_held_values_is_the_smallest_by_holm():
    values = {"a": told(p=0.01), "b": told(p=None), "c": told(p=0.2)}
    assert held.joint_p(values) == pytest.approx(0.02)
    assert np.isnan(held.joint_p({"b": told(p=None)}))
