"""How long commands, the adjustment and the rendering take, and others beside them: one page.

The numbers are those of ``make bench``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.pages.benchmarks import stored
from acx4book.typesetting import style
from acx4book.typesetting.myst import at_commit, myst_table, scientific
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array

NAMES = ("commands", "many", "measuring", "adjustment", "rendering")
"""Of the benchmarks, as their files and the parts of the page are called."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Benchmark:
    """The results of a benchmark.

    Attributes
    ----------
    runs : DataFrame
        ``NAME.csv``: a row for each run.
    about : mapping
        ``NAME.json``: date, machine, versions, and what belongs to all runs.
    """

    runs: pd.DataFrame
    about: Mapping[str, Any]

    def medians(self, *by: str) -> pd.DataFrame:
        """Return medians of the numbers of all runs with the same keys, in the file's order."""
        return self.runs.groupby(list(by), sort=False).median(numeric_only=True)


def read(folder: Path) -> dict[str, Benchmark]:
    """Read what ``make bench`` left in a folder, by the names of the benchmarks."""
    found = {}
    for name in NAMES:
        about, (runs,) = stored.read(folder, name)
        found[name] = Benchmark(runs=runs, about=about)
    return found


def text(name: str, benchmark: Benchmark) -> str:
    """Return the part of the page on a benchmark, as MyST text: machine and tables."""
    parts = {
        "commands": _commands,
        "many": _many,
        "measuring": _measuring,
        "adjustment": _adjustment,
        "rendering": _rendering,
    }
    shown = [_measured(benchmark.about), *parts[name](benchmark)]
    return "\n\n".join(part for part in shown if part) + "\n"


def _measured(about: Mapping[str, Any]) -> str:
    """Say when, at what commit, and on what machine it was measured."""
    versions = about.get("versions", {})
    names = ("python", "numpy", "numba", "ceres", "pycolmap", "distributed", "nona", "enblend")
    software = ", ".join(f"{name} {versions[name]}" for name in names if name in versions)
    return (
        f"Measured on {about['date']} at {at_commit(about['commit'])}: {about['processor']}, "
        f"{about['cores']} cores, {about['memory_gb']:g} GB of memory; {software}."
    )


def _table(
    table: pd.DataFrame, caption: str, name: str, formats: Mapping[str, str] | None = None
) -> str:
    return myst_table(table, caption, name=f"tab-speed-{name}", formats=dict(formats or {}))


# --- commands ------------------------------------------------------------------------------------

IMPORTS, GROWTH = "imports", "run --numbers-only"
"""What stands for a command where the packages are only imported; the command whose growth with
the number of images is told."""


def _commands(benchmark: Benchmark) -> Iterator[str]:
    """Yield the table of whole commands, and how one of them grows."""
    medians = benchmark.medians("flight", "command").reset_index()
    alone = medians[medians["command"] == IMPORTS].set_index("flight")["cpu_s"]
    own = medians[medians["command"] != IMPORTS]
    beyond = own["cpu_s"] - own["flight"].map(alone)
    table = pd.DataFrame(
        {
            "Flight": own["flight"],
            "Command": [Markup(f"`acx4 {name}`") for name in own["command"]],
            "Images": own["images"].astype(int),
            "Image points": own["measurements"].astype(int),
            "Seconds": own["wall_s"],
            "CPU seconds": own["cpu_s"],
            "beyond imports": beyond.where(beyond > 0),  # some import less than a run
            "MB": own["tree_mb"],
        }
    )
    seconds = dict.fromkeys(("Seconds", "CPU seconds", "beyond imports"), ".1f")
    caption = (
        "Whole commands: the time that passes, CPU time of all processes, the part of it beyond "
        f"{benchmark.about['imports']}, and the largest memory of all processes together"
    )
    counts = dict.fromkeys(("Images", "Image points"), ",d")
    yield _table(table, caption, "commands", {**counts, **seconds, "MB": ",.0f"})
    yield _of_two_sizes(own[own["command"] == GROWTH].sort_values("measurements"))


def _of_two_sizes(runs: pd.DataFrame) -> str:
    """Say how time and memory grow from one to the other of the two largest flights."""
    if len(runs) < 2:
        return ""
    times = runs.iloc[-1][["images", "cpu_s", "tree_mb"]] / runs.iloc[-2]
    power = np.log(float(times["cpu_s"])) / np.log(float(times["images"]))
    return (
        f"With {times['images']:.1f} times the images `acx4 {GROWTH}` takes {times['cpu_s']:.1f} "
        f"times the CPU time, the power {power:.2f} of their number, and {times['tree_mb']:.1f} "
        "times the memory."
    )


