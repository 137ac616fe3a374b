"""Chapter 9 changed as it suggests, and what one flight of each kind says."""

import numpy as np
import pytest

import acx4sim
from acx4book.chapters import error_budget, weights
from acx4book.chapters.failures import standardised, worst
from acx4book.chapters.image_quality import examined
from acx4files import flight as flights
from acx4files.stages import mounting
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

TIME = "share, constant_s = 0.95, 600.0"
AIR = 'replace(weights.EXACT, refraction="standard")'


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by the change, on the flight of an ideal camera."""
    flight, results = tmp_path_factory.mktemp("flight") / "ideal", tmp_path_factory.mktemp("run")
    acx4sim.write(acx4sim.DESIGNS["acx4-ideal"](seed=1), flight)
    mounting.run(flights.read(flight), results)

    def one(changes=None, n_flights=1):
        places = {"flight_path": flight, "results_path": results}
        return changed("09", changes, **places, n_flights=n_flights)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run(n_flights=2)


def diagnosis(names):
    return {one.group: one for one in names["diagnosis"]}


def test_sigma_that_are_wrong_are_diagnosed_and_estimated(as_it_is):
    heading = diagnosis(as_it_is)["heading"]
    assert abs(heading.factor - 0.5) < 3.3 * heading.sigma
    assert as_it_is["estimated"]["heading"] == pytest.approx(heading.factor, rel=0.05)
    assert as_it_is["estimated"]["control plan"] == 1.0


def test_the_geometry_promises_what_the_adjustment_states(as_it_is):
    """To the root of the variance of unit weight, and to how far the declared values are off."""
    found = weights.promised(as_it_is["promised"], as_it_is["single"].calibration)
    root = np.sqrt(as_it_is["single"].bundle.solution.sigma0_sq)
    np.testing.assert_allclose(found["ratio"], root, rtol=0.1)
    assert list(as_it_is["reached"]["state"]) == ["holds"] * 6


def test_the_covariance_by_hand_is_that_of_the_weights(as_it_is):
    assert as_it_is["by_hand"] == pytest.approx(as_it_is["library"], rel=1e-9)


def test_the_library_undoes_the_simulators_refraction(as_it_is):
    """Two implementations: Snell's law by layers, and the integral of the density."""
    without, within = (as_it_is["ratio"][model].droplevel("unit") for model in ("none", "standard"))
    assert abs(without["f"]) > 1
    assert abs(without["lever z"]) > 0.8
    # refractive indices differ by 0.1 %, and so do K and what is left of it
    assert np.all(np.abs(within) <= 0.003)


def test_errors_that_change_faster_average_out_better(run, as_it_is):
    def most(names):
        pair = {"independent": names["single"], "slow": names["slowly"]}
        return weights.of_boresight(weights.side_by_side(pair))[1]

    short = run({TIME: "share, constant_s = 0.95, 60.0"})
    assert 1 < most(short) < most(as_it_is)
    assert short["by_hand"] == pytest.approx(short["library"], rel=1e-9)


def test_a_model_of_refraction_that_is_not_there_does_harm(run, as_it_is):
    vacuum = run({AIR: "weights.EXACT"})
    with_model = vacuum["ratio"]["standard"].droplevel("unit")
    assert with_model["f"] == pytest.approx(-as_it_is["ratio"]["none"][("f", "mm")], rel=0.05)
    assert np.all(np.abs(vacuum["ratio"]["none"]) <= 0.003)


# --- What notebook 10 says of its changes is seen in its tables


DRAWN = "wrong = examined.drawn_calibration(heads, seed=2, angle_deg={})"
TARGETS = "targets = examined.border_distortion_of_targets(known, {}, seed=1)"


@pytest.mark.slow
def test_drawn_angles_and_errors_of_targets_go_where_the_text_says():
    old, new = TARGETS.format("200, sigma_px=0.5"), TARGETS.format("50, sigma_px=0.1")
    found = changed("10", {old: new, DRAWN.format(0.01): DRAWN.format(0.03)}, reduce=16)
    known, after = found["known"], found["geometry"]
    before = changed("10", {}, reduce=16)["geometry"]
    ratio = {way: after[way]["oriented_px"] / before[way]["oriented_px"] for way in after}
    assert 2 < ratio["mean shift"] < 4
    assert ratio["rotations"] == pytest.approx(1, abs=0.2)  # with tie points of coarse pictures
    targets = examined.border_distortion_of_targets(known, 50, sigma_px=0.5, seed=1)
    invented = np.median(found["targets"].radial_px)
    assert np.median(targets.radial_px) == pytest.approx(5 * invented, rel=0.02)


# --- Chapter 12 changed as it suggests; its one flight is the first of those that are stored


FLIGHT = 'simulated.fly_and_read("acx4", 1, blocks'


@pytest.fixture(scope="module")
def as_it_is_12():
    return changed("12")


