"""The page on the speed of commands, adjustment and rendering, beside other programs.

``make bench`` writes the numbers to ``data/benchmarks``.
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

from acx4book.pages.benchmarks import sigma
from acx4book.typesetting import style
from acx4book.typesetting.myst import at_commit, myst_table, scientific
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array

NAMES = ("commands", "many", "measuring", "adjustment", "rendering")
"""Names of the benchmarks, of their files, and of the parts of the page."""


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
        """Return medians over runs with the same keys, in the file's order."""
        return self.runs.groupby(list(by), sort=False).median(numeric_only=True)


def read(folder: Path) -> dict[str, Benchmark]:
    """Read the results of ``make bench`` from a folder, by the names of the benchmarks."""
    benchmarks = {}
    for name in NAMES:
        about, (runs,) = sigma.read_stored(folder, name)
        benchmarks[name] = Benchmark(runs=runs, about=about)
    return benchmarks


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
    """State date, commit, machine and software of the measurement."""
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
"""The entry for importing the packages alone; the command with a sentence on its growth with the
number of images."""


def _commands(benchmark: Benchmark) -> Iterator[str]:
    """Yield the table of whole commands, and a sentence on the growth of one command."""
    medians = benchmark.medians("flight", "command").reset_index()
    alone = medians[medians["command"] == IMPORTS].set_index("flight")["cpu_s"]
    commands = medians[medians["command"] != IMPORTS]
    beyond = commands["cpu_s"] - commands["flight"].map(alone)
    table = pd.DataFrame(
        {
            "Flight": commands["flight"],
            "Command": [Markup(f"`acx4 {name}`") for name in commands["command"]],
            "Images": commands["images"].astype(int),
            "Image points": commands["measurements"].astype(int),
            "Seconds": commands["wall_s"],
            "CPU seconds": commands["cpu_s"],
            "beyond imports": beyond.where(beyond > 0),  # some import less than a run
            "MB": commands["tree_mb"],
        }
    )
    seconds = dict.fromkeys(("Seconds", "CPU seconds", "beyond imports"), ".1f")
    caption = (
        "Whole commands: the time that passes, CPU time of all processes, the part of it beyond "
        f"{benchmark.about['imports']}, and the largest memory of all processes together"
    )
    counts = dict.fromkeys(("Images", "Image points"), ",d")
    yield _table(table, caption, "commands", {**counts, **seconds, "MB": ",.0f"})
    yield _of_two_sizes(commands[commands["command"] == GROWTH].sort_values("measurements"))


def _of_two_sizes(runs: pd.DataFrame) -> str:
    """State the growth of time and memory between the two largest flights."""
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
    """Yield the table of time and memory of `acx4 measure`, measured and computed."""
    runs = _computed(benchmark.runs)
    shown = runs[runs["pictures"] > 0]
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
    """Return the runs with missing times and memory computed from the others."""
    # at each level of the search a pair has a fixed cost, and a picture a cost by its pixels; the
    # row without pictures has the cost of the library alone; memory grows with the pixels of a
    # picture, because a few pictures are held at a time
    completed = runs.copy()
    run = completed["cpu_s"].notna().to_numpy()
    columns = ("levels", "pairs", "pictures", "megapixels")
    levels, pairs, pictures, pixels = (completed[name].to_numpy() for name in columns)
    ones = np.ones(len(completed))
    matrices = {
        "cpu_s": np.column_stack([ones, levels * pairs, levels * pictures * pixels]),
        "tree_mb": np.column_stack([pictures == 0, pictures > 0, pixels]),
    }
    for name, A in matrices.items():
        completed.loc[~run, name] = A[~run] @ _costs(A[run], completed.loc[run, name].to_numpy())
    return completed.assign(run=run)


def _costs(A: Array, cost: Array) -> Array:
    """Return the costs by least squares; none is below zero."""
    from scipy.optimize import nnls  # noqa: PLC0415 here alone

    weights = 1 / cost
    return np.asarray(nnls(A * weights[:, None], cost * weights)[0])


# --- adjustment ----------------------------------------------------------------------------------

OURS, SWEEP, FREE = "ours", "sweep-", "free-"
"""Our solver; prefix of the problems that differ only in their number of tie points; prefix of the
problems without lever arms, which pycolmap can state, too."""

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
    """Return the fastest run of each problem among the solvers with a prefix."""
    rows = medians[medians["solver"].str.startswith(beginning)]
    return rows.sort_values("cpu_s").groupby("problem").first()


