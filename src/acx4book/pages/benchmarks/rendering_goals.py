"""What was to be reached in rendering, and what the benchmark measured (``make bench``)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from acx4book.pages.benchmarks import stored


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A number that was to be reached.

    Attributes
    ----------
    what, unit : str
    limit, measured : float
    at_most : bool
        Whether the limit is one from above.
    digits : int
        Decimals that are shown.
    """

    what: str
    unit: str
    limit: float
    measured: float
    at_most: bool = True
    digits: int = 2

    @property
    def reached(self) -> bool:
        """Whether the number keeps the limit."""
        return self.measured <= self.limit if self.at_most else self.measured >= self.limit

    def shown(self, value: float) -> str:
        """Return a value with the unit."""
        return f"{value:,.{self.digits}f} {self.unit}".strip()


@dataclass(frozen=True, kw_only=True, eq=False)
class Renderings:
    """The results of the benchmark of rendering.

    Attributes
    ----------
    runs : DataFrame
        ``rendering.csv``: a row for each run of a renderer or command at a size.
    about : mapping
        ``rendering.json``: date, machine, versions, positions, responses, tie points.
    """

    runs: pd.DataFrame
    about: Mapping[str, Any]

    @cached_property
    def medians(self) -> pd.DataFrame:
        """Medians of all runs, by what ran and how much images were reduced."""
        groups = self.runs.groupby(["what", "reduction"], sort=False)
        return groups.median(numeric_only=True).drop(columns="run")

    @property
    def reduction(self) -> int:
        """How much the images were reduced that were rendered in memory."""
        return int(self.about["reduction"])

    def has(self, what: str) -> bool:
        """Tell whether something ran at the size of the benchmark."""
        return (what, self.reduction) in self.medians.index

    def of(self, what: str) -> dict[str, float]:
        """Return the medians of what ran at the size of the benchmark."""
        own = self.medians.loc[[(what, self.reduction)]]
        return {str(key): float(own[key].iloc[0]) for key in own}

    def ns_per_sample(self, what: str) -> float:
        """Return the CPU time of a sample, ns."""
        own = self.of(what)
        return 1e9 * own["cpu_s"] / own["samples"]

    @property
    def ties(self) -> pd.DataFrame:
        """A row for each way to match; empty where none was asked for."""
        return pd.DataFrame(self.about["ties"])


def read(folder: Path) -> Renderings:
    """Read what ``make bench`` left in a folder."""
    about, (runs,) = stored.read(folder, "rendering")
    return Renderings(runs=runs, about=about)


# --- goals ---------------------------------------------------------------------------------------


def goals(benchmark: Renderings) -> list[Goal]:
    """Return all goals whose numbers were measured."""
    return [*_truth(benchmark), *_speed(benchmark), *_by_files(benchmark), *_matching(benchmark)]


def _truth(benchmark: Renderings) -> Iterator[Goal]:
    about = benchmark.about
    position = about["position_px"]["max"]
    yield Goal(
        what="largest error of a position", unit="px", limit=0.0025, measured=position, digits=4
    )
    if benchmark.has("ours_1"):
        own = benchmark.of("ours_1")
        yield Goal(
            what="grey values to an exact rendering, rms",
            unit="DN",
            limit=0.45,
            measured=own["rms_dn"],
        )
        yield Goal(what="the same, 99.9 % below", unit="DN", limit=3.5, measured=own["p999_dn"])
    after = 100 * about["response"]["after"]
    yield Goal(
        what="equalised heads disagree in overlaps by, at most", unit="%", limit=0.6, measured=after
    )


def _speed(benchmark: Renderings) -> Iterator[Goal]:
    if benchmark.has("ours_2") and benchmark.has("copy"):
        copies = benchmark.of("ours_2")["wall_s"] / benchmark.of("copy")["wall_s"]
        yield Goal(
            what="time of the whole image on two threads, in plain copies of it on one",
            unit="",
            limit=35,
            measured=copies,
            digits=1,
        )
    if benchmark.has("ours_1") and benchmark.has("remap_linear"):
        ratio = benchmark.ns_per_sample("ours_1") / benchmark.ns_per_sample("remap_linear")
        yield Goal(
            what="CPU time of a sample, in those of OpenCV's remap with its map ready",
            unit="",
            limit=1.2,
            measured=ratio,
        )


def _by_files(benchmark: Renderings) -> Iterator[Goal]:
    if not benchmark.has("acx4_render"):
        return
    own = benchmark.of("acx4_render")
    if benchmark.has("nona"):
        for key, kind in (("cpu_s", "CPU time"), ("wall_s", "time")):
            yield Goal(
                what=f"{kind} of nona over that of acx4 render, files in and out",
                unit="",
                limit=10,
                measured=benchmark.of("nona")[key] / own[key],
                at_most=False,
                digits=1,
            )
    gigabytes = own["peak_mb"] * 2**20 / 1e9
    yield Goal(what="peak memory of acx4 render", unit="GB", limit=2, measured=gigabytes)


def _matching(benchmark: Renderings) -> Iterator[Goal]:
    if benchmark.ties.empty:
        return
    ours, sift = (benchmark.ties.iloc[i] for i in (0, -1))
    yield Goal(
        what="tie points of an overlap",
        unit="",
        limit=8000,
        measured=ours["points"],
        at_most=False,
        digits=0,
    )
    yield Goal(what="their errors, rms", unit="px", limit=0.04, measured=ours["rms_px"], digits=3)
    yield Goal(
        what="of them within 0.1 px",
        unit="%",
        limit=98,
        measured=100 * ours["within_0.1_px"],
        at_most=False,
        digits=1,
    )
    yield Goal(
        what="CPU time of SIFT over that of ours",
        unit="",
        limit=5,
        measured=sift["cpu_s"] / ours["cpu_s"],
        at_most=False,
        digits=1,
    )