def sigma0_sq(names):
    return names["single"].bundle.solution.sigma0_sq


def rms(names, way):
    return names["compared"].loc[way, "points"]["RMS"].to_numpy()


def test_the_one_flight_is_the_first_of_the_stored_ones(as_it_is_12):
    stored = as_it_is_12["study"]
    own = stored.parameters.query("seed == 1 and way == 'synthetic'").set_index("parameter")
    f = as_it_is_12["single"].table().droplevel("unit").loc["f"]
    assert f["value"] == pytest.approx(own["value"]["f_mm"], abs=1e-5)
    assert f["sigma"] == pytest.approx(own["sigma"]["f_mm"], rel=1e-4)
    points = stored.points.query("seed == 1 and over == 'points'").set_index(["way", "axis"])
    for way in ("synthetic", "rig"):
        np.testing.assert_allclose(rms(as_it_is_12, way), points["rms_m"][way], rtol=1e-4)


def test_the_rise_by_hand_is_the_closed_form(as_it_is_12):
    closed = as_it_is_12["synthetic_cost"].apparent_rise_m(
        as_it_is_12["side_m"], as_it_is_12["f_mm"], as_it_is_12["size_mm"]
    )
    assert as_it_is_12["by_hand"] == pytest.approx(closed, rel=1e-4)  # 400 points a side


def test_steps_at_the_seams_stay_where_nothing_has_noise():
    exact = changed("12", {FLIGHT: 'simulated.fly_and_read("acx4", 1, simulated.EXACT, blocks'})
    assert exact["rig"].bundle.solution.sigma0_sq < 1e-3
    assert sigma0_sq(exact) == pytest.approx(0.060, abs=0.005)  # of the stored flights


# --- Chapter 14: what mistakes leave, what commands say of them, and what is computed by hand


@pytest.fixture(scope="module")
def as_it_is_14():
    return changed("14")


@pytest.fixture(scope="module")
def found(as_it_is_14):
    return as_it_is_14["examined"]


def test_without_a_mistake_nothing_is_said_and_residuals_are_as_large_as_sigma(found):
    clean = found["no mistake"]
    assert clean.check == clean.run == ()
    assert not clean.named
    assert np.all(np.abs(standardised(clean) - 1) < 0.3)
    assert worst(clean)["off"] < 3.5


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("wrong sign", "pitch of opposite sign"),
        ("angles exchanged", "roll, pitch exchanged"),
        ("coordinates exchanged", "east_m and north_m were swapped in control_points.csv"),
        ("convergence", "heading from grid north"),
        ("delay", "s late"),
    ],
)
def test_check_names_the_mistake_before_any_adjustment(found, name, words):
    assert any(words in line for line in found[name].check)


def test_run_names_the_height_system_and_what_few_strips_leave_weak(found):
    assert any("height system of control or trajectory" in line for line in found["geoid"].run)
    assert any("CAM f_mm is weak" in line for line in found["one direction"].run)


@pytest.mark.parametrize(
    ("name", "parameter", "by"),
    [
        ("convergence", "boresight_kappa_deg", 1.22),  # of PROJ, at the field
        ("geoid", "lever_z_m", -45.0),
        ("delay", "lever_x_m", -7.0),  # 70 m/s
    ],
)
def test_a_constant_mistake_goes_into_a_parameter_that_claims_to_be_certain(
    found, name, parameter, by
):
    off = worst(found[name])
    assert off.name == parameter
    assert off["error"] == pytest.approx(by, rel=0.02)
    assert off["off"] > 100


def test_one_direction_leaves_no_residual_and_large_sigmas(as_it_is_14):
    assert standardised(as_it_is_14["examined"]["one direction"]).max() < 1.5
    assert as_it_is_14["ratio"].min() > 1
    assert as_it_is_14["ratio"]["f_mm"] > 10


def test_residuals_of_a_wrong_sign_are_those_of_the_library_and_twice_the_angle(as_it_is_14):
    np.testing.assert_allclose(as_it_is_14["by_hand"], as_it_is_14["library"], rtol=1e-9)
    both = np.sqrt(np.mean(as_it_is_14["library"][:2] ** 2))
    rms = standardised(as_it_is_14["examined"]["wrong sign"])
    assert both == pytest.approx(rms["roll, pitch"], rel=1e-6)
    assert np.corrcoef(as_it_is_14["twice"], as_it_is_14["pitch"])[0, 1] > 0.99
    assert as_it_is_14["reading"].name == "pitch of opposite sign"


def test_a_mistake_of_a_reader_is_planted_in_the_same_way():
    """Heights that are 5 m wrong in place of 45 m move the lever arm by 5 m."""
    other = changed("14", {'control["height_m"] - 45.0': 'control["height_m"] - 5.0'})
    assert worst(other["examined"]["geoid"])["error"] == pytest.approx(-5.0, rel=0.05)


# --- Chapter 15: what planned flights determine, what is computed by hand, and a plan of
# one's own


