"""Rejected observations, and groups with too many of them to be single errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.block import Block
from acx4lib.expected import Index
from acx4lib.least_squares import statistics

# --- Observations rejected as gross errors


CRITICAL = 3.9
"""Critical value of a w-test: alpha = 0.01 % per component."""

POWER = 0.8
"""Probability with which an error of the detectable size is found."""

KINDS = ("image_point", "control_point", "gnss", "attitude")
"""Kinds of observations that may be rejected, in the order of a network's groups."""


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """An observation rejected as a gross error.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    row : int
        Index into the block's image points, control points or exposures.
    component : int
        Component of a control point; -1 for the whole observation.
    statistic : float
        Its w.
    limit : float
        Limit that its w exceeds.
    largest : int
        Component with the largest w; -1 where it is not known.
    """

    kind: str
    row: int
    component: int
    statistic: float
    limit: float = CRITICAL
    largest: int = -1

    def __post_init__(self) -> None:
        expected.one_of("kind", self.kind, KINDS)


def without(block: Block, rejected: Sequence[Rejection]) -> Block:
    """Return the block without some observations.

    Parameters
    ----------
    block : Block
    rejected : sequence of Rejection
        Their rows are indices in this block.

    Returns
    -------
    Block
        The rejected observations have an infinite sigma.
    """
    points, control, trajectory = block.image_points, block.control, block.trajectory
    sigma = {
        "image_point": points.sigma_px.copy(),
        "control_point": control.sigma_m.copy(),
        "gnss": trajectory.sigma_position.copy(),
        "attitude": trajectory.sigma_attitude.copy(),
    }
    for r in rejected:
        if r.component < 0:
            sigma[r.kind][r.row] = np.inf
        else:
            sigma[r.kind][r.row, r.component] = np.inf
    return replace(
        block,
        image_points=replace(points, sigma_px=sigma["image_point"]),
        control=replace(control, sigma_m=sigma["control_point"]),
        trajectory=replace(
            trajectory, sigma_position=sigma["gnss"], sigma_attitude=sigma["attitude"]
        ),
    )


def noncentrality(*, critical: float = CRITICAL, power: float = POWER) -> float:
    """Return delta_0: the shift of w that the test finds with the probability `power`.

    4.74 for a critical w of 3.9 (alpha = 0.01 %); textbooks have 4.13 for 3.29 (alpha = 0.1 %).

    Parameters
    ----------
    critical : float
        Critical value of w.
    power : float
        The other side of the two-sided test is neglected: its probability is below 1e-16.

    Raises
    ------
    ValueError
        Where `critical` is not positive or `power` is no probability.
    """
    expected.positive("critical", critical)
    return critical + statistics.norm_ppf(power)


# --- Limits of data snooping: more rejections mean a systematic error or a wrong sigma
#
# Data snooping finds single errors. If it rejected a large part of a group, the rest would agree
# with itself and prove nothing. Then no observation of this group is rejected, and it is named.


ROWS = (10, 3)
"""Attitudes (by component), positions, control points: more than 1 in 10, at least 3."""

OF_IMAGE, OF_CAMERA = (3, 10), (5, 10)
"""Rays of one image: more than one in three; of one camera: more than one in five; at least 10."""

NAMES = {
    "attitude": "attitudes",
    "gnss": "GNSS positions",
    "control_point": "control points",
}

COMPONENTS = {
    "attitude": ("roll", "pitch", "heading"),
    "gnss": ("east", "north", "height"),
    "control_point": ("east", "north", "height"),
}


@dataclass(frozen=True, kw_only=True)
class Stopped:
    """A group in which data snooping would reject too much, and therefore rejects nothing.

    Attributes
    ----------
    kind : str
        One of `rejections.KINDS`.
    names : tuple of str
        The images, or the camera, of the rays; empty for other kinds. Of several images, the
        worst stands first, with its numbers.
    n_rejected : int
        Number of rejections in the group or in the first image.
    n : int
        Number of its observations.
    components : tuple of str
        Components that would have been rejected most, such as ``pitch``.
    """

    kind: str
    n_rejected: int
    n: int
    names: tuple[str, ...] = ()
    components: tuple[str, ...] = ()

    @property
    def group(self) -> str:
        """The group in words: ``attitudes (pitch)``, ``rays of image A1``."""
        if self.kind == "image_point":
            first, *others = self.names
            more = f", and too many of {len(others)} other images" if others else ""
            return f"rays of {first}{more}"
        components = f" ({', '.join(self.components)})" if self.components else ""
        return f"{NAMES[self.kind]}{components}"


def sentence(stopped: Sequence[Stopped]) -> str:
    """Return one sentence on the groups that exceed the limits."""
    groups = "; ".join(f"{group.n_rejected} of {group.n} {group.group}" for group in stopped)
    return (
        f"data snooping would reject {groups}: a systematic error or a wrong sigma, no single "
        "errors, so none of them is rejected"
    )


