"""Chapters 0, 2, 3, 4 and 8 changed as they suggest: one line, and everything below follows."""

import shutil

import numpy as np
import pytest

import acx4sim
from acx4book.chapters.synthetic_image import tables
from acx4book.typesetting.tables import markdown
from acx4files import flight as flights
from acx4files.stages import heads, mounting
from acx4lib.least_squares.covariance import sigmas
from support.changed_notebook import changed
from support.flights import in_heads, pictured
from support.helpers import repeats

# --- Chapter 0 changed as it suggests: one line, and everything below follows ----------------


READ_00 = "flight = acx.read(flight_path, pictures=pictures_path)\n"


@pytest.fixture(scope="module")
def run_00(tmp_path_factory):
    """What the cells define, by what happens to every block."""
    path = tmp_path_factory.mktemp("flight") / "small"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)

    def one(part="", *arguments):
        blocks = f"{{n: design.{part}({', '.join(('b', *arguments))}) for n, b in flight.blocks.items()}}"  # noqa: E501
        line = f"flight = replace(flight, blocks={blocks})\n" if part else ""
        return changed("00", {READ_00: READ_00 + line}, flight_path=path)

    return one


@pytest.fixture(scope="module")
def as_it_is_00(run_00):
    return run_00()


def test_the_height_by_hand_is_the_librarys(as_it_is_00):
    block = as_it_is_00["flight"].calibration
    heights = as_it_is_00["flying_heights"](block)
    assert as_it_is_00["by_hand"]["H by hand (m)"] == pytest.approx(heights[0], abs=1e-6)


def test_from_one_height_every_block_has_one_level(run_00, as_it_is_00):
    lowest = run_00("lowest_height")
    assert list(as_it_is_00["flown"].loc["calibration"].index) == [1, 2]
    assert list(lowest["flown"].index) == [("calibration", 1), ("validation", 1)]
    seen = [names["contents"]["images per point"]["calibration"] for names in (as_it_is_00, lowest)]
    assert seen[1] < seen[0]


def test_without_control_its_points_are_tie_points_and_heights_are_not_known(run_00, as_it_is_00):
    without = run_00("without_control")
    before, after = (names["contents"].loc["calibration"] for names in (as_it_is_00, without))
    assert after["control points"] == 0
    assert after["tie points"] == before["tie points"] + before["control points"]
    heights = without["flown"]["height above ground (m)"]
    assert np.isnan(heights["calibration"]).all()
    assert heights["validation"].notna().all()  # it has check points


# --- What notebook 02 says of its changes is seen in its tables ------------------------------


READ_02 = "orientation = synthetic.read_heads(flight, results_path)"
TURNED = (
    "orientation = replace(orientation, opk=orientation.opk"
    " + np.radians(0.01) * np.eye(len(orientation.opk), 3, -1))"
)


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("changed")
    flight = pictured.write_flight(folder / "flight")
    return flight, pictured.write_results(folder / "results", flight)


@pytest.fixture
def run_02(paths, tmp_path):
    """Return what the notebook has in the end, with cells changed."""
    results = shutil.copytree(paths[1], tmp_path / "results")
    given = {"flight_path": paths[0], "results_path": results}
    return lambda changes: changed("02", changes, **given)


@pytest.fixture(scope="module")
def unchanged(paths, tmp_path_factory):
    results = shutil.copytree(paths[1], tmp_path_factory.mktemp("unchanged") / "results")
    return changed("02", flight_path=paths[0], results_path=results)


def turns(found):
    return tables.turns(found["refinement"]).xs("value", axis=1, level=1).loc["RIGHT"]


def test_a_pixel_by_hand_is_the_librarys(unchanged):
    assert abs(unchanged["by_hand"] - unchanged["library"]).max() < 1e-4


def test_heads_that_are_turned_are_turned_back(unchanged, run_02):
    other = run_02({READ_02: f"{READ_02}\n{TURNED}"})
    before, after = unchanged["left"][tables.RMS], other["left"][tables.RMS]
    assert after["as calibrated"] > 3 * before["as calibrated"]
    assert after["three rotations"] == pytest.approx(before["three rotations"], rel=0.01)
    back = turns(other) - turns(unchanged)
    assert back.tolist() == pytest.approx([-10, 0, 0], abs=0.05)


# --- flights that lack something ---------------------------------------------------------------

