"""Adjust a problem file with acx4lib: ``python ours.py PROBLEM``.

The covariance of all unknowns and points is part of what is timed. One adjustment goes before, so
that compiled code is loaded; its memory counts.
"""

import sys
from pathlib import Path

import numpy as np

from acx4lib.bundle import adjust
from benchmarks.adjusting import problem_file
from benchmarks.measure import memory_mb, report, timed


def main(path: Path) -> None:
    """Read, adjust twice, report the second time."""
    baseline_mb = memory_mb("VmRSS")
    network = problem_file.read(path)
    adjust.adjust(network)
    found, seconds = timed(lambda: adjust.adjust(network))
    peak_mb = memory_mb("VmHWM")
    solution, T_b_c = found.solution, found.state.T_b_c
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
            "sigma": np.sqrt(np.diagonal(solution.cov)[:14]).tolist(),
        }
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
