"""Flights of five plans, clean and spoilt, and what becomes of them."""

import tomllib

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from benchmarks.verdicts import faults, flights, sizes
from benchmarks.verdicts.faults import FAULTS, PLANS
from benchmarks.verdicts.sizes import Pilot, Statistic
from support.helpers import repeats


def order(plan, fault="", size=0.0, *, seed=1):
    return flights.Order(purpose="clean", plan=plan, fault=fault, size=size, seed=seed)


def tables(plan, fault="", size=0.0):
    return faults.fly(plan, 1, fault, size)[0].tables


# --- flights ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("plan", [repeats(plan) if n else plan for n, plan in enumerate(PLANS)])
def test_every_parameter_of_a_clean_flight_is_determined(plan):
    for seed in (1, 2, 3):
        row = flights.judged(order(plan, seed=seed))
        assert (row["status"], row["error"]) == (0, "")


@pytest.mark.slow
def test_a_row_has_the_state_of_every_question_of_the_report():
    row = flights.judged(order("no-control"))
    states = {value for key, value in row.items() if key not in flights.KEYS}
    assert {"holds", "untested", "note"} <= states
    assert row["Independent check points"] in {"holds", "fails"}
    assert row["holds"] == int("fails" not in states)


@pytest.mark.slow
def test_a_step_of_the_boresight_is_found_and_a_gross_error_is_taken_out():
    step = flights.judged(order("two-heights-crossing", "step", 0.03))
    assert step["Boresight stable over time"] == "fails"
    gross = flights.judged(order("two-heights-crossing", "gross errors", 3.0))
    assert [gross[f"found: {kind}"] for kind in ("image_point", "gnss", "control_point")] == [1] * 3


def test_a_flight_that_cannot_be_calibrated_has_a_row():
    row = flights.judged(order("flat", "datum in plan", 50_000.0))
    assert row["status"] == 2
    assert "control_points.csv" in row["error"]
    assert "/tmp" not in row["error"]


# --- faults ----------------------------------------------------------------------------------


