"""The folder that ``acx4 compare`` leaves: a page, and a table for every part of it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from acx4book.report.campaigns import figures, rig, sentences, tables
from acx4book.report.campaigns.page import Drawn, page
from acx4book.report.campaigns.study import Study
from acx4book.typesetting.myst import myst_table
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.trust.rigidity import Rigidity
from acx4lib.results.campaigns import tables as of_library
from acx4lib.results.campaigns.tables import NOUN, trends_of
from acx4lib.results.own_folder import claims
from acx4lib.results.own_folder.whole_files import write_all

FORM: Any = {"float_format": "%.10g", "lineterminator": "\n"}
"""How tables are written."""

COMMAND = "acx4 compare"
PAGE = "compare.html"
MOST_SHOWN = 6
"""Differences that a page shows in any case."""


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
        put(page("Comparison of campaigns", names, [*_parts(study)]))


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
    table = of_library.rigidity(found)
    with _claimed(out, {"rigidity": table}) as put:
        put(page("Rigidity of the rig", name, [*_parts_of_rig(found, table, level)]))


@contextlib.contextmanager
def _claimed(out: Path, listed: Mapping[str, pd.DataFrame]) -> Iterator[Callable[[str], None]]:
    """Claim a folder for tables and a page; yield what writes them all, with the page's text."""
    with claims.claim(out, command=COMMAND) as own:
        tables = {f"{name}.csv": of.to_csv(index=False, **FORM) for name, of in listed.items()}
        own.expect([PAGE, *tables])
        yield lambda text: write_all({out / n: t for n, t in {**tables, PAGE: text}.items()})
        own.remove([name for name in own.files if name not in (PAGE, *tables)])
        own.seal()


def _parts(study: Study) -> Iterator[str | Drawn]:
    yield f"## Has the camera changed?\n\n{sentences.verdict(study)}"
    yield "## The campaigns"
    yield myst_table(tables.campaigns(study), "What is compared", name="tab-campaigns")
    yield sentences.notes(study)
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
    yield f"## How the numbers were obtained\n\n{sentences.how(study)}"


def _differences(study: Study) -> Iterator[str]:
    """Yield a section for every difference, or of many for those that are significant."""
    shown_ones = [
        one for one in study.found if len(study.found) <= MOST_SHOWN or study.changed(one)
    ]
    for number, one in enumerate(shown_ones, 1):
        later, earlier = map(shown, study.names(one))
        yield f"## {later} less {earlier}"
        yield myst_table(tables.parts(study, one), "By parts", name=f"tab-parts-{number}")
        yield myst_table(
            tables.singles(study, one), "Parameter by parameter", name=f"tab-singles-{number}"
        )
    if left := len(study.found) - len(shown_ones):
        yield f"In {left} more differences nothing is significant; differences.csv has them."


def _trends(study: Study) -> Iterator[str | Drawn]:
    yield f"## Time and temperature\n\n{sentences.trend(study)}"
    for what in trends_of(study.comparison):
        yield Drawn(
            figure=figures.over(study, what),
            name=f"fig-over-{what}",
            caption=f"The parameters that follow {NOUN[what]} most, in their standard deviations.",
            alt=f"Small diagrams of parameters over {NOUN[what]}, each with a straight line.",
        )
        slopes = tables.trends(study, what)
        yield myst_table(slopes, f"Slopes over {NOUN[what]}", name=f"tab-over-{what}")


def _parts_of_rig(found: Rigidity, table: pd.DataFrame, level: float) -> Iterator[str | Drawn]:
    yield f"## Do the heads keep their places?\n\n{rig.verdict(found, level=level)}"
    yield Drawn(
        figure=rig.turns(found),
        name="fig-turns",
        caption=(
            "Rotation of every head against the first one of the exposure, if the rig is rigid at "
            "all other exposures. Bars: two standard deviations to each side."
        ),
        alt="Three rows of dots with error bars, one dot for each head at each exposure.",
    )
    yield "## Exposure by exposure"
    yield myst_table(
        rig.table(table, level=level), "The free rig against the rigid one", name="tab-f"
    )
    yield f"## How the numbers were obtained\n\n{rig.HOW.format(level=level)}"
