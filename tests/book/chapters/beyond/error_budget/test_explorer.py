"""At its stops the explorer says what the library computes for such a flight."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.beyond.error_budget import explorer
from acx4book.chapters.beyond.error_budget.tables import plan_and_height
from acx4lib.georeferencing.mapping_flight import over_ground


@pytest.fixture(scope="module")
def shown(found):
    flown = replace(found.mapping, height_m=1300.0)
    return explorer.explorer(found.calibrations["single_step"], flown)


def straight(calibration, values):
    """Return σ in plan and in height, cm, of a flight with the sliders' values."""
    height_m, sigma_px, gnss_cm, tilt, heading = values
    flight = replace(
        explorer.unit_flight(height_m),
        sigma_px=sigma_px,
        sigma_position_m=(gnss_cm / 100,) * 3,
        sigma_attitude=tuple(np.radians([tilt, tilt, heading])),
    )
    mean = plan_and_height(over_ground(calibration, flight).mean)
    return 100 * np.sqrt(mean.sum(axis=-1))


@pytest.mark.parametrize(
    "values", [[500.0, 0.5, 5.0, 0.005, 0.008], [3000.0, 3.0, 30.0, 0.02, 0.04]]
)
def test_all_together_is_the_predicted_sigma(shown, found, values):
    *parts, together = [[float(x) for x in row] for row in shown.readings(values)]
    assert together == pytest.approx(straight(found.calibrations["single_step"], values), abs=0.051)
    assert np.linalg.norm(parts, axis=0) == pytest.approx(together, abs=0.2)


def test_it_starts_as_the_flight_was_simulated(shown):
    assert shown.start == [1300.0, 1.5, 2.0, 0.005, 0.008]
    for values in shown.presets.values():
        for value, slider in zip(values, shown.sliders, strict=True):
            assert slider.low <= value <= slider.high


def test_a_slider_moves_its_own_row_alone(shown):
    before = shown.readings(shown.start)
    values = [*shown.start[:2], 20.0, *shown.start[3:]]
    changed = [a != b for a, b in zip(before, shown.readings(values), strict=True)]
    assert dict(zip(shown.rows, changed, strict=True)) == {
        name: name in ("GNSS", "all together") for name in shown.rows
    }
