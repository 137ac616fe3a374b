"""The folder of a large flight is the block from which it was made."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration import mounting
from acx4lib.flight import reader
from acx4lib.geometry.camera import inside
from benchmarks.adjusting import bench_blocks
from benchmarks.commands import large_flight

pytestmark = [pytest.mark.slow, pytest.mark.repeats]


@pytest.fixture(scope="module")
def made():
    strips = bench_blocks.parallel([40], base_m=large_flight.BASE_M)
    return bench_blocks.fly(strips, 40 * large_flight.TIES_PER_IMAGE, control=(6, 6), seed=1).block


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    large_flight.write(folder, 40)
    return reader.read(folder).calibration


def test_poses_and_control_come_back(made, read):
    to_made = made.frame.from_grid(read.frame.to_grid(read.trajectory.T_m_b.r))
    assert_allclose(to_made, made.trajectory.T_m_b.r, atol=1e-5)
    axes = made.frame.grid_axes(to_made) @ made.trajectory.T_m_b.R  # in grid axes
    own = read.frame.grid_axes(read.trajectory.T_m_b.r) @ read.trajectory.T_m_b.R
    assert_allclose(own, axes, atol=1e-9)
    assert len(read.control) == len(made.control) == 36


def test_all_measurements_on_the_sensor_come_back(made, read):
    on_sensor = inside(made.cameras[0], made.image_points.colrow)
    expected, found = by_name(made), by_name(read)
    assert 0.999 < on_sensor.mean() < 1
    assert sorted(found) == sorted(n for n, on in zip(expected, on_sensor, strict=True) if on)
    apart = [np.subtract(found[name], expected[name]) for name in found]
    assert_allclose(apart, 0, atol=1e-6)


def by_name(block):
    points = block.image_points
    images = (block.images.names[i] for i in points.image_idx)
    names = zip(images, (block.points[i] for i in points.point_idx), strict=True)
    return dict(zip(names, points.colrow, strict=True))


def test_a_flight_less_in_order_is_calibrated_in_as_few_steps(tmp_path):
    large_flight.write_turned(tmp_path / "flight", 80)
    flight = reader.read(tmp_path / "flight")
    found = mounting.calibrate(flight.calibration, free=flight.estimate_mounting)
    for method in found.methods.values():
        assert method.bundle.solution.iterations <= 3
        assert abs(method.bundle.solution.sigma0_sq - 1) < 0.05
