"""What held values that the data reject change on the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.held import Held
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array
from acx4lib.georeferencing import budget


@dataclass(frozen=True, kw_only=True, eq=False)
class Displacement:
    """Displacements of ground points, by freeing the rejected values together.

    Attributes
    ----------
    d, sigma : ndarray, shape (n, 3)
        Displacement and predicted standard deviation, m: along the strip, across it, height.
    """

    d: Array
    sigma: Array

    @property
    def largest_m(self) -> Array:
        """The largest displacement along each axis, shape (3,), m."""
        return np.abs(self.d).max(axis=0)

    @property
    def largest_sigma(self) -> Array:
        """The largest displacement along each axis over its predicted sigma, shape (3,)."""
        return np.abs(self.d / self.sigma).max(axis=0)


def on_ground(mounting: Mounting, held: Held) -> Displacement | None:
    """Return the displacements of the ground under the corners of the format, of all cameras.

    Direct georeferencing in a regular mapping flight like that of the block, by `budget.like`. The
    calibration moves by the linear step that frees the rejected values.

    Parameters
    ----------
    mounting : Mounting
        Of the single step or a rig.
    held : Held
        Its held values, tested.

    Returns
    -------
    Displacement or None
        None where nothing is rejected, no camera looks down or no such flight can be predicted.
    """
    if not held.rejected:
        return None
    calibration, block = _extended(mounting.calibration, held), mounting.bundle.network.block
    dx = held.change(held.rejected)[: calibration.n_columns]
    d: list[Array] = []
    sigma: list[Array] = []
    for camera in calibration.cameras:
        flight = budget.like(block, camera)
        if flight is not None and budget.looks_down(camera):
            sources = budget.at_corners(calibration, camera, flight)
            d.append(sources.by_parameters @ dx)
            sigma.append(budget.of(sources, calibration.layout).sigma)
    if not d:
        return None
    return Displacement(d=np.concatenate(d), sigma=np.concatenate(sigma))


def _extended(calibration: Calibration, held: Held) -> Calibration:
    """Return the calibration with columns of the held parameters before its own, without sigma."""
    n, columns = len(held.names), held.network.layout
    cov = np.zeros((n + calibration.n_columns,) * 2)
    cov[n:, n:] = calibration.cov
    return replace(
        calibration,
        layout=replace(
            calibration.layout,
            interior=columns.interior,
            mount=columns.mount,
            shift=np.where(columns.shift < n, columns.shift, -1),
        ),
        cov=cov,
        open_columns=np.append(np.zeros(n, dtype=bool), calibration.open_columns),
    )