def too_many(n_rejected: int, n: int, limit: tuple[int, int] = ROWS) -> bool:
    """Tell whether rejections are too many to be single gross errors.

    Parameters
    ----------
    n_rejected, n : int
        Rejected observations of a group, and all.
    limit : tuple of int
        More than one in so many, and at least so many: `ROWS`, `OF_IMAGE` or `OF_CAMERA`.
    """
    one_in, least = limit
    return n_rejected >= least and one_in * n_rejected > n


def within_limits(
    block: Block, rows: Index, rejected: Sequence[Rejection]
) -> tuple[tuple[Rejection, ...], tuple[Stopped, ...]]:
    """Return the rejections that are single errors, and the groups with too many rejections.

    Parameters
    ----------
    block : Block
    rows : ndarray of int
        Its image points that were tested.
    rejected : sequence of Rejection
    """
    rayless = _without_rays(block, rows, rejected)
    stopped = [
        *(_of_rows(block, [*rejected, *rayless], kind) for kind in NAMES),
        *_of_rays(block, rows, rejected),
    ]
    groups = tuple(group for group in stopped if group is not None)
    points = {int(block.control.point_idx[r.row]) for r in rayless}
    kept = (r for r in rejected if not any(_is_of(block, r, s, points) for s in groups))
    return tuple(kept), groups


def _without_rays(block: Block, rows: Index, rejected: Sequence[Rejection]) -> list[Rejection]:
    """Return the rejections of control points that would lose all of their rays."""
    out = [r.row for r in rejected if r.kind == "image_point"]
    point_idx = block.image_points.point_idx
    used = np.zeros(len(point_idx), dtype=bool)
    used[rows] = True
    used[out] = False
    kept = np.bincount(point_idx[used], minlength=len(block.points))[block.control.point_idx] > 0
    lost = ~kept & np.isin(block.control.point_idx, point_idx[out])
    return [
        Rejection(kind="control_point", row=int(row), component=-1, statistic=np.inf)
        for row in np.flatnonzero(lost)
    ]


def _is_of(block: Block, rejection: Rejection, group: Stopped, rayless: Set[int]) -> bool:
    """Tell whether a group contains a rejection; of control points, also rays of `rayless` ones."""
    if rejection.kind != "image_point":
        return rejection.kind == group.kind
    if group.kind == "control_point":
        return int(block.image_points.point_idx[rejection.row]) in rayless
    if group.kind != "image_point":
        return False
    image = block.image_points.image_idx[rejection.row]
    camera = block.cameras[block.images.camera_idx[image]].name
    return f"image {block.images.names[image]}" in group.names or f"camera {camera}" in group.names


def _of_rows(block: Block, rejected: Sequence[Rejection], kind: str) -> Stopped | None:
    """Return the trajectory rows or control points, if too many would be rejected."""
    rejected_rows = {(r.row, r.largest) for r in rejected if r.kind == kind}
    n_rows, n = len({row for row, _ in rejected_rows}), _number(block, kind)
    by_component = [
        sum(largest == k for _, largest in rejected_rows) for k in range(len(COMPONENTS[kind]))
    ]
    components = tuple(
        name
        for name, count in zip(COMPONENTS[kind], by_component, strict=True)
        if too_many(count, n)
    )
    stops = bool(components) if kind == "attitude" else too_many(n_rows, n)
    return Stopped(kind=kind, n_rejected=n_rows, n=n, components=components) if stops else None


def _number(block: Block, kind: str) -> int:
    """Return how many rows of a kind a block has and uses."""
    if kind == "control_point":
        known = np.isfinite(block.control.sigma_m).any(axis=1)
        return int(np.sum(known & (block.rays[block.control.point_idx] > 0)))
    trajectory = block.trajectory
    sigma = trajectory.sigma_position if kind == "gnss" else trajectory.sigma_attitude
    used = np.unique(block.images.exposure_idx)
    return int(np.isfinite(sigma[used]).any(axis=1).sum())


def _of_rays(block: Block, rows: Index, rejected: Sequence[Rejection]) -> Iterator[Stopped]:
    """Yield the cameras whose rays would be rejected too often, then the images of others."""
    image_idx, n_images = block.image_points.image_idx, len(block.images)
    out = np.array([r.row for r in rejected if r.kind == "image_point"], dtype=np.intp)
    n_out = np.bincount(image_idx[out], minlength=n_images)
    n_all = np.bincount(image_idx[rows], minlength=n_images)
    alone = np.ones(n_images, dtype=bool)
    for k, camera in enumerate(block.cameras):
        of_camera = block.images.camera_idx == k
        n_rejected, n = int(n_out[of_camera].sum()), int(n_all[of_camera].sum())
        if too_many(n_rejected, n, OF_CAMERA):
            alone &= ~of_camera
            of = (f"camera {camera.name}",)
            yield Stopped(kind="image_point", n_rejected=n_rejected, n=n, names=of)
    bad = [i for i in np.flatnonzero(alone) if too_many(n_out[i], n_all[i], OF_IMAGE)]
    bad.sort(key=lambda i: -n_out[i] / n_all[i])
    if bad:
        n_rejected, n, names = int(n_out[bad[0]]), int(n_all[bad[0]]), block.images.names
        images = tuple(f"image {names[i]}" for i in bad)
        yield Stopped(kind="image_point", n_rejected=n_rejected, n=n, names=images)
