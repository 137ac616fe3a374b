"""The output folder of ``acx4 compare``: a page with figures, and its tables.

Of several campaigns it compares the calibrations, of one run it tests whether its rig is rigid.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import html
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from acx4book.report import comparison_tables, page
from acx4book.report.comparison_tables import SMALL, Study, rows_of
from acx4book.report.markdown import Document, listed, number_labels, table_labels, to_html
from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS, POWER, SUPERSCRIPTS, myst_table, p_value
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.svg import inline, vector
from acx4lib.calibration.stability import Rigidity, rigidity
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.expected import Array
from acx4lib.least_squares.covariance import sigmas
from acx4lib.results import own_folder
from acx4lib.results.provenance import read_run
from acx4lib.results.whole_files import write_all
from acx4lib.stages import rig
from acx4tools import campaigns
from acx4tools.campaigns import NOUN, trends_of

# --- parameters over time and temperature, effects on the ground -----------------------------


COLUMNS = 3
BARS = 2.0
"""Length of error bars, in standard deviations to each side."""

MOST_PANELS = 6
YEARS = "years after the first campaign"

SPREAD = 0.25
"""Spread of a campaign's cameras along the axis, as a share of the campaigns' spacing."""


def time_line(study: Study) -> Figure:
    """Draw every parameter of every campaign minus its pooled value, with error bars."""
    comparison = study.comparison
    mean = campaigns.pooled(comparison)
    x, dated = _places(study)
    d = comparison.values - mean.coefficients[0]  # noqa: PD011 no frame's
    band = sigmas(mean.cov[0, :, 0])
    names = list(dict.fromkeys(p.name for p in comparison.parameters))
    with style.applied():
        fig, axes = _panels(names, height=1.35)
        for ax, name in zip(axes, names, strict=False):
            unit = _draw(ax, study, name, x, d, band)
            ax.set_title(f"{LABELS[name]} ({unit})" if unit else LABELS[name])
            _axis_of_campaigns(ax, study, x, dated)
        _legend(fig, study, axes)
    return fig


def _panels(names: Sequence[str], *, height: float, **shared: bool) -> tuple[Figure, list[Axes]]:
    n_rows = -(-len(names) // COLUMNS)
    size = (style.WIDTH, height * n_rows + 0.6)
    fig, axes = style.subplots(n_rows, COLUMNS, figsize=size, squeeze=False, **shared)
    for ax in axes.flat[len(names) :]:
        ax.axis("off")
    return fig, [*axes.flat]


def _places(study: Study) -> tuple[Array, bool]:
    """Return the positions of the campaigns on the axis, by date or order."""
    dates = [c.session.date for c in study.comparison.campaigns]
    known = [date for date in dates if date is not None]
    if len(known) == len(dates) and len(set(known)) > 1:
        return np.array([_year_of(day) for day in known]), True
    return np.arange(float(len(dates))), False


def _year_of(date: dt.date) -> float:
    """Return a date as a year with decimals."""
    first = dt.date(date.year, 1, 1).toordinal()
    return date.year + (date.toordinal() - first) / 365.25


def _draw(ax: Axes, study: Study, name: str, x: Array, d: Array, band: Array) -> str:
    """Draw a parameter for every camera with it; return the unit."""
    comparison, unit = study.comparison, ""
    cameras = list(dict.fromkeys(p.camera for p in comparison.parameters))
    step = SPREAD * float(np.diff(np.sort(x)).min(initial=np.inf)) / max(1, len(cameras) - 1)
    for i, p in enumerate(comparison.parameters):
        if p.name != name:
            continue
        factor, unit = _fine(p.unit, float(band[i]))
        k = cameras.index(p.camera)
        shift = step * (k - (len(cameras) - 1) / 2) if len(cameras) > 1 else 0.0
        sigma = factor * np.sqrt(comparison.covs[:, i, i])
        bars: dict[str, Any] = {"fmt": "o", "ms": 3.5, "lw": 1.1, "color": style.colour(k)}
        ax.errorbar(x + shift, factor * d[:, i], yerr=BARS * sigma, **bars)
        if len(cameras) == 1:
            ax.axhspan(*(BARS * factor * band[i] * np.array([-1, 1])), color=style.SHEET)
    ax.axhline(0, color=style.INK, lw=0.7)
    return unit


def _fine(unit: str, size: float) -> tuple[float, str]:
    """Return factor and unit for a figure; small numbers have a power of ten in the unit."""
    factor, sign = SMALL.get(unit, (1.0, unit))
    power = math.floor(math.log10(size)) if unit not in SMALL and size > 0 else 0
    text = POWER.sub(lambda m: m[1].translate(SUPERSCRIPTS), "" if sign == "1" else sign)
    if not power:
        return factor, text
    return factor / 10.0**power, f"10{str(power).translate(SUPERSCRIPTS)} {text}".strip()


def _axis_of_campaigns(ax: Axes, study: Study, x: Array, dated: bool) -> None:
    if dated:
        ax.xaxis.set_major_locator(MaxNLocator(5, integer=True, min_n_ticks=1))
    else:
        names = [style.plain(c.name, longest=10) for c in study.comparison.campaigns]
        ax.set_xticks(x, names, rotation=90 if len(names) > 4 else 0)
    margin = 0.2 * float(np.ptp(x))
    ax.set_xlim(x.min() - margin, x.max() + margin)


def _legend(fig: Figure, study: Study, axes: Sequence[Axes]) -> None:
    cameras = list(dict.fromkeys(p.camera for p in study.comparison.parameters))
    if len(cameras) > 1:
        handles = [
            axes[0].plot([], [], "o", ms=3.5, color=style.colour(k), label=style.plain(name))[0]
            for k, name in enumerate(cameras)
        ]
        style.legend_below(fig, handles)


def on_the_ground(study: Study) -> Figure:
    """Draw the ground displacement of the most significant difference over each format."""
    clearest = min(study.found, key=lambda difference: difference.test().p)
    names = [style.plain(c.name) for c in study.comparison.campaigns]
    cameras = list(study.ground.of)
    n = min(len(cameras), 4)
    columns = min(n, 2)
    rows = -(-n // columns)
    with style.applied():
        fig, axes = style.subplots(
            rows,
            columns,
            figsize=(style.WIDTH * (0.62 if n == 1 else 1), (3.6 if n == 1 else 2.7) * rows),
            squeeze=False,
        )
        for ax in axes.flat[n:]:
            ax.axis("off")
        for ax, camera in zip(axes.flat, cameras, strict=False):
            _draw_ground(ax, study, clearest, camera)
            title = f"{names[clearest.later]} less {names[clearest.earlier]}"
            ax.set_title(f"{style.plain(camera)}: {title}" if n > 1 else title, pad=16)
    return fig


def _draw_ground(ax: Axes, study: Study, difference: campaigns.Difference, camera: str) -> None:
    effects = study.ground.of[camera]
    columns = study.comparison.of_camera(camera)
    moved = effects.moved(difference.d[columns])
    sigma = effects.sigma(difference.cov[np.ix_(columns, columns)])
    forward, left = effects.xy.T
    gap = float(np.ptp(forward)) / 14
    longest = float(np.hypot(*moved.T).max())
    key = style.round_length(longest) if longest > 0 else 1.0
    arrows = ax.quiver(
        *(-left, forward, *(np.column_stack([-moved[:, 1], moved[:, 0]]).T * gap / key)),
        np.hypot(*moved.T) / sigma,
        cmap=style.SHADES,
        clim=(0, 4),
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.005,
    )
    label, place = f"{key:g} m", (0.84, 1.04)
    ax.quiverkey(
        arrows, *place, gap, label, labelpos="W", color=style.INK, fontproperties=style.LETTERS
    )
    ax.locator_params(axis="x", nbins=5)
    ax.set(aspect="equal", xlabel="to the right of the flight (m)", ylabel="forward (m)")
    bar = ax.figure.colorbar(arrows, ax=ax, shrink=0.7, aspect=30, extend="max")
    bar.set_label("length over its σ (1)")
    bar.outline.set_visible(False)


def over(study: Study, what: str) -> Figure:
    """Draw parameters over time or temperature with their lines, the largest slope over σ first.

    Parameters
    ----------
    study : Study
    what : str
        ``"temperature"`` or ``"year"``.
    """
    lines = trends_of(study.comparison)
    if what not in lines:
        return style.nothing(f"The campaigns have no {what}s to fit a line over.")
    line, comparison = lines[what], study.comparison
    t = np.abs(line.slope / sigmas(line.cov))
    steepest = np.argsort(-t, kind="stable")[:MOST_PANELS]
    ends = np.array([line.at.min(), line.at.max()])
    with style.applied():
        fig, axes = _panels([comparison.names[i] for i in steepest], height=1.6)
        for ax, i in zip(axes, steepest.tolist(), strict=False):
            p = comparison.parameters[i]
            factor, unit = _fine(p.unit, float(np.sqrt(comparison.covs[0, i, i])))
            sigma = factor * np.sqrt(comparison.covs[:, i, i])
            d = factor * (comparison.values[:, i] - line.at_mean[i])  # noqa: PD011 no frame's
            ax.errorbar(line.at, d, yerr=BARS * sigma, fmt="o", ms=3.5, lw=1.1)
            ax.plot(ends, factor * line.slope[i] * (ends - line.at.mean()), color=style.ORANGE)
            camera = f"{style.plain(p.camera)} " if len(study.ground.of) > 1 else ""
            style.heading(ax, f"{camera}{LABELS[p.name]}", f"{unit}; slope {t[i]:.1f} σ")
        for ax in axes[: len(steepest)][-COLUMNS:]:
            ax.set_xlabel("temperature (°C)" if what == "temperature" else YEARS)
    return fig


# --- The rigidity of the rig of one flight: from its results to a table, a figure and sentences


HOW = (
    "In the rigid rig every head has one boresight and one lever arm at all exposures. In the free "
    "rig the heads turn: by three angles each, against the first head that measured at the "
    "exposure. With Ω the weighted sum of squared residuals, r the redundancy, and q angles "
    "more, F = ((Ω(rigid) - Ω(free)) / q) / (Ω(free) / (r - q)). In a row the heads of this "
    "exposure alone are free; in the last row all are, where what the boresights take up does not "
    "count. "
    "*p, joint* is Holm's: the probability of one false alarm or more among the exposures is at "
    "most {level:g}."
)
"""How the numbers were obtained, as Markdown."""

NAMED = 5
MOST_ROWS = 60
"""Largest number of exposures in the table; of more, only deviating ones are listed."""

MOST_NAMES = 40
"""Largest number of exposure names on an axis."""


def read_rigidity(folder: str | Path) -> Rigidity:
    """Adjust the heads of a run's flight together again, and test the rig for rigidity.

    Parameters
    ----------
    folder : path
        Results of a run, with its flight.

    Raises
    ------
    FlightError
        Where the flight has no block of heads.
    AdjustmentError
        Where the heads cannot be adjusted together.
    """
    run = read_run(folder)
    path, flight = run.folder, run.flight
    if flight.heads is None or len(flight.heads.cameras) < 2:
        problem = (
            f"{path}: one results folder without a block of several heads; name two or more "
            "folders to compare campaigns"
        )
        raise FlightError([problem])
    stage = rig.calibrate(flight)
    if stage.rig is None:
        raise AdjustmentError(f"{path}: the heads cannot be adjusted together: {stage.left_out}")
    return rigidity(stage.rig.bundle)


def rigidity_table(found: pd.DataFrame, *, level: float) -> pd.DataFrame:
    """Tabulate the tests by exposure; of many exposures, only the deviating ones.

    Parameters
    ----------
    found : DataFrame
        As `acx4tools.campaigns.rigidity` returns it.
    level : float
    """
    if len(found) > MOST_ROWS:
        found = found[(found["p_joint"] < level) | (found["exposure"] == "")]
    return pd.DataFrame(
        [
            {
                "Exposure": row.exposure or "all at once",
                "Degrees of freedom": f"{row.dof}, {row.redundancy:,}",
                "F": f"{row.f:.2f}",
                "p": p_value(row.p),
                "p, joint": p_value(row.p_joint),
                "Turned": "yes" if row.p_joint < level else "no",
                "Head that turned most": row.head or None,
                "by (″)": f"{row.turn_arcsec:+.1f} ± {row.sigma_arcsec:.1f}" if row.head else None,
            }
            for row in rows_of(found)
        ]
    )


def rigidity_verdict(found: Rigidity, *, level: float) -> str:
    """Say whether the rig is rigid, as Markdown."""
    whole, turned = found.whole, np.flatnonzero(found.p_joint < level)
    p = p_value(whole.p)
    text = (
        f"**The heads {'keep their places' if whole.p >= level else 'turn against each other'}.** "
        f"All {len(found.exposures)} exposures at once: F = {whole.f:.2f} with {whole.dof} and "
        f"{whole.redundancy:,} degrees of freedom, p {p if p.startswith('<') else f'= {p}'}; the "
        f"level is {level:g}."
    )
    if not len(turned):
        return f"{text} No exposure by itself deviates at the joint level."
    names = [shown(found.exposures[i]) for i in turned[:NAMED]]
    more = f", and {len(turned) - NAMED} more" if len(turned) > NAMED else ""
    return f"{text} At the joint level these exposures deviate: {listed(names)}{more}."


def rigidity_lines(found: Rigidity, *, level: float) -> list[str]:
    """Return the verdict in lines without markup."""
    whole = found.whole
    keeps = "keep their places" if whole.p >= level else "turn against each other"
    lines = [
        f"{len(found.exposures)} exposures: the heads {keeps}; F {whole.f:.2f}, {whole.dof} and "
        f"{whole.redundancy} degrees of freedom, p {p_value(whole.p)}"
    ]
    turned = np.flatnonzero(found.p_joint < level)
    deviations = [
        f"exposure {found.exposures[i]} deviates: F {found.tests[i].f:.2f}" for i in turned
    ]
    return [*lines, *deviations]


def turns(found: Rigidity) -> Figure:
    """Draw the rotation of every head at every exposure, axis by axis, with error bars."""
    x = np.arange(len(found.exposures))
    arcsec = 3600 * np.degrees(np.stack([found.turns, found.sigma]))
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 4.8), sharex=True)
        for axis, ax in enumerate(axes):
            for k, head in enumerate(found.heads):
                value, sigma = arcsec[:, :, k, axis]
                estimated = sigma > 0
                shift = 0.5 * (k / max(1, len(found.heads) - 1) - 0.5)
                bars: dict[str, Any] = {"fmt": "o", "ms": 2.8, "lw": 0.8, "color": style.colour(k)}
                if estimated.any():
                    ax.errorbar(
                        *(x[estimated] + shift, value[estimated]),
                        yerr=2 * sigma[estimated],
                        label=style.plain(head),
                        **bars,
                    )
            ax.axhline(0, color=style.INK, lw=0.7)
            ax.set_ylabel(f"about {'xyz'[axis]} (″)")
            ax.grid(visible=False, axis="x")
        if len(x) <= MOST_NAMES:
            names = [style.plain(name, longest=10) for name in found.exposures]
            axes[-1].set_xticks(x, names, rotation=90)
        axes[-1].set_xlabel("exposure")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


# --- the folder ------------------------------------------------------------------------------


FORM: Any = {"float_format": "%.10g", "lineterminator": "\n"}
"""How tables are written."""

COMMAND = "acx4 compare"
PAGE = "compare.html"
MOST_SHOWN = 6
"""Number of differences up to which the page shows all; of more, significant ones."""


def write(study: Study, out: Path) -> None:
    """Write a comparison of campaigns into a folder of its own.

    Parameters
    ----------
    study : Study
    out : Path
        New, empty, or of an earlier comparison.

    Raises
    ------
    OutputError
        Where the command must not write there.
    """
    with _claimed(out, study.tables) as put:
        names = ", ".join(c.name for c in study.comparison.campaigns)
        put(_page("Comparison of campaigns", names, [*_parts(study)]))


def write_rigidity(found: Rigidity, out: Path, *, name: str, level: float) -> None:
    """Write the test of a rig into a folder of its own.

    Parameters
    ----------
    found : Rigidity
    out : Path
    name : str
        Of the results.
    level : float
    """
    table = campaigns.rigidity(found)
    with _claimed(out, {"rigidity": table}) as put:
        put(_page("Rigidity of the rig", name, [*_parts_of_rig(found, table, level)]))


@contextlib.contextmanager
def _claimed(out: Path, listed: Mapping[str, pd.DataFrame]) -> Iterator[Callable[[str], None]]:
    """Claim a folder; yield a function that writes the tables and the text of the page."""
    with own_folder.claim(out, command=COMMAND) as folder:
        tables = {
            f"{name}.csv": table.to_csv(index=False, **FORM) for name, table in listed.items()
        }
        folder.expect([PAGE, *tables])
        yield lambda text: write_all({out / n: t for n, t in {**tables, PAGE: text}.items()})
        folder.remove([name for name in folder.files if name not in (PAGE, *tables)])
        folder.seal()


def _parts(study: Study) -> Iterator[str | _Drawn]:
    yield f"## Has the camera changed?\n\n{comparison_tables.verdict(study)}"
    yield "## The campaigns"
    yield myst_table(comparison_tables.campaigns(study), "What is compared", name="tab-campaigns")
    yield "\n".join(f"- {shown(note)}." for note in study.comparison.notes)
    yield _Drawn(
        figure=time_line(study),
        name="fig-time-line",
        caption=(
            "Parameters of every campaign less their value of all campaigns. Bars and bands: two "
            "standard deviations to each side."
        ),
        alt="A small diagram for each parameter with one dot and error bar for each campaign.",
    )
    yield "## All parameters together"
    yield myst_table(
        comparison_tables.tests(study), "Joint tests of all parameters", name="tab-tests"
    )
    yield _Drawn(
        figure=on_the_ground(study),
        name="fig-ground",
        caption=(
            f"What the most significant difference moves on the ground, from "
            f"{study.ground.height_m:g} m. Arrows begin where nodes over the format lie; the "
            "bluer an arrow, the longer it is in its own standard deviation."
        ),
        alt="Arrows over the ground that an image covers.",
    )
    yield from _differences(study)
    yield "## Values of all campaigns"
    yield myst_table(
        comparison_tables.pooled(study),
        "Values of all campaigns, with their stability",
        name="tab-pooled",
    )
    yield from _trends(study)
    yield f"## How the numbers were obtained\n\n{_how(study)}"


def _differences(study: Study) -> Iterator[str]:
    """Yield a section for every difference; of many, only for the significant ones."""
    selected = [
        difference
        for difference in study.found
        if len(study.found) <= MOST_SHOWN or study.changed(difference)
    ]
    for number, difference in enumerate(selected, 1):
        later, earlier = map(shown, study.names(difference))
        yield f"## {later} less {earlier}"
        yield myst_table(
            comparison_tables.parts(study, difference), "By parts", name=f"tab-parts-{number}"
        )
        yield myst_table(
            comparison_tables.singles(study, difference),
            "Parameter by parameter",
            name=f"tab-singles-{number}",
        )
    if n_hidden := len(study.found) - len(selected):
        yield f"In {n_hidden} more differences nothing is significant; differences.csv has them."


def _trends(study: Study) -> Iterator[str | _Drawn]:
    yield f"## Time and temperature\n\n{comparison_tables.trend(study)}"
    for variable in trends_of(study.comparison):
        yield _Drawn(
            figure=over(study, variable),
            name=f"fig-over-{variable}",
            caption=(
                f"The parameters that follow {NOUN[variable]} most, in their standard deviations."
            ),
            alt=f"Small diagrams of parameters over {NOUN[variable]}, each with a straight line.",
        )
        slopes = comparison_tables.trends(study, variable)
        yield myst_table(slopes, f"Slopes over {NOUN[variable]}", name=f"tab-over-{variable}")


def _how(study: Study) -> str:
    """Say how the numbers were obtained."""
    sigma = (
        "as they were stated before the adjustments"
        if study.comparison.apriori
        else "multiplied by the root of each campaign's own σ₀²"
    )
    p_of = "χ²" if study.comparison.apriori else "F, with the smallest redundancy of the campaigns"
    return (
        "Campaigns count as independent: the covariance of a difference is the sum of both, from "
        f"covariance.csv. Standard deviations are {sigma}. χ² is $d^T C^{{-1}} d$ of the "
        f"differences d with their joint covariance C; p is from {p_of}. *p, joint* is Holm's: "
        "among all parameters of all differences, or all their parts, or all differences as a "
        "whole, the probability of one false alarm or more is at most "
        f"{study.level:g}, however the tests depend on each other. Values *of all campaigns* are "
        "fitted by least squares with the full covariances; they hold where nothing has changed. "
        f"*Ground* is what a difference moves in a single image from {study.ground.height_m:g} m "
        "over level ground of known height, as RMS over the format; *by chance* is what it would "
        "be if only errors of both calibrations made it."
    )


def _parts_of_rig(rigidity: Rigidity, table: pd.DataFrame, level: float) -> Iterator[str | _Drawn]:
    yield f"## Do the heads keep their places?\n\n{rigidity_verdict(rigidity, level=level)}"
    yield _Drawn(
        figure=turns(rigidity),
        name="fig-turns",
        caption=(
            "Rotation of every head against the first one of the exposure, if the rig is rigid at "
            "all other exposures. Bars: two standard deviations to each side."
        ),
        alt="Three rows of dots with error bars, one dot for each head at each exposure.",
    )
    yield "## Exposure by exposure"
    yield myst_table(
        rigidity_table(table, level=level), "The free rig against the rigid one", name="tab-f"
    )
    yield f"## How the numbers were obtained\n\n{HOW.format(level=level)}"


# --- The page of a comparison: one HTML file, by day and by night, without external files


ADDED = resources.files("acx4book.report") / "comparison.css"

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="acx4 compare">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<p class="kind">In-flight camera calibration</p>
<h1>{title}</h1>
<p class="name">{name}</p>
</header>
<main>
{body}
</main>
</body>
</html>
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Drawn:
    """A figure of a page; its caption is Markdown."""

    figure: Figure
    name: str
    caption: str
    alt: str


def _page(title: str, name: str, parts: Sequence[str | _Drawn]) -> str:
    """Return texts and figures as a page."""
    labels = [
        name
        for part in parts
        for name in ([part.name] if isinstance(part, _Drawn) else table_labels(part))
    ]
    document = Document(numbers=number_labels(labels))
    known: set[str] = set()
    body = [
        _figure(part, document, known) if isinstance(part, _Drawn) else to_html(part, document)
        for part in parts
    ]
    return _PAGE.format(
        title=shown(title, "html"),
        style=_style(),
        name=shown(name, "html"),
        body="\n".join(body),
    )


def _style() -> str:
    colours = "".join(f"  --figure-{name}: {value};\n" for value, name in style.NAMES.items())
    sheets = (page.STYLE, ADDED)
    base, added = (sheet.read_text(encoding="utf-8") for sheet in sheets)
    return f"{base}\n:root {{\n{colours}}}\n{added}"


def _figure(part: _Drawn, document: Document, known: set[str]) -> str:
    document.n_figures += 1
    name = f"f{document.n_figures}-"
    drawn = inline(vector(part.figure), alt=part.alt, name=name, known=known)
    caption = to_html(part.caption, document).strip().removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(part.name)}">\n{drawn}\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )
