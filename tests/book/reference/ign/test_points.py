"""Seven UltraCam images: through convergence, geoid and altered heights to surveyed points."""

from __future__ import annotations

import numpy as np
import pytest

from acx4book.reference.ign import files, points
from support.reference_files import needs

AXES = ["east", "north", "height"]


@pytest.fixture(scope="module")
def table():
    return points.results().set_index("point")


@pytest.fixture(scope="module")
def steps():
    return points.forgotten_steps().set_index("reading")


@needs("ign-uce-m3")
def test_680_tie_points_intersect_within_a_fifth_of_a_pixel():
    flight = points.load()
    got = points.intersected(flight, points.complete(flight))
    is_tie = ~flight.is_surveyed[got.rays.group]
    assert len(np.unique(got.rays.group[is_tie])) == 680
    assert np.sqrt((got.found.v[is_tie] ** 2).mean(axis=0)).max() < 0.2  # px


@needs("ign-uce-m3")
def test_tie_points_have_igns_coordinates(table):
    tie = table[table["kind"] == "tie point"]
    d = tie[[f"d_{axis}_m" for axis in AXES]].to_numpy()
    assert np.abs(d.mean(axis=0)).max() < 0.01  # m
    # most have two rays that meet at 8 degrees; 0.2 px are 0.1 m in height
    assert (d.std(axis=0) < [0.03, 0.02, 0.11]).all()


@needs("ign-uce-m3")
@pytest.mark.parametrize(("point", "rays", "ground_pixels"), [("1003", 3, 1.0), ("1006", 2, 2.5)])
def test_surveyed_points_in_space(table, point, rays, ground_pixels):
    assert table.loc[point, "rays"] == rays
    assert table.loc[point, "ground_pixels"] < ground_pixels


@needs("ign-uce-m3")
def test_point_1005(table):
    """In space the point nearest to its two rays is just within 2.5 pixels on the ground.

    The least-squares point has the smaller image residuals and lies 3 mm farther away.
    """
    own = table.loc["1005"]
    pixel_m = points.ground_pixel_m(points.load())
    assert own["rays"] == 2
    assert own["nearest_ground_pixels"] < 2.5
    assert max(abs(own[f"d_{axis}_m"]) for axis in AXES) < 2.5 * pixel_m


@needs("ign-uce-m3")
def test_surveyed_points_lie_within_three_predicted_sigma(table):
    surveyed = table[table["kind"] == "surveyed"]
    assert len(surveyed) == 3
    for axis in AXES:
        in_sigma = surveyed[f"d_{axis}_m"].abs() / surveyed[f"sigma_{axis}_m"]
        assert in_sigma.max() < 3


@needs("ign-uce-m3")
def test_each_forgotten_step_costs_what_it_should(steps):
    """Magnitudes from the map scale, the convergence and the undulation at this place."""
    height = steps["mean_height_m"]
    assert abs(height["complete"]) < 0.01
    above_m = 1763
    assert height["linear alteration left in"] == pytest.approx(0.000283 * above_m, abs=0.01)
    assert height["geoid forgotten"] == pytest.approx(-49.33, abs=0.03)
    assert height["map as Cartesian, true heights"] == pytest.approx(-0.000283 * above_m, abs=0.03)
    assert abs(height["map as Cartesian, altered heights"]) < 0.05
    assert steps.loc["convergence forgotten", "residual_px"] > 20
    assert steps.loc["one vertical for all images", "misfit_px"] > 20
    assert steps.loc["complete", "misfit_px"] < 0.25


def test_linear_alteration_is_undone():
    true = np.array([1763.0, 900.0])
    altered = 4.0 + 1.000283 * (true - 4.0)
    got = files.unaltered(altered, ground=4.0, scale=1.000283)
    np.testing.assert_allclose(got, true, atol=1e-9)
