"""Weights of the observations: from the given sigma, or from sigma that fit the residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.variance_components import (
    PARTS,
    Component,
    components,
    group_names,
    image_groups,
)
from acx4lib.calibration.mounting import single_step
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array
from acx4lib.flight.block import Block

CONVERGED = 1e-3
MAX_ITERATIONS = 30
LARGEST_STEP = 3.0  # of a factor in one iteration


def weighted(
    block: Block,
    *,
    weights: str,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    gnss: Sequence[str] = (),
) -> tuple[Block, dict[str, float]]:
    """Return a block with the standard deviations its flight asks for, and their factors.

    Parameters
    ----------
    block : Block
    weights : str
        ``"given"``, or ``"estimated"`` from the residuals of the single step.
    free, fix, refraction, gnss
        As in `mounting.single_step`.

    Raises
    ------
    AdjustmentError
        Where the single step or the factors do not converge.
    ValueError
        For other weights.
    """
    expected.instance("block", block, Block)
    expected.one_of("weights", weights, ("given", "estimated"))
    if weights == "given":
        return block, {}
    factors = estimated(
        block,
        lambda b: single_step(b, free=free, fix=fix, refraction=refraction, gnss=gnss).bundle,
    )
    return scaled(block, factors), factors


def estimated(block: Block, adjust_block: Callable[[Block], Bundle]) -> dict[str, float]:
    """Return the factor of every group's sigma that makes them fit the residuals.

    A group with too little effective redundancy keeps its sigma: its factor is one.

    Parameters
    ----------
    block : Block
    adjust_block : callable
        Adjusts a block, with or without a search for gross errors.

    Raises
    ------
    AdjustmentError
        Where an adjustment or the factors do not converge.
    """
    factors: dict[str, float] = {}
    steps: dict[str, float] = {}
    held: set[str] = set()
    for _ in range(MAX_ITERATIONS):
        estimates = components(adjust_block(scaled(block, factors)), applied=factors)
        held |= {c.group for c in estimates if not c.estimable}
        steps = {c.group: 1 / c.applied if c.group in held else _step(c) for c in estimates}
        factors = {c.group: c.applied * steps[c.group] for c in estimates}
        if all(abs(step - 1) < CONVERGED for step in steps.values()):
            return factors
    worst = max(steps, key=lambda name: abs(np.log(steps[name])))
    msg = (
        f"the standard deviations cannot be estimated: after {MAX_ITERATIONS} adjustments those "
        f'of {worst} still change by {100 * abs(steps[worst] - 1):.1f} %; use weights = "given"'
    )
    raise AdjustmentError(msg)


def _step(c: Component) -> float:
    """Return the next factor of a group's sigma."""
    return float(np.clip(c.factor / c.applied, 1 / LARGEST_STEP, LARGEST_STEP))


def scaled(block: Block, factors: Mapping[str, float]) -> Block:
    """Return the block with the sigma of its observations multiplied.

    Parameters
    ----------
    block : Block
    factors : mapping of str to float
        By group; groups not named keep their sigma.

    Raises
    ------
    ValueError
        For an unknown group, or a factor that is not positive.
    """
    expected.names_of("factors", factors, group_names(block))
    for name, factor in factors.items():
        expected.positive_number(name, factor)
    by_camera = np.array([factors.get(name, 1.0) for name in image_groups(block)])
    points, trajectory = block.image_points, block.trajectory
    camera_idx = block.images.camera_idx[points.image_idx]
    control, gnss, attitude, distance = (
        _by_component(kind, factors) for kind in ("control_point", "gnss", "attitude", "distance")
    )
    return replace(
        block,
        image_points=replace(points, sigma_px=points.sigma_px * by_camera[camera_idx]),
        control=replace(block.control, sigma_m=block.control.sigma_m * control),
        trajectory=replace(
            trajectory,
            sigma_position=trajectory.sigma_position * gnss,
            sigma_attitude=trajectory.sigma_attitude * attitude,
        ),
        distances=replace(block.distances, sigma_m=block.distances.sigma_m * distance[0]),
    )


def _by_component(kind: str, factors: Mapping[str, float]) -> Array:
    """Return the factors of an observation's components, at most three."""
    row = np.ones(3)
    for name, of_kind, columns in PARTS:
        if of_kind == kind:
            row[list(columns)] = factors.get(name, 1.0)
    return row
