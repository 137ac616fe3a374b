"""The test of every single observation of a network at one adjustment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors.rejections import CRITICAL, KINDS
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations.points import usable
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.statistical import distributions
from acx4lib.least_squares.statistical.residuals import Group
from acx4lib.least_squares.statistical.w_test import CONTROLLED, statistics

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """The tested observations, in the order of `KINDS`; of control points each component.

    Attributes
    ----------
    kind : ndarray, shape (n,)
        Indices into `KINDS`.
    row, component : ndarray, shape (n,)
        As in `Rejection`.
    point, pose : ndarray, shape (n,)
        The point and the pose that it observes, -1 for none.
    """

    kind: Index
    row: Index
    component: Index
    point: Index
    pose: Index


def observations(network: Network) -> Observations:
    """Return the tested observations of a network."""
    free = np.flatnonzero(~network.held_control)
    in_block = np.flatnonzero(np.isin(network.block.control.point_idx, network.control.point_idx))
    points, poses = network.image_points, np.arange(len(network.pose_names))
    none = np.full(len(network.rows), -1)
    unmeasured = np.full(len(poses), -1)
    distances = usable(network.block.distances, points.point_idx)
    of_none = np.full(len(distances), -1)
    parts = [
        (network.rows, none, points.point_idx, network.pose_idx[points.image_idx]),
        (
            np.repeat(in_block[free], 3),
            np.tile(np.arange(3), len(free)),
            np.repeat(network.control.point_idx[free], 3),
            np.full(3 * len(free), -1),
        ),
        (poses, unmeasured, unmeasured, poses),
        (poses, unmeasured, unmeasured, poses),
        (distances, of_none, of_none, of_none),
    ]
    row, component, point, pose = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    kind = np.repeat(np.arange(len(KINDS)), [len(part[0]) for part in parts])
    return Observations(kind=kind, row=row, component=component, point=point, pose=pose)


def by_group(network: Network, values: NDArray[T]) -> list[NDArray[T]]:
    """Return values of the observations as columns, to be broadcast to the network's groups."""
    n, k = len(network.rows), int(np.sum(~network.held_control))
    n_poses = len(network.pose_names)
    image, control, *others = np.split(values, np.cumsum([n, 3 * k, n_poses, n_poses]))
    return [image[:, None], control.reshape(-1, 3), *(part[:, None] for part in others)]


def flat(values: Sequence[NDArray[T]]) -> NDArray[T]:
    """Return one value per observation, the largest of its components."""
    largest = [np.max(value, axis=1) for value in values]
    return np.concatenate([largest[0], values[1].ravel(), *largest[2:]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Verdict:
    """The test of every observation at one adjustment, the largest of its components.

    Attributes
    ----------
    w : ndarray, shape (n,)
        Zero where no other observation controls it.
    limit : ndarray, shape (n,)
    controlled : ndarray, shape (n,)
    largest : ndarray, shape (n,)
        The component with it.
    """

    w: Array
    limit: Array
    controlled: Mask
    largest: Index

    @property
    def failed(self) -> Mask:
        """Which observations disagree with the others."""
        return self.w > self.limit


Limits = Callable[[Sequence[Group], Sequence[Mask], float], list[float]]


def judge(limits: Limits, critical: float, bundle: Bundle, out: Mask) -> Verdict:
    """Test every observation, used or rejected.

    Parameters
    ----------
    limits : callable
        `w_test.w_limits` or `w_test.tau_limits`.
    critical : float
        Critical value of a normal variable.
    bundle : Bundle
        Adjusted with a factor `w_test.OUT` on the sigma of rejected observations.
    out : ndarray, shape (n,)
        Which are rejected.
    """
    groups, outs = bundle.solution.groups[: len(KINDS)], by_group(bundle.network, out)
    tested = [statistics(group, mask) for group, mask in zip(groups, outs, strict=True)]
    limit = [
        np.full(group.v.shape, value)
        for group, value in zip(groups, limits(groups, outs, critical), strict=True)
    ]
    return Verdict(
        w=flat([w for w, _ in tested]),
        limit=flat(limit),
        controlled=flat([controlled for _, controlled in tested]),
        largest=flat([_places_of_largest(w) for w, _ in tested]),
    )


def _places_of_largest(w: Array) -> Index:
    """Return, for every component, which one of its row is the largest; of control, itself."""
    largest: Index = np.argmax(w, axis=1)
    return np.repeat(largest[:, None], w.shape[1], axis=1)


def expected_failures(bundle: Bundle, *, critical: float = CRITICAL) -> float:
    """Return how many tests of a bundle fail by chance where all its observations are right.

    Parameters
    ----------
    bundle : Bundle
    critical : float
        Critical value of a normal variable, two-sided.
    """
    groups = bundle.solution.groups[: len(KINDS)]
    n = sum(int(np.sum(g.used & (g.redundancy > CONTROLLED))) for g in groups)
    return n * (2 * distributions.norm_sf(critical))
