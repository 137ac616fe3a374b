"""The slides as a page of its own: a slide is a title, some sentences, a figure of the book."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from acx4book.teaching.showing.figure_pack import Figure
from acx4book.typesetting import svg
from acx4book.typesetting.svg import inline

COLOURS = {name: colour for colour, name in svg.NAMES.items()}
NAMED = re.compile(r"var\(--figure-([\w-]+)\)")
"""Where a page of the book sets a colour; slides are light."""

ADDRESS = "../downloads/slides.html"
"""Of the slides, from the pages of the teaching kit."""


@dataclass(frozen=True, kw_only=True)
class Slide:
    """A slide.

    Attributes
    ----------
    title : str
    says : tuple of str
        Sentences, one a line.
    chapter, figure : str
        Of the figure; both empty where there is none.
    """

    title: str
    says: tuple[str, ...]
    chapter: str = ""
    figure: str = ""


BLOCKS: tuple[tuple[Slide, ...], ...] = (
    (
        Slide(
            title="From pixels to the ground without control points",
            says=(
                "Four cameras on one aircraft make one image.",
                "GNSS and INS say where the IMU is, and how it is turned.",
                "What else must be known, so that a pixel is a place?",
            ),
            chapter="00-flight",
            figure="fig-system",
        ),
        Slide(
            title="A pixel is a direction",
            says=(
                "Similar triangles: image over focal length is ground over height.",
                "The focal length and the flying height only occur together.",
            ),
            chapter="foundations/1-image",
            figure="fig-image-ray",
        ),
        Slide(
            title="Where does a pixel begin?",
            says=(
                "Two programs, two origins: half a pixel.",
                "It is a shift, and calibrates away.",
            ),
            chapter="foundations/1-image",
            figure="fig-image-pixels",
        ),
        Slide(
            title="A rotation has axes",
            says=(
                "ω, φ, κ count from the axes of the map.",
                "Roll, pitch and heading count from the horizon and from true north.",
            ),
            chapter="foundations/2-rotations",
            figure="fig-rotation-axes",
        ),
        Slide(
            title="Collinearity",
            says=(
                "Point, perspective centre and image point lie on one line.",
                "Two equations for each image point; three unknowns for each point on the ground.",
                "So a point needs two images.",
            ),
        ),
        Slide(
            title="Most errors are a sign or an axis",
            says=("Guess first: what does each do to the point on the ground?",),
            chapter="foundations/2-rotations",
            figure="fig-rotation-mistakes",
        ),
    ),
    (
        Slide(
            title="A standard deviation is a promise",
            says=(
                "Of a hundred errors, some 68 are smaller than σ, and 95 smaller than 2 σ.",
                "It can be tested: errors over σ have an RMS of one.",
            ),
        ),
        Slide(
            title="A residual is not an error",
            says=(
                "A residual shows the share r of an error, the redundancy number.",
                "With r near zero an error hides: all unknowns give way to it.",
            ),
            chapter="foundations/5-least-squares",
            figure="fig-redundancy-numbers",
        ),
        Slide(
            title="What one standard deviation moves",
            says=("Each observation leaves another pattern on the ground.",),
            chapter="foundations/7-direct-georeferencing",
            figure="fig-ground-errors",
        ),
    ),
    (
        Slide(
            title="Many images, one adjustment",
            says=(
                "Unknown: every pose, every point, one camera.",
                "Points are eliminated first, then thousands of unknowns are hundreds.",
            ),
        ),
        Slide(
            title="The lens is estimated, too",
            says=(
                "Coefficients are correlated. The curve is what counts.",
                "Change f, and a part of the curve goes with it.",
            ),
            chapter="foundations/4-distortion",
            figure="fig-distortion-curves",
        ),
        Slide(
            title="What an image cannot tell",
            says=(
                "A change of the interior orientation hides behind a change of the pose.",
                "A longer focal length and a higher camera make the same image of flat ground.",
                "Two heights, relief and control points tell them apart.",
            ),
        ),
    ),
    (
        Slide(
            title="Equation (14): three vectors",
            says=(
                "From the origin to the IMU: GNSS.",
                "From the IMU to the camera: the lever arm, turned by the attitude.",
                "From the camera to the ground: the ray, turned by the boresight, too.",
            ),
            chapter="foundations/7-direct-georeferencing",
            figure="fig-vector-sum",
        ),
        Slide(
            title="Opposite strips, two heights",
            says=(
                "A lever arm turns with the aircraft, a shift of GNSS does not.",
                "A boresight grows with the height, a lever arm does not.",
            ),
            chapter="foundations/7-direct-georeferencing",
            figure="fig-three-flights",
        ),
        Slide(
            title="Designs",
            says=("Four flights with as many images. Which would you fly?",),
            chapter="foundations/9-block-design",
            figure="fig-plans",
        ),
        Slide(
            title="Two heights are worth their price",
            says=("The larger their ratio, the better f and the lever arm are told apart.",),
            chapter="foundations/9-block-design",
            figure="fig-ratio",
        ),
        Slide(
            title="Frames: the map is not the ground",
            says=("The map has another scale than the ground, and its north is not true north.",),
            chapter="foundations/8-frames",
            figure="fig-projection",
        ),
    ),
    (
        Slide(
            title="Four heads, one image",
            says=("Calibrate each head, then orient them to each other by tie points.",),
            chapter="02-synthetic-image",
            figure="fig-footprints",
        ),
        Slide(
            title="Two methods, one lever arm",
            says=(
                "The two-step method holds the lever arm; f and the principal point take it up.",
                "Their difference between the methods gives the lever arm back.",
                "From other heights than the block's, the two parts no longer cancel.",
            ),
        ),
        Slide(
            title="A proof needs points that nobody used",
            says=("Bias: a t-test. Scatter: a χ² test. Both on points, not on pairs of images.",),
            chapter="04-validation",
            figure="fig-differences",
        ),
        Slide(
            title="One step forgotten at a time",
            says=("Each has its own size. Most are found by an independent block.",),
            chapter="04-validation",
            figure="fig-mistakes",
        ),
        Slide(
            title="Four real heads",
            says=("No control points: tie points alone put the bands in register.",),
            chapter="13-four-real-heads",
            figure="fig-real-registers",
        ),
        Slide(
            title="A magnetometer in an aircraft",
            says=(
                "Its heading is off by another amount on another course.",
                "Pictures of four courses find it; of one course, it goes into the boresight.",
            ),
            chapter="13-four-real-heads",
            figure="fig-real-compass",
        ),
        Slide(
            title="Your turn",
            says=("Every student has another flight. Talk about the way, not about the numbers.",),
        ),
    ),
)
"""The slides of each of the five blocks of a course; all of them are one lecture."""

LECTURE = tuple(slide for block in BLOCKS for slide in block)


def texts() -> Iterator[tuple[str, str]]:
    """Yield names and texts: the slides of every block as links, in HTML, which no term links."""
    first = 1
    for number, block in enumerate(BLOCKS, 1):
        links = [
            f'<a href="{ADDRESS}#slide-{first + k}">{escape(slide.title)}</a>'
            for k, slide in enumerate(block)
        ]
        yield f"block-{number}-slides.md", f"<p><b>Slides.</b> {'; '.join(links)}.</p>\n"
        first += len(block)


def page(found: Sequence[Figure], slides: Sequence[Slide] = LECTURE) -> str:
    """Return slides as one HTML page that needs no other file.

    Parameters
    ----------
    found : sequence of Figure
        Figures of the book; a slide whose figure is not among them has its text alone.
    slides : sequence of Slide
    """
    by_name = {(one.chapter, one.name): one for one in found}
    known: set[str] = set()
    sections = [
        _section(slide, by_name.get((slide.chapter, slide.figure)), f"s{k}-", known)
        for k, slide in enumerate(slides)
    ]
    template = Path(__file__).with_name("slides.html").read_text(encoding="utf-8")
    return template.replace("<!-- slides -->", "\n".join(sections))


def _section(slide: Slide, figure: Figure | None, name: str, known: set[str]) -> str:
    lines = "".join(f"<p>{escape(line)}</p>" for line in slide.says)
    picture = "" if figure is None else _picture(figure, name, known)
    return f"<section><h1>{escape(slide.title)}</h1>{lines}{picture}</section>"


def _picture(figure: Figure, name: str, known: set[str]) -> str:
    """Return a drawing as part of the page, with the letters that none above it has brought."""
    if figure.kind == "svg":
        drawn = inline(figure.content.decode(), alt=figure.alt, name=name, known=known)
        return NAMED.sub(lambda found: COLOURS[found[1]], drawn)
    data = base64.b64encode(figure.content).decode("ascii")
    return f'<img alt="{escape(figure.alt)}" src="data:image/{figure.kind};base64,{data}">'
