"""Systematic mistakes, from the files of a flight to the words of a run and of its report."""

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4book.command import acx4
from acx4book.notebooks import runner
from acx4files import flight as flights
from acx4files.results import folder
from acx4files.stages import mounting, order
from acx4lib.bundle.variance_components import BOUNDS, Component
from acx4lib.calibration.diagnosis import confirmations
from support.flights.simulated import read_back
from support.flights.written import TOML, TRAJECTORY, change, replace
from support.helpers import repeats
from support.run_results import state

SINGLE = "mounting/single_step"
LEVER = "lever_x_m = {}\nlever_y_m = 0.09\nlever_z_m = -0.34\n"
SPEED = 70.0


def written(tmp_path, design="single-head", **options):
    path = tmp_path / "flight"
    options = acx4sim.Options(blocks=("calibration",), **options)
    acx4sim.write(acx4sim.DESIGNS[design](seed=3, options=options), path)
    return path


def calibrated(path, tmp_path):
    """Return the summary of the single step and what it rejected."""
    mounting.run(flights.read(path), tmp_path / "results")
    found = folder.read(tmp_path / "results")
    rejected = found.rejected[found.rejected["method"] == "single_step"]
    return found.summary[SINGLE], rejected


def declare(path, lines):
    replace(path, TOML, "mount_kappa_deg = 90.0", f"{lines}mount_kappa_deg = 90.0")


@pytest.mark.parametrize(
    ("design", "column", "component"),
    [
        ("single-head", "pitch_deg", "pitch"),
        repeats("single-head", "roll_deg", "roll"),
        repeats("acx4-ideal", "phi_deg", ""),
        ("acx4-ideal", "omega_deg", ""),
    ],
)
def test_a_wrong_sign_is_named_and_nothing_of_the_attitudes_is_rejected(
    tmp_path, design, column, component
):
    path = written(tmp_path, design)
    change(path, TRAJECTORY, lambda t: t.assign(**{column: -t[column]}))
    entry, rejected = calibrated(path, tmp_path)
    group, n_rejected, n = entry["stopped_groups"][0]
    assert group.startswith("attitudes")
    assert component in group
    assert n_rejected > n / 2
    assert not (rejected["kind"] == "attitude").any()
    assert SINGLE in order.CONSISTENT  # so the run ends with status 1 and prints this line
    (line,) = entry["stopped"]
    assert f"would reject {n_rejected} of {n} {group}" in line
    assert entry["not_determined"] == []


def test_the_command_names_the_reading_that_fits(tmp_path, capsys):
    path = written(tmp_path)
    change(path, TRAJECTORY, lambda t: t.assign(roll_deg=-t["roll_deg"]))
    with pytest.raises(SystemExit) as ended:
        acx4.main(["run", "--numbers-only", str(path), "--results", str(tmp_path / "results")])
    assert ended.value.code == 1
    *_, stopped, reading = capsys.readouterr().err.splitlines()
    assert stopped.startswith(f"{SINGLE}: ")
    assert reading.startswith("block calibration: with roll of opposite sign")


def _late(table, delay_s):
    """Shift geographic positions along the flight, at a constant speed over ground."""
    heading, lat = np.radians(table["heading_deg"]), np.radians(table["lat_deg"])
    along_m = SPEED * delay_s
    return table.assign(
        lat_deg=table["lat_deg"] + along_m * np.cos(heading) / 111_200,
        lon_deg=table["lon_deg"] + along_m * np.sin(heading) / (111_300 * np.cos(lat)),
    )


def test_a_late_clock_is_told_by_a_lever_arm_without_sigma(tmp_path):
    path = written(tmp_path)
    declare(path, LEVER.format(-0.12))
    change(path, TRAJECTORY, lambda t: _late(t, 0.020))
    entry, _ = calibrated(path, tmp_path)
    assert entry["stopped"] == []
    assert entry["sigma0_squared"] == pytest.approx(1.0, abs=0.06)  # nothing else would tell
    assert entry["not_confirmed"] == []  # it is an approximation
    (line,) = entry["approximations"]
    assert line.startswith(f"{SINGLE}: lever arm of CAM differs")
    assert entry["declared"]["CAM/lever_arm"]["difference"][0] == pytest.approx(-1.4, abs=0.05)


def test_true_for_grid_north_is_not_confirmed(tmp_path):
    path = written(tmp_path)
    convergence = -1.22
    change(path, TRAJECTORY, lambda t: t.assign(heading_deg=t["heading_deg"] - convergence))
    entry, _ = calibrated(path, tmp_path)
    (line,) = entry["not_confirmed"]
    assert "the meridian convergence, 1.2" in line
    assert "is the heading read against true or grid north?" in line


@pytest.mark.parametrize(
    ("sigma", "key"), [("", "approximations"), ("lever_sigma_m = 0.05\n", "not_confirmed")]
)
def test_a_lever_arm_declared_1_5_m_off_is_said_and_with_sigma_not_confirmed(tmp_path, sigma, key):
    path = written(tmp_path)
    declare(path, LEVER.format(1.38) + sigma)
    entry, _ = calibrated(path, tmp_path)
    (line,) = entry[key]
    assert "lever arm of CAM differs from the declared one by (-1.5" in line
    assert entry["declared"]["CAM/lever_arm"]["confirmed"] == (not sigma)


