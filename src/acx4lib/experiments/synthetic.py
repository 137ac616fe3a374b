"""A synthetic image with a wrong reading of the heads' rotations, or with a wrong angle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4lib._typing import Array
from acx4lib.frames import opk_from_rotation, rotation_from_opk, turn
from acx4lib.relative_orientation import RelativeOrientation
from acx4lib.tie_points import TiePoints, overlaps, refine_by_mean_differences


def transposed(orientation: RelativeOrientation) -> RelativeOrientation:
    """Return the heads as they would stand if their rotations were read the other way round."""
    R_s_h = rotation_from_opk(orientation.opk)
    return replace(orientation, opk=opk_from_rotation(np.swapaxes(R_s_h, -1, -2)))


def turned(orientation: RelativeOrientation, k: int, *, angle: float) -> RelativeOrientation:
    """Return the heads with one of them turned about its own optical axis.

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Head.
    angle : float
        Radians; the head's kappa changes by as much.
    """
    opk = orientation.opk.copy()
    opk[k] = opk_from_rotation(rotation_from_opk(opk[k]) @ turn(2, angle))
    return replace(orientation, opk=opk)


@dataclass(frozen=True, kw_only=True, eq=False)
class Misfit:
    """How well the heads fit together in the synthetic image.

    Attributes
    ----------
    systematic_mm : float
        Root mean square of the differences that an error of the orientation has added, over all
        tie points; measuring errors cancel.
    refined_mm : float
        The same after the refinement by mean differences.
    largest_mm : float
        The largest of them after the refinement.
    """

    systematic_mm: float
    refined_mm: float
    largest_mm: float


def misfit(right: RelativeOrientation, wrong: RelativeOrientation, ties: TiePoints) -> Misfit:
    """Return what an error of the orientation does to the differences in the overlaps.

    Parameters
    ----------
    right, wrong : RelativeOrientation
        The same heads.
    ties : TiePoints
    """
    before = _differences(wrong, ties) - _differences(right, ties)
    refined = refine_by_mean_differences(wrong, ties)
    after = _differences(refined, ties) - _differences(
        refine_by_mean_differences(right, ties), ties
    )
    lengths = np.hypot(*after.T)
    return Misfit(
        systematic_mm=float(np.sqrt(np.mean(np.sum(before**2, axis=1)))),
        refined_mm=float(np.sqrt(np.mean(lengths**2))),
        largest_mm=float(lengths.max()),
    )


def _differences(orientation: RelativeOrientation, ties: TiePoints) -> Array:
    """Return the differences of all overlaps one after the other, shape (n, 2), mm."""
    return np.concatenate([overlap.d for overlap in overlaps(ties, orientation)])