NEVER = "design.explorer(plan)"
"""The figure that moves has flights of its own, which take long."""


@pytest.fixture(scope="module")
def as_it_is_15():
    return changed("15", {NEVER: "None"})


def test_equal_heights_leave_f_and_z_nearly_one_number(as_it_is_15):
    assert as_it_is_15["library"] == pytest.approx(as_it_is_15["by_hand"], rel=0.05)


def test_two_heights_matter_to_f_and_z(as_it_is_15):
    gain = as_it_is_15["by_ratio"][1.0] / as_it_is_15["by_ratio"][1.5]
    assert gain[["f_mm", "lever_z_m"]].min() > 5
    assert gain.drop(["f_mm", "lever_z_m"]).max() < 2


def test_opposite_directions_matter_to_what_turns_with_the_aircraft(as_it_is_15):
    gain = as_it_is_15["by_turn"][0.0] / as_it_is_15["by_turn"][180.0]
    assert gain[["lever_x_m", "lever_y_m"]].min() > 5
    assert gain[["xp_mm", "yp_mm", "boresight_omega_deg", "boresight_phi_deg"]].min() > 1.5
    assert gain[["f_mm", "lever_z_m", "boresight_kappa_deg"]].max() < 1.2


def test_kappa_is_a_mean_of_headings(as_it_is_15):
    pairs, one_way = as_it_is_15["by_pairs"], as_it_is_15["by_same_way"]
    means = [0.008 / np.sqrt(28 * n) for n in pairs.columns]
    assert pairs.loc["boresight_kappa_deg"].tolist() == pytest.approx(means, rel=0.03)
    assert one_way.loc["boresight_kappa_deg"].tolist() == pytest.approx(means, rel=0.03)
    assert as_it_is_15["by_formula"].tolist() == pytest.approx(means)
    assert as_it_is_15["n"] == pytest.approx(256)


def test_the_cheapest_good_flight_is_cheaper_and_within_what_is_allowed(as_it_is_15):
    table, cheapest = as_it_is_15["table"], as_it_is_15["cheapest"]
    assert table.loc["minutes", cheapest] < table.loc["minutes", "the paper's"]
    ratio = table[cheapest] / table["the paper's"]
    assert ratio[as_it_is_15["wanted"]].max() <= 1.5


# --- Chapter 16 changed as it suggests, and what it computes by hand and in its exercises


READ = "block, calibrations = before.block, before.calibrations\n"


@pytest.fixture(scope="module")
def run_16(tmp_path_factory):
    """What the cells define, by the change, on the flight of an ideal camera."""
    flight, results = tmp_path_factory.mktemp("flight") / "ideal", tmp_path_factory.mktemp("run")
    acx4sim.write(acx4sim.DESIGNS["acx4-ideal"](seed=1), flight)
    mounting.run(flights.read(flight), results)

    def one(changes=None):
        return changed("16", changes, flight_path=flight, results_path=results)

    return one


def forgotten(part):
    """Return the change that forgets a part of every calibration."""
    each = f"{{name: forgotten.{part}(one) for name, one in calibrations.items()}}"
    how = "from acx4lib.georeferencing import forgotten\n"
    return {READ: f"{READ}{how}calibrations = {each}\n"}


@pytest.fixture(scope="module")
def as_it_is_16(run_16):
    return run_16()


def groups(names):
    return error_budget.groups(names["validations"], names["points"], names["pairs"])


def test_a_point_by_hand_has_the_sigma_of_the_library(as_it_is_16):
    np.testing.assert_allclose(as_it_is_16["by_hand"], as_it_is_16["library"], rtol=1e-9)


def test_exercises_are_solved_in_two_ways(as_it_is_16):
    found = as_it_is_16
    assert found["by_roll"] == pytest.approx(found["by_image"], rel=1e-6)
    assert np.degrees(found["half"]) == pytest.approx(0.002155, abs=1e-6)  # 2.8 um / 74.44 mm
    ratio = np.sqrt(np.sum(found["x_few"] ** 2) / np.sum(found["x_many"] ** 2))
    assert found["many"] / found["few"] == pytest.approx(ratio, rel=1e-6)
    assert found["best"] == pytest.approx(found["trials"][np.argmin(found["harm"])], abs=50)
    assert 1000 <= found["best"] <= 1500
    assert found["after"].rms[2] == pytest.approx(0.8 * found["before"].rms[2], rel=1e-3)


def test_a_forgotten_lever_arm_leaves_the_shares_and_makes_larger_differences(run_16, as_it_is_16):
    row, share = ("Single-step", "all", "height"), "calibration (%)"
    before, after = groups(as_it_is_16).loc[row], groups(run_16(forgotten("lever_arm"))).loc[row]
    assert after[share] == pytest.approx(before[share], rel=0.2)
    assert after["RMS of d / σ"] > 1.2 * before["RMS of d / σ"]