FLIGHT = "flight = acx.read(flight_path, pictures=pictures_path)"
BLOCK = (
    f"{FLIGHT}\nblock = flight.blocks['heads']\nflight = replace(flight, blocks={{'heads': %s}})"
)
LACKING = {
    "nothing is measured": "replace(block, image_points=block.image_points[:0])",
    "one head is measured": (
        "replace(block, image_points=block.image_points["
        "block.images.camera_idx[block.image_points.image_idx] == 0])"
    ),
    "no control": "replace(block, control=block.control[:0])",
}


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """A flight of two heads that are not the paper's, without pictures; and results of them."""
    folder = tmp_path_factory.mktemp("other")
    flight = in_heads.write_other_heads(folder / "flight")
    heads.run(flights.read(flight), folder / "results")
    return flight, folder / "results"


@pytest.mark.parametrize(
    "lacking", [repeats(one) if one == "no control" else one for one in LACKING]
)
def test_flights_that_lack_something_go_through(other, tmp_path, lacking):
    results = shutil.copytree(other[1], tmp_path / "results")
    change = {FLIGHT: BLOCK % LACKING[lacking]}
    found = changed("02", change, flight_path=other[0], results_path=results)
    assert (found["numbers"]["n"] > 0) == (lacking == "no control")
    assert bool(found["apart"]) == (lacking != "no control")  # heights over control points
    assert "ended" not in found
    for table in (found["left"], (found["matched"] or found["ties"]).table()):
        assert len(table) > 0 or found["numbers"]["n"] == 0
        assert markdown(table).startswith("|") or not len(table)


# --- Chapter 3 changed as it suggests: one argument, and everything below follows ------------


CHOICES_03 = "model, weights = flight.model, flight.weights"
MEASURED_03 = "block = mounting.measured(flight, results_path)\n"


