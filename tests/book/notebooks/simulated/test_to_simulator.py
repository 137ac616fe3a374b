"""A plan and the flight that the simulator flies of it."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.notebooks.simulated import of_design, to_simulator
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.trajectory_errors import parameters as gnss_parameters
from acx4lib.errors import FlightError
from acx4lib.flight.reader import read
from acx4lib.planning import design, text
from acx4lib.stages import mounting, rig
from acx4sim.designs import PLANS
from acx4sim.files.writer import write_files
from acx4sim.plan import Options
from support.flights.planned import CAMERA, strip, values

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
    write_files(to_simulator.simulate(plan, seed=seed, options=Options()), folder)
    return read(folder)


def agreement(plan, flight):
    """Return sigma of the flight's run over sigma of its plan, a priori, by parameter."""
    found = design.of(plan)
    ratios = {}
    for method, planned in found.mountings.items():
        if method == "single_step":
            run = mounting.calibrate(flight).single_step
        else:
            run = rig.calibrate(flight, method=method).rig
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
    plan = text.from_values(PLANS_OF_TEN[name])
    ratios = agreement(plan, flown(plan, tmp_path / "flight"))
    assert len(ratios) >= 9
    assert {key: r for key, r in ratios.items() if abs(r - 1) > CLOSE} == {}


@pytest.mark.repeats
def test_sigma_of_delays_differs_from_flight_to_flight_and_so_from_the_plan(tmp_path):
    """Their velocities and rates are those of the wind; the mean of flights has little of it."""
    speeds = {
        name: {**s, "speed_m_s": v} for (name, s), v in zip(TWO.items(), 3 * [55, 85], strict=True)
    }
    stages = {"mounting": {"estimate": ESTIMATE, "gnss": ["delay", "attitude_delay"]}}
    plan = text.from_values(values(**of_strips(**speeds), stages=stages))
    found = [agreement(plan, flown(plan, tmp_path / f"{seed}", seed)) for seed in range(1, 13)]
    for name, spread in (("gnss_delay_s", 0.06), ("attitude_delay_s", 0.12)):
        ratio = np.array([one["single_step", name] for one in found])
        assert ratio.std() == pytest.approx(spread, rel=0.5)
        assert ratio.mean() == pytest.approx(1.0, abs=1.5 * spread)


def test_a_plan_is_flown_with_its_own_settings_strips_and_points(tmp_path):
    plan = text.from_values(values())
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


def test_the_same_seed_flies_the_same_and_the_truth_of_a_plan_is_flown():
    plan = text.from_values(values(truth={"CAM": {"focal_mm": 50.2, "lever_x_m": 0.3}}))
    one, other = (to_simulator.simulate(plan, seed=4, options=Options()) for _ in range(2))
    assert one.truth == other.truth
    assert all(one.tables[name].equals(other.tables[name]) for name in one.tables)
    assert one.truth["cameras"]["CAM"]["f_mm"] == 50.2
    assert one.truth["cameras"]["CAM"]["lever_x_m"] == 0.3
    assert "50.2" not in one.toml


def correlated(**apriori):
    plan = text.from_values(values())
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
        flight = to_simulator.simulate(correlated(**apriori), seed=1, options=Options())
        assert flight.truth["options"]["slow_errors"] == expected
    white = to_simulator.simulate(text.from_values(values()), seed=1, options=Options())
    assert white.truth["options"]["slow_errors"] is None


def test_what_the_simulator_does_not_have_is_named():
    plan = text.from_values(values(cameras={"CAM": {**CAMERA, "b1": 1e-4}}))
    with pytest.raises(FlightError, match=r"cameras\.CAM\.b1: the simulator has no b1"):
        to_simulator.simulated(plan)


@pytest.mark.parametrize("name", PLANS)
def test_the_plan_of_a_design_has_its_exposures_and_its_points(name):
    wanted = PLANS[name]()
    found = to_simulator.simulated(text.from_values(of_design.values(wanted)))
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


def test_the_plan_of_a_design_has_its_true_cameras():
    wanted = PLANS["acx4"]()
    found = to_simulator.simulated(text.from_values(of_design.values(wanted)))
    for head in wanted.heads:
        one, other = found.cameras[head], wanted.cameras[head]
        assert one.f_mm == other.f_mm
        assert one.boresight_deg == pytest.approx(other.boresight_deg, abs=1e-9)
        assert one.lever_m == other.lever_m
        angles = found.head_angles_deg[head]
        assert angles == pytest.approx(wanted.head_angles_deg[head], abs=1e-9)
