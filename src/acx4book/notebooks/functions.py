"""The way of the functions: every stage by the function that its notebook calls, without pictures.

It needs none of the requirements of notebooks and figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from threadpoolctl import threadpool_limits

from acx4book.notebooks.runner import Step
from acx4lib.flight.reader import Flight
from acx4lib.stages import heads, mounting, rig, validation


def _synthetic(flight: Flight, staging: Path) -> object:
    from acx4lib.stages import synthetic  # noqa: PLC0415 loads what works on pictures

    return synthetic.run(flight, staging)


RUNS: Mapping[str, Callable[[Flight, Path], object]] = {
    "heads": heads.run,
    "synthetic": _synthetic,
    "mounting": mounting.run,
    "rig": rig.run,
    "validation": validation.run,
}
"""What every stage computes and writes."""


@dataclass(frozen=True)
class Functions:
    """Stages run by their functions, in this process; all read the flight that was checked."""

    def steps(
        self,
        flight: Flight,
        folder: Path,  # noqa: ARG002 of the way
        stages: Sequence[str],
        calibration: str,
    ) -> dict[str, Step]:
        """Return what runs each stage, as `runner.Way` has it."""
        validate = partial(validation.run, calibration_path=calibration)
        runs: dict[str, Callable[[Flight, Path], object]] = {**RUNS, "validation": validate}
        return {stage: partial(_compute, runs[stage], flight) for stage in stages}


def _compute(
    run: Callable[[Flight, Path], object],
    flight: Flight,
    staging: Path,
    tell: Callable[[int, int], None],
) -> None:
    """Run a stage with linear algebra on one thread, as in a notebook, so that bytes are equal."""
    tell(0, 1)
    with threadpool_limits(1, user_api="blas"):
        run(flight, staging)
    tell(1, 1)
