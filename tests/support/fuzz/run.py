"""Many mutated flights, and how reading them ended.

`python -m support.fuzz.run --cases N --seed SEED`.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from support.fuzz import flights

TESTS = Path(__file__).parents[2]


@dataclass
class Report:
    """How cases ended.

    Attributes
    ----------
    outcomes : Counter
        Of kind of mutation and outcome.
    findings : list of str
        What must not be, with seed and case.
    seconds, peak : tuple of float, int
        The most that a case took, s of computing and bytes, and which it was.
    """

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)
    seconds: tuple[float, int] = (0.0, 0)
    peak: tuple[int, int] = (0, 0)

    def __str__(self) -> str:
        by_outcome: Counter[str] = Counter()
        for (_, outcome), n in self.outcomes.items():
            by_outcome[outcome] += n
        kinds = sorted({kind for kind, _ in self.outcomes})
        rows = [
            f"{kind:>26}: "
            + ", ".join(f"{n} {o}" for (k, o), n in sorted(self.outcomes.items()) if k == kind)
            for kind in kinds
        ]
        total = ", ".join(f"{n} {outcome}" for outcome, n in by_outcome.most_common())
        most = (
            f"slowest {self.seconds[0]:.1f} s (case {self.seconds[1]}), "
            f"largest {self.peak[0] / 2**20:.0f} MiB (case {self.peak[1]})"
        )
        return "\n".join([*rows, *self.findings, f"{total}; {most}"])


def run(work: Path, *, cases: int, seed: int) -> Report:
    """Work through the cases of a seed in one process; a new one where it was killed.

    Parameters
    ----------
    work : Path
        An empty folder.
    cases, seed : int
    """
    good = work / "good"
    good.mkdir(parents=True)
    flights.write_good(good)
    report, case = Report(), 0
    while case < cases:
        case = _run_from(case, good, report, cases=cases, seed=seed)
    return report


def _run_from(case: int, good: Path, report: Report, *, cases: int, seed: int) -> int:
    """Let a process read cases as long as it lives; return the first that is not read."""
    path = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    numbers = map(str, (case, cases, seed))
    command = [sys.executable, "-m", "support.fuzz.worker", str(good), *numbers]
    begun: dict[str, object] = {}
    with (
        tempfile.TemporaryFile("w+") as said,
        subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=said,
            stdin=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        ) as worker,
    ):
        assert worker.stdout is not None
        for line in worker.stdout:
            told = json.loads(line)
            if "case" in told:
                begun = told
            else:
                _count(report, begun, told, seed)
                case, begun = int(str(begun["case"])) + 1, {}
        status = worker.wait()
        said.seek(0)
        errors = said.read()
    if status == 0:
        return cases
    if not begun:
        msg = f"the worker ended with {status} before case {case}: {errors}"
        raise RuntimeError(msg)
    outcome = (
        "hung" if status in (-signal.SIGALRM, -signal.SIGPROF) else f"killed the process ({status})"
    )
    _count(report, begun, {"outcome": outcome, "wrong": errors or outcome}, seed)
    return int(str(begun["case"])) + 1


def _count(report: Report, begun: dict[str, object], told: dict[str, object], seed: int) -> None:
    kind = str(begun["kind"])
    report.outcomes["several" if "+" in kind else kind, str(told["outcome"])] += 1
    case = int(str(begun["case"]))
    report.seconds = max(report.seconds, (float(str(told.get("seconds", 0))), case))
    report.peak = max(report.peak, (int(str(told.get("peak", 0))), case))
    if told["wrong"]:
        report.findings.append(f"seed {seed}, case {begun['case']} ({kind}): {told['wrong']}")


def main() -> None:
    """Run, print and fail where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        empty = Path(os.path.realpath(work)) / "fuzz"
        report = run(empty, cases=given.cases, seed=given.seed)
    print(report)  # noqa: T201 a command
    sys.exit(bool(report.findings))


if __name__ == "__main__":
    main()
