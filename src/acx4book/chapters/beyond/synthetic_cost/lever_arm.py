"""Why the lever arm of a synthetic camera is not where the lens centres are.

The centres of four heads form a square, and each head looks outward over its corner. What it sees
is shifted outward on the ground by as much as its centre lies beside the square's. A camera in the
middle sees ground at the distances t H from below it; if it were higher by c, at t (H + c). The
shift does not depend on H, and at all flying heights it looks like a higher camera, with the factor
of least squares over the image: c = sum(d t) / sum(t t).
"""

from __future__ import annotations

import numpy as np

from acx4lib.expected import Array
from acx4sim.optics.head_truth import HEADS


def apparent_rise_m(side_m: float, f_mm: float, size_mm: Array) -> float:
    """Return how much higher the lens centre of the synthetic camera appears, m.

    Parameters
    ----------
    side_m : float
        Of the square of the heads' lens centres, parallel to the image.
    f_mm : float
    size_mm : ndarray, shape (2,)
        Of the image, evenly filled with points, each head in its quarter.
    """
    mean_t = size_mm / 4 / f_mm
    mean_t_t = size_mm**2 / 12 / f_mm**2
    return float(side_m / 2 * mean_t.sum() / mean_t_t.sum())


def true_centre_m() -> Array:
    """Return the mean of the lens centres of the simulated heads in the body frame, shape (3,)."""
    centre: Array = np.mean([head.lever_m for head in HEADS.values()], axis=0)
    return centre
