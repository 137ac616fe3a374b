"""What a plan predicts, and names as weak, is what flights of it have."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acx4book.notebooks import functions, runner
from acx4book.notebooks.simulated import to_simulator
from acx4book.report.material import read as read_results
from acx4book.report.verdict.verdict import findings
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.trajectory_errors import parameters as of_trajectory
from acx4lib.flight.reader import read
from acx4lib.georeferencing import weak
from acx4lib.georeferencing.validation import validate
from acx4lib.planning import design, tables, text
from acx4lib.results import folder
from acx4sim.files.writer import write_files
from acx4sim.plan import Options
from support.flights.planned import strip, values

MAPPING = {
    "east_m": 388000.0,
    "check": {"number": [4, 4], "area_m": [1500.0, 1500.0]},
    "strips": {
        "map": {
            "flying_height_m": 800.0,
            "course_deg": 0.0,
            "length_m": 2000.0,
            "overlap": 0.6,
            "parallel": 4,
            "side_overlap": 0.3,
        }
    },
}
LINES = ("north", "south", "east", "west")
TWO = {
    "tie_points": 150,
    "strips": {n: strip(n, h) for n, h in zip(LINES, 2 * [600.0] + 2 * [1000.0], strict=True)},
}
ONE = {"tie_points": 150, "strips": {name: strip(name) for name in LINES}}
ALL = ["f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2"]
DELAY_S = 0.02
N_DELAYED = 50


def flown(plan, seed, *, change=None, **options):
    simulated = to_simulator.simulate(plan, seed=seed, options=Options(**options))
    if change is not None:
        simulated = change(simulated)
    with tempfile.TemporaryDirectory() as at:
        write_files(simulated, Path(at) / "flight")
        return read(Path(at) / "flight")


def calibrated(flight):
    return mounting.single_step(
        flight.calibration, free=flight.estimate_mounting, fix=flight.fix, gnss=flight.gnss
    )


# --- averages --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n_flights", [60, pytest.param(300, marks=pytest.mark.repeats)])
def test_the_predicted_rms_and_sigma_are_those_of_many_flights(n_flights):
    """RMS of check points within the plan's tolerance and two sigma of the flights' mean."""
    whole = values(calibration=TWO, validation=MAPPING, stages={"mounting": {"estimate": ALL}})
    plan = text.from_values(whole)
    planned = design.of(plan, winds=design.usual_winds(plan))
    squares, sigma = [], []
    for seed in range(1, n_flights + 1):
        flight = flown(plan, seed)
        found = calibrated(flight)
        checked = validate(flight.validation, found.calibration, method="single_step")
        squares.append([np.mean(d.d**2, axis=0) for d in (checked.points, checked.pairs)])
        unit = np.sqrt(found.calibration.sigma0_sq)
        sigma.append([p.sigma / unit for p in parameters(found.calibration)])
    mean = np.mean(squares, axis=0)
    error = 0.5 * np.std(squares, axis=0, ddof=1) / mean / np.sqrt(n_flights)
    for k, predicted in enumerate(tables.expected_rms(planned, "single_step").values()):
        off = np.sqrt(mean[k]) / predicted.rms - 1
        assert np.all(np.abs(off) < predicted.tolerance + 2.5 * error[k]), off
        assert predicted.tolerance.max() < 0.04
    pooled = np.sqrt(np.mean(np.square(sigma), axis=0))
    ratio = pooled / tables.parameter_table(planned)["sigma"].to_numpy()
    assert np.all(np.abs(ratio - 1) < 0.03), ratio


# --- delays ----------------------------------------------------------------------------------


def delayed(*speeds):
    strips = {
        name: {**one, "speed_m_s": speed}
        for (name, one), speed in zip(TWO["strips"].items(), speeds, strict=True)
    }
    stages = {"mounting": {"estimate": ALL, "gnss": ["delay"]}}
    return text.from_values(values(calibration={**TWO, "strips": strips}, stages=stages))


def late_by_the_strips_speed(simulated):
    """Move positions by 20 ms of the mean velocity of their strip, not by the simulator's."""
    name = "calibration/trajectory.csv"
    table = simulated.tables[name].copy()
    strip_of = table["exposure"].str.partition("-")[0]
    for _, own in table.groupby(strip_of):
        for column in ("lat_deg", "lon_deg", "height_m"):
            slope = np.polyfit(own["time_s"] - own["time_s"].mean(), own[column], 1)[0]
            table.loc[own.index, column] += DELAY_S * slope
    return replace(simulated, tables={**simulated.tables, name: table})


