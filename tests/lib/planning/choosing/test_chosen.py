from itertools import combinations

import numpy as np
import pytest

from acx4lib.planning import design, text
from acx4lib.planning.choosing import candidates, chosen, tables, target

from .conftest import CANDIDATES


def of(plan, **wanted):
    return candidates.of(target.from_values({**wanted, "candidates": CANDIDATES}, plan))


@pytest.fixture(scope="module")
def some(plan):
    return of(plan, sigma={"f_mm": 0.003, "lever_x_m": 0.04, "boresight_kappa_deg": 0.004})


def test_the_choice_meets_the_target_as_a_plan_of_its_own(some):
    found = chosen.choose(some)
    assert found.met
    assert found.given == pytest.approx(some.planned(found.plan))
    assert np.all(found.given <= some.limits)
    again = text.from_values(found.plan.values)
    assert again.blocks["calibration"].strips == found.plan.blocks["calibration"].strips


@pytest.mark.parametrize("share", [1.1, 1.4, 2.0, 3.0])
def test_no_choice_of_a_small_set_is_cheaper_by_more_than_a_twentieth(plan, share):
    """All 511 choices, by the same tie points."""
    names = ("f_mm", "lever_x_m", "lever_z_m", "boresight_omega_deg", "boresight_kappa_deg")
    easy = of(plan, sigma=dict.fromkeys(names, 100.0))
    limits = share * easy.given(range(9)) * [1.0, 1.2, 1.0, 1.1, 1.0]
    order = chosen.searched(easy, limits, np.inf)
    assert np.all(easy.given(order) <= limits)
    best = min(
        easy.seconds[list(one)].sum()
        for n in range(1, 10)
        for one in combinations(range(9), n)
        if np.all(easy.given(one) <= limits)
    )
    assert easy.seconds[list(order)].sum() <= 1.05 * best


def test_no_plan_of_a_small_set_is_cheaper_by_more_than_a_twentieth(plan):
    """All 31 choices, each as a plan of its own with all of its tie points."""
    strips = {"c": {**CANDIDATES["c"], "course_deg": [0, 180]}}
    wanted = {"f_mm": 0.004, "lever_x_m": 0.05, "boresight_kappa_deg": 0.005}
    few = candidates.of(target.from_values({"sigma": wanted, "candidates": strips}, plan))
    found = chosen.choose(few)
    assert found.met
    every = [one for n in range(1, 6) for one in combinations(range(5), n)]
    reaching = [
        few.minutes(one)
        for one in every
        if np.all(few.planned(chosen.with_strips(few.target.plan, one)) <= few.limits)
    ]
    assert 0 < len(reaching) < len(every)
    assert found.minutes <= 1.05 * min(reaching)


def test_what_a_strip_buys_ends_with_what_the_plan_gives(some):
    found = chosen.choose(some)
    assert found.after[-1] == pytest.approx(found.given)
    assert np.all(np.diff(found.after, axis=0) <= 0)
    assert np.all(found.without >= found.given)
    assert np.all((found.without > some.limits).any(axis=1))  # every strip is needed
    assert np.all(np.diff(found.minutes_after) > 4)  # a turn takes four minutes


def test_what_is_missed_in_a_short_time_is_known(some):
    found = chosen.choose(some, minutes=5)
    assert not found.met
    assert found.minutes <= 5
    assert len(found.strips) == 2
    assert found.minutes < chosen.choose(some).minutes


def test_check_points_alone_choose_strips(plan):
    easy = of(plan, check_points={"height_m": 10.0})
    rms = easy.wanted[0].with_all
    found = chosen.choose(of(plan, check_points={"height_m": 1.1 * rms}))
    assert found.met
    designed = design.of(found.plan).validations["single_step"].points.sigma
    assert found.given == pytest.approx(np.sqrt(np.mean(designed[:, 2] ** 2)))


def test_tables_have_a_row_for_every_strip_and_every_wish(some):
    found = chosen.choose(some)
    strips, wanted = tables.strips(found), tables.wanted(found)
    assert len(strips) == len(found.strips) * len(wanted)
    assert [*wanted.chosen] == pytest.approx(found.given)
    assert [*strips.after[-len(wanted) :]] == pytest.approx(found.given)
    assert strips.strip.iloc[0] == found.strips[0]
