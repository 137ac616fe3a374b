"""The parts of the report in their order: what ``report.md`` says, and what is computed for it.

A computed part stands in that file as a directive with the name that it has here, ``section`` with
tables, or ``figure`` with a caption and the words in the figure's place.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from acx4book.report import shown
from acx4book.report.adjustment import residuals
from acx4book.report.adjustment import tables as adjustment
from acx4book.report.ground import check_points, error_budget
from acx4book.report.identity import certificate, describe
from acx4book.report.material import Material, checked_points
from acx4book.report.mounting import over_time, stability
from acx4book.report.parameters import image
from acx4book.report.parameters import tables as parameters
from acx4book.report.shown import Text
from acx4book.report.verdict import verdict
from acx4book.report.verdict.finding import Finding
from acx4book.typesetting import maps, matrix

TEXT = resources.files("acx4book.report.page") / "report.md"

DIRECTIVE = re.compile(
    r"^```\{(?:section|figure)\} (?P<name>\w+)\n(?::alt: (?P<alt>[^\n]*)\n)?"
    r"\s*(?P<caption>.*?)\s*```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the report.

    Attributes
    ----------
    content : Text or Figure
    name, caption, alt : str
        Of a figure: its label, its caption, and words in its place.
    """

    content: Text | Figure
    name: str = ""
    caption: str = ""
    alt: str = ""


def computed(run: Material, found: Sequence[Finding]) -> dict[str, Callable[[], Text | Figure]]:
    """Return what computes each part, by the name that the text has for it.

    Parameters
    ----------
    run : Material
    found : sequence of Finding
        Of this run.
    """
    planes = cache(lambda: {**shown.planes(run, "mounting"), **shown.planes(run, "heads")})
    mapped = cache(lambda: error_budget.mapped(run))
    return {
        "certificate": lambda: certificate.first_page(run, found),
        "statement": lambda: verdict.section(found),
        "identity": lambda: describe.identity(run),
        "method": lambda: describe.method_and_data(run),
        "blocks": lambda: maps.block_maps(*describe.mapped(run)),
        "adjustment": lambda: adjustment.section(run),
        "parameters": lambda: parameters.section(run),
        "correlations": lambda: matrix.correlation_matrix(shown.correlation_picture(run)),
        "image": lambda: image.image_figure(run),
        "distortion": lambda: image.section(run),
        "plane": lambda: residuals.residual_plane(planes(), run.flight.cameras),
        "strips": lambda: residuals.residuals_by_strip(planes()),
        "mounting": lambda: over_time.section(run),
        "boresight": lambda: over_time.boresight_over_time(stability.boresights(run)),
        "check": lambda: check_points.check_points(checked_points(run)),
        "ground": lambda: check_points.section(run),
        "budget": lambda: error_budget.section(mapped()),
        "format": lambda: error_budget.over_format(mapped()),
    }


def parts(
    text: str,
    by_name: Mapping[str, Callable[[], Text | Figure]],
    on_part: Callable[[int, int], None],
) -> Iterator[Part]:
    """Yield the texts and what is computed between them, in their order.

    Parameters
    ----------
    text : str
        Markdown with directives, see above.
    by_name : mapping
        As of `computed`.
    on_part : callable
        Called with the number of finished parts, and of all that are computed.

    Raises
    ------
    KeyError
        Where the text names a part that nothing computes.
    Exception
        Whatever a part raises.
    """
    directives, done = [*DIRECTIVE.finditer(text)], 0
    with threadpool_limits(1, user_api="blas"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as a page shows none
        for number, directive in enumerate(directives):
            on_part(number, len(directives))
            yield from _text(text[done : directive.start()])
            name, done = directive["name"], directive.end()
            told = {"caption": directive["caption"], "alt": directive["alt"] or ""}
            yield Part(content=by_name[name](), name=f"fig-report-{name}", **told)
        yield from _text(text[done:])
    on_part(len(directives), len(directives))


def _text(text: str) -> Iterator[Part]:
    """Yield a text, divided before its headings."""
    for one in re.split(r"(?m)^(?=## )", text):
        if one.strip():
            yield Part(content=Text(one.strip()))
