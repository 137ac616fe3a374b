"""Exposures and control points that stand out from the others of a block, to be named in errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib.expected import Array
from acx4lib.flight.block import Block

FAR, TILTED = 20.0, np.radians(20.0)
"""An exposure stands out that is so many median distances from the middle of all, or turned so far
against the median vertical."""

MOST_NAMED = 3


def sentence(block: Block) -> str:
    """Return which exposures and control points stand out, as a part of a sentence.

    Parameters
    ----------
    block : Block
    """
    at, trajectory = block.trajectory.T_m_b, block.trajectory
    middle = np.median(at.r, axis=0)
    apart = np.linalg.norm(at.r - middle, axis=1)
    usual = max(float(np.median(apart)), 1.0)
    up = np.median(at.R[:, :, 2], axis=0)
    tilt = np.arccos(np.clip(at.R[:, :, 2] @ up / max(float(np.linalg.norm(up)), 1e-9), -1, 1))
    names = [block.points[i] for i in block.control.point_idx]
    survey = np.linalg.norm(block.control.x_m - middle, axis=1)
    parts = [
        *_named("exposure", trajectory.exposures, apart / usual / FAR),
        *_named("exposure", trajectory.exposures, tilt / TILTED),
        *_named("control point", names, survey / usual / FAR),
    ]
    return f", in which {', '.join(dict.fromkeys(parts))} stand out," if parts else ""


def _named(what: str, names: Sequence[str], size: Array) -> list[str]:
    """Return the largest of those with a size above one."""
    worst = [i for i in np.argsort(-size)[:MOST_NAMED] if not size[i] <= 1]
    return [f"{what} {names[i]}" for i in worst]
