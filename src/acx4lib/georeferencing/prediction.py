"""Exposures that took no part in a calibration, predicted by it: a test without check points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from acx4lib import expected, shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.expected import Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import transform
from acx4lib.geometry.parameters import Prior


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A block adjusted with its cameras held at a calibration.

    Attributes
    ----------
    method : str
    bundle : Bundle
        Poses and tie points are its unknowns, positions and attitudes its observations.
    """

    method: str
    bundle: Bundle

    def __repr__(self) -> str:
        """Say in a line how it fits."""
        return shown.line(
            f"Prediction by {self.method}",
            f"rays {self.rays_rms_px:.3f} px",
            f"positions {', '.join(f'{v:.3f}' for v in self.position_rms_m)} m",
            f"p of χ² {self.chi_square_p:.3f}",
        )

    @property
    def _seen(self) -> Mask:
        """Exposures with measurements: the others have no residuals."""
        network = self.bundle.network
        seen = np.zeros(len(network.pose_names), dtype=bool)
        seen[network.pose_idx[network.image_points.image_idx]] = True
        return seen

    @property
    def rays_rms_px(self) -> float:
        """Root mean square of the residuals of image coordinates, px."""
        v = self.bundle.network.residuals(self.bundle.state)[0][0]
        return float(np.sqrt(np.mean(v**2)))

    @property
    def position_rms_m(self) -> tuple[float, ...]:
        """Root mean square of adjusted minus recorded positions along the grid's axes, m."""
        observed, state = self.bundle.network.observed, self.bundle.state
        known = self._seen & np.isfinite(observed.sigma_position).all(axis=1)
        if not known.any():
            return (np.nan,) * 3
        off = transform(observed.R_g_m, state.T_m_b.r - observed.T_m_b.r)[known]
        return tuple(np.sqrt(np.mean(off**2, axis=0)).tolist())

    @property
    def chi_square_p(self) -> float:
        """Two-sided probability of such a weighted sum of squared residuals or a more extreme."""
        return self.bundle.solution.chi_square_p

    @property
    def sentence(self) -> str:
        """How well the exposures fit, in words."""
        n, east_north_height = int(self._seen.sum()), self.position_rms_m
        off = ", ".join(f"{value:.2f}" for value in east_north_height)
        return (
            f"there are no check points; {shown.count(n, 'exposure')} that took no part in the "
            f"calibration: rays meet within {self.rays_rms_px:.2f} px, positions are off by {off} "
            f"m (east, north, height; RMS), variance of unit weight "
            f"{self.bundle.solution.sigma0_sq:.3f} (p of chi-square {self.chi_square_p:.3f})"
        )


def predict(
    block: Block,
    cameras: Sequence[Camera],
    *,
    method: str,
    refraction: str = "none",
    gnss: Sequence[str] = (),
) -> Prediction:
    """Adjust a block with its cameras held at a calibration, and see how well that fits.

    Rays of the block's own tie points meet, and meet where the trajectory has them, if interior
    orientation and mounting are right. Gross errors are rejected as in the single step.

    Parameters
    ----------
    block : Block
        That took no part in the calibration, with tie points.
    cameras : sequence of Camera
        Calibrated, in the order of the block's cameras.
    method : str
        Name of the calibration in the results; it has no other effect.
    refraction : str
        ``"none"`` or ``"standard"``.
    gnss : sequence of str
        Errors of this block's own trajectory to estimate, as in `uses.mounted_orientation`.

    Raises
    ------
    AdjustmentError
        Where the block has too few points, or it does not converge.
    ValueError
        Where there is not one camera for each of the block's.

    Notes
    -----
    The calibration's own errors have no part in sigma. Those of m parameters, calibrated on as
    many exposures, add about m to a sum of squares that scatters by the root of twice the
    redundancy, which is more.
    """
    expected.instance("block", block, Block)
    expected.sequence("cameras", cameras, Camera)
    expected.many("cameras", cameras, len(block.cameras), "cameras")
    held = tuple(replace(camera, prior=Prior()) for camera in cameras)
    network = partial(mounted_orientation, free=(), free_mount=(), refraction=refraction, gnss=gnss)
    return Prediction(method=method, bundle=adjust_rejecting(replace(block, cameras=held), network))
