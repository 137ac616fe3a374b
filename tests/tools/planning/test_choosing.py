"""A small plan of one camera, and targets with candidates over the middle of its field."""

import tomllib
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.flight.block import select_images
from acx4tools.planning import choosing, design, flown, tables
from acx4tools.planning import plan as plans
from acx4tools.planning.choosing import cheapest, in_order, of_strips, with_strips
from acx4tools.planning.flown import flying_time_s

PLAN = """
name = "small"
crs = "EPSG:32633"
heights = "ellipsoidal"
[apriori]
image_point_px = 0.4
gnss_horizontal_m = 0.02
gnss_vertical_m = 0.03
roll_pitch_deg = 0.006
heading_deg = 0.015
[cameras.CAM]
width_px = 11608
height_px = 8708
pixel_um = 4.6
focal_mm = 50.0
[stages.mounting]
estimate = ["f_mm", "xp_mm", "yp_mm"]
gnss = ["shift"]
[field]
east_m = 385000.0
north_m = 5518000.0
height_m = 430.0
relief_m = 20.0
[control]
layout = "corners"
number = 4
area_m = [500.0, 500.0]
[calibration]
tie_points = 90
tie_area_m = [900.0, 900.0]
[calibration.strips]
there = {flying_height_m = 900, course_deg = 90, length_m = 600, overlap = 0.75}
[validation]
[validation.check]
layout = "grid"
number = [3, 3]
area_m = [500.0, 500.0]
[validation.strips]
a = {flying_height_m = 700, course_deg = 0, length_m = 600, overlap = 0.6, left_m = 250}
b = {flying_height_m = 700, course_deg = 180, length_m = 600, overlap = 0.6, left_m = -250}
"""

CANDIDATES = {
    "c": {
        "flying_height_m": [500, 900],
        "course_deg": [0, 90, 180, 270],
        "length_m": 600,
        "overlap": 0.75,
    }
}


@pytest.fixture(scope="session")
def plan():
    return plans.from_values(tomllib.loads(PLAN))


def test_candidates_are_all_combinations_and_the_plans_own_strips(plan):
    read = choosing.from_values({"sigma": {"f_mm": 0.002}, "candidates": CANDIDATES}, plan)
    strips = read.plan.blocks["calibration"].strips
    assert [*strips][:3] == ["there", "c-500-0", "c-500-90"]
    assert len(strips) == 9
    assert strips["c-900-270"].flying_height_m == 900
    assert strips["c-900-270"].course_deg == 270
    assert read.sigma == {"f_mm": 0.002}
    assert read.minutes == np.inf


def test_without_candidates_the_plans_own_strips_are_the_choice(plan):
    read = choosing.from_values({"minutes": 60, "check_points": {"height_m": 0.1}}, plan)
    assert [*read.plan.blocks["calibration"].strips] == ["there"]
    assert read.minutes == 60.0


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("minutes = 60", "sigma: nothing is wanted; needs [sigma] with f_mm = 0.002, or"),
        ("[sigma]\nf_m = 1", "t.toml:2: sigma.f_m: unknown key (did you mean 'f_mm'?)"),
        ("[sigma]\nf_mm = -1", "t.toml:2: sigma.f_mm: -1; must be positive"),
        ("minutes = 0\n[sigma]\nf_mm = 1", "t.toml:1: minutes: 0; must be positive"),
        (
            "[sigma]\nf_mm = 1\n[candidates]\nc = {flying_height_m = [500, 0], course_deg = 0, "
            "length_m = 600, overlap = 0.8}",
            "t.toml:4: calibration.strips.c-0.flying_height_m: 0; must lie",
        ),
        (
            "[sigma]\nf_mm = 1\n[candidates]\nc = 5",
            "t.toml:4: candidates.c: 5; must be a table, as",
        ),
        (
            "[sigma]\nf_mm = 1\n[candidates]\nc = {course_deg = []}",
            "t.toml:4: candidates.c.course_deg: []; must be a value, or a list of 1 to 200",
        ),
        (
            f"[sigma]\nf_mm = 1\n[candidates]\nc = {{a = {[*range(20)]}, b = {[*range(20)]}}}",
            "t.toml:3: candidates: 400 strips; must be at most 200",
        ),
        ("[sigma", "must be valid TOML"),
    ],
)
def test_a_mistake_is_named_with_its_line_and_a_cure(plan, tmp_path, written, message):
    path = tmp_path / "t.toml"
    path.write_text(written, encoding="utf-8")
    with pytest.raises(FlightError) as error:
        choosing.read(path, plan)
    assert message in str(error.value)


