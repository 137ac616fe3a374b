"""What the trajectory says of attitudes beside what the pictures say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4lib import shown
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import rph_from_rotation
from acx4tools.measuring.pictures.views import View

GAP_DEG = 20.0
"""Headings that are farther apart than this belong to different courses."""

R_NED_M = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def told(block: Block, views: Sequence[View]) -> Iterator[str]:
    """Yield a sentence on the attitudes of every strip, or of every course where none is named.

    A strip's mean tells of headings that depend on the heading, as those of a magnetometer do; its
    scatter tells what a single attitude is worth. A mounting that is not declared is in all means.

    Parameters
    ----------
    block : Block
        As the flight gives it.
    views : sequence of View
        With their orientations by the pictures; of some images of the block.
    """
    at = [block.images.names.index(view.name) for view in views]
    exposure, first = np.unique(block.images.exposure_idx[at], return_index=True)
    R_c_b = np.swapaxes(mountings(block.cameras).R, 1, 2)[block.images.camera_idx[at]]
    R_m_b = (np.array([view.T_m_c.R[0] for view in views]) @ R_c_b)[first]
    by_pictures = np.degrees(rph_from_rotation(R_NED_M @ R_m_b))
    given = np.degrees(rph_from_rotation(R_NED_M @ block.trajectory.T_m_b.R[exposure]))
    off = (given - by_pictures + 180) % 360 - 180
    strips = np.array(block.images.strips)[at][first]
    named = bool(np.all(strips != ""))
    group = np.unique(strips, return_inverse=True)[1] if named else _courses(by_pictures[:, 2])
    for k in range(int(group.max()) + 1):
        own = group == k
        heading = _mean_deg(by_pictures[own, 2])
        name = f"strip {strips[own][0]}, heading" if named else "heading"
        yield (
            f"{block.name}: {name} {heading:.0f}°, {shown.count(int(own.sum()), 'exposure')}: "
            f"the trajectory's roll, pitch, heading are off by {_numbers(off[own].mean(axis=0))}°, "
            f"each by {_numbers(np.sqrt(np.mean(np.square(off[own]), axis=0)), '')}° rms"
        )


def _courses(heading_deg: Array) -> Index:
    """Return the number of the course of every exposure; courses are apart by `GAP_DEG`."""
    order = np.argsort(heading_deg % 360)
    sorted_deg = (heading_deg % 360)[order]
    step = np.diff(sorted_deg, prepend=sorted_deg[-1] - 360) > GAP_DEG
    number = np.cumsum(step) % max(int(step.sum()), 1)
    out = np.zeros(len(order), dtype=np.intp)
    out[order] = number
    return out


def _mean_deg(angles: Array) -> float:
    turn = np.exp(1j * np.radians(angles)).mean()
    return float(np.degrees(np.angle(turn)) % 360)


def _numbers(values: Array, sign: str = "+") -> str:
    return ", ".join(f"{value:{sign}.1f}" for value in values.tolist())
