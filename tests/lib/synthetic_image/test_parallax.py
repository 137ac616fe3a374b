"""Base and relief: closed forms, and two real projections of one ground point."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from acx4lib.errors import AdjustmentError
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy
from acx4lib.geometry.collinearity import pinhole
from acx4lib.geometry.frames import Pose
from acx4lib.synthetic_image.parallax import (
    TYPICAL_BASES_M,
    bases,
    flight_parallax,
    parallax,
)
from support import blocks
from support.strategies import numbers

SYNTHETIC = Camera(
    name="SYN", width_px=12000, height_px=16200, pixel_mm=0.0056, interior=Interior(f=74.0)
)
RELIEF_M = np.array([10.0, 30.0, 100.0, 200.0])


@pytest.mark.parametrize(
    ("base_m", "height_m", "shift_px", "change_px"),
    [
        (0.10, 1000.0, 1.32, (0.01, 0.04, 0.15, 0.33)),
        (0.15, 1000.0, 1.98, (0.02, 0.06, 0.22, 0.50)),
        (0.30, 1000.0, 3.96, (0.04, 0.12, 0.44, 0.99)),
        (0.15, 1300.0, 1.52, (0.01, 0.04, 0.13, 0.28)),
        (0.30, 1300.0, 3.05, (0.02, 0.07, 0.25, 0.55)),
    ],
)
def test_shifts_of_usual_bases_and_heights(base_m, height_m, shift_px, change_px):
    """Worked out for Table 2, f / p = 13214 px, before there was a library; two decimals."""
    found = parallax(SYNTHETIC, np.array([base_m]), np.array([height_m]), RELIEF_M)
    assert_allclose(found.shift_px, [shift_px], atol=0.0051)
    assert_allclose(found.change_px, [change_px], atol=0.0051)


@given(
    base=numbers(0.5, smallest=0.01),
    height=numbers(4000.0, smallest=300.0),
    relief=numbers(250.0),
)
def test_two_lenses_see_a_ground_point_as_far_apart(base, height, relief):
    found = parallax(SYNTHETIC, np.array([base]), np.array([height]), np.array([relief]))

    def apart(z):
        seen = [
            pinhole(SYNTHETIC.interior.f, np.array([[120.0 - r, 80.0, z - height]]))
            for r in (0.0, base)
        ]
        first, second = (colrow_from_xy(SYNTHETIC, xy)[0] for xy in seen)
        return np.hypot(*(second - first))

    assert_allclose(found.shift_px, apart(0.0), rtol=1e-7)  # of a small difference
    assert_allclose(found.change_px[0, 0], apart(relief) - apart(0.0), atol=1e-8)


def test_heights_that_are_not_above_the_ground_have_no_parallax():
    found = parallax(SYNTHETIC, np.full(3, 0.2), np.array([150.0, 0.0, -20.0]), RELIEF_M)
    assert np.isnan(found.shift_px).tolist() == [False, True, True]
    assert np.isnan(found.change_px[0]).tolist() == [False, False, False, True]


# --- a flight --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def block():
    """Two heights, 1000 and 1300 m."""
    return blocks.standard()


def head(name, *r):
    return replace(SYNTHETIC, name=name, T_b_c=Pose(R=np.eye(3), r=np.array(r)))


HEADS = (head("A", 0.0, 0.0, 0.0), head("B", 0.12, 0.0, 0.0), head("C", 0.12, 0.16, 0.0))


def test_bases_are_the_distances_of_the_lenses():
    assert_allclose(bases(HEADS), [0.12, 0.20, 0.16], atol=1e-12)


def test_a_flights_shifts_follow_from_its_lever_arms_and_heights(block):
    found = flight_parallax(block, HEADS, SYNTHETIC)
    ground = block.control.x_m[:, 2]
    z = block.trajectory.T_m_b.r[:, 2]
    assert found.declared
    assert found.labels == ("A and B", "A and C", "B and C")
    assert_allclose(found.height_m, z - ground.mean())
    assert found.relief_m == pytest.approx(ground.max() - ground.mean())
    f_px = 74.0 / 0.0056
    assert_allclose(found.shift_px, f_px * np.outer([0.12, 0.20, 0.16], 1 / (z - ground.mean())))
    # the highest point is seen as far apart as from a flight so much lower
    seen = f_px * np.outer([0.12, 0.20, 0.16], 1 / (z - ground.max()))
    assert_allclose(found.shift_px + found.change_px, seen, rtol=1e-12)


def test_undeclared_lever_arms_are_replaced_by_typical_bases(block):
    found = flight_parallax(block, [HEADS[0], head("B", 0.0, 0.0, 0.0)], SYNTHETIC)
    assert not found.declared
    assert_allclose(found.base_m, TYPICAL_BASES_M)
    assert found.labels == ("0.1 m, typical", "0.3 m, typical")


def test_ground_may_be_told(block):
    found = flight_parallax(block, HEADS, SYNTHETIC, ground_m=np.array([100.0, 300.0]))
    assert_allclose(found.height_m, block.trajectory.T_m_b.r[:, 2] - 200.0)
    assert found.relief_m == 100.0


def test_without_control_the_heights_are_not_known(block):
    none = replace(block, control=block.control[:0])
    with pytest.raises(AdjustmentError, match="no control points: flying heights"):
        flight_parallax(none, HEADS, SYNTHETIC)


def test_the_table_has_the_lowest_and_the_highest_exposure(block):
    found = flight_parallax(block, HEADS, SYNTHETIC)
    table = found.table()
    assert table.index.tolist() == ["A and B", "A and C", "B and C"]
    assert_allclose(table["Base (m)"], [0.12, 0.20, 0.16])
    assert_allclose(table.iloc[:, 1], found.shift_px.max(axis=1))
    assert_allclose(table.iloc[:, 2], found.shift_px.min(axis=1))
    assert_allclose(table.iloc[:, 3], found.change_px.max(axis=1))
    assert len(repr(found)) < 120
