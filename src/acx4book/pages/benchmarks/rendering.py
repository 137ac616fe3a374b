"""How fast and how true synthetic images are rendered beside others, as a page of the book.

The numbers are those of ``make bench``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from acx4book.pages.benchmarks.rendering_goals import Goal, Renderings, goals
from acx4book.typesetting.myst import at_commit, myst_table
from acx4book.typesetting.plain_text import Markup

RENDERERS = {
    "ours_2": "acx4lib, two threads",
    "ours_1": "acx4lib, one thread",
    "ours_fresh": "acx4lib, two threads, all at once into new memory",
    "ours_stripes": "acx4lib, two threads, by stripes from mapped files",
    "ours_seam": "acx4lib, two threads, hard seam",
    "ours_plain_1": "acx4lib, one thread, hard seam, no response",
    "ours_cubic": "acx4lib, two threads, cubic",
    "ours_cubic_1": "acx4lib, one thread, cubic",
    "remap_linear": "OpenCV remap, linear",
    "remap_cubic": "OpenCV remap, cubic",
    "pyvips": "pyvips mapim, bilinear",
    "scipy": "scipy map_coordinates, order 1",
    "skimage": "scikit-image warp, order 1",
    "oracle": "numpy in double precision",
}
"""Renderers in memory, in the order of the table."""

FILES = {
    "acx4_render": "acx4 render",
    "acx4_render_unequalised": "acx4 render, --equalise none",
    "nona": "nona",
    "enblend": "enblend, after nona",
}
"""Commands that go from files to files."""

TIES = {
    "points": "Points",
    "rms_px": "rms, px",
    "within_0.1_px": "Share within 0.1 px",
    "wall_s": "Wall, s",
    "cpu_s": "CPU, s",
}
"""Columns of the table of tie points."""


def page(benchmark: Renderings) -> str:
    """Return what was measured as MyST text."""
    parts = [
        _machine(benchmark),
        _goal_table(benchmark),
        _disagreement(benchmark),
        _renderer_table(benchmark),
        _planning(benchmark),
        _error_table(benchmark),
        _file_table(benchmark),
        _tie_table(benchmark),
        _left_out(benchmark),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _machine(benchmark: Renderings) -> str:
    """Say on what and when it was measured."""
    about, versions = benchmark.about, benchmark.about["versions"]
    packages = ", ".join(
        f"{name} {versions[key]}"
        for key, name in (
            ("python", "Python"),
            ("numpy", "numpy"),
            ("numba", "numba"),
            ("opencv-python-headless", "OpenCV"),
            ("scipy", "scipy"),
            ("scikit-image", "scikit-image"),
            ("pyvips", "pyvips"),
            ("nona", "nona"),
            ("enblend", "enblend"),
        )
        if key in versions
    )
    size = f"{about['width_px']:,} × {about['height_px']:,} px"
    reduced = (
        "" if benchmark.reduction == 1 else f", at 1/{benchmark.reduction} of the camera's size"
    )
    return (
        f"Measured on {about['date']} at {at_commit(about['commit'])}: {about['processor']}, "
        f"{about['cores']} cores, {about['memory_gb']:g} GB of memory, {about['system']}; "
        f"{packages}. The image of exposure {about['exposure']} has {size}{reduced}, three bands "
        "of 16 bit."
    )


def _goal_table(benchmark: Renderings) -> str:
    """Return a table of what was to be reached and what was."""
    rows = [
        {
            "Goal": goal.what,
            "To reach": f"{'≤' if goal.at_most else '≥'} {_limit(goal)}",
            "Measured": goal.shown(goal.measured),
            "Reached": "yes" if goal.reached else Markup("**no**"),
        }
        for goal in goals(benchmark)
    ]
    return myst_table(pd.DataFrame(rows), "Goals of the renderer", name="tab-rendering-goals")


def _disagreement(benchmark: Renderings) -> str:
    """Say which part of the heads' disagreement is no fault of their responses."""
    found = {key: f"{100 * value:.2f} %" for key, value in benchmark.about["response"].items()}
    return (
        f"Before they are equalised, heads disagree in overlaps by up to {found['before']}, "
        f"afterwards by up to {found['after']}, the most of all overlaps and bands. What changes "
        "from one sample to the next, noise and ground that two heads see differently, is up to "
        f"{found['floor']}; "
        f"without it, {found['systematic']} are left at most."
    )


def _limit(goal: Goal) -> str:
    return f"{goal.limit:,g} {goal.unit}".strip()


def _renderer_table(benchmark: Renderings) -> str:
    """Return a table of times and memory in memory, those of windows scaled to the image."""
    names = [name for name in RENDERERS if benchmark.has(name)]
    if not names:
        return ""
    rows = [_timed(benchmark, name) for name in names]
    formats = {
        "Samples a pixel": ".3f",
        "Wall, s": ".2f",
        "CPU, s": ".2f",
        "ns a sample": ".1f",
        "Copies": ".1f",
        "Peak, MB": ",.0f",
    }
    if not benchmark.has("copy"):
        del formats["Copies"]
    caption = (
        "The whole image from images in memory: time that passed and CPU time of all threads in "
        "seconds, CPU time of a sample, time that passed in plain copies of the image, peak of the "
        "process"
    )
    return myst_table(pd.DataFrame(rows), caption, name="tab-rendering-time", formats=formats)