def test_check_points_need_a_mapping_flight(plan):
    without = replace(plan, blocks={"calibration": plan.blocks["calibration"]})
    with pytest.raises(FlightError, match="a plan without block validation; the plan needs"):
        choosing.from_values({"check_points": {"height_m": 0.1}}, without)
    with pytest.raises(FlightError, match="a plan without block calibration"):
        choosing.from_values(
            {"sigma": {"f_mm": 1}}, replace(plan, blocks={"validation": plan.blocks["validation"]})
        )


def test_sigma_of_distortion_may_be_as_small_as_they_are(plan):
    wanted = {"k1": 5e-8, "k2": 3e-10, "k3": 2e-13, "p1": 1e-6}
    assert choosing.from_values({"sigma": wanted}, plan).sigma == wanted
    with pytest.raises(FlightError, match=r"sigma\.k2: 0; must be positive"):
        choosing.from_values({"sigma": {"k2": 0}}, plan)


WANTED = {
    "sigma": {"f_mm": 1e-4, "boresight_kappa_deg": 1.0, "gnss_shift_east_m": 1.0},
    "check_points": {"height_m": 1.0, "east_m": 1.0},
    "candidates": CANDIDATES,
}


@pytest.fixture(scope="module")
def found(plan):
    return choosing.of(choosing.from_values(WANTED, plan))


def test_what_is_wanted_is_what_the_plan_of_these_strips_has(found):
    """Boresight angles in degrees, a shift of GNSS, and RMS of check points, by `design.of`."""
    chosen = (0, 1, 3, 5, 8)
    designed = design.of(with_strips(found.target.plan, chosen))
    parameters = tables.parameter_table(designed).set_index("parameter")["sigma"]
    rms = np.sqrt(np.mean(designed.validations["single_step"].points.sigma ** 2, axis=0))
    expected = [parameters[name] for name in WANTED["sigma"]] + [rms[2], rms[0]]
    assert found.planned(designed.plan) == pytest.approx(expected, rel=1e-12)
    assert found.given(chosen) == pytest.approx(expected, rel=0.05)


def test_what_no_choice_gives_is_known_with_what_it_would_need(found):
    (failing,) = found.failing
    assert (failing.camera, failing.name) == ("CAM", "f_mm")
    assert failing.with_all > failing.limit
    assert failing.needs


def test_the_flying_time_is_the_plans(found):
    strips = [*found.target.plan.blocks["calibration"].strips.values()]
    for chosen in ((), (2,), (0, 4, 5)):
        expected = flying_time_s(tuple(strips[k] for k in chosen)) / 60
        assert found.minutes(chosen) == pytest.approx(expected)


def test_what_the_plan_does_not_estimate_cannot_be_wanted(plan):
    wanted = choosing.from_values({"sigma": {"k3": 1.0}}, plan)
    with pytest.raises(
        FlightError, match=r"sigma\.k3: the plan does not estimate it, but f_mm, xp"
    ):
        choosing.of(wanted)


ALL_POINTS = 10_000

SLOW = {
    "gnss_correlation_s": 100.0,
    "gnss_correlated_share": 0.9,
    "attitude_correlation_s": 50.0,
    "attitude_correlated_share": 0.7,
}


@pytest.fixture(
    scope="module",
    params=[((), {}), (["shift", "drift"], {}), (["shift"], SLOW)],
    ids=["white", "drift", "slow"],
)
def everything(request, plan):
    """Return the plan of all candidates, and its network."""
    gnss, slow = request.param
    values = {
        **plan.values,
        "apriori": {**plan.values["apriori"], **slow},
        "stages": {"mounting": {**plan.values["stages"]["mounting"], "gnss": [*gnss]}},
    }
    wanted = {"sigma": {"f_mm": 1.0}, "candidates": CANDIDATES}
    both = choosing.from_values(wanted, plans.from_values(values)).plan
    block = flown.block(both, choosing.BLOCK)
    return both, design.calibrated(both, block, method="single_step").bundle.network


