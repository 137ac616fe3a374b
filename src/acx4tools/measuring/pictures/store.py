"""Matched pairs kept until a flight is measured, so that an interrupted command goes on."""

from __future__ import annotations

import hashlib
import pickle
import zipfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acx4lib.opening import opened
from acx4lib.production.image_files import fingerprint
from acx4lib.results.own_folder import OwnFolder
from acx4lib.results.whole_files import opened_new
from acx4tools.measuring.pictures.pairs import Found, PairJob, match_pair

FOLDER = "pairs"
_PARTS = ("which", "colrow", "sigma_px")
_BROKEN = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)

Both = tuple[Found, Found]
Count = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Matching:
    """How pairs are matched, and where they are kept.

    Attributes
    ----------
    own : OwnFolder
    executor : Executor or None
        Where pairs are matched; here, one after the other, without.
    prints : dict of Path to str
        Checksums of pictures that were looked at before.
    """

    own: OwnFolder
    executor: Executor | None = None
    prints: dict[Path, str] = field(default_factory=dict)

    def run(self, jobs: Sequence[PairJob], count: Count) -> list[Both]:
        """Return the matches of pairs; those that were matched before are not matched again.

        Parameters
        ----------
        jobs : sequence of PairJob
        count : callable
            Called with the number of finished pairs and of all.
        """
        names = [f"{FOLDER}/{self._digest(job)}.npz" for job in jobs]
        self.own.expect(names)
        out: list[Both | None] = [_kept(self.own.path / name) for name in names]
        left = [k for k, both in enumerate(out) if both is None]
        done = len(jobs) - len(left)
        count(done, len(jobs))
        for k, both in self._matched(jobs, left):
            _keep(self.own.path / names[k], both)
            out[k] = both
            done += 1
            count(done, len(jobs))
        return [both for both in out if both is not None]

    def forget(self) -> None:
        """Remove the pairs of a flight that is measured."""
        self.own.remove([name for name in self.own.files if name.startswith(f"{FOLDER}/")])

    def _matched(self, jobs: Sequence[PairJob], left: Sequence[int]) -> Iterator[tuple[int, Both]]:
        if self.executor is None:
            yield from ((k, match_pair(jobs[k])) for k in left)
            return
        calls = {self.executor.submit(match_pair, jobs[k]): k for k in left}
        for call in as_completed(list(calls)):
            yield calls.pop(call), call.result()

    def _digest(self, job: PairJob) -> str:
        """Return a name for a pair as it is to be matched: pictures, orientations, options."""
        for path in (job.a.path, job.b.path):
            if path not in self.prints:
                self.prints[path] = fingerprint(path)
        said = [self.prints[job.a.path], self.prints[job.b.path]]
        return hashlib.sha256(pickle.dumps((said, job), protocol=5)).hexdigest()[:24]


def _keep(path: Path, both: Both) -> None:
    path.parent.mkdir(exist_ok=True)
    parts = {f"{k}_{name}": getattr(found, name) for k, found in enumerate(both) for name in _PARTS}
    with opened_new(path) as file:
        np.savez(file, **parts)


def _kept(path: Path) -> Both | None:
    """Return a pair that was matched before; None where there is none, or a damaged one."""
    if not path.is_file():
        return None
    try:
        with opened(path) as kept, np.load(kept, allow_pickle=False) as file:
            there, back = (Found(**{name: file[f"{k}_{name}"] for name in _PARTS}) for k in (0, 1))
    except _BROKEN:
        return None
    return there, back
