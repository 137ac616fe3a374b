"""Simulated flights by the name of a design or the file of a plan."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acx4book.notebooks import runner
from acx4book.notebooks import simulated as notebooks_simulated
from acx4book.planning import design, tables
from acx4book.planning import plan as plans
from acx4book.planning.flown import simulate
from acx4files.flight.reader import read
from acx4files.results import folder
from acx4files.stages import mounting as stages_mounting
from acx4files.stages import rig
from acx4lib.calibration import diagnosis, mounting
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.trajectory_errors import parameters as gnss_parameters
from acx4lib.georeferencing.validation import validate
from acx4lib.model import Model
from acx4sim.designs import PLANS
from acx4sim.files import write_files
from acx4sim.plan import Options
from support.flights.planned import CAMERA, strip, values
from support.helpers import repeats


def test_a_design_and_a_plan_are_flown_by_their_seed(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(plans.written(values()))
    notebooks_simulated.check("single-head")
    notebooks_simulated.check(str(path))
    for name in ("single-head", str(path)):
        first, again, other = (notebooks_simulated.fly(name, seed=seed) for seed in (1, 1, 2))
        table = "calibration/trajectory.csv"
        assert first.tables[table].equals(again.tables[table])
        assert not first.tables[table].equals(other.tables[table])


# --- A plan and the flight that the simulator flies of it


CLOSE = 0.03
"""Share by which sigma of a flight may differ from those of its plan: its wind is another."""

HEADS = {
    f"H{i}": {
        **CAMERA,
        "width_px": 8984,
        "height_px": 6732,
        "pixel_um": 6.0,
        "mount_omega_deg": omega,
        "mount_phi_deg": phi,
        "mount_kappa_deg": 0.0,
    }
    for i, (omega, phi) in enumerate(((0.0, 12.0), (0.0, -12.0)), 1)
}


def of_strips(**strips):
    return {"calibration": {"tie_points": 900, "strips": strips}}


def heads(**strips):
    """Return a plan of two heads that look to the front and to the back."""
    whole = values(
        cameras={**HEADS, "SYN": CAMERA},
        synthetic={"camera": "SYN", "heads": [*HEADS]},
        heads={"tie_points": 700, "tie_area_m": [1300.0, 1300.0], "strips": strips},
    )
    del whole["cameras"]["CAM"], whole["calibration"]
    return whole


ESTIMATE = ["f_mm", "xp_mm", "yp_mm", "k1", "p1", "p2"]
CROSS = {"a": strip("north"), "b": strip("south"), "c": strip("east"), "d": strip("west")}
TWO = {**CROSS, "e": strip("north", 1100.0), "f": strip("south", 1100.0)}
PLANS_OF_TEN = {
    "two heights": values(**of_strips(**TWO)),
    "hills": values(**of_strips(**TWO), field={"relief_m": 90.0}),
    "heads": heads(**TWO),
    "corners": values(
        **of_strips(**TWO),
        control={"layout": "corners", "number": 4, "area_m": [900.0, 900.0]},
    ),
    "one control point": values(**of_strips(**TWO), control={"number": [1, 1]}),
    "lever arm held": values(
        **of_strips(**CROSS), stages={"mounting": {"estimate": ESTIMATE, "fix": ["lever_arm"]}}
    ),
    "shift": values(
        **of_strips(**TWO), stages={"mounting": {"estimate": ESTIMATE, "gnss": ["shift"]}}
    ),
    "high": values(
        **of_strips(
            a=strip("north", 2000.0, overlap=0.85),
            b=strip("south", 2000.0, overlap=0.85),
            c=strip("east", 1200.0),
            d=strip("west", 1200.0),
        )
    ),
    "coarse images": values(**of_strips(**TWO), apriori={"image_point_px": 1.5}),
    "heads at one height": heads(**CROSS),
}


def flown(plan, folder, seed=1):
    write_files(simulate(plan, seed=seed, options=Options()), folder)
    return read(folder)


def agreement(plan, flight):
    """Return sigma of the flight's run over sigma of its plan, a priori, by parameter."""
    found = design.of(plan)
    ratios = {}
    for method, planned in found.mountings.items():
        if method == "single_step":
            run = stages_mounting.calibrate(flight)["single_step"]
        else:
            run = rig.calibrate(flight, method=method)
        unit = np.sqrt(run.bundle.solution.sigma0_sq)
        before = [*parameters(planned.calibration), *gnss_parameters(planned.bundle)]
        after = [*parameters(run.calibration), *gnss_parameters(run.bundle)]
        assert [p.full_name for p in before] == [p.full_name for p in after]
        ratios |= {
            (method, a.full_name): b.sigma / unit / a.sigma
            for a, b in zip(before, after, strict=True)
        }
    return ratios