def covariance(plan, block, names):
    """Return the covariance that the library's own adjustment of a block has."""
    bundle = design.calibrated(plan, block, method="single_step").bundle
    columns = np.array([bundle.network.column_names().index(name) for name in names])
    return bundle.solution.inverse.at(columns[:, None], columns)


@pytest.mark.parametrize("chosen", [(1, 3, 7), (0, 1, 2, 5, 6, 8), tuple(range(9))])
def test_the_sum_over_strips_is_the_adjustment_of_their_images(everything, chosen):
    plan, network = everything
    information = of_strips(network, tie_points=ALL_POINTS)
    names = [information.strips[k] for k in chosen]
    block = select_images(network.block, np.isin(network.block.images.strips, names))
    cov, expected = information.covariance(chosen), covariance(plan, block, information.names)
    exact = all(e.correlation is None for e in network.equations(network.start))
    near = 1e-6 if exact else 0.15  # slow errors are correlated from strip to strip, too
    assert np.sqrt(np.diag(cov)) == pytest.approx(np.sqrt(np.diag(expected)), rel=near)


def test_a_part_of_the_tie_points_with_the_weight_of_all_tells_nearly_as_much(everything):
    _, network = everything
    whole, part = (of_strips(network, tie_points=n) for n in (ALL_POINTS, 45))
    for chosen in ((1, 3, 7), range(9)):
        a, b = (np.sqrt(np.diag(one.covariance(chosen))) for one in (whole, part))
        assert b == pytest.approx(a, rel=0.2)


def test_no_strip_makes_anything_worse(everything):
    information = of_strips(everything[1])
    sigma = [np.sqrt(np.diag(information.covariance(range(n)))) for n in range(10)]
    assert np.all(np.diff(sigma, axis=0) <= 1e-9 * sigma[0])


def test_every_image_must_have_a_strip(everything):
    _, network = everything
    images = replace(network.block.images, strips=("",) * len(network.block.images))
    with pytest.raises(ValueError, match="every image must have a strip"):
        of_strips(replace(network, block=replace(network.block, images=images)))


def covering(sets, n):
    """Return a lack that counts what no chosen set has: a problem whose optimum is by hand."""

    def lack(chosen):
        return float(n - len(set().union(*(sets[k] for k in chosen))))

    return lack


def test_one_dear_candidate_gives_way_to_two_cheap_ones():
    lack = covering([{1, 2, 3, 4}, {1, 2}, {3, 4}], 4)
    assert set(cheapest(lack, np.array([10.0, 4.0, 4.0]))) == {1, 2}
    assert cheapest(lack, np.array([7.0, 4.0, 4.0])) == (0,)


def test_what_becomes_superfluous_is_dropped():
    """The greedy step takes the large set first, and the two others have all of it."""
    lack = covering([{2, 3, 4, 5}, {1, 2, 3}, {4, 5, 6}], 6)
    assert set(cheapest(lack, np.ones(3))) == {1, 2}


def test_a_choice_costs_no_more_than_is_allowed_and_then_lacks_least():
    lack = covering([{1}, {2, 3}, {4, 5, 6}, {1, 2, 3, 4}], 6)
    assert cheapest(lack, np.ones(4), most=1.0) == (3,)
    assert cheapest(lack, np.ones(4), most=0.5) == ()
    assert len(cheapest(lack, np.ones(4), most=2.0)) == 2


def test_no_choice_is_far_from_the_best_of_all():
    rng = np.random.default_rng(3)
    for _ in range(40):
        sets = [set(rng.integers(0, 30, 8).tolist()) for _ in range(9)]
        cost = rng.uniform(1.0, 3.0, 9)
        lack = covering(sets, len(set().union(*sets)))
        found = cheapest(lack, cost)
        assert lack(found) == 0
        best = min(
            cost[list(one)].sum()
            for n in range(10)
            for one in combinations(range(9), n)
            if lack(one) == 0
        )
        assert cost[list(found)].sum() <= 1.05 * best