def _many(benchmark: Benchmark) -> Iterator[str]:
    """Yield the table of many flights: in one process, in two, and on a cluster."""
    runs = benchmark.runs
    table = pd.DataFrame(
        {
            "Way": runs["way"],
            "At a time": runs["workers"],
            "Flights": runs["flights"],
            "Seconds": runs["wall_s"],
            "Speed-up": runs["wall_s"].iloc[0] / runs["wall_s"],
            "CPU seconds a flight": runs["cpu_s"] / runs["flights"],
            "MB of a worker": runs["worker_mb"],
        }
    )
    formats = {"Seconds": ".0f", "Speed-up": ".2f", "CPU seconds a flight": ".2f"}
    caption = Markup(
        f"Seeds of the design {benchmark.about['design']}, simulated and run: time that passes, "
        f"speed-up, CPU time, and the largest memory of a worker"
    )
    yield _table(table, caption, "many", {**formats, "MB of a worker": ".0f"})


def _measuring(benchmark: Benchmark) -> Iterator[str]:
    """Yield the table of what `acx4 measure` takes, measured and computed."""
    found = _computed(benchmark.runs)
    shown = found[found["pictures"] > 0]
    table = pd.DataFrame(
        {
            "": np.where(shown["run"], "measured", "computed"),
            "Pictures": shown["pictures"],
            "Megapixels each": shown["megapixels"],
            "Pairs": shown["pairs"],
            "CPU seconds": shown["cpu_s"],
            "MB": shown["tree_mb"],
        }
    )
    formats = {"Megapixels each": ".1f", "CPU seconds": ",.0f", "MB": ",.0f"}
    caption = (
        "Measuring pictures: CPU time, and the largest memory of all processes together; what is "
        "computed follows from the costs of a pair and of a megapixel in the other rows"
    )
    yield _table(table, caption, "measuring", formats)


