"""The report for machines: the same values as JSON, with units in the names of the keys."""

from __future__ import annotations

import base64
import errno
import html
import json
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from acx4book.report import (
    adjustment,
    findings,
    ground,
    identity,
    markdown,
    mounting,
    parameters,
    typeset,
)
from acx4book.report.adjustment import decisive_qualities
from acx4book.report.findings import NOT_EXAMINED, Finding
from acx4book.report.markdown import Document, Text, number_labels, table_labels, to_html
from acx4book.report.material import Material, checked_points, image_residuals, read, validated
from acx4book.report.parameters import Lens, balanced, corners, correlations, lenses, profile
from acx4book.typesetting import maps, matrix
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.svg import vector
from acx4files.results import folder, whole_files
from acx4files.results.own_folder import check_file
from acx4lib.block import Block
from acx4lib.errors import OutputError
from acx4lib.geometry.camera import INTERIOR, Camera, xy_from_colrow
from acx4lib.geometry.parameters import LEVER_ARM, REPORTED
from acx4lib.least_squares.verdict import FAILS, LEVEL

FORMAT = 1
"""Version of the file format; raised when a key is removed or changes its meaning."""

MARK = b'"made_by": "acx4 report"'
"""Mark of a report as JSON, which a newer report may replace."""

TESTS = (
    *("n_observations", "n_unknowns", "redundancy", "sigma0_squared", "chi_square_p"),
    *("n_rejected", "expected_rejections", "condition", "weakest", "declared"),
)
"""Entries of summary.json repeated for every adjustment."""


def text(material: Material, found: Sequence[Finding]) -> str:
    """Return the report as JSON; an unknown number is null."""
    return json.dumps(_plain(record(material, found)), indent=1, ensure_ascii=False) + "\n"


def record(material: Material, found: Sequence[Finding]) -> dict[str, Any]:
    """Return the content of the report; book/results.md explains the keys."""
    flight, summary = material.flight, material.found.summary
    return {
        "made_by": "acx4 report",
        "format": FORMAT,
        "results_of": material.date.isoformat(),
        "flight": {
            "name": flight.name,
            "date": flight.session.date,
            "temperature_c": flight.session.temperature_c,
            "crs": flight.grid.crs,
            "sha256": material.provenance.digest,
            "files_sha256": dict(material.provenance.files),
        },
        "software": {n: dict(s["versions"]) for n, s in material.provenance.stages.items()},  # type: ignore[call-overload] # read from JSON
        "certificate": _stated(asdict(flight.certificate)),
        "statement": {
            "holds": not any(f.state == FAILS for f in found),
            "level": LEVEL,
            "procedure": "Holm",
            "findings": [_finding(f) for f in found],
            "not_examined": NOT_EXAMINED,
        },
        "calibration": material.calibration or None,
        "methods": {name: _method(material, name) for name in _methods(material)},
        "adjustments": {
            name: {key: summary[name].get(key) for key in TESTS} for name in material.adjustments
        },
        "groups": [asdict(quality) for quality in decisive_qualities(material)],
        "check_points": _checked(summary.get(validated(material), {})),
        "error_budget": ground.recorded(ground.mapped(material)),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    """Return a finding with its tests; p is the smallest, by itself and among all tests."""
    return {
        "question": finding.question,
        "state": finding.state,
        "p": finding.p,
        "p_joint": finding.p_joint,
        "tests": [
            {
                **{key: getattr(t, key) for key in ("name", "p", "p_joint", "state")},
                **{key: getattr(t, key) for key in ("size", "limit", "unit")},
                "fails": t.state == FAILS,
            }
            for t in finding.tests
        ],
    }


def _stated(value: dict[str, Any]) -> dict[str, Any]:
    """Return a nested dictionary without its empty entries."""
    inner = {k: _stated(v) if isinstance(v, dict) else v for k, v in value.items()}
    return {key: entry for key, entry in inner.items() if entry}


def _methods(material: Material) -> list[str]:
    heads = ["heads/bundle"] if folder.has(material.found, "heads/bundle") else []
    return [name for name in (material.calibration, *heads) if name]


def _method(material: Material, name: str) -> dict[str, Any]:
    cov, rho = folder.covariance(material.found, name), correlations(material, name)
    return {
        "cameras": {
            lens.camera.name: {**_camera(lens), "parameters": _parameters(material, name, lens)}
            for lens in lenses(material, name)
        },
        "parameters": list(cov.index),
        "covariance_matrix": cov.to_numpy(),
        "correlation_matrix": rho.to_numpy(),
    }


def _camera(lens: Lens) -> dict[str, Any]:
    camera, balance = lens.camera, balanced(lens)
    keys = ("col_px", "row_px", "x_mm", "y_mm")
    places = np.hstack([corners(camera), xy_from_colrow(camera, corners(camera))])
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "pixel_um": 1000 * camera.pixel_mm,
        "corners": pd.DataFrame(places, columns=keys),
        "interior": {REPORTED[key][0]: getattr(lens.interior, key) for key in INTERIOR},
        "balanced_f_mm": {"value": balance.f, "standard_deviation": balance.sigma},
        "distortion": profile(lens),
        "lever_surveyed_m": _surveyed(camera),
    }


