"""The flight of the chapter: calibrated and validated, with the budgets of its check points."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.reader import read
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.accuracy import triple
from acx4lib.georeferencing.budget import Budget
from acx4lib.georeferencing.mapping_flight import Format, MappingFlight, over_format
from acx4lib.georeferencing.validation import Validation
from acx4lib.stages import mounting, validation
from acx4sim.designs import acx4_ideal
from acx4sim.files import writer
from acx4sim.plan import Options

HEIGHT_M = 1300.0
"""Flying height of the independent block."""

PAPERS, BARE = "single_step", "two_step"
"""The method of which most is shown, and the one that uses no position of the trajectory in its
bundle."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Examined:
    """A flight with a calibration and an independent block.

    Attributes
    ----------
    block : Block
        The independent block.
    calibrations : dict of str to Calibration
        By method.
    validations : dict of str to Validation
        By method.
    """

    block: Block
    calibrations: dict[str, Calibration]
    validations: dict[str, Validation]

    def points(self, method: str) -> Budget:
        """Return the budget of the check points, each intersected from all its rays."""
        found = self.validations[method]
        return budget.of(found.points.sources, found.georeferenced.layout)

    def pairs(self, method: str) -> Budget:
        """Return the budget of all pairs of rays, which the paper counts."""
        found = self.validations[method]
        return budget.of(found.pairs.sources, found.georeferenced.layout)

    def mapping(self, height_m: float = HEIGHT_M) -> MappingFlight:
        """Return a regular flight with the standard deviations of the independent block."""
        trajectory, points = self.block.trajectory, self.block.image_points
        return MappingFlight(
            height_m=height_m,
            sigma_position_m=triple(_rms(trajectory.sigma_position)),
            sigma_attitude=triple(_rms(trajectory.sigma_attitude)),
            sigma_px=float(_rms(points.sigma_px)),
            sigma_survey_m=triple(_rms(self.block.check.sigma_m)),
        )

    def over_format(self) -> Format:
        """Return the errors over the format of an image of this flight, single-step method."""
        return over_format(self.calibrations[PAPERS], self.mapping())


def _rms(values: Array) -> Array:
    found: Array = np.sqrt(np.mean(values**2, axis=0))
    return found


def flown(seed: int) -> Examined:
    """Simulate the design acx4-ideal, calibrate it and validate the calibrations.

    Parameters
    ----------
    seed : int
        Of the flight.
    """
    flight = acx4_ideal(seed=seed, options=Options(blocks=("calibration", "validation")))
    with tempfile.TemporaryDirectory() as temporary:
        written, results = Path(temporary) / "flight", Path(temporary) / "results"
        results.mkdir()
        writer.write(flight, written)
        files = read(written)
        mounting.run(files, results)
        stage = validation.run(files, results)
    return Examined(
        block=stage.block,
        calibrations=stage.calibrations,
        validations={found.method: found for found in stage.validations},
    )


def plan_and_height(variance: Array) -> Array:
    """Return variances in plan, east and north together, and in height.

    Parameters
    ----------
    variance : ndarray, shape (3, n_sources)

    Returns
    -------
    ndarray, shape (2, n_sources)
    """
    return np.stack([variance[0] + variance[1], variance[2]])
