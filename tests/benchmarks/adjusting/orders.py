"""The time of one adjustment over orders of its images and courses of its strips.

A flight of a thousand images with cross strips is adjusted as it was designed and in random orders
on other courses, which take turns. ``python -m benchmarks.adjusting.orders`` stores seconds over
those of the design.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd

from acx4lib.bundle import adjust
from acx4lib.bundle.network import Network
from acx4lib.least_squares import processors
from benchmarks import harness
from benchmarks.adjusting import bench_blocks
from benchmarks.adjusting.bench_blocks import Made, Strip

CROSS = tuple(
    Strip(n=50, height_m=1300.0, base_m=430.0, aside_m=aside, turned=aside > 0, across=True)
    for aside in (-5000.0, 5000.0)
)
STRIPS = (*bench_blocks.parallel([45] * 20, base_m=235.0), *CROSS)
COURSES_DEG = (0.0, 7.0, 37.0, 101.0)
ORDERS, TURNS, TIES = 20, 2, 40_000


@cache
def made(strips: tuple[Strip, ...], ties: int, course_deg: float) -> Made:
    """Return a flight on a course; the same points are seen on every one."""
    return bench_blocks.fly(strips, ties, control=(6, 6), seed=1, turned_deg=course_deg)


def mixed(block: Made, seed: int) -> Made:
    """Return a block whose images stand in a random order."""
    images, flown, points = block.block.images, block.block.trajectory, block.block.image_points
    old = np.random.default_rng(seed).permutation(len(images))
    names, new = tuple(np.array(images.names)[old]), np.argsort(old)
    trajectory = replace(
        flown,
        exposures=names,
        T_m_b=flown.T_m_b[old],
        R_g_m=flown.R_g_m[old],
        sigma_position=flown.sigma_position[old],
        sigma_attitude=flown.sigma_attitude[old],
    )
    points = replace(points, image_idx=new[points.image_idx])
    points = points[np.argsort(points.image_idx, kind="stable")]
    images = replace(images, names=names)
    return replace(
        block,
        block=replace(block.block, images=images, trajectory=trajectory, image_points=points),
    )


def seconds(network: Network) -> float:
    """Return the CPU seconds of an adjustment, with packing."""
    again, start = replace(network), time.process_time()
    adjust.adjust(again)
    return time.process_time() - start


def main() -> None:
    """Time all orders in turn, the design first and between them."""
    harness.refuse_changes(harness.OUT)
    processors.keep_memory()
    design = bench_blocks.network(made(STRIPS, TIES, 0.0))
    seconds(design)  # loads compiled code
    rows = []
    for order in range(ORDERS):
        course = COURSES_DEG[order % len(COURSES_DEG)]
        other = bench_blocks.network(mixed(made(STRIPS, TIES, course), order))
        took = [(seconds(design), seconds(other)) for _ in range(TURNS)]
        as_designed, as_mixed = np.min(took, axis=0)
        rows.append(
            {
                "order": order,
                "course_deg": course,
                "band": other.packed.band,
                "design_s": as_designed,
                "ratio": as_mixed / as_designed,
            }
        )
    harness.write(harness.OUT, "orders", {"": pd.DataFrame(rows)}, harness.about(), digits=4)


if __name__ == "__main__":
    main()
