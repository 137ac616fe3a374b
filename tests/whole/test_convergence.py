"""From start values as bad as users have them: one minimum, or an error that says what is wrong.

The blocks are simulated flights with the number of images, the geometry and the noise of real
ones, and few tie points.
"""

import csv
import re
import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4book.notebooks import runner
from acx4files import flight
from acx4files.results import folder
from acx4lib.block import select_cameras
from acx4lib.bundle import adjust
from acx4lib.bundle.start import recovered
from acx4lib.errors import Acx4Error, AdjustmentError, FlightError
from acx4lib.geometry.camera import colrow_from_xy, xy_from_colrow
from acx4lib.geometry.frames import Pose, exp, log, turn
from acx4lib.model import Model
from support.flights import simulated, written
from support.fuzz.run import write_good
from support.helpers import repeats, rotation_angle

FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")
SHAPES = ("52 images", "268 images", "one head", "single camera")
OFF_DEG, OFF_FOCAL, OFF_M = 5.0, 0.03, 100.0
"""Of every angle of every attitude and boresight, of f, of every coordinate of tie points."""


# --- blocks ------------------------------------------------------------------------------------


@cache
def block_of(shape, quarters=0):
    """Return a block whose camera is built in, and declared, so many quarter turns further."""
    if quarters:
        return turned_in_its_mount(block_of(shape), quarters)
    design, name, ties = {
        "52 images": ("acx4-ideal", "calibration", 150),
        "268 images": ("acx4-ideal", "validation", 800),
        "one head": ("acx4", "heads", 150),
        "single camera": ("single-head", "calibration", 150),
    }[shape]
    options = acx4sim.Options(blocks=(name,), tie_points={name: ties})
    flown = simulated.read_back(acx4sim.DESIGNS[design](seed=1, options=options))
    block = getattr(flown.flight, name)
    if name == "validation":  # its targets are check points
        return replace(block, control=block.check, check=block.check[np.zeros(36, dtype=bool)])
    return select_cameras(block, ["CAM1"]) if name == "heads" else block


def turned_in_its_mount(block, quarters):
    """The same measurements by a camera that was built in turned counterclockwise."""
    (camera,) = block.cameras
    R_c_t = turn(2, np.pi / 2 * quarters)  # t: the turned camera
    width, height = camera.width_px, camera.height_px
    turned = replace(
        camera,
        width_px=height if quarters % 2 else width,
        height_px=width if quarters % 2 else height,
        T_b_c=Pose(R=camera.T_b_c.R @ R_c_t, r=camera.T_b_c.r),
    )
    xy = xy_from_colrow(camera, block.image_points.colrow) @ R_c_t[:2, :2]
    points = replace(block.image_points, colrow=colrow_from_xy(turned, xy))
    return replace(block, cameras=(turned,), image_points=points)


def set_up(shape, block):
    """Set up a block as the stages do: heads with free orientation, the others mounted."""
    if shape == "one head":
        return adjust.free_orientation(block, Model(free=("f", "xp", "yp", "k1", "p1", "p2")))
    return adjust.mounted_orientation(block, Model(free=FREE))


@cache
def best(shape, quarters=0):
    """Return the adjustment from good start values."""
    return adjust.adjust(set_up(shape, block_of(shape, quarters)))


# --- bad starts --------------------------------------------------------------------------------


def turns(rng, *shape):
    """Return rotations about all three axes, each by 5 degrees one way or the other."""
    return exp(np.radians(OFF_DEG) * rng.choice([-1.0, 1.0], (*shape, 3)))


def badly_declared(block, rng, *, trajectory):
    """Return the block with what a user has wrong."""
    (camera,) = block.cameras
    f = camera.interior.f * (1 + OFF_FOCAL * rng.choice([-1, 1]))
    T_b_c = Pose(R=camera.T_b_c.R @ turns(rng), r=camera.T_b_c.r)
    bad = replace(camera, interior=replace(camera.interior, f=f), T_b_c=T_b_c)
    if trajectory:
        T_m_b = block.trajectory.T_m_b
        T_m_b = Pose(R=T_m_b.R @ turns(rng, len(T_m_b)), r=T_m_b.r)
        block = replace(block, trajectory=replace(block.trajectory, T_m_b=T_m_b))
    return replace(block, cameras=(bad,))


def badly_started(network, rng):
    """Return a network whose own start values are worse still."""
    start = network.start
    T_m_b = Pose(R=start.T_m_b.R @ turns(rng, len(start.T_m_b)), r=start.T_m_b.r)
    x_m = start.x_m + OFF_M * rng.choice([-1.0, 1.0], start.x_m.shape)
    return replace(network, start=replace(start, T_m_b=T_m_b, x_m=x_m))


