"""Two exposures, or two surveyed points, whose names were exchanged.

Both are rejected, and each is where the other was expected. So much is no chance, and the cure is
known: their names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np

from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.gross_errors.rejections import Exchange, Rejection, without
from acx4lib.bundle.network import Network
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import Pose, log

NEARER = 0.3
"""Share of its own misfit within which each of a pair lies by the other's name."""


def exchanges(
    block: Block,
    set_up: Callable[[Block], Network],
    bundle: Bundle,
    rejected: Sequence[Rejection],
    failed: Callable[[Bundle], AbstractSet[tuple[str, int]]],
) -> tuple[Exchange, ...]:
    """Return the pairs among rejected observations that were exchanged.

    Parameters
    ----------
    block : Block
        With all observations.
    set_up : callable
        Makes the network of a block.
    bundle : Bundle
        Adjusted without the effect of the rejected ones.
    rejected : sequence of Rejection
        All that the tests would reject.
    failed : callable
        Kinds and rows of the observations that fail their tests in another bundle of the block.
    """
    candidates = [*_exposures(block, bundle, rejected), *_control(block, bundle, rejected)]
    if not candidates:
        return ()
    mended = block
    for one in candidates:
        mended = _mended(mended, one)
    others = [r for r in rejected if not any(_is_of(one, r.kind, r.row) for one in candidates)]
    try:
        network = set_up(without(mended, others))
        again = adjust(network.beginning_at(bundle.state))
    except AdjustmentError:
        return ()
    wrong = failed(again)
    return tuple(one for one in candidates if not any(_is_of(one, *row) for row in wrong))


def pairs_of(own: Array, other: Array) -> Iterator[tuple[int, int]]:
    """Yield the pairs of rows that lie near each other's place and far from their own.

    Parameters
    ----------
    own : ndarray, shape (n,)
        Misfit of every row in its own place.
    other : ndarray, shape (n, n)
        Misfit of the row in the place of the column's row.
    """
    if len(own) < 2:
        return
    apart = np.where(np.eye(len(own), dtype=bool), np.inf, other)
    nearest = np.argmin(apart, axis=1)
    for i, j in enumerate(nearest):
        limit = NEARER * min(own[i], own[j])
        if i < j and nearest[j] == i and max(apart[i, j], apart[j, i]) < limit:
            yield i, int(j)


def _exposures(block: Block, bundle: Bundle, rejected: Sequence[Rejection]) -> Iterator[Exchange]:
    """Yield the exposures that are candidates: by their positions, else by their attitudes."""
    w = {kind: _largest(rejected, kind) for kind in ("gnss", "attitude")}
    kind = "gnss" if len(w["gnss"]) > 1 else "attitude"
    rows = np.array(sorted(w[kind]), dtype=np.intp)
    given, found = block.trajectory.T_m_b[rows], bundle.state.T_m_b[rows]
    apart = _apart(given, found, kind)
    for i, j in pairs_of(np.diagonal(apart), apart):
        a, b = int(rows[i]), int(rows[j])
        largest = max(of_kind.get(row, 0.0) for of_kind in w.values() for row in (a, b))
        names = (block.trajectory.exposures[a], block.trajectory.exposures[b])
        yield Exchange(kind="exposure", names=names, rows=(a, b), statistic=largest)


def _apart(given: Pose, found: Pose, kind: str) -> Array:
    """Return how far each given position or attitude is from each one found, (n, n), m or rad."""
    if kind == "gnss":
        return np.linalg.norm(given.r[:, None] - found.r[None], axis=2)
    turns = np.swapaxes(found.R, -1, -2)[None] @ given.R[:, None]
    n = len(turns)
    return np.linalg.norm(log(turns.reshape(-1, 3, 3)), axis=1).reshape(n, n)


def _control(block: Block, bundle: Bundle, rejected: Sequence[Rejection]) -> Iterator[Exchange]:
    """Yield the control points that are candidates."""
    w, control = _largest(rejected, "control_point"), block.control
    rows = np.array(sorted(w), dtype=np.intp)
    found = bundle.state.x_m[control.point_idx[rows]]
    apart = np.linalg.norm(control.x_m[rows][:, None] - found[None], axis=2)
    for i, j in pairs_of(np.diagonal(apart), apart):
        a, b = int(rows[i]), int(rows[j])
        names = (block.points[control.point_idx[a]], block.points[control.point_idx[b]])
        largest = max(w[a], w[b])
        yield Exchange(kind="control_point", names=names, rows=(a, b), statistic=largest)


def _largest(rejected: Sequence[Rejection], kind: str) -> dict[int, float]:
    """Return the largest w of every row of a kind that is rejected."""
    out: dict[int, float] = {}
    for one in rejected:
        if one.kind == kind:
            out[one.row] = max(out.get(one.row, 0.0), one.statistic)
    return out


def _is_of(one: Exchange, kind: str, row: int) -> bool:
    """Tell whether an observation is one of those that were exchanged."""
    kinds = ("gnss", "attitude") if one.kind == "exposure" else ("control_point",)
    return kind in kinds and row in one.rows


def _mended(block: Block, one: Exchange) -> Block:
    """Return the block with the values of two rows exchanged, and their sigma."""
    given, control = block.trajectory, block.control
    order = np.arange(len(given if one.kind == "exposure" else control))
    order[list(one.rows)] = one.rows[::-1]
    if one.kind == "exposure":
        mended = replace(
            given,
            T_m_b=given.T_m_b[order],
            sigma_position=given.sigma_position[order],
            sigma_attitude=given.sigma_attitude[order],
            time_s=given.time_s[order] if len(given.time_s) == len(order) else given.time_s,
        )
        return replace(block, trajectory=mended)
    moved = replace(
        control,
        x_m=control.x_m[order],
        sigma_m=control.sigma_m[order],
        R_g_m=control.R_g_m[order],
    )
    return replace(block, control=moved)