def _timed(benchmark: Renderings, name: str) -> dict[str, Any]:
    own = benchmark.of(name)
    whole = own["pixels"] == benchmark.about["width_px"] * benchmark.about["height_px"]
    scale = 1.0 if whole else _samples(benchmark) / own["samples"]
    side = round(float(own["pixels"]) ** 0.5)
    row = {
        "Renderer": RENDERERS[name],
        "Measured on": "the image" if whole else f"{side} × {side} px, scaled",
        "Samples a pixel": own["samples"] / own["pixels"],
        "Wall, s": scale * own["wall_s"],
        "CPU, s": scale * own["cpu_s"],
        "ns a sample": benchmark.ns_per_sample(name),
        "Peak, MB": own["peak_mb"] if whole else None,
    }
    if benchmark.has("copy"):
        row["Copies"] = scale * own["wall_s"] / benchmark.of("copy")["wall_s"]
    return row


def _planning(benchmark: Renderings) -> str:
    """Say what comes before the first image of an orientation."""
    if not benchmark.has("plan"):
        return ""
    own = benchmark.of("plan")
    return (
        "The maps of acx4lib, which all images of an orientation share, take another "
        f"{own['cpu_s']:.1f} s of CPU time, once."
    )


def _samples(benchmark: Renderings) -> float:
    """Return how many samples the image needs."""
    if benchmark.has("ours_1"):
        return float(benchmark.of("ours_1")["samples"])
    return float(benchmark.about["width_px"] * benchmark.about["height_px"])


def _error_table(benchmark: Renderings) -> str:
    """Return a table of differences to exact grey values."""
    names = [n for n in RENDERERS if benchmark.has(n) and benchmark.of(n)["rms_dn"] >= 0]
    if not names:
        return ""
    rows = [
        {
            "Renderer": RENDERERS[name],
            "rms": benchmark.of(name)["rms_dn"],
            "99.9 %": benchmark.of(name)["p999_dn"],
            "Largest": benchmark.of(name)["max_dn"],
        }
        for name in names
    ]
    formats = dict.fromkeys(("rms", "99.9 %", "Largest"), ".2f")
    caption = (
        "Differences of grey values to exact ones, DN: of the equalised and blended image for "
        "acx4lib, of samples at exactly known places of one head for the others"
    )
    return myst_table(pd.DataFrame(rows), caption, name="tab-rendering-errors", formats=formats)


def _file_table(benchmark: Renderings) -> str:
    """Return a table of whole commands, from files to files."""
    medians = benchmark.medians.reset_index().to_dict("records")
    order = list(FILES)
    rows: list[dict[str, Any]] = [
        {
            "Command": FILES[own["what"]],
            "Image": f"{own['width_px']:,.0f} × {own['height_px']:,.0f} px",
            "Wall, s": own["wall_s"],
            "CPU, s": own["cpu_s"],
            "Peak, MB": own["peak_mb"],
            "order": (own["reduction"], order.index(own["what"])),
        }
        for own in medians
        if own["what"] in FILES
    ]
    if not rows:
        return ""
    table = pd.DataFrame(rows).sort_values("order").drop(columns="order")
    formats = {"Wall, s": ".1f", "CPU, s": ".1f", "Peak, MB": ",.0f"}
    caption = "From the heads' files to the image's: whole commands, their start included"
    return myst_table(table, caption, name="tab-rendering-files", formats=formats)


def _tie_table(benchmark: Renderings) -> str:
    """Return a table of ways to find tie points in one overlap."""
    if benchmark.ties.empty:
        return ""
    table = benchmark.ties[["method", *TIES]].rename(columns={"method": "Way", **TIES})
    formats = {"Points": ",d", "rms, px": ".3f", "Share within 0.1 px": ".3f"}
    formats |= dict.fromkeys(("Wall, s", "CPU, s"), ".2f")
    caption = "Tie points of one overlap, errors against the truth of the simulation"
    return myst_table(table, caption, name="tab-rendering-ties", formats=formats)


def _left_out(benchmark: Renderings) -> str:
    """Say what was not installed."""
    lacking: Mapping[str, str] = benchmark.about["missing"]
    names = {**RENDERERS, **FILES}
    if not lacking:
        return ""
    return f"Not installed, and so left out: {', '.join(names[name] for name in lacking)}."


def limits(benchmark: Renderings) -> str:
    """Say how far the renderer is from what memory allows; a paragraph, or nothing."""
    if not all(benchmark.has(name) for name in ("ours_1", "ours_2", "copy")):
        return ""
    copy, one, two = (benchmark.of(name) for name in ("copy", "ours_1", "ours_2"))
    sentences = [
        f"A copy reads and writes every pixel of the image once and takes {copy['wall_s']:.3f} s; "
        f"the heads' images have {_head_share(benchmark):.2f} times as many.",
        f"One thread renders in {one['wall_s'] / copy['wall_s']:.1f} copies; two in "
        f"{two['wall_s'] / copy['wall_s']:.1f}, {one['wall_s'] / two['wall_s']:.2f} times as fast "
        "as one.",
        f"A sample takes {benchmark.ns_per_sample('ours_1'):.1f} ns on one thread.",
    ]
    if benchmark.has("ours_plain_1"):
        plain = benchmark.ns_per_sample("ours_plain_1")
        sentences.append(f"Without responses, and with a hard seam, it takes {plain:.1f} ns.")
    if benchmark.has("ours_fresh"):
        fresh = benchmark.of("ours_fresh")["cpu_s"] - two["cpu_s"]
        sentences.append(
            "Memory that the system has to provide first makes a difference of "
            f"{fresh:.1f} s of CPU time."
        )
    return " ".join(sentences) + "\n"


def _head_share(benchmark: Renderings) -> float:
    """Return how many pixels all heads have for one of the image."""
    about = benchmark.about
    return float(about["head_pixels"] / (about["width_px"] * about["height_px"]))
