"""The output folder of ``acx4 compare``: a page and its tables."""

from __future__ import annotations

import contextlib
import html
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from acx4book.report import page
from acx4book.report.campaigns import figures, tables
from acx4book.report.campaigns.tables import Study
from acx4book.report.markdown import Document, number_labels, table_labels, to_html
from acx4book.typesetting import style
from acx4book.typesetting.myst import myst_table
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.svg import inline, vector
from acx4lib.calibration.stability import Rigidity
from acx4lib.results import own_folder
from acx4lib.results.whole_files import write_all
from acx4tools import campaigns
from acx4tools.campaigns import NOUN, trends_of

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


def _parts(study: Study) -> Iterator[str | Drawn]:
    yield f"## Has the camera changed?\n\n{tables.verdict(study)}"
    yield "## The campaigns"
    yield myst_table(tables.campaigns(study), "What is compared", name="tab-campaigns")
    yield "\n".join(f"- {shown(note)}." for note in study.comparison.notes)
    yield Drawn(
        figure=figures.time_line(study),
        name="fig-time-line",
        caption=(
            "Parameters of every campaign less their value of all campaigns. Bars and bands: two "
            "standard deviations to each side."
        ),
        alt="A small diagram for each parameter with one dot and error bar for each campaign.",
    )
    yield "## All parameters together"
    yield myst_table(tables.tests(study), "Joint tests of all parameters", name="tab-tests")
    yield Drawn(
        figure=figures.on_the_ground(study),
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
        tables.pooled(study), "Values of all campaigns, with their stability", name="tab-pooled"
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
        yield myst_table(tables.parts(study, difference), "By parts", name=f"tab-parts-{number}")
        yield myst_table(
            tables.singles(study, difference),
            "Parameter by parameter",
            name=f"tab-singles-{number}",
        )
    if n_hidden := len(study.found) - len(selected):
        yield f"In {n_hidden} more differences nothing is significant; differences.csv has them."


def _trends(study: Study) -> Iterator[str | Drawn]:
    yield f"## Time and temperature\n\n{tables.trend(study)}"
    for variable in trends_of(study.comparison):
        yield Drawn(
            figure=figures.over(study, variable),
            name=f"fig-over-{variable}",
            caption=(
                f"The parameters that follow {NOUN[variable]} most, in their standard deviations."
            ),
            alt=f"Small diagrams of parameters over {NOUN[variable]}, each with a straight line.",
        )
        slopes = tables.trends(study, variable)
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


def _parts_of_rig(rigidity: Rigidity, table: pd.DataFrame, level: float) -> Iterator[str | Drawn]:
    yield f"## Do the heads keep their places?\n\n{figures.verdict(rigidity, level=level)}"
    yield Drawn(
        figure=figures.turns(rigidity),
        name="fig-turns",
        caption=(
            "Rotation of every head against the first one of the exposure, if the rig is rigid at "
            "all other exposures. Bars: two standard deviations to each side."
        ),
        alt="Three rows of dots with error bars, one dot for each head at each exposure.",
    )
    yield "## Exposure by exposure"
    yield myst_table(
        figures.table(table, level=level), "The free rig against the rigid one", name="tab-f"
    )
    yield f"## How the numbers were obtained\n\n{figures.HOW.format(level=level)}"


# --- The page of a comparison: one HTML file, by day and by night, without external files


ADDED = resources.files("acx4book.report.campaigns") / "campaigns.css"

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
class Drawn:
    """A figure of a page.

    Attributes
    ----------
    figure : Figure
    name, caption, alt : str
        The caption is Markdown.
    """

    figure: Figure
    name: str
    caption: str
    alt: str


def _page(title: str, name: str, parts: Sequence[str | Drawn]) -> str:
    """Return texts and figures as a page."""
    labels = [
        name
        for part in parts
        for name in ([part.name] if isinstance(part, Drawn) else table_labels(part))
    ]
    document = Document(numbers=number_labels(labels))
    known: set[str] = set()
    body = [
        _figure(part, document, known) if isinstance(part, Drawn) else to_html(part, document)
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


def _figure(part: Drawn, document: Document, known: set[str]) -> str:
    document.n_figures += 1
    name = f"f{document.n_figures}-"
    drawn = inline(vector(part.figure), alt=part.alt, name=name, known=known)
    caption = to_html(part.caption, document).strip().removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(part.name)}">\n{drawn}\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )
