"""Baarda's data snooping: adjust, test every residual, take out, adjust again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acx4lib._typing import Array
from acx4lib.block import Block
from acx4lib.bundle import Bundle, adjust
from acx4lib.gross_errors import CRITICAL, Rejection, without
from acx4lib.network import Network, State

SMEARED = 0.5
"""Share of the largest w below which an observation waits for the next round."""


def adjust_rejecting(
    block: Block, set_up: Callable[[Block], Network], *, critical: float = CRITICAL
) -> Bundle:
    """Adjust and take out gross errors by w-tests until none is left.

    Parameters
    ----------
    block : Block
    set_up : callable
        Makes the network of a block.
    critical : float

    Returns
    -------
    Bundle
        Of the block without what was rejected.

    Notes
    -----
    In every round the observation with the largest w goes, with all others at least half as far
    out that share neither its point nor its pose: a large error lifts the w of its neighbours
    over the critical value, and they are to be judged without it. Where the spread of a
    kind's w says that its a priori sigma is too small, w counts in units of that spread: a
    wrong weight is no gross error.
    """
    bundle = adjust(set_up(block))
    rejected: tuple[Rejection, ...] = ()
    while found := _gross_errors(bundle, critical):
        rejected += found
        network = set_up(without(block, rejected))
        bundle = adjust(replace(network, start=_warm(network, bundle.state)))
    return replace(bundle, rejected=rejected)


def _warm(network: Network, state: State) -> State:
    return replace(state, x_m=np.where(np.isfinite(state.x_m), state.x_m, network.start.x_m))


def _gross_errors(bundle: Bundle, critical: float) -> tuple[Rejection, ...]:
    """Return the observations to take out in this round, the largest w first."""
    candidates = sorted(_candidates(bundle, critical), key=lambda c: -c[0].statistic)
    if not candidates:
        return ()
    least = SMEARED * candidates[0][0].statistic
    network = bundle.network
    taken: list[Rejection] = []
    touched_points: set[int] = set()
    touched_poses: set[int] = set()
    for candidate, point, pose in candidates:
        if point in touched_points or pose in touched_poses or candidate.statistic < least:
            continue
        taken.append(candidate)
        touched_points.add(point)
        if candidate.kind != "control_point":
            touched_poses.add(pose)
        if candidate.kind in ("gnss", "attitude"):
            of_pose = network.pose_idx[network.image_points.image_idx] == pose
            touched_points.update(network.image_points.point_idx[of_pose].tolist())
    return tuple(taken)


def _candidates(bundle: Bundle, critical: float) -> list[tuple[Rejection, int, int]]:
    """Return every observation above the critical value with its point and pose, -1 for none."""
    network = bundle.network
    control = network.control[~network.held_control]
    control_row = np.flatnonzero(np.isin(network.block.control.point_idx, control.point_idx))
    out = []
    for group in bundle.solution.groups:
        w = np.abs(np.nan_to_num(group.w))
        worst = w.argmax(axis=1)
        limit = critical * _excess(group.w)
        for row in np.flatnonzero(w.max(axis=1, initial=0.0) > limit):
            point = pose = component = -1
            block_row = int(row)
            if group.kind == "image_point":
                block_row = int(network.rows[row])
                point = int(network.image_points.point_idx[row])
                pose = int(network.pose_idx[network.image_points.image_idx[row]])
            elif group.kind == "control_point":
                block_row, component = int(control_row[row]), int(worst[row])
                point = int(control.point_idx[row])
            else:
                pose = block_row
            statistic = float(w[row, worst[row]])
            rejection = Rejection(
                kind=group.kind, row=block_row, component=component, statistic=statistic
            )
            out.append((rejection, point, pose))
    return out


def _excess(w: Array) -> float:
    """Return by how much the spread of w exceeds one, robustly; one for few or good w."""
    known = np.abs(w[np.isfinite(w)])
    return max(1.0, float(np.median(known)) / 0.6745) if len(known) >= 20 else 1.0