BOTH = {faults.TRAJECTORY, "validation/trajectory.csv"}
CHANGED = {
    "step": {faults.TRAJECTORY},
    "sigma of image points": {faults.POINTS, "validation/image_points.csv"},
    "sigma of GNSS": BOTH,
    "sigma of attitudes": BOTH,
    "gross errors": {faults.TRAJECTORY, faults.POINTS, "control_points.csv"},
    "delay": {faults.TRAJECTORY},
    "delay in both": BOTH,
    "lever arm": set(),
    "datum in plan": set(faults.SURVEYED),
    "datum in height": set(faults.SURVEYED),
}
"""Tables that are not as in a clean flight."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_changes_its_own_tables_and_no_other(fault):
    clean, spoilt = tables("flat"), tables("flat", fault, FAULTS[fault].begin("flat"))
    assert {path for path in clean if not clean[path].equals(spoilt[path])} == CHANGED[fault]


def test_a_step_turns_the_camera_before_the_second_half_of_the_strips():
    clean, spoilt = (tables("flat", *f)[faults.TRAJECTORY] for f in ((), ("step", 0.3)))
    turns = [
        Rotation.from_euler("ZYX", t[["heading_deg", "pitch_deg", "roll_deg"]], degrees=True)
        for t in (clean, spoilt)
    ]
    turn_deg = (turns[0].inv() * turns[1]).as_rotvec(degrees=True)
    second = clean["exposure"].str[1].astype(int) > 2
    assert turn_deg[second] == pytest.approx(np.tile([0.3, 0, 0], (second.sum(), 1)))
    assert turn_deg[~second] == pytest.approx(0.0)


def test_a_held_focal_length_is_off_by_its_size_and_the_tables_are_those_of_the_design():
    right, wrong = (faults.holding("single-head", 1, size) for size in (0.0, 0.4))
    (right_mm, free), (wrong_mm, held) = (
        (toml["cameras"]["CAM"]["focal_mm"], toml["stages"]["mounting"]["estimate"])
        for toml in (tomllib.loads(flight.toml) for flight in (right, wrong))
    )
    assert wrong_mm - right_mm == pytest.approx(0.4)
    assert [name for name in free if name not in held] == ["f_mm"]
    assert all(right.tables[path].equals(wrong.tables[path]) for path in right.tables)


@pytest.mark.slow
def test_a_wrong_focal_length_that_the_mounting_holds_fails_and_is_named_first():
    (orders, *_) = flights.holding(1)
    row = flights.judged(orders[0])
    assert (row["holds"], row["Held values"]) == (0, "fails")
    assert row["rejected"].split()[0] == "CAM/f_mm"


@pytest.mark.repeats
@pytest.mark.slow
def test_the_studys_flight_holds_and_names_the_focal_lengths_of_its_four_heads():
    (_, orders) = flights.holding(1)
    row = flights.judged(orders[0])
    assert (row["holds"], row["Held values"]) == (1, "minor")
    assert {f"CAM{k}/f_mm" for k in (1, 2, 3, 4)} <= set(row["rejected"].split())


def test_sigma_is_stated_too_small_and_not_changed_with_the_noise():
    clean = faults.fly("flat", 1)[0]
    spoilt = faults.fly("flat", 1, "sigma of GNSS", 1.5)[0]
    assert clean.toml == spoilt.toml
    heights = [f.tables[faults.TRAJECTORY]["height_m"] for f in (clean, spoilt)]
    assert not np.allclose(*heights, rtol=0, atol=1e-3)
    assert "sigma_height_m" not in spoilt.tables[faults.TRAJECTORY]


def test_gross_errors_have_their_size_and_are_named():
    clean, (spoilt, planted) = tables("flat"), faults.fly("flat", 1, "gross errors", 2.0)
    names = {
        faults.POINTS: ["col_px", "row_px"],
        faults.TRAJECTORY: ["height_m"],
        "control_points.csv": ["height_m"],
    }
    keys = {
        faults.POINTS: ["image", "point"],
        faults.TRAJECTORY: ["exposure"],
        "control_points.csv": ["point"],
    }
    found = {}
    for path, columns in names.items():
        moved = (spoilt.tables[path][columns] - clean[path][columns]).abs().sum(axis=1)
        (row,) = np.flatnonzero(moved > 1e-9)
        found[path] = moved[row], [*clean[path].loc[row, keys[path]]]
    assert [size for size, _ in found.values()] == pytest.approx([4.0, 0.32, 0.32])
    assert [[part for part in one[1:] if part] for one in planted] == [
        key for _, key in found.values()
    ]


def test_where_there_is_no_control_no_control_point_is_wrong():
    kinds = [kind for kind, *_ in faults.fly("no-control", 1, "gross errors", 2.0)[1]]
    assert kinds == ["image_point", "gnss"]


def test_declared_mountings_are_off_by_what_their_sigma_promises():
    errors = []
    for seed in range(400):
        values = {
            "cameras": {"A": {"lever_sigma_m": 0.02, "mount_sigma_deg": 0.05}},
            "truth": {"A": {"lever_z_m": -0.3, "mount_phi_deg": 30.0, "mount_kappa_deg": 90.0}},
        }
        faults.declare(values, np.random.default_rng(seed))
        own = values["cameras"]["A"]
        true, said = (
            Rotation.from_euler("XYZ", [of.get(key, 0.0) for key in faults.MOUNT], degrees=True)
            for of in (values["truth"]["A"], own)
        )
        turn = (said * true.inv()).as_rotvec(degrees=True) / 0.05
        errors.append([*turn, (own["lever_z_m"] + 0.3) / 0.02])
    squares = np.sum(np.square(errors), axis=0)
    assert np.all(squares > stats.chi2.ppf(1e-3, 400))
    assert np.all(squares < stats.chi2.isf(1e-3, 400))


# --- all flights -----------------------------------------------------------------------------


def test_flights_at_any_time_are_spread_evenly():
    kinds = [
        flights.of_kind("clean", "flat", "", 0.0, 20),
        flights.of_kind("spoilt", "flat", "step", 0.1, 6),
    ]
    turns = flights.in_turns(kinds)
    assert len(turns) == 26
    for n in range(1, 27):
        clean = sum(one.purpose == "clean" for one in turns[:n])
        assert abs(clean - n * 20 / 26) <= 1


def test_no_seed_is_flown_for_two_purposes():
    of = {p: flights.of_kind(p, "flat", "", 0.0, 100) for p in ("spoilt", "third", "pilot", "slow")}
    of["clean"] = flights.of_kind("clean", "flat", "", 0.0, flights.N_CLEAN)
    seeds = [one.seed for kind in of.values() for one in kind]
    assert len(seeds) == len(set(seeds))


@pytest.mark.repeats
@pytest.mark.slow
def test_a_flight_that_has_a_row_of_this_code_is_not_flown_again(tmp_path, monkeypatch):
    orders = flights.of_kind("clean", "no-control", "", 0.0, 2)
    first = flights.fly_all(orders[:1], tmp_path, 1)
    assert first["seed"].tolist() == [orders[0].seed]
    both = flights.fly_all(orders, tmp_path, 1)
    assert both["seed"].tolist() == [one.seed for one in orders]
    flown = []
    monkeypatch.setattr(flights, "as_finished", lambda _, __, missing: flown.extend(missing) or ())
    assert len(flights.fly_all(orders, tmp_path, 1)) == 2
    assert not flown
    monkeypatch.setattr(flights, "source", lambda: "another")
    assert flights.fly_all(orders, tmp_path, 1).empty
    assert flown == orders


# --- sizes -----------------------------------------------------------------------------------


def test_pilots_fly_every_fault_in_both_directions_and_every_plan_without_any():
    kinds = {(kind[0].plan, kind[0].fault, kind[0].size) for kind in flights.pilots(2)}
    assert {(plan, "", 0.0) for plan in PLANS} < kinds
    for fault, of in FAULTS.items():
        for plan in of.plans:
            begin = of.begin(plan)
            both = {(-1.0, 0.0)} if of.scales else {(begin, -begin)}
            expected = set() if plan in of.known else {(plan, fault, s) for s in both.pop()}
            assert expected == {kind for kind in kinds if kind[:2] == (plan, fault)}


def test_the_stored_flights_have_the_sizes_that_the_stored_pilots_predict():
    predicted = flights.sizes_of(pd.DataFrame(flights.rows_of(flights.OUT / "verdicts_pilots.csv")))
    flown = pd.DataFrame(flights.rows_of(flights.OUT / "verdicts.csv"))
    own = flown[flown["purpose"] == "spoilt"]
    for (plan, fault), flown_at in own.groupby(["plan", "fault"])["size"]:
        assert flown_at.unique() == pytest.approx([predicted[plan, fault]], rel=1e-3)


# --- predicted sizes of faults -----------------------------------------------------------------


N = 400_000


def test_a_shift_is_found_as_often_as_noncentral_sums_of_squares_fail(rng):
    test = Statistic(name="lever arm of CAM", value=0.0, dof=3)
    shift = np.array([1.0, -2.0, 2.5])
    squares = np.sum((rng.normal(size=(N, 3)) + shift) ** 2, axis=1)
    counted = np.mean(squares > stats.chi2.isf(0.0025, 3))
    assert test.found(0.0025, shift=shift @ shift) == pytest.approx(counted, abs=0.003)


def test_a_turn_is_found_as_often_as_ratios_of_variances_fail(rng):
    test = Statistic(name="strips", value=0.0, dof=9, beside=40.0)
    noise = rng.normal(size=(N // 4, 49))
    noise[:, 0] += 5.0
    f = np.mean(noise[:, :9] ** 2, axis=1) / np.mean(noise[:, 9:] ** 2, axis=1)
    counted = np.mean(f > stats.f.isf(0.0025, 9, 40))
    assert test.found(0.0025, shift=25.0) == pytest.approx(counted, abs=0.006)


def test_noise_is_found_on_both_sides_and_only_where_it_matters(rng):
    squares = np.sum(rng.normal(size=(N // 4, 40)) ** 2, axis=1)
    low, high = stats.chi2.ppf(0.0125, 40), stats.chi2.isf(0.0125, 40)
    for factor in (0.4, 1.0, 2.2):
        counted = np.mean((factor * squares < low) | (factor * squares > high))
        found = Statistic(name="all together", value=0.0, dof=40).found(0.025, factor=factor)
        assert found == pytest.approx(counted, abs=0.006)
    rejected = np.where(np.abs(noise := 1.6 * rng.normal(size=(N // 4, 40))) > 3.9, 0.0, noise)
    counted = np.mean(np.sum(rejected**2, axis=1) > stats.chi2.isf(0.00125, 40))
    snooped = Statistic(name="sigma of heading", value=0.0, dof=40)
    assert snooped.found(0.0025, factor=1.6**2) == pytest.approx(counted, abs=0.01)
    many = Statistic(name="rays", value=0.0, dof=5000)
    assert many.found(0.05, factor=1.12) < 1e-3  # significant, but by less than a tenth of sigma


def row(values, *, dof=3.0, name="lever arm of CAM"):
    return [
        pd.Series(
            {sizes.VALUE + name: v, sizes.DOF + name: dof, sizes.BESIDE + name: np.inf}
            | {"n_tests": 20}
        )
        for v in values
    ]


def test_pilots_tell_the_noncentrality_without_their_noise(rng):
    noise, shift = rng.normal(size=3), np.array([0.4, 0.1, -0.3])
    squares = [np.sum((noise + k * shift) ** 2) for k in (0, 1, -1)]
    ((_, growth),) = sizes.shifted(*row(squares), size=0.5).tests
    assert growth == pytest.approx(shift @ shift / 0.25, rel=1e-12)


def test_the_size_is_that_of_which_80_percent_are_found():
    """One normal test at 5 % of 20: the quantiles of its level and of its power are added."""
    pilot = sizes.shifted(*row([0.0, 9.0, 9.0], dof=1.0), size=0.15)  # three sigma
    beyond = (stats.norm.isf(0.05 / 20 / 2) + stats.norm.ppf(0.8)) / 3 * 0.15
    assert sizes.predicted([pilot, pilot], 0.15) == pytest.approx(beyond, rel=0.005)


def test_independent_tests_find_more_and_those_of_the_same_residuals_do_not():
    def of(*names):
        tests = tuple((Statistic(name=n, value=0.0, dof=4), 10.0) for n in names)
        return Pilot(tests=tests, n_tests=20.0, scales=False).found(1.0)

    rays, arm = of("rays"), of("lever arm of CAM")
    assert of("rays", "lever arm of CAM") == pytest.approx(1 - (1 - rays) * (1 - arm))
    assert of("mean east", "mean north") == pytest.approx(of("mean east"))


def test_a_fault_that_no_test_sees_has_no_size():
    assert np.isnan(sizes.predicted([sizes.shifted(*row([2.0, 2.0, 2.0]), size=0.15)], 0.15))


def test_larger_noise_enlarges_sums_of_squares_of_residuals_by_the_known_share(rng):
    """v = W e with the projector W; the noise of one group is s times what is stated."""
    W = np.eye(60) - (q := np.linalg.qr(rng.normal(size=(60, 25)))[0]) @ q.T
    own = np.arange(60) < 20
    r, square = np.trace(W[:20, :20]), np.sum(W[:20, :20] ** 2)
    s = 1.7
    v = W @ (rng.normal(size=(60, 40_000)) * np.where(own, s, 1.0)[:, None])
    counted = np.mean(np.sum(v[:20] ** 2, axis=0))
    dof = r**2 / square
    name = "sigma of GNSS, plan"
    noisy = row([0.0], dof=dof, name=name)[0]
    noisy[sizes.BESIDE + name] = r
    ((_, growth),) = sizes.scaled(noisy, noisy, noisy, groups=("GNSS, plan",)).tests
    assert (dof + (s**2 - 1) * growth) * r / dof == pytest.approx(counted, rel=0.01)


OTHERS = ("p: Gross errors", "p: Held values")
"""Questions whose tests have no statistic of their own in a flight's row."""


@pytest.mark.slow
def test_the_statistics_of_a_flight_are_those_of_the_report():
    """Every p of the report but of the groups is the tail of the statistic's own distribution."""
    made = flights.Order(purpose="pilot", plan="oblique-heads", fault="", size=0.0, seed=3501)
    again = flights.Order(purpose="clean", plan="oblique-heads", fault="", size=0.0, seed=3501)
    report = flights.judged(again)
    p = [v for k, v in report.items() if k.startswith("p: ") and not k.startswith(OTHERS)]
    found = []
    for test in sizes.from_row(pd.Series(flights.judged(made))):
        of = stats.chi2(test.dof)
        if test.family == "boresight":
            of = stats.f(test.dof, test.beside, scale=test.dof)
        above, below = of.sf(test.value), of.cdf(test.value)
        found.append(2 * min(above, below) if test.two_sided else above)
    assert len(found) == len(p)
    exact = [a for a, b in zip(sorted(found), sorted(p), strict=True) if abs(a / b - 1) < 0.2]
    assert len(exact) == len(p)
