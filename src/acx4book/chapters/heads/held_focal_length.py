"""The heads calibrated with a wrong focal length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.uses import free_orientation
from acx4lib.calibration.heads import Heads, RelativeOrientation, relative_orientation
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array
from acx4lib.flight.block import Block, select_cameras
from acx4lib.flight.reader import Flight
from acx4lib.stages.heads import HeadsStage


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldFocalLength:
    """The heads calibrated with a focal length held at some value.

    Attributes
    ----------
    change_mm : ndarray, shape (n_heads,)
        Of every head's focal length against the first calibration.
    bundles : dict of str to Bundle
        By head; one that cannot be adjusted so is missing.
    orientation : RelativeOrientation or None
        None where a head is missing, or where the heads share no exposure.
    """

    change_mm: Array
    bundles: dict[str, Bundle]
    orientation: RelativeOrientation | None

    @property
    def sigma0_sq(self) -> float:
        """A posteriori variance of unit weight, mean of the heads."""
        return float(np.mean([fit.solution.sigma0_sq for fit in self.bundles.values()]))

    @property
    def control_rms_m(self) -> float:
        """Root mean square of all components of the control points' residuals, all heads."""
        v = [fit.solution.group("control_point").v.ravel() for fit in self.bundles.values()]
        squares = np.concatenate(v) ** 2
        return float(np.sqrt(squares.mean())) if len(squares) else np.nan

    @property
    def above_gnss_m(self) -> dict[str, float]:
        """By head, how high its images stand above the trajectory's positions in the mean."""
        rise = {}
        for name, fit in self.bundles.items():
            images, trajectory = fit.network.block.images, fit.network.block.trajectory
            above = fit.T_m_c.r[:, 2] - trajectory.T_m_b.r[images.exposure_idx, 2]
            rise[name] = float(above[fit.oriented].mean())
        return rise


def all_heads(
    flight: Flight, stage: HeadsStage, changes_mm: Sequence[float]
) -> list[HeldFocalLength]:
    """Calibrate all heads again with the focal length held at other values.

    Parameters
    ----------
    flight : Flight
    stage : HeadsStage
    changes_mm : sequence of float
        Against the first calibration, the same for all heads.
    """
    n = len(stage.heads.bundles)
    return [hold(flight, stage, np.full(n, float(change))) for change in changes_mm]


def last_head(flight: Flight, stage: HeadsStage, change_mm: float) -> HeldFocalLength:
    """Calibrate the heads again with the focal length of the last one held at another value."""
    change = np.zeros(len(stage.heads.bundles))
    change[-1:] = change_mm
    return hold(flight, stage, change)


def hold(flight: Flight, stage: HeadsStage, change_mm: Array) -> HeldFocalLength:
    """Calibrate the heads again with other focal lengths held.

    Gross errors that were found before stay out, and none are looked for: a wrong focal length
    is to show itself.

    Parameters
    ----------
    flight : Flight
    stage : HeadsStage
    change_mm : ndarray, shape (n_heads,)
        Added to the focal lengths of the first calibration.
    """
    held = tuple(name for name in flight.estimate_heads if name != "f")
    fits, bundles = stage.heads.bundles, {}
    for (name, fit), change in zip(fits.items(), change_mm, strict=True):
        block = _with_focal_length(fit, float(change))
        try:
            bundles[name] = adjust(
                free_orientation(block, free=held, refraction=fit.network.refraction)
            )
        except AdjustmentError:
            continue
    orientation, synthetic = None, flight.synthetic_camera
    if stage.orientation is not None and synthetic is not None and len(bundles) == len(fits) > 1:
        orientation = relative_orientation(
            Heads(bundles=bundles, failures={}), synthetic, weak=True
        )
    return HeldFocalLength(change_mm=change_mm, bundles=bundles, orientation=orientation)


def asked_by_gnss(held: Sequence[HeldFocalLength]) -> dict[str, float]:
    """Return the focal lengths with which the cameras would stand at the trajectory's heights.

    A wrong focal length lifts or lowers the cameras in proportion, so that a straight line
    through the mean heights over the held focal lengths tells where they are right. A lever arm
    is not taken off: 1 m of it is f over the flying height in m.

    Parameters
    ----------
    held : sequence of HeldFocalLength
        With at least two different focal lengths of every head.

    Returns
    -------
    dict of str to float
        f in mm by head; only heads that all of `held` have.
    """
    names = [name for name in held[0].bundles if all(name in h.bundles for h in held)]
    f = {}
    for name in names:
        tried = [h.bundles[name].cameras[0].interior.f for h in held]
        rise = [h.above_gnss_m[name] for h in held]
        f[name] = float(np.polynomial.Polynomial.fit(rise, tried, 1)(0.0))
    return f


def _with_focal_length(fit: Bundle, change_mm: float) -> Block:
    """Return the block of a calibrated head with another focal length declared."""
    block, interior = fit.network.block, fit.cameras[0].interior
    camera = block.cameras[0].with_interior(replace(interior, f=interior.f + change_mm))
    return replace(select_cameras(block, [camera.name]), cameras=(camera,))