@pytest.mark.parametrize(
    "name",
    [
        name if i < 3 else pytest.param(name, marks=pytest.mark.repeats)
        for i, name in enumerate(PLANS_OF_TEN)
    ],
)
def test_the_run_of_a_plan_has_the_sigma_that_the_plan_predicts(name, tmp_path):
    plan = plans.from_values(PLANS_OF_TEN[name])
    ratios = agreement(plan, flown(plan, tmp_path / "flight"))
    assert len(ratios) >= 9
    assert {key: r for key, r in ratios.items() if abs(r - 1) > CLOSE} == {}


def test_a_plan_is_flown_with_its_own_settings_strips_and_points(tmp_path):
    plan = plans.from_values(values())
    flight = flown(plan, tmp_path / "flight")
    assert flight.apriori == plan.setup.apriori
    assert flight.estimate_mounting == plan.setup.estimate_mounting
    block = flight.blocks["calibration"]
    planned = design.of(plan).blocks["calibration"]
    assert sorted(set(block.images.strips)) == ["high-1", "high-2", "low-1", "low-2"]
    assert len(block.images) == len(planned.images)
    assert len(block.image_points) == pytest.approx(len(planned.image_points), rel=0.02)
    # surveyed with 1, 1, 2 cm: the places in the map are those of the plan
    surveyed = block.frame.to_grid(block.control.x_m)
    expected = planned.frame.to_grid(planned.control.x_m)
    np.testing.assert_allclose(surveyed, expected, atol=0.08)


def correlated(**apriori):
    plan = plans.from_values(values())
    return replace(plan, values={**plan.values, "apriori": {**plan.values["apriori"], **apriori}})


def test_correlated_errors_of_a_plan_are_flown_each_with_its_time_constant():
    gnss = {"gnss_correlated_share": 0.9, "gnss_correlation_s": 60.0}
    attitude = {"attitude_correlated_share": 0.5, "attitude_correlation_s": 90.0}
    flown_with = {
        "gnss": 0.9,
        "gnss_constant_s": 60.0,
        "attitude": 0.5,
        "attitude_constant_s": 90.0,
    }
    for apriori, expected in (
        (gnss, {**flown_with, "attitude": 0.0, "attitude_constant_s": 600.0}),
        ({**gnss, **attitude}, flown_with),
    ):
        flight = simulate(correlated(**apriori), seed=1, options=Options())
        assert flight.truth["options"]["slow_errors"] == expected
    white = simulate(plans.from_values(values()), seed=1, options=Options())
    assert white.truth["options"]["slow_errors"] is None


def flown_again(wanted):
    """Return what the simulator flies by the plan that a design has as a plan's file."""
    plan = plans.from_values(notebooks_simulated.values(wanted))
    return simulate(plan, seed=1, options=Options()).plan


@pytest.mark.parametrize("name", PLANS)
def test_the_plan_of_a_design_has_its_exposures_and_its_points(name):
    wanted = PLANS[name]()
    found = flown_again(wanted)
    assert list(found.blocks) == list(wanted.blocks)
    assert found.relief == pytest.approx(wanted.relief, abs=0.001)
    np.testing.assert_allclose(found.control, wanted.control, atol=0.051)
    for key, block in wanted.blocks.items():
        other = found.blocks[key]
        assert other.cameras == block.cameras
        assert other.frame == block.frame
        np.testing.assert_allclose(other.targets, block.targets, atol=0.051)
        for a, b in zip(other.strips, block.strips, strict=True):
            assert (a.n, a.height_m, a.base_m) == (b.n, b.height_m, b.base_m)
            assert (a.forward_m, a.left_m) == (b.forward_m, b.left_m)
            assert (a.turn_deg - b.turn_deg) % 360.0 == pytest.approx(0.0, abs=1e-9)


# --- What a plan predicts, and names as weak, is what flights of it have


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
FLIGHTS_OF_A_PLAN_TWO = {
    "tie_points": 150,
    "strips": {n: strip(n, h) for n, h in zip(LINES, 2 * [600.0] + 2 * [1000.0], strict=True)},
}
ONE = {"tie_points": 150, "strips": {name: strip(name) for name in LINES}}
ALL = ["f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2"]
DELAY_S = 0.02
N_DELAYED = 50


def flights_of_a_plan_flown(plan, seed, *, change=None, **options):
    simulated = simulate(plan, seed=seed, options=Options(**options))
    if change is not None:
        simulated = change(simulated)
    with tempfile.TemporaryDirectory() as at:
        write_files(simulated, Path(at) / "flight")
        return read(Path(at) / "flight")


def calibrated(flight):
    return mounting.single_step(
        flight.calibration, Model(free=flight.estimate_mounting, fix=flight.fix, gnss=flight.gnss)
    )