def _beside_ceres(medians: pd.DataFrame) -> str:
    ours = _of(medians, OURS).reindex(medians["problem"].unique())
    table = ours[[*SIZES]].astype(int).rename(columns=SIZES)
    table["CPU s"], table["s"], table["MB"] = ours["cpu_s"], ours["wall_s"], ours["peak_mb"]
    for kind, label in CERES.items():
        ceres = _of(medians, f"ceres_{kind}_").reindex(ours.index)
        table[f"{label}: CPU s"] = ceres["cpu_s"]
        table[f"{label}: MB"] = ceres["peak_mb"]
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
    by_solver = {name: medians[medians["solver"] == name].set_index("problem") for name in PYCOLMAP}
    ours = _of(medians, OURS).sort_values("observations")
    if ours.empty or all(rows.empty for rows in by_solver.values()):
        return ""
    table = ours[[*SIZES]].astype(int).rename(columns=SIZES)
    table["acx4lib"] = ours["cpu_s"]
    for name, label in PYCOLMAP.items():
        table[label] = by_solver[name]["cpu_s"].reindex(ours.index).astype(float)
    apart = max((by_solver[n]["cost"] / ours["cost"] - 1).abs().max() for n in PYCOLMAP)
    caption = f"CPU time beside pycolmap, in seconds; costs agree to {scientific(apart)}"
    formats = dict.fromkeys(SIZES.values(), ",d") | dict.fromkeys(
        ("acx4lib", *PYCOLMAP.values()), ".3f"
    )
    return _table(table, Markup(caption), "pycolmap", formats)


def _of_points(sweep: pd.DataFrame) -> str:
    """State the power of the number of points with which the time grows."""
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
    """State the differences between our solution and that of Ceres."""
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
    """Draw CPU seconds of the adjustment over the number of points: total and per ray."""
    medians = benchmark.medians(*KEYS).reset_index()
    medians = medians[medians["problem"].str.startswith(SWEEP)]
    if medians.empty:
        return style.nothing("No numbers of tie points were compared.")
    with style.applied():
        fig, (total, per_ray) = style.subplots(1, 2, figsize=(style.WIDTH, 2.9))
        for solver, (label, colour, line) in SOLVERS.items():
            rows = medians[medians["solver"] == solver].sort_values("points")
            points, seconds = rows["points"].to_numpy(), rows["cpu_s"].to_numpy()
            total.plot(points / 1000, seconds, line[0], color=colour, label=label)
            if len(rows) > 1:
                slope, start = np.polyfit(points, seconds, 1)
                total.plot(points / 1000, start + slope * points, color=colour, lw=1.0)
            per_ray.plot(points / 1000, 1e6 * seconds / rows["image_points"], line, color=colour)
        total.set(xlabel="points (1000)", ylabel="CPU time (s)", ylim=(0, None), xlim=(0, None))
        per_ray.set(xscale="log", xlabel="points (1000)", ylim=(0, None))
        per_ray.set_ylabel("CPU time for an image point (\N{MICRO SIGN}s)")
        ticks = np.unique(medians["points"]) / 1000
        per_ray.set_xticks(ticks, [f"{tick:.2g}" for tick in ticks])
        per_ray.set_xticks([], minor=True)
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
"""Renderers in memory, in the order of the table."""

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
    rows = medians.xs(about["reduction"], level="reduction")
    rows = rows.reindex([name for name in RENDERERS if name in rows.index])
    samples = rows["samples"].to_numpy()
    table = pd.DataFrame(
        {
            "Renderer": [RENDERERS[name] for name in rows.index],
            "ns a sample, CPU": 1e9 * rows["cpu_s"].to_numpy() / samples,
            "ns a sample, passed": 1e9 * rows["wall_s"].to_numpy() / samples,
            "Errors, rms (DN)": rows["rms_dn"].to_numpy(),
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
    rows = medians[medians["what"].isin(FILES)]
    rows = rows.sort_values(["reduction", "what"], key=lambda c: c.map(order).fillna(c))
    if rows.empty:
        return ""
    sizes = zip(rows["width_px"], rows["height_px"], strict=True)
    table = pd.DataFrame(
        {
            "Command": [FILES[command] for command in rows["what"]],
            "Image": [f"{width:,.0f} × {height:,.0f} px" for width, height in sizes],
            "Seconds": rows["wall_s"].to_numpy(),
            "CPU seconds": rows["cpu_s"].to_numpy(),
            "MB": rows["peak_mb"].to_numpy(),
        }
    )
    formats = {"Seconds": ".1f", "CPU seconds": ".1f", "MB": ",.0f"}
    caption = "From the heads' files to the image's: whole commands, their start included"
    return _table(table, caption, "files", formats)


# --- what was tried of reading files of other programs


WIDTH = 76
"""Longest line on the page, characters; longer lines are wrapped."""


def of_imports(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield name and text for each kind of import: the command and its output.

    Parameters
    ----------
    folder : Path
        With ``imports.csv``.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    """
    about, (table,) = sigma.read_stored(folder, "imports", make="reference-results")
    for kind, rows in table.groupby("kind", sort=False):
        lines = [f"$ {about['commands'][kind]}", *rows["line"]]
        yield f"imports-{kind}.txt", wrapped("\n".join(lines) + "\n")


def wrapped(text: str) -> str:
    """Wrap the long lines of a text; continued lines are indented."""
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
