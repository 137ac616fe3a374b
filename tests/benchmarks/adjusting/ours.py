"""Adjust a problem file with acx4lib: ``python ours.py PROBLEM [free]``.

Packing and the covariance of all unknowns and points are part of what is timed. The first
adjustment of the process, which also loads compiled code, is not timed.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from acx4lib.bundle import adjust
from acx4lib.least_squares import processors
from benchmarks.adjusting import bench_blocks
from benchmarks.adjusting.bench_blocks import PINHOLE
from benchmarks.harness import clocked, memory_mb, report


def main(path: Path, *, free_poses: bool) -> None:
    """Read, adjust twice, report."""
    processors.keep_memory()  # as `acx4 run --numbers-only` does
    baseline_mb = memory_mb("VmRSS")
    chosen = {"free": PINHOLE, "free_mount": ()} if free_poses else {}
    network = bench_blocks.read_problem(path, **chosen)
    adjust.adjust(replace(network))  # loads compiled code; its result is let go
    found, seconds = clocked(lambda: adjust.adjust(replace(network)))  # packed anew
    peak_mb = memory_mb("VmHWM")
    solution, T_b_c = found.solution, found.state.T_b_c
    border = np.arange(network.layout.pose.min())
    report(
        {
            **seconds,
            "peak_mb": peak_mb,
            "growth_mb": peak_mb - baseline_mb,
            "cost": solution.cost,
            "steps": solution.iterations,
            "converged": True,
            "observations": solution.n_observations,
            "unknowns": solution.n_unknowns,
            "interior": found.state.interiors[0].to_array()[:8].tolist(),
            "lever": T_b_c.r[0].tolist(),
            "boresight_opk": T_b_c.opk[0].tolist(),
            "sigma": np.sqrt(solution.inverse.at(border, border)).tolist(),
            "position": found.state.T_m_b.r.tolist(),
        }
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), free_poses=sys.argv[2:] == ["free"])