def _surveyed(camera: Camera) -> dict[str, Any]:
    """Return the surveyed components of the lever arm by their names."""
    components = zip(LEVER_ARM, camera.prior.lever_declared, camera.T_b_c.r, strict=True)
    return {REPORTED[key][0]: float(value) for key, declared, value in components if declared}


def _parameters(material: Material, name: str, lens: Lens) -> dict[str, Any]:
    rows = folder.parameters(material.found, name, lens.camera.name)
    return {
        str(label): {
            "value": row["value"],
            "standard_deviation": row["sigma"],
            "unit": row["unit"],
        }
        for label, row in rows.iterrows()
    }


def _checked(entry: Mapping[str, Any]) -> dict[str, Any] | None:
    points = entry.get("points")
    if not isinstance(points, dict):
        return None
    return {
        "n_points": entry.get("n_points"),
        **{key: points.get(key) for key in ("mean", "std", "rms", "mean_sigma", "classes")},
        "joint_chi_square_p": entry.get("joint_chi_square_p"),
    }


def _plain(value: Any) -> Any:
    """Convert a value to types of JSON; non-finite numbers become None."""
    if isinstance(value, dict):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, pd.DataFrame):
        return _plain(value.to_dict("records"))
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if isinstance(value, int | str | None) else str(value)  # a date


# --- The report as files: one page of HTML without external files, JSON, and a PDF/A


PAGE_MARK = b'<meta name="generator" content="acx4'
"""Mark of a report as HTML, which a newer report may replace."""

PDF_MARK = b"/Title(Calibration report)"
"""Mark of a PDF of a report: its heading among the bookmarks, with which the file begins."""

STYLE = resources.files("acx4book.report") / "report.css"

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="acx4 report">
<meta name="dcterms.date" content="{day}">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<p class="kind">In-flight camera calibration</p>
{heading}
<p class="name">{name}</p>
<p class="date">{date}</p>
</header>
<main>
<section class="certificate">
{certificate}
<table class="signatures">
<tr><td>Prepared by</td><td>Checked by</td><td>Place and date, signature</td></tr>
</table>
</section>
{body}
</main>
</body>
</html>
"""


def write(
    folder: str | Path,
    out: str | Path,
    *,
    on_part: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write the calibration report of a run as an HTML file, with a JSON file beside it.

    Both are written completely or not at all.

    Parameters
    ----------
    folder : path
        Results of a run.
    out : path
        The page; an existing report is replaced, any other existing file is not. The other file has
        the ending .json.
    on_part : callable
        Called with the number of finished parts, and of all parts.

    Raises
    ------
    FlightError
        Where the results are missing, not complete, or do not belong together.
    OutputError
        Where the file must not be replaced by a report, or there is no space for it.
    OSError
        Where the file cannot be written otherwise.
    """
    out = Path(out)
    _check_places(out)
    run = read(folder)
    answers = findings.findings(run)
    shown = parts(TEXT.read_text(encoding="utf-8"), computed(run, answers), on_part)
    texts = _page([*shown], run), text(run, answers)
    _check_places(out)  # again, as some seconds have passed
    whole_files.write_all(dict(zip((out, out.with_suffix(".json")), texts, strict=True)))


def _page(parts: Sequence[Part], material: Material) -> str:
    """Return the parts of a report, the heading first, as a page."""
    document = Document(numbers=number_labels([name for part in parts for name in _labels(part)]))
    rendered = [_rendered(part, document) for part in parts]
    heading, _, first = rendered[0].partition("</h1>")
    sections = [i for i, part in enumerate(rendered) if part.startswith("<h2")]
    body = sections[1] if len(sections) > 1 else len(rendered)
    return PAGE.format(
        title=shown(f"Calibration report: {material.flight.name}", "html"),
        style=STYLE.read_text(encoding="utf-8"),
        heading=f"{heading}</h1>",
        name=shown(material.flight.name, "html"),
        date=f"{material.date.day} {material.date:%B %Y}",
        day=f"{material.date:%Y-%m-%d}",
        certificate="\n".join(rendered[1:body]),
        body="\n".join([first, *rendered[body:]]),
    )