@pytest.fixture(scope="module")
def run_03(tmp_path_factory):
    """What the cells define, by the change; each into results of its own."""
    flight = tmp_path_factory.mktemp("flight") / "small"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), flight)

    def one(**changes):
        results = tmp_path_factory.mktemp("results")
        return changed("03", dict(changes.values()), flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is_03(run_03):
    return run_03()


def sigma_03(names, parameter):
    return float(names["single"].table().droplevel("unit")["sigma"][parameter])


def test_the_two_methods_by_hand_are_the_librarys(as_it_is_03):
    np.testing.assert_allclose(as_it_is_03["by_hand"], as_it_is_03["ray"].residual_px, atol=1e-6)
    np.testing.assert_allclose(as_it_is_03["lever_arm"], as_it_is_03["T_b_c"].r, atol=1e-9)
    np.testing.assert_allclose(as_it_is_03["boresight"], as_it_is_03["T_b_c"].R, atol=1e-9)


def test_a_held_lever_arm_is_held_in_every_table_below(run_03, as_it_is_03):
    held = run_03(fix=(CHOICES_03, f'{CHOICES_03}\nmodel = replace(model, fix=("lever_arm",))'))
    for axis in "xyz":
        assert np.isnan(sigma_03(held, f"lever {axis}"))
        assert sigma_03(as_it_is_03, f"lever {axis}") > 0
    assert sigma_03(held, "f") < sigma_03(as_it_is_03, "f")
    columns = held["table"].columns.get_level_values(0)
    assert {"two-step", "two-step, GNSS positions", "single-step"} <= set(columns)


def test_from_one_height_focal_length_and_lever_arm_are_not_told_apart(run_03, as_it_is_03):
    lowest = run_03(block=(MEASURED_03, f"{MEASURED_03}block = design.lowest_height(block)\n"))
    for parameter in ("f", "lever z"):
        assert sigma_03(lowest, parameter) > 3 * sigma_03(as_it_is_03, parameter)
    assert len(lowest["block"].images) < len(as_it_is_03["block"].images)


def test_without_control_the_boresight_stays_and_the_two_step_method_is_left_out(
    run_03, as_it_is_03
):
    without = run_03(block=(MEASURED_03, f"{MEASURED_03}block = design.without_control(block)\n"))
    assert not without["two"]
    assert "two_step" in without["methods"].failures
    for axis in "ωφκ":
        before = sigma_03(as_it_is_03, f"boresight {axis}")
        assert sigma_03(without, f"boresight {axis}") == pytest.approx(before, rel=0.25)
    assert sigma_03(without, "lever z") > 3 * sigma_03(as_it_is_03, "lever z")


# --- Chapter 4 changed as it suggests: one argument, and everything below follows ------------


CHOICES_04 = "model, smallest_angle = flight.model, block.smallest_angle"
FACTORS = "factors: dict[str, float] = {}"
READ_04 = "calibrations = before.calibrations\n"


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A flight, and results with its calibration."""
    flight, results = tmp_path_factory.mktemp("flight") / "small", tmp_path_factory.mktemp("run")
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), flight)
    mounting.run(flights.read(flight), results)
    return flight, results


@pytest.fixture(scope="module")
def run_04(calibrated):
    """What the cells define, by the change."""
    flight, results = calibrated

    def one(changes=None):
        return changed("04", changes, flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is_04(run_04):
    return run_04()


def of(names, rays):
    """Return the table of the last method's differences, without its unit."""
    return names["validated"].table().droplevel("unit").loc[rays]


def test_the_intersection_by_hand_is_the_librarys(as_it_is_04):
    library = as_it_is_04["library"]
    np.testing.assert_allclose(as_it_is_04["x"], library.x_m[0], atol=1e-4)  # one step: 0.1 mm
    np.testing.assert_allclose(as_it_is_04["sigma"], sigmas(library.cov[0]), rtol=1e-3)


def test_chi_square_by_hand_is_the_librarys(as_it_is_04):
    d, C = as_it_is_04["d"], as_it_is_04["C"]
    assert d @ np.linalg.solve(C, d) == pytest.approx(as_it_is_04["validated"].joint_chi_square)


def test_wider_angles_leave_fewer_and_better_pairs_and_the_same_points(run_04, as_it_is_04):
    wide = run_04({CHOICES_04: "model, smallest_angle = flight.model, np.radians(30)"})
    assert wide["validated"].n_failed > as_it_is_04["validated"].n_failed
    assert of(wide, "pairs")["RMS"]["height"] < 0.6 * of(as_it_is_04, "pairs")["RMS"]["height"]
    assert of(wide, "points").equals(of(as_it_is_04, "points"))


def test_a_trajectory_that_is_mistrusted_is_predicted_too_poor(run_04, as_it_is_04):
    doubted = run_04({FACTORS: 'factors = {"GNSS": 3.0, "roll, pitch": 3.0}'})
    before, after = of(as_it_is_04, "pairs"), of(doubted, "pairs")
    assert np.all(after["expected RMS"] > 1.3 * before["expected RMS"])
    np.testing.assert_allclose(after["RMS"], before["RMS"])
    assert doubted["validated"].joint_chi_square < 0.5 * as_it_is_04["validated"].joint_chi_square
    assert doubted["validated"].joint_chi_square_p < 0.001
    assert not any(doubted["honest"]["Single-step"].accepted)


def test_a_forgotten_lever_arm_is_seen_in_heights(run_04, as_it_is_04):
    line = "calibrations = {k: forgotten.lever_arm(camera) for k, camera in calibrations.items()}\n"
    without = run_04({READ_04: f"{READ_04}{line}"})
    assert of(without, "points")["RMS"]["height"] > of(as_it_is_04, "points")["RMS"]["height"]
    p = [names["validated"].joint_chi_square_p for names in (without, as_it_is_04)]
    assert p[0] < 0.001 < p[1]


# --- Chapter 8 changed as it suggests: one line, and everything below follows ----------------


MEASURED_08 = "block = stage.measured(flight)\n"
IN_OVERLAPS = "misfit in overlaps, predicted RMS (px)"


@pytest.fixture(scope="module")
def run_08(tmp_path_factory):
    """What the cells define, by what happens to the block; each into results of its own."""
    flight = tmp_path_factory.mktemp("flight") / "heads"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 100})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=1, options=options), flight)

    def one(line=""):
        results = tmp_path_factory.mktemp("results")
        change = {MEASURED_08: f"{MEASURED_08}{line}\n"}
        return changed("08", change, flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is_08(run_08):
    return run_08()


def test_the_equations_by_hand_are_the_librarys(as_it_is_08):
    np.testing.assert_allclose(as_it_is_08["ideal"], as_it_is_08["measured"], atol=1e-6)
    for ours, theirs in zip(as_it_is_08["by_hand"], as_it_is_08["library"], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_without_shared_points_the_overlaps_of_the_rig_misfit_more(run_08, as_it_is_08):
    apart = run_08("block = design.unshared(block)")
    assert apart["at_once"][2:].sum() < 0.3 * as_it_is_08["at_once"][2:].sum()  # control stays
    before = as_it_is_08["in_pixels"][IN_OVERLAPS]
    found = apart["in_pixels"][IN_OVERLAPS]
    assert found["rig"] > 1.4 * before["rig"]
    assert found["rig"] == pytest.approx(before["rig, no shared points"], rel=0.02)


def test_without_control_only_the_rig_orients_the_heads(run_08, as_it_is_08):
    without = run_08("block = design.without_control(block)")
    assert not without["one_by_one"]
    assert as_it_is_08["one_by_one"]
    assert "one by one" not in without["in_pixels"].index
    before, after = (names["rigid"].sigma[:, 3:] for names in (as_it_is_08, without))
    np.testing.assert_allclose(after, before, rtol=0.3)