def _computed(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the runs with time and memory of the rows that have none."""
    # a pair costs the same at each level of the search, and a picture by its pixels, which are read
    # at each level; what the library costs alone is a row without pictures; memory grows with the
    # pixels of a picture, because a few are held at a time
    found = runs.copy()
    run = found["cpu_s"].notna().to_numpy()
    columns = ("levels", "pairs", "pictures", "megapixels")
    levels, pairs, pictures, pixels = (found[name].to_numpy() for name in columns)
    ones = np.ones(len(found))
    by = {
        "cpu_s": np.column_stack([ones, levels * pairs, levels * pictures * pixels]),
        "tree_mb": np.column_stack([pictures == 0, pictures > 0, pixels]),
    }
    for name, A in by.items():
        found.loc[~run, name] = A[~run] @ _costs(A[run], found.loc[run, name].to_numpy())
    return found.assign(run=run)


def _costs(A: Array, cost: Array) -> Array:
    """Return the costs by least squares; none is below zero."""
    from scipy.optimize import nnls  # noqa: PLC0415 here alone

    weights = 1 / cost
    return np.asarray(nnls(A * weights[:, None], cost * weights)[0])


# --- adjustment ----------------------------------------------------------------------------------

OURS, SWEEP, FREE = "ours", "sweep-", "free-"
"""Our solver; how the names of problems begin that differ in their number of tie points only, and
of those that pycolmap can state, too: it has no lever arms."""

CERES = {"automatic": "Ceres, automatic", "analytic": "Ceres, by hand"}
PYCOLMAP = {
    "pycolmap_tuned": "pycolmap, tuned",
    "pycolmap_covariance": "with covariances",
    "pycolmap_default": "by default",
}
SIZES = {"images": "Images", "points": "Points", "observations": "Observations"}
KEYS = ("problem", "solver")


def _adjustment(benchmark: Benchmark) -> Iterator[str]:
    """Yield tables of the adjustment beside Ceres and pycolmap, growth, and agreement."""
    medians = benchmark.medians(*KEYS).reset_index()
    alone = medians[~medians["problem"].str.startswith((SWEEP, FREE))]
    yield _beside_ceres(alone)
    yield _beside_pycolmap(medians[medians["problem"].str.startswith(FREE)])
    yield _of_points(medians[medians["problem"].str.startswith(SWEEP)])
    yield _agreement(benchmark.about)


def _of(medians: pd.DataFrame, beginning: str) -> pd.DataFrame:
    """Return the fastest way of a kind to solve each problem."""
    own = medians[medians["solver"].str.startswith(beginning)]
    return own.sort_values("cpu_s").groupby("problem").first()


def _beside_ceres(medians: pd.DataFrame) -> str:
    ours = _of(medians, OURS).reindex(medians["problem"].unique())
    table = ours[[*SIZES]].astype(int).rename(columns=SIZES)
    table["CPU s"], table["s"], table["MB"] = ours["cpu_s"], ours["wall_s"], ours["peak_mb"]
    for kind, label in CERES.items():
        theirs = _of(medians, f"ceres_{kind}_").reindex(ours.index)
        table[f"{label}: CPU s"] = theirs["cpu_s"]
        table[f"{label}: MB"] = theirs["peak_mb"]
    formats = {
        **dict.fromkeys(SIZES.values(), ",d"),
        **{name: ".3f" for name in map(str, table) if name.endswith("CPU s")},
        **{name: ",.0f" for name in map(str, table) if name.endswith("MB")},
        "s": ".3f",
    }
    caption = (
        "The adjustment, and Ceres on the same problem: CPU time of all threads, the time that "
        "passed, and the peak memory of the process"
    )
    return _table(table, caption, "adjustment", formats)


def _beside_pycolmap(medians: pd.DataFrame) -> str:
    of = {name: medians[medians["solver"] == name].set_index("problem") for name in PYCOLMAP}
    ours = _of(medians, OURS).sort_values("observations")
    if ours.empty or all(found.empty for found in of.values()):
        return ""
    table = ours[[*SIZES]].astype(int).rename(columns=SIZES)
    table["acx4lib"] = ours["cpu_s"]
    for name, label in PYCOLMAP.items():
        table[label] = of[name]["cpu_s"].reindex(ours.index).astype(float)
    apart = max((of[n]["cost"] / ours["cost"] - 1).abs().max() for n in PYCOLMAP)
    caption = f"CPU time beside pycolmap, in seconds; costs agree to {scientific(apart)}"
    formats = dict.fromkeys(SIZES.values(), ",d") | dict.fromkeys(
        ("acx4lib", *PYCOLMAP.values()), ".3f"
    )
    return _table(table, Markup(caption), "pycolmap", formats)


def _of_points(sweep: pd.DataFrame) -> str:
    """Say with which power of the number of points the time grows."""
    ours = sweep[sweep["solver"] == OURS].sort_values("points")
    upper = ours.iloc[len(ours) // 2 :]
    if len(upper) < 2:
        return ""
    power, _ = np.polyfit(np.log(upper["points"]), np.log(upper["cpu_s"]), 1)
    return (
        f"From {upper['points'].iloc[0]:,.0f} to {upper['points'].iloc[-1]:,.0f} points on the "
        f"same images our time grows with the power {power:.2f} of their number."
    )


def _agreement(about: Mapping[str, Any]) -> str:
    """Say how far the answers of Ceres and ours lie apart."""
    rows = pd.DataFrame(about.get("agreement", ()))
    if rows.empty:
        return ""
    return (
        f"All solve the same problem: where Ceres goes on until its cost changes by less than "
        f"{scientific(about['ceres_exact_tolerance'])} of itself, costs agree to "
        f"{scientific(rows['cost'].abs().max())}, and the 14 parameters to "
        f"{scientific(rows['parameters_sigma'].max())} of their standard deviations."
    )


SOLVERS = {
    OURS: ("acx4lib, with covariance", style.BLUE, "o-"),
    "ceres_automatic_dense_1": ("Ceres, automatic derivatives", style.ORANGE, "s-"),
}


def seconds_by_points(benchmark: Benchmark) -> Figure:
    """Draw CPU seconds of the adjustment over the number of points, in all and for each ray."""
    medians = benchmark.medians(*KEYS).reset_index()
    medians = medians[medians["problem"].str.startswith(SWEEP)]
    if medians.empty:
        return style.nothing("No numbers of tie points were compared.")
    with style.applied():
        fig, (total, each) = style.subplots(1, 2, figsize=(style.WIDTH, 2.9))
        for solver, (label, colour, line) in SOLVERS.items():
            own = medians[medians["solver"] == solver].sort_values("points")
            points, seconds = own["points"].to_numpy(), own["cpu_s"].to_numpy()
            total.plot(points / 1000, seconds, line[0], color=colour, label=label)
            if len(own) > 1:
                slope, start = np.polyfit(points, seconds, 1)
                total.plot(points / 1000, start + slope * points, color=colour, lw=1.0)
            each.plot(points / 1000, 1e6 * seconds / own["image_points"], line, color=colour)
        total.set(xlabel="points (1000)", ylabel="CPU time (s)", ylim=(0, None), xlim=(0, None))
        each.set(xscale="log", xlabel="points (1000)", ylim=(0, None))
        each.set_ylabel("CPU time for an image point (\N{MICRO SIGN}s)")
        ticks = np.unique(medians["points"]) / 1000
        each.set_xticks(ticks, [f"{tick:.2g}" for tick in ticks])
        each.set_xticks([], minor=True)
        style.legend_below(fig, total.get_legend_handles_labels()[0])
    return fig


# --- rendering -----------------------------------------------------------------------------------

RENDERERS = {
    "ours_2": "acx4lib, two threads",
    "ours_1": "acx4lib, one thread",
    "ours_cubic_1": "acx4lib, one thread, cubic",
    "remap_linear": "OpenCV remap, linear",
    "remap_cubic": "OpenCV remap, cubic",
    "pyvips": "pyvips mapim, bilinear",
    "scipy": "scipy map_coordinates, order 1",
    "skimage": "scikit-image warp, order 1",
}
"""Those in memory, in the order of the table."""

FILES = {
    "acx4_render": "acx4 render",
    "acx4_render_unequalised": "acx4 render, --equalise none",
    "nona": "nona",
    "enblend": "enblend, after nona",
}
"""Commands that go from files to files."""

TIES = {"method": "Way", "points": "Points", "rms_px": "rms (px)", "cpu_s": "CPU s"}


def _rendering(benchmark: Benchmark) -> Iterator[str]:
    """Yield tables of renderers in memory, of commands, and of ways to find tie points."""
    about, medians = benchmark.about, benchmark.medians("what", "reduction")
    own = medians.xs(about["reduction"], level="reduction")
    own = own.reindex([name for name in RENDERERS if name in own.index])
    samples = own["samples"].to_numpy()
    table = pd.DataFrame(
        {
            "Renderer": [RENDERERS[name] for name in own.index],
            "ns a sample, CPU": 1e9 * own["cpu_s"].to_numpy() / samples,
            "ns a sample, passed": 1e9 * own["wall_s"].to_numpy() / samples,
            "Errors, rms (DN)": own["rms_dn"].to_numpy(),
        }
    )
    size = f"{about['width_px']:,} × {about['height_px']:,} px, three bands of 16 bit"
    formats = dict.fromkeys(("ns a sample, CPU", "ns a sample, passed"), ".1f")
    caption = f"Sampling the heads' pictures in memory for a synthetic image of {size}"
    if len(table):
        yield _table(table, caption, "rendering", {**formats, "Errors, rms (DN)": ".2f"})
    yield _by_files(medians.reset_index())
    if len(ties := pd.DataFrame(about["ties"])):
        shown = ties[[*TIES]].rename(columns=TIES)
        caption = "Tie points of one overlap, errors against the truth of the simulation"
        formats = {"Points": ",d", "rms (px)": ".3f", "CPU s": ".2f"}
        yield _table(shown, caption, "ties", formats)


def _by_files(medians: pd.DataFrame) -> str:
    """Return a table of whole commands, the larger image first."""
    order = {name: i for i, name in enumerate(FILES)}
    own = medians[medians["what"].isin(FILES)]
    own = own.sort_values(["reduction", "what"], key=lambda c: c.map(order).fillna(c))
    if own.empty:
        return ""
    sizes = zip(own["width_px"], own["height_px"], strict=True)
    table = pd.DataFrame(
        {
            "Command": [FILES[what] for what in own["what"]],
            "Image": [f"{width:,.0f} × {height:,.0f} px" for width, height in sizes],
            "Seconds": own["wall_s"].to_numpy(),
            "CPU seconds": own["cpu_s"].to_numpy(),
            "MB": own["peak_mb"].to_numpy(),
        }
    )
    formats = {"Seconds": ".1f", "CPU seconds": ".1f", "MB": ",.0f"}
    caption = "From the heads' files to the image's: whole commands, their start included"
    return _table(table, caption, "files", formats)


# --- what was tried of reading files of other programs


WIDTH = 76
"""Longest line that is shown, characters; longer ones go on in the next."""


def of_imports(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the name of a text and the text for each kind: the command and what it printed.

    Parameters
    ----------
    folder : Path
        With ``imports.csv``.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    """
    about, (table,) = stored.read(folder, "imports", make="reference-results")
    for kind, rows in table.groupby("kind", sort=False):
        lines = [f"$ {about['commands'][kind]}", *rows["line"]]
        yield f"imports-{kind}.txt", wrapped("\n".join(lines) + "\n")


def wrapped(text: str) -> str:
    """Return a text whose long lines go on in the next, farther to the right."""
    return "".join(f"{_wrapped(line)}\n" for line in text.splitlines())


def _wrapped(line: str) -> str:
    indent = " " * (len(line) - len(line.lstrip()))
    return textwrap.fill(
        line,
        WIDTH,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