def _check_places(out: Path) -> None:
    """Check that the page and its JSON file may be written."""
    if not out.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(out.parent))
    if out.suffix in (".json", ".pdf"):
        msg = f"{out}: name the page, such as {out.with_suffix('.html').name}"
        raise OutputError(f"{msg}; JSON and PDF stand beside it")
    check_file(out, mark=PAGE_MARK, what="a report of acx4")
    check_file(out.with_suffix(".json"), mark=MARK, what="a report of acx4")


def check_pdf(out: str | Path) -> None:
    """Check that the PDF beside the report `out` may be written.

    Raises
    ------
    OutputError
        Where the file must not be replaced.
    """
    check_file(Path(out).with_suffix(".pdf"), mark=PDF_MARK, what="a report of acx4")


def write_pdf(out: str | Path) -> Path:
    """Typeset the report `out` as a PDF/A beside it, and return the path of the PDF.

    Raises
    ------
    OutputError, TypesetError
        As `check_pdf`, and where the package typst is missing.
    """
    out = Path(out)
    check_pdf(out)
    place = out.with_suffix(".pdf")
    whole_files.write(place, typeset.pdf(out.read_text("utf-8-sig")))
    return place


def _labels(part: Part) -> list[str]:
    if isinstance(part.content, Text):
        return table_labels(part.content.markdown)
    return [part.name]


def _rendered(part: Part, document: Document) -> str:
    if isinstance(part.content, Text):
        return to_html(part.content.markdown, document)
    document.n_figures += 1
    data = base64.b64encode(vector(part.content).encode()).decode()
    caption = to_html(part.caption, document).strip()
    caption = caption.removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(part.name)}">\n'
        f'<img alt="{html.escape(part.alt)}" src="data:image/svg+xml;base64,{data}">\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )


# --- The parts of the report in their order: what ``report.md`` says, and what is computed for it
#
# In that file a computed part is a directive with its name from here: ``section`` with tables, or
# ``figure`` with a caption and the alternative text.


TEXT = resources.files("acx4book.report") / "report.md"

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
    """Return the functions that compute the parts, by their names in the text.

    Parameters
    ----------
    run : Material
    found : sequence of Finding
        Of this run.
    """
    planes = cache(lambda: {**_planes(run, "mounting"), **_planes(run, "heads")})
    mapped = cache(lambda: ground.mapped(run))
    return {
        "certificate": lambda: identity.first_page(run, found),
        "statement": lambda: findings.section(found),
        "identity": lambda: identity.identity(run),
        "method": lambda: identity.method_and_data(run),
        "blocks": lambda: maps.block_maps(*_used_blocks(run)),
        "adjustment": lambda: adjustment.section(run),
        "parameters": lambda: parameters.section(run),
        "correlations": lambda: matrix.correlation_matrix(parameters.correlation_picture(run)),
        "image": lambda: parameters.image_figure(run),
        "distortion": lambda: parameters.image_section(run),
        "plane": lambda: adjustment.residual_plane(planes(), run.flight.cameras),
        "strips": lambda: adjustment.residuals_by_strip(planes()),
        "mounting": lambda: mounting.section(run),
        "boresight": lambda: mounting.boresight_over_time(mounting.boresights(run)),
        "check": lambda: ground.check_points(checked_points(run)),
        "ground": lambda: ground.check_points_section(run),
        "budget": lambda: ground.section(mapped()),
        "format": lambda: ground.over_format(mapped()),
    }


def _used_blocks(material: Material) -> tuple[Block, ...]:
    """Return the blocks of the calibration, or else all blocks."""
    blocks = material.flight.blocks
    used = [blocks[name] for name in ("heads", "calibration") if name in blocks]
    return tuple(used or blocks.values())


def _planes(material: Material, stage: str) -> dict[str, pd.DataFrame]:
    """Return the image residuals of a stage's decisive adjustments, by their titles."""
    names = [name for name in material.decisive if name.startswith(f"{stage}/")]
    return {markdown.heading(name): image_residuals(material, name) for name in names}


def parts(
    text: str,
    by_name: Mapping[str, Callable[[], Text | Figure]],
    on_part: Callable[[int, int], None],
) -> Iterator[Part]:
    """Yield texts and computed parts in the order of the text.

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
            labels = {"caption": directive["caption"], "alt": directive["alt"] or ""}
            yield Part(content=by_name[name](), name=f"fig-report-{name}", **labels)
        yield from _text(text[done:])
    on_part(len(directives), len(directives))


def _text(text: str) -> Iterator[Part]:
    """Split a text before its headings."""
    for section in re.split(r"(?m)^(?=## )", text):
        if section.strip():
            yield Part(content=Text(section.strip()))