def differences(a, b):
    """Return the differences of all unknowns of two adjustments in sigmas of the second."""
    columns, dx = a.network.layout, np.zeros(a.network.n_columns)
    both = list(zip(a.state.interiors, b.state.interiors, strict=True))
    for where, values in (
        (columns.interior, np.array([p.to_array() - q.to_array() for p, q in both])),
        (columns.mount, apart(a.state.T_b_c, b.state.T_b_c)),
        (columns.pose, apart(a.state.T_m_b, b.state.T_m_b)),
    ):
        dx[where[where >= 0]] = values[where >= 0]
    free = a.network.free_points
    sigma = np.sqrt(np.diagonal(b.solution.cov_points[free], axis1=1, axis2=2))
    dp = (a.state.x_m - b.state.x_m)[free] / sigma
    return np.concatenate([dx / np.sqrt(np.diag(b.solution.cov)), dp.ravel()])


def apart(T, other):
    return np.hstack([T.r - other.r, log(np.swapaxes(other.R, -1, -2) @ T.R)])


def assert_same_minimum(found, shape, quarters):
    """Cost to 1e-8, unknowns to a thousandth of their sigma."""
    expected = best(shape, quarters)
    assert np.array_equal(found.network.rows, expected.network.rows)
    assert found.solution.cost == pytest.approx(expected.solution.cost, rel=1e-8)
    assert np.abs(differences(found, expected)).max() < 1e-3


def bad_network(shape, seed):
    rng, quarters = np.random.default_rng(seed), seed % 4
    bad = badly_declared(block_of(shape, quarters), rng, trajectory=shape == "one head")
    return set_up(shape, bad), quarters


@pytest.mark.parametrize("shape", SHAPES)
def test_what_a_user_has_wrong_does_not_change_the_minimum(shape):
    network, quarters = bad_network(shape, seed=2)
    assert_same_minimum(adjust.adjust(network), shape, quarters)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("starts", [2, repeats(50)])
def test_bad_starts_end_in_the_same_minimum(shape, starts):
    for seed in range(1, starts + 1):
        network, quarters = bad_network(shape, seed)
        worse = badly_started(network, np.random.default_rng(seed))
        assert_same_minimum(adjust.adjust(worse), shape, quarters)


def test_the_minimum_is_that_of_a_camera_turned_in_its_mount():
    """The turned block is the same flight: same cost, and the boresight turns along."""
    a, b = best("single camera"), best("single camera", 1)
    assert b.solution.cost == pytest.approx(a.solution.cost, rel=1e-9)
    R_b_t = a.state.T_b_c.R[0] @ turn(2, np.pi / 2)
    assert np.abs(log(b.state.T_b_c.R[0].T @ R_b_t)).max() < 1e-8


# --- worse than that ---------------------------------------------------------------------------


@pytest.mark.parametrize("wrong_deg", [90.0, 180.0])
@pytest.mark.parametrize("shape", ["52 images", "one head"])
def test_a_mounting_declared_a_quarter_or_half_turn_wrong_is_found_by_control(shape, wrong_deg):
    """`flight.check` refuses it; the adjustment does not depend on that."""
    block = block_of(shape)
    (camera,) = block.cameras
    T_b_c = Pose(R=camera.T_b_c.R @ turn(2, np.radians(wrong_deg)), r=camera.T_b_c.r)
    wrong = replace(block, cameras=(replace(camera, T_b_c=T_b_c),))
    assert_same_minimum(adjust.adjust(set_up(shape, wrong)), shape, 0)


@pytest.mark.repeats  # with the smaller blocks above
def test_most_images_need_no_control_to_be_turned():
    """Twelve control points in 268 images, all of which look the other way."""
    block = block_of("268 images")
    (camera,) = block.cameras
    T_b_c = Pose(R=camera.T_b_c.R @ turn(2, np.pi), r=camera.T_b_c.r)
    wrong = replace(block, control=block.control[::3], cameras=(replace(camera, T_b_c=T_b_c),))
    state = recovered(adjust.free_orientation(wrong, Model(free=FREE)))
    expected = block.T_m_b_images.R @ best("268 images").state.T_b_c.R[0]
    assert rotation_angle(state.T_m_b.R, expected).max() < np.radians(8.0)


def spoilt(block, rng, *, share, size_px):
    """Return a block with some image points off, and their rows."""
    points = block.image_points
    rows = rng.choice(len(points), int(share * len(points)), replace=False)
    colrow = points.colrow.copy()
    colrow[rows] += rng.uniform(*size_px, (len(rows), 1)) * rng.choice([-0.7, 0.7], (len(rows), 2))
    return replace(block, image_points=replace(points, colrow=colrow)), rows


def test_gross_errors_do_not_lead_a_bad_start_elsewhere():
    """2 % of the image points are 5 to 200 px off."""
    rng = np.random.default_rng(3)
    wrong, _ = spoilt(block_of("single camera"), rng, share=0.02, size_px=(5, 200))
    good = adjust.adjust(set_up("single camera", wrong))
    bad = adjust.adjust(set_up("single camera", badly_declared(wrong, rng, trajectory=False)))
    assert good.solution.sigma0_sq > 20  # they do pull
    assert bad.solution.cost == pytest.approx(good.solution.cost, rel=1e-8)


