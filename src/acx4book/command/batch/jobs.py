"""What is to be run: flights, or seeds of simulated ones, each with a name and a folder."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acx4lib.flight.tables import name_fault

TABLE, TIMES = "flights.csv", "times.csv"
"""Files of a folder of many flights; every flight has a folder of its own beside them."""

SIMULATED = "simulated"
"""Folder of the flights that were simulated, with the truth of each."""

RESERVED = (TABLE, TIMES, SIMULATED)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is run of every flight.

    Attributes
    ----------
    stages : tuple of str
    notebooks : Path or None
        Folder of the notebooks to execute; None computes the numbers only.
    calibration : Path or None
        Results of an earlier flight, whose calibration is validated.
    """

    stages: tuple[str, ...]
    notebooks: Path | None = None
    calibration: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Job:
    """A flight to be run.

    Attributes
    ----------
    name : str
        Of the flight among the others.
    flight, results : Path
        Absolute, since a worker may run in another folder.
    settings : Settings
    design : str
        The flight is simulated by the design of this name, or by the plan in this file, if it is
        not there; empty if it must be.
    seed : int
    """

    name: str
    flight: Path
    results: Path
    settings: Settings
    design: str = ""
    seed: int = 0


def of_flights(flights: Sequence[Path], folder: Path, settings: Settings) -> list[Job]:
    """Return a job for each flight, with its results in a folder below another.

    It has the name of the flight's folder. Where two of these are alike, as many folders above are
    put before it as tell them apart: ``north-flight`` and ``south-flight``.

    Raises
    ------
    ValueError
        A flight is given twice, or its folder has a name that cannot be used.
    """
    paths = [absolute(flight) for flight in flights]
    again = [path for path, times in Counter(paths).items() if times > 1]
    if again:
        msg = f"{again[0]}: is given twice"
        raise ValueError(msg)
    return [
        Job(name=name, flight=path, results=absolute(folder) / name, settings=settings)
        for name, path in zip(_told_apart(paths), paths, strict=True)
    ]


def of_seeds(
    designs: Sequence[str], seeds: Sequence[int], folder: Path, settings: Settings
) -> list[Job]:
    """Return a job for every seed of every design or plan, called ``single-head-1`` and so on.

    Raises
    ------
    ValueError
        The files of two plans have one name, or a name that cannot be used.
    """
    top = absolute(folder)
    jobs = [
        Job(
            name=(name := f"{Path(design).stem}-{seed}"),
            flight=top / SIMULATED / name,
            results=top / name,
            settings=settings,
            design=design,
            seed=seed,
        )
        for design in dict.fromkeys(designs)
        for seed in seeds
    ]
    often = Counter(job.name for job in jobs)
    for job in jobs:
        if fault := _fault(job.name, often, cure="rename the plan"):
            msg = f"{job.design}: {fault}"
            raise ValueError(msg)
    return jobs


def seeds_of(text: str) -> list[int]:
    """Return the seeds that a text such as ``1-200`` or ``1,5,9-12`` names, in its order.

    Raises
    ------
    ValueError
        For any other text.
    """
    found: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"\s*(\d{1,18})\s*(?:-\s*(\d{1,18})\s*)?", part, re.ASCII)
        first, last = (int(end or ends[1]) for end in ends.groups()) if ends else (1, 0)
        if first > last:
            msg = f"{part.strip()!r} names no seeds; give whole numbers, as in 1-200 or 1,5,9-12"
            raise ValueError(msg)
        found += range(first, last + 1)
    return list(dict.fromkeys(found))


def absolute(path: Path) -> Path:
    """Return a path from the root; a link keeps its own name."""
    return Path(os.path.abspath(path))  # noqa: PTH100 `resolve` would follow links


def _told_apart(paths: Sequence[Path]) -> list[str]:
    """Return names that differ, of as few folders as possible."""
    names = [_name(path, 1) for path in paths]
    for n in range(2, 1 + max(len(path.parts) for path in paths)):
        alike = {name for name, times in Counter(names).items() if times > 1}
        names = [
            _name(path, n) if name in alike else name
            for name, path in zip(names, paths, strict=True)
        ]
    often = Counter(names)
    for name, path in zip(names, paths, strict=True):
        if fault := _fault(name, often):
            msg = f"{path}: {fault}"
            raise ValueError(msg)
    return names


def _name(path: Path, n: int) -> str:
    """Return the last folders of a path as one name."""
    return "-".join(part for part in path.parts[-n:] if part != path.anchor)


def _fault(name: str, often: Counter[str], *, cure: str = "rename the flight's folder") -> str:
    """Return what is wrong with a name, and what to do; empty for a good one."""
    if not name or name.startswith(".") or name in RESERVED:
        return f"a folder of results cannot be called {name!r}; {cure}"
    if often[name] > 1:
        return f"another flight would be called {name}, too; {cure}"
    fault = name_fault(name)
    return f"{fault[0]}; {cure}" if fault else ""