@pytest.mark.slow
@pytest.mark.parametrize("planted", ["by the simulator", "by the speed of the strip"])
def test_delays_of_strips_at_two_speeds_come_out_without_bias(planted):
    """Mean and scatter of 50 normalised errors: to 2.6 of their own sigma, 1 % each."""
    plan, z = delayed(70.0, 50.0, 70.0, 50.0), []
    for seed in range(1001, 1001 + N_DELAYED):
        how = (
            {"gnss_delay_s": DELAY_S}
            if planted == "by the simulator"
            else {"change": late_by_the_strips_speed}
        )
        found = calibrated(flown(plan, seed, blocks=("calibration",), **how))
        (delay,) = of_trajectory(found.bundle)
        assert "gnss_delay_s" not in {w.parameter.name for w in weak.of_bundle(found.bundle)}
        z.append((delay.value - DELAY_S) / delay.sigma)
    assert abs(np.mean(z)) < 2.6 / np.sqrt(N_DELAYED)
    assert np.std(z) == pytest.approx(1.0, abs=2.6 / np.sqrt(2 * N_DELAYED))


def test_a_delay_at_one_speed_is_weak_in_plan_and_flight_and_without_bias():
    plan = delayed(70.0, 70.0, 70.0, 70.0)
    said = [line.split()[1] for line in tables.weak_sentences(design.of(plan))]
    assert "gnss_delay_s" in said
    z = []
    for seed in range(1, 11):
        flight = flown(plan, seed, blocks=("calibration",), change=late_by_the_strips_speed)
        bundle = calibrated(flight).bundle
        assert "gnss_delay_s" in {w.parameter.name for w in weak.of_bundle(bundle)}
        (delay,) = of_trajectory(bundle)
        assert delay.sigma > 0.002  # not carried by the jitter of single exposures
        z.append((delay.value - DELAY_S) / delay.sigma)
    assert abs(np.mean(z)) < 2.6 / np.sqrt(len(z))
    assert np.abs(z).max() < 3.5


# --- named -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def weak_run(tmp_path_factory):
    """One height, no control points, 20 m of relief: run and its results."""
    at = tmp_path_factory.mktemp("weak")
    plan = text.from_values(
        values(
            calibration=ONE,
            control={"number": [0, 0]},
            validation=MAPPING,
            stages={"mounting": {"estimate": ALL}},
        )
    )
    write_files(to_simulator.simulate(plan, seed=1, options=Options()), at / "flight")
    done = runner.run(at / "flight", at / "results", way=functions.Functions())
    return plan, done, at / "results"


def test_a_weak_parameter_is_named_by_the_run_which_has_its_row_and_succeeds(weak_run):
    _, done, results = weak_run
    assert done.not_determined == ()
    said = [line for line in done.notes if " is weak (" in line]
    assert any("CAM lever_z_m is weak (sigma" in line for line in said)
    assert any("of the variance of check points in height" in line for line in said)
    found = folder.read(results)
    row = folder.parameters(found, "mounting/single_step", "CAM").loc["lever_z_m"]
    entry = found.summary["mounting/single_step"]["weak_parameters"]["CAM/lever_z_m"]
    assert entry["sigma"] == pytest.approx(row["sigma"])
    assert entry["calm_ratio"] > weak.RESTS
    shares = found.summary["validation/single_step"]["weak_parameters"]
    assert shares["CAM/lever_z_m"]["share"] > weak.MOST


def test_the_plan_names_the_same_parameters_as_its_flight(weak_run):
    plan, done, _ = weak_run
    planned = {line.split()[2] for line in tables.weak_sentences(design.of(plan))}
    named = {line.split()[2] for line in done.notes if " is weak (" in line}
    assert planned <= named
    assert {"f_mm", "lever_z_m"} <= planned


def test_the_report_has_a_note_on_weak_parameters(weak_run):
    *_, results = weak_run
    (finding,) = [f for f in findings(read_results(results)) if f.question == "Weak parameters"]
    assert finding.state == "note"
    assert "CAM lever_z_m is weak (sigma" in finding.answer
    assert "mounting/" not in finding.answer