def test_the_first_is_the_one_that_takes_off_most_for_its_cost():
    lack = covering([{1}, {2, 3, 4}, {5, 6}], 6)
    assert in_order((0, 1, 2), lack, np.array([1.0, 2.0, 1.0])) == (2, 1, 0)


def test_a_cost_must_be_positive():
    with pytest.raises(ValueError, match=r"cost must be positive, got 0\.0"):
        cheapest(covering([{1}], 1), np.zeros(1))


def of(plan, **wanted):
    return choosing.of(choosing.from_values({**wanted, "candidates": CANDIDATES}, plan))


@pytest.fixture(scope="module")
def some(plan):
    return of(plan, sigma={"f_mm": 0.003, "lever_x_m": 0.04, "boresight_kappa_deg": 0.004})


def test_the_choice_meets_the_target_as_a_plan_of_its_own(some):
    found = choosing.choose(some)
    assert found.met
    assert found.given == pytest.approx(some.planned(found.plan))
    assert np.all(found.given <= some.limits)
    again = plans.from_values(found.plan.values)
    assert again.blocks["calibration"].strips == found.plan.blocks["calibration"].strips


@pytest.mark.parametrize("share", [1.1, 1.4, 2.0, 3.0])
def test_no_choice_of_a_small_set_is_cheaper_by_more_than_a_twentieth(plan, share):
    """All 511 choices, by the same tie points."""
    names = ("f_mm", "lever_x_m", "lever_z_m", "boresight_omega_deg", "boresight_kappa_deg")
    easy = of(plan, sigma=dict.fromkeys(names, 100.0))
    limits = share * easy.given(range(9)) * [1.0, 1.2, 1.0, 1.1, 1.0]
    order = choosing.searched(easy, limits, np.inf)
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
    few = choosing.of(choosing.from_values({"sigma": wanted, "candidates": strips}, plan))
    found = choosing.choose(few)
    assert found.met
    every = [one for n in range(1, 6) for one in combinations(range(5), n)]
    reaching = [
        few.minutes(one)
        for one in every
        if np.all(few.planned(choosing.with_strips(few.target.plan, one)) <= few.limits)
    ]
    assert 0 < len(reaching) < len(every)
    assert found.minutes <= 1.05 * min(reaching)


def test_what_a_strip_buys_ends_with_what_the_plan_gives(some):
    found = choosing.choose(some)
    assert found.after[-1] == pytest.approx(found.given)
    assert np.all(np.diff(found.after, axis=0) <= 0)
    assert np.all(found.without >= found.given)
    assert np.all((found.without > some.limits).any(axis=1))  # every strip is needed
    assert np.all(np.diff(found.minutes_after) > 4)  # a turn takes four minutes


def test_what_is_missed_in_a_short_time_is_known(some):
    found = choosing.choose(some, minutes=5)
    assert not found.met
    assert found.minutes <= 5
    assert len(found.strips) == 2
    assert found.minutes < choosing.choose(some).minutes


def test_check_points_alone_choose_strips(plan):
    easy = of(plan, check_points={"height_m": 10.0})
    rms = easy.wanted[0].with_all
    found = choosing.choose(of(plan, check_points={"height_m": 1.1 * rms}))
    assert found.met
    designed = design.of(found.plan).validations["single_step"].points.sigma
    assert found.given == pytest.approx(np.sqrt(np.mean(designed[:, 2] ** 2)))


def test_tables_have_a_row_for_every_strip_and_every_wish(some):
    found = choosing.choose(some)
    strips, wanted = choosing.strips(found), choosing.wanted(found)
    assert len(strips) == len(found.strips) * len(wanted)
    assert [*wanted.chosen] == pytest.approx(found.given)
    assert [*strips.after[-len(wanted) :]] == pytest.approx(found.given)
    assert strips.strip.iloc[0] == found.strips[0]