def test_a_clean_flight_with_everything_declared_says_nothing(tmp_path):
    path = written(tmp_path)
    right = LEVER.format(-0.124).replace("0.09", "0.086").replace("-0.34", "-0.342")
    angles = "mount_omega_deg = 0.21\nmount_phi_deg = -0.32\nmount_sigma_deg = [0.05, 0.05, 0.2]\n"
    declare(path, f"{right}lever_sigma_m = [0.02, 0.02, 0.03]\n{angles}")
    entry, rejected = calibrated(path, tmp_path)
    assert entry["stopped"] == entry["not_confirmed"] == []
    assert all(part["confirmed"] for part in entry["declared"].values())
    assert len(rejected) <= entry["expected_rejections"] + 3
    kinds = pd.read_csv(tmp_path / "results" / "residuals.csv")["kind"]
    assert (kinds == "lever_arm").sum() == 3
    assert (kinds == "boresight").sum() == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("design", "flights"),
    [("single-head", 6), repeats("single-head", 15), repeats("acx4-ideal", 15)],
)
def test_clean_flights_raise_nothing(design, flights):
    """With what flight.toml declares."""
    for seed in range(100, 100 + flights):
        options = acx4sim.Options(blocks=("calibration",))
        flown = read_back(acx4sim.DESIGNS[design](seed=seed, options=options)).flight
        bundle = mounting.calibrate(flown)["single_step"].bundle
        assert bundle.stopped == ()
        assert all(c.confirmed for c in confirmations(bundle))


@pytest.mark.parametrize("mistake", ["none", "geoid", "clock"])
def test_a_surveyed_lever_arm_without_sigma_shows_what_the_residuals_do_not(tmp_path, mistake):
    """A geoid model 0.49 m off and a clock 5 ms late leave nothing in the residuals."""
    path = tmp_path / "flight"
    options = acx4sim.Options(blocks=("calibration",), tie_points={"calibration": 120})
    flown = acx4sim.DESIGNS["single-head"](seed=1, options=options)
    acx4sim.write(flown, path)
    lever = dict(zip("xyz", flown.plan.cameras["CAM"].lever_m, strict=True))
    declare(path, "".join(f"lever_{axis}_m = {value}\n" for axis, value in lever.items()))
    if mistake == "geoid":
        change(path, TRAJECTORY, lambda t: t.assign(height_m=t["height_m"] + 0.49))
    elif mistake == "clock":
        change(path, TRAJECTORY, lambda t: _late(t, 0.005))
    entry, _ = calibrated(path, tmp_path)
    assert entry["not_confirmed"] == entry["stopped"] == []
    assert bool(entry["approximations"]) == (mistake != "none")


# --- weights that are estimated from the residuals do not certify mistakes ---------------------


QUESTION = "Estimated weights within bounds"


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Return a function that writes a flight with other control points, or none others."""
    at = tmp_path_factory.mktemp("weights")

    def flown(name, change):
        path = at / name
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=4), path)
        toml = path / "flight.toml"
        text = toml.read_text()
        assert "[stages.mounting]\n" in text
        toml.write_text(
            text.replace("[stages.mounting]\n", '[stages.mounting]\nweights = "estimated"\n')
        )
        control = pd.read_csv(path / "control_points.csv")
        change(control)
        control.to_csv(path / "control_points.csv", index=False)
        return path

    return flown


def other_epoch(control):
    control[["east_m", "north_m"]] += [0.5, 0.5]


def scaled(control):
    for column in ("east_m", "north_m"):
        middle = control[column].mean()
        control[column] = middle + (control[column] - middle) * (1 + 400e-6)


def too_optimistic(control):
    """State sigma of three quarters of the true ones."""
    for column in ("sigma_east_m", "sigma_north_m", "sigma_height_m"):
        control[column] *= 0.75


def right(control):
    assert len(control)


@pytest.mark.parametrize("mistake", [other_epoch, scaled])
def test_a_mistake_of_control_is_no_sigma(flight, tmp_path, mistake):
    outcome = runner.run(flight(mistake.__name__, mistake), tmp_path / "r")
    assert any("sigma of" in note and "outside 0.33 to 1.5" in note for note in outcome.notes)
    said = state(tmp_path / "r", QUESTION)
    assert said[0] == "fails"
    entry = folder.entries(tmp_path / "r")["mounting/single_step"]
    assert max(one["applied"] for one in entry["sigma_factors"].values()) > BOUNDS[1]


@pytest.mark.parametrize("change", [right, too_optimistic])
def test_sigma_that_are_wrong_are_estimated_within_the_bounds(flight, tmp_path, change):
    runner.run(flight(change.__name__, change), tmp_path / "r", stages=["mounting"])
    assert state(tmp_path / "r", QUESTION)[0] == "holds"
    assert folder.entries(tmp_path / "r")["mounting/single_step"]["sigma_beyond"] == []


def test_a_factor_is_beyond_by_its_size_and_by_more_than_chance():
    """With redundancy 5, chi-square above 20.5 has a probability of 0.1 % (tables): 2.02²."""
    group = {"group": "control plan", "n": 10, "redundancy": 8.0, "effective": 5.0}
    beyond = {
        factor: Component(**group, factor=factor, applied=factor).is_beyond
        for factor in (0.05, 0.3, 1.0, 1.6, 2.2, 48.6)
    }
    assert [factor for factor, is_so in beyond.items() if is_so] == [2.2, 48.6]
    many = {**group, "effective": 500.0, "redundancy": 500.0}
    assert Component(**many, factor=0.3, applied=0.3).is_beyond
    assert not Component(**many, factor=0.4, applied=0.4).is_beyond