def swapped(block, i, j):
    """Return a block with the names of two images swapped in the measurements."""
    points = block.image_points
    other = np.arange(len(block.images))
    other[[i, j]] = j, i
    return replace(block, image_points=replace(points, image_idx=other[points.image_idx]))


def test_swapped_images_are_turned_and_moved_where_their_orientation_is_free():
    block = block_of("one head")
    found = adjust.adjust(set_up("one head", swapped(block, 3, 30)))
    assert found.solution.cost == pytest.approx(best("one head").solution.cost, rel=1e-8)


# --- errors ------------------------------------------------------------------------------------


def test_swapped_images_are_named_where_their_orientation_is_observed():
    block = block_of("52 images")
    names = {block.images.names[3], block.images.names[30]}
    with pytest.raises(AdjustmentError, match=r"rays miss their points in 2 of 52 images") as e:
        adjust.adjust(set_up("52 images", swapped(block, 3, 30)))
    assert set(re.findall(r"C\d-\d\d(?= by)", str(e.value))) == names


def test_swapped_control_points_are_named():
    block = block_of("52 images")
    x_m = block.control.x_m.copy()
    x_m[[1, 22]] = x_m[[22, 1]]
    wrong = replace(block, control=replace(block.control, x_m=x_m))
    names = {block.points[p] for p in block.control.point_idx[[1, 22]]}
    with pytest.raises(AdjustmentError, match=r"rays miss their points in 2 of \d+ points") as e:
        adjust.adjust(set_up("52 images", wrong))
    assert set(re.findall(r"P\d\d(?= by)", str(e.value))) == names


@pytest.mark.parametrize(
    ("kappa_deg", "turned_deg"),
    [(95, 0), (5, 85), (-85, 175), (-175, -95)],
)
def test_a_check_names_a_quarter_turn_of_a_mounting_that_is_also_5_degrees_off(
    tmp_path, kappa_deg, turned_deg
):
    """The camera is mounted at 0, 0, 90 degrees; f is 3 % off as well."""
    toml = written.write_flight(tmp_path) / "flight.toml"
    text = toml.read_text().replace("focal_mm = 25.0", "focal_mm = 25.75")
    for name, angle in (("omega", 5), ("phi", -5), ("kappa", kappa_deg)):
        text = re.sub(rf"mount_{name}_deg = .*", f"mount_{name}_deg = {angle}", text)
    toml.write_text(text)
    if turned_deg:
        with pytest.raises(FlightError) as caught:
            flight.read(tmp_path)
        said = re.search(
            r"the camera axes were turned by (-?\d+) degrees about z", str(caught.value)
        )
        assert float(said[1]) == pytest.approx(turned_deg, abs=3)
    else:
        assert flight.read(tmp_path).cameras["CAM"].interior.f == 25.75


# --- flights of which one number is far from all others ----------------------------------------


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return {path.name: path for path in write_good(tmp_path_factory.mktemp("good") / "flights")}


def with_cell(good, folder, table, row, column, cell):
    """Return a copy of a flight with another number in a table."""
    flight = shutil.copytree(good, folder / "flight")
    path = flight / table
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    rows[row][rows[0].index(column)] = cell
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    return flight


def ended(flight, results):
    """Return the sentences with which a run ends."""
    try:
        outcome = runner.run(flight, results)
    except Acx4Error as error:
        return [*getattr(error, "__notes__", ()), *str(error).splitlines()]
    return list(outcome.not_determined)


@pytest.mark.repeats
def test_a_position_on_the_equator_stops_data_snooping_and_no_linear_algebra(good, tmp_path):
    """Variance components of the two-step method met points without coordinates."""
    row = ("calibration/trajectory.csv", 4, "lat_deg", "0")
    said = " ".join(ended(with_cell(good["simulated"], tmp_path, *row), tmp_path / "results"))
    assert "C1-04" in said
    assert "did not converge" not in said


def test_check_points_that_rays_meet_off_the_map_are_counted_and_the_others_compared(
    good, tmp_path
):
    row = ("validation/trajectory.csv", 3, "east_m", "0")
    ended(with_cell(good["in_heads"], tmp_path, *row), tmp_path / "results")
    pairs = pd.read_csv(tmp_path / "results/validation.csv")
    assert len(pairs)
    assert pairs.notna().all(axis=None)
    entries = folder.entries(tmp_path / "results")
    assert all(e["n_failed_pairs"] for n, e in entries.items() if n.startswith("validation/"))


def test_a_camera_that_looks_at_the_horizon_leaves_the_other_images_compared(good, tmp_path):
    """The joint covariance of the check points was singular in numbers."""
    row = ("validation/trajectory.csv", 5, "phi_deg", "-45")
    assert ended(with_cell(good["in_heads"], tmp_path, *row), tmp_path / "results") == []
    assert len(pd.read_csv(tmp_path / "results/check_points.csv"))
