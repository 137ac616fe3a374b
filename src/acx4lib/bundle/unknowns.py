"""The unknowns of a bundle, and the columns of all but the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from acx4lib import expected, shown
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Interior
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.parameters import (
    AXES,
    MOUNT,
    POSE,
)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """The column of every unknown; no other module counts columns.

    Attributes
    ----------
    interior : ndarray, shape (n_cameras, 10)
        Columns of the interior parameters in the order of `camera.INTERIOR`, -1 where held.
    mount : ndarray, shape (n_cameras, 6)
        Columns of the mountings in the order of `MOUNT`, -1 where held.
    pose : ndarray, shape (n_poses, 6)
        Columns of the poses, -1 where held.
    shift : ndarray, shape (3,)
        Columns of the shift of all GNSS positions in the order of `AXES`, -1 where held.
    drift : ndarray, shape (n_drifts, 3)
        Columns of the drifts of GNSS positions.
    delay : ndarray, shape (1,)
        Column of the delay of positions, -1 where held.
    deviation : ndarray, shape (2,)
        Columns of the deviation of headings, by their sine and their cosine, -1 where held.
    """

    interior: Index
    mount: Index
    pose: Index
    shift: Index = field(default_factory=lambda: np.full(3, -1))
    drift: Index = field(default_factory=lambda: np.full((0, 3), -1))
    delay: Index = field(default_factory=lambda: np.full(1, -1))
    deviation: Index = field(default_factory=lambda: np.full(2, -1))

    @cached_property
    def n_columns(self) -> int:
        """Number of unknowns that are not points."""
        return int(sum(np.count_nonzero(getattr(self, f.name) >= 0) for f in fields(self)))


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """All unknowns of a bundle.

    Attributes
    ----------
    interiors : tuple of Interior
        One per camera.
    T_b_c : Pose
        Mountings, one per camera.
    T_m_b : Pose
        One per pose.
    x_m : ndarray, shape (n_points, 3)
        m.
    shift : ndarray, shape (3,)
        Common error of all observed positions along the grid's axes, m.
    drift : ndarray, shape (n_drifts, 3)
        Change of their error along each strip, m per unit of `Strips`' time.
    delay : ndarray, shape (1,)
        How much later than exposures positions are recorded, s.
    deviation : ndarray, shape (2,)
        By how much recorded headings are larger, times their sine and their cosine, radians.
    """

    interiors: tuple[Interior, ...]
    T_b_c: Pose
    T_m_b: Pose
    x_m: Array
    shift: Array = field(default_factory=lambda: np.zeros(3))
    drift: Array = field(default_factory=lambda: np.zeros((0, 3)))
    delay: Array = field(default_factory=lambda: np.zeros(1))
    deviation: Array = field(default_factory=lambda: np.zeros(2))


def moved(columns: Layout, state: State, dx: Array, dp: Array) -> State:
    """Return the state after a step; rotations are about the turned axes.

    Parameters
    ----------
    columns : Layout
    state : State
    dx : ndarray, shape (n_columns,)
    dp : ndarray, shape (n_points, 3)
        m.
    """
    padded = np.append(dx, 0.0)
    interior = np.array([i.to_array() for i in state.interiors])
    # a very large step must not make a focal length negative; damping then shortens it
    interior = interior + padded[columns.interior]
    interior[:, 0] = np.maximum(interior[:, 0], 1e-3)
    return State(
        interiors=tuple(Interior.from_array(row) for row in interior),
        T_b_c=_moved_pose(state.T_b_c, padded[columns.mount]),
        T_m_b=_moved_pose(state.T_m_b, padded[columns.pose]),
        x_m=state.x_m + dp,
        shift=state.shift + padded[columns.shift],
        drift=state.drift + padded[columns.drift],
        delay=state.delay + padded[columns.delay],
        deviation=state.deviation + padded[columns.deviation],
    )


def _moved_pose(T: Pose, step: Array) -> Pose:
    return Pose(R=T.R @ exp(step[:, 3:]), r=T.r + step[:, :3])


def named(
    columns: Layout,
    *,
    cameras: Sequence[str],
    strips: Sequence[str],
    poses: Sequence[str],
) -> list[str]:
    """Return a name for every column: its owner, a slash, the parameter.

    Parameters
    ----------
    columns : Layout
    cameras, strips, poses : sequence of str
        Names of the owners.
    """
    names = [""] * columns.n_columns
    for part, owners, labels in (
        (columns.interior, cameras, INTERIOR),
        (columns.mount, cameras, MOUNT),
        (columns.shift[None], ["GNSS"], [f"shift_{axis}" for axis in AXES]),
        (columns.drift, strips, [f"drift_{axis}" for axis in AXES]),
        (columns.delay[None], ["GNSS"], ["delay"]),
        (columns.deviation[None], ["attitude"], ["deviation_sin", "deviation_cos"]),
        (columns.pose, poses, POSE),
    ):
        for row, owner in zip(part, owners, strict=True):
            for column, label in zip(row, labels, strict=True):
                if column >= 0:
                    names[column] = f"{owner}/{label}"
    return names


def layout(
    n_cameras: int,
    n_poses: int,
    *,
    free: Sequence[str],
    free_mount: Sequence[str] = (),
    free_shift: Sequence[str] = (),
    n_drifts: int = 0,
    recorded: Sequence[str] = (),
) -> Layout:
    """Return the column of every unknown: interior and mounting by camera, trajectory, then poses.

    Parameters
    ----------
    n_cameras, n_poses : int
    free : sequence of str
        Interior parameters to estimate, names of `camera.INTERIOR`.
    free_mount : sequence of str
        Parameters of the mounting to estimate, names of `MOUNT`.
    free_shift : sequence of str
        Axes of the GNSS shift to estimate, names of `AXES`.
    n_drifts : int
    recorded : sequence of str
        Errors of the recorded trajectory to estimate, ``"delay"`` and ``"deviation"``.
    """
    of_camera = [name in free for name in INTERIOR] + [name in free_mount for name in MOUNT]
    columns, n_before = [], 0
    for is_free in (
        np.tile(of_camera, (n_cameras, 1)),
        np.array([name in free_shift for name in AXES]),
        np.ones((n_drifts, 3), dtype=bool),
        np.array(["delay" in recorded]),
        np.full(2, "deviation" in recorded),
        np.ones((n_poses, 6), dtype=bool),
    ):
        counted = n_before + np.cumsum(is_free).reshape(is_free.shape)
        columns.append(np.where(is_free, counted - 1, -1))
        n_before += int(is_free.sum())
    camera, shift, drift, delay, deviation, pose = columns
    return Layout(
        interior=camera[:, : len(INTERIOR)],
        mount=camera[:, len(INTERIOR) :],
        shift=shift,
        drift=drift,
        delay=delay,
        deviation=deviation,
        pose=pose,
    )


def holding(columns: Layout, held: Index) -> Layout:
    """Return a layout in which some of its columns are held, and the others are renumbered.

    Parameters
    ----------
    columns : Layout
    held : ndarray, shape (k,)
        Columns of `columns`.
    """
    expected.places("held", held, columns.n_columns)
    stays = np.ones(columns.n_columns + 1, dtype=bool)  # column -1 is held before and after
    stays[[*held, -1]] = False
    new = np.where(stays, np.cumsum(stays) - 1, -1)
    return Layout(**{f.name: new[getattr(columns, f.name)] for f in fields(Layout)})
