"""What is known of a camera's mounting before an adjustment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Mask
from acx4lib.geometry.parameters import MOUNT


@dataclass(frozen=True, kw_only=True)
class Prior:
    """What is known of a camera's mounting, in the order of `parameters.MOUNT`.

    Attributes
    ----------
    declared : tuple of bool
        Which values are declared; the others are zero for want of better ones.
    sigma : tuple of float
        Standard deviations of the declared values: the lever arm along the body's axes, m, the
        boresight about them, radians. Infinite where a value is an approximation only.

    Raises
    ------
    ValueError
        Where there are not six of them, or a sigma is not positive.
    """

    declared: tuple[bool, ...] = (False,) * len(MOUNT)
    sigma: tuple[float, ...] = (np.inf,) * len(MOUNT)

    def __post_init__(self) -> None:
        if len(self.declared) != len(MOUNT) or len(self.sigma) != len(MOUNT):
            msg = f"declared and sigma: expected {len(MOUNT)} values each"
            raise ValueError(msg)
        if not all(sigma > 0 for sigma in self.sigma):
            msg = f"sigma: expected positive numbers, got {self.sigma}"
            raise ValueError(msg)

    @property
    def lever_sigma(self) -> Array:
        """Standard deviations of the lever arm along the body's axes, m."""
        return np.array(self.sigma[:3])

    @property
    def boresight_sigma(self) -> Array:
        """Standard deviations of the boresight about the body's axes, radians."""
        return np.array(self.sigma[3:])

    @property
    def lever_declared(self) -> Mask:
        """Which components of the lever arm are declared."""
        return np.array(self.declared[:3])

    @property
    def boresight_declared(self) -> Mask:
        """Which angles of the boresight are declared."""
        return np.array(self.declared[3:])
