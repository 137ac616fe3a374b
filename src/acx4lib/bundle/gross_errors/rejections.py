"""Observations taken out of a block as gross errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.flight.block import Block
from acx4lib.least_squares.statistical import distributions

CRITICAL = 3.9
"""Critical value of a w-test: alpha = 0.01 % per component."""

POWER = 0.8
"""Probability with which an error of the detectable size is found."""

KINDS = ("image_point", "control_point", "gnss", "attitude", "distance")
"""Kinds of observations that may be rejected, in the order of a network's groups."""


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """One observation taken out as a gross error.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    row : int
        Index into the block's image points, control points, exposures or distances.
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


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """Two rows of a table that fit where their names are exchanged.

    Attributes
    ----------
    kind : str
        ``exposure``, ``control_point`` or ``check_point``.
    names : tuple of str
        Both names.
    rows : tuple of int
        Of the block's trajectory, control or check points.
    statistic : float
        The largest w of both as they are named.
    """

    kind: str
    names: tuple[str, str]
    rows: tuple[int, int]
    statistic: float

    @property
    def sentence(self) -> str:
        """Which two were exchanged, and why this is said."""
        a, b = self.names
        what = f"{self.kind.replace('_', ' ')}s {a} and {b}"
        return (
            f"{what} were exchanged: each is where the other should be, and both fit with their "
            f"names exchanged (w up to {self.statistic:.3g} as they are)"
        )


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
        What is taken out has an infinite sigma.

    Raises
    ------
    ValueError
        Where the block has no such row.
    """
    expected.instance("block", block, Block)
    rows = {
        kind: np.array([r.row for r in rejected if r.kind == kind], dtype=np.intp) for kind in KINDS
    }
    for kind, n in zip(KINDS, _numbers_of_rows(block), strict=True):
        expected.places(f"rejected: {kind} rows", rows[kind], n)
    components = [
        slice(None) if r.component < 0 else r.component
        for r in rejected
        if r.kind == "control_point"
    ]
    points, control, trajectory = block.image_points, block.control, block.trajectory
    sigma_px, sigma_m = points.sigma_px.copy(), control.sigma_m.copy()
    position, attitude = trajectory.sigma_position.copy(), trajectory.sigma_attitude.copy()
    sigma_px[rows["image_point"]] = np.inf
    for row, component in zip(rows["control_point"], components, strict=True):
        sigma_m[row, component] = np.inf
    sigma_of_distances = block.distances.sigma_m.copy()
    sigma_of_distances[rows["distance"]] = np.inf
    position[rows["gnss"]] = np.inf
    attitude[rows["attitude"]] = np.inf
    return replace(
        block,
        image_points=replace(points, sigma_px=sigma_px),
        control=replace(control, sigma_m=sigma_m),
        trajectory=replace(trajectory, sigma_position=position, sigma_attitude=attitude),
        distances=replace(block.distances, sigma_m=sigma_of_distances),
    )


def _numbers_of_rows(block: Block) -> tuple[int, ...]:
    """Return a block's number of observations of each of the `KINDS`."""
    n = len(block.trajectory)
    return len(block.image_points), len(block.control), n, n, len(block.distances)


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
    expected.positive_number("critical", critical)
    expected.probability("power", power)
    return critical + distributions.norm_ppf(power)