# --- averages --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n_flights", [30, repeats(300)])
def test_the_predicted_rms_and_sigma_are_those_of_many_flights(n_flights):
    """RMS of check points within 4 % and 2.5 sigma of the flights' mean."""
    whole = values(
        calibration=FLIGHTS_OF_A_PLAN_TWO,
        validation=MAPPING,
        stages={"mounting": {"estimate": ALL}},
    )
    plan = plans.from_values(whole)
    planned = design.of(plan, winds=design.usual_winds(plan))
    squares, sigma = [], []
    for seed in range(1, n_flights + 1):
        flight = flights_of_a_plan_flown(plan, seed)
        found = calibrated(flight)
        checked = validate(flight.validation, found.calibration, method="single_step")
        squares.append([np.mean(d.d**2, axis=0) for d in (checked.points, checked.pairs)])
        unit = np.sqrt(found.calibration.sigma0_sq)
        sigma.append([p.sigma / unit for p in parameters(found.calibration)])
    mean = np.mean(squares, axis=0)
    error = 0.5 * np.std(squares, axis=0, ddof=1) / mean / np.sqrt(n_flights)
    rms = tables.rms_table(planned)
    rms = rms[(rms["method"] == "single_step") & (rms["of"] == "all")].set_index("differences")
    for k, part in enumerate(("points", "pairs")):
        off = np.sqrt(mean[k]) / rms.loc[part, [*tables.AXES]].to_numpy(dtype=float) - 1
        assert np.all(np.abs(off) < 0.04 + 2.5 * error[k]), off
    pooled = np.sqrt(np.mean(np.square(sigma), axis=0))
    ratio = pooled / tables.parameter_table(planned)["sigma"].to_numpy()
    assert np.all(np.abs(ratio - 1) < 0.03), ratio


# --- delays ----------------------------------------------------------------------------------


def delayed(*speeds):
    strips = {
        name: {**one, "speed_m_s": speed}
        for (name, one), speed in zip(FLIGHTS_OF_A_PLAN_TWO["strips"].items(), speeds, strict=True)
    }
    stages = {"mounting": {"estimate": ALL, "gnss": ["delay"]}}
    return plans.from_values(
        values(calibration={**FLIGHTS_OF_A_PLAN_TWO, "strips": strips}, stages=stages)
    )


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
@pytest.mark.repeats
def test_delays_of_strips_at_two_speeds_come_out_without_bias(planted):
    """Mean and scatter of 50 normalised errors: to 2.6 of their own sigma, 1 % each."""
    plan, z = delayed(70.0, 50.0, 70.0, 50.0), []
    for seed in range(1001, 1001 + N_DELAYED):
        how = (
            {"gnss_delay_s": DELAY_S}
            if planted == "by the simulator"
            else {"change": late_by_the_strips_speed}
        )
        found = calibrated(flights_of_a_plan_flown(plan, seed, blocks=("calibration",), **how))
        (delay,) = gnss_parameters(found.bundle)
        assert "gnss_delay_s" not in {
            w.parameter.name for w in diagnosis.of(found.bundle, found.calibration).weak()
        }
        z.append((delay.value - DELAY_S) / delay.sigma)
    assert abs(np.mean(z)) < 2.6 / np.sqrt(N_DELAYED)
    assert np.std(z) == pytest.approx(1.0, abs=2.6 / np.sqrt(2 * N_DELAYED))


def test_a_delay_at_one_speed_is_weak_and_without_bias():
    plan = delayed(70.0, 70.0, 70.0, 70.0)
    z = []
    for seed in range(1, 11):
        flight = flights_of_a_plan_flown(
            plan, seed, blocks=("calibration",), change=late_by_the_strips_speed
        )
        found = calibrated(flight)
        assert "gnss_delay_s" in {
            w.parameter.name for w in diagnosis.of(found.bundle, found.calibration).weak()
        }
        (delay,) = gnss_parameters(found.bundle)
        assert delay.sigma > 0.002  # not carried by the jitter of single exposures
        z.append((delay.value - DELAY_S) / delay.sigma)
    assert abs(np.mean(z)) < 2.6 / np.sqrt(len(z))
    assert np.abs(z).max() < 3.5


# --- named -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def weak_run(tmp_path_factory):
    """One height, no control points, 20 m of relief: run and its results."""
    at = tmp_path_factory.mktemp("weak")
    plan = plans.from_values(
        values(
            calibration=ONE,
            control={"number": [0, 0]},
            validation=MAPPING,
            stages={"mounting": {"estimate": ALL}},
        )
    )
    write_files(simulate(plan, seed=1, options=Options()), at / "flight")
    done = runner.run(at / "flight", at / "results")
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
    assert entry["calm_ratio"] > diagnosis.RESTS
    shares = found.summary["validation/single_step"]["weak_parameters"]
    assert shares["CAM/lever_z_m"]["share"] > diagnosis.MOST
