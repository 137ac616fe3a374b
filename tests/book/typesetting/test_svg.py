"""Vector drawings: the same twice, all of the figure, and nothing else."""

import base64
import io
import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.path import Path
from PIL import Image

from acx4book.typesetting import style, svg
from acx4book.typesetting.svg import inline, smaller, vector


def figure(label="a"):
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2))
        ax.plot([0, 1 / 3], [0, 1 / 7], label=label)
        ax.set_title(label)
    return fig


def test_a_drawing_is_the_same_twice_and_has_no_date():
    drawn = [vector(figure()) for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert drawn[0].startswith("<svg ")
    assert "date" not in drawn[0]


def test_a_figure_is_drawn_once(monkeypatch):
    drawn, draw = [], Figure.draw
    monkeypatch.setattr(Figure, "draw", lambda own, *to: drawn.append(own) or draw(own, *to))
    vector(figure())
    assert len(drawn) == 1


def test_a_drawing_has_outlines_of_letters_and_no_text():
    assert "zq53" not in vector(figure("zq53 --><b>"))


def test_what_reaches_out_of_the_figure_is_drawn_too():
    fig = figure()
    where = {"xycoords": "axes fraction", "textcoords": "axes fraction"}
    fig.axes[0].annotate("far out", (1, 1), xytext=(1.3, 1.4), **where)
    fig.set_layout_engine("none")
    whole, left_out = (
        [float(n) for n in re.search(r'viewBox="([^"]*)"', vector(f))[1].split()]
        for f in (fig, figure())
    )
    assert left_out[2] == pytest.approx(72 * style.WIDTH, abs=0.1)
    assert whole[2] > left_out[2] + 20
    assert whole[3] > left_out[3] + 5


@pytest.mark.parametrize(("side", "allowed"), [(20, 0), (400, 10)])
def test_small_pictures_are_stored_without_loss_and_large_ones_with_some(rng, side, allowed):
    smooth = np.add.outer(np.arange(side), np.arange(side)) * 200 / (2 * side)
    seen = (smooth[..., None] + rng.uniform(0, 20, (side, side, 3))).astype(np.uint8)
    png = io.BytesIO()
    Image.fromarray(seen).save(png, "PNG")
    text = base64.b64encode(png.getvalue()).decode()
    stored = smaller(f'<svg><image href="data:image/png;base64,{text}"/></svg>')
    kept = base64.b64decode(re.search(r'webp;base64,([^"]*)', stored)[1])
    found = np.asarray(Image.open(io.BytesIO(kept)).convert("RGB"))
    assert np.abs(found.astype(int) - seen).mean() <= allowed
    assert len(stored) < (1.2 if allowed == 0 else 0.3) * len(text)


# --- Drawings in a page: in its colours, their names apart, every letter once


LETTER = '<defs><path id="D47" d="m0 0h9"/></defs><use href="#D47"/>'
DRAWING = (
    '<svg viewBox="0 0 252 90" width="252pt"><g><g id="patch_1"><path d="m0 0h9"/></g>'
    f'<g clip-path="url(#p1)" style="fill: #1f2933">{LETTER}</g>'
    '<clipPath id="p1"><rect/></clipPath></g></svg>'
)


def test_a_page_has_every_letter_once_and_the_names_of_each_drawing_apart():
    known = set()
    first, second = (inline(DRAWING, alt='"a"', name=name, known=known) for name in ("f1-", "f2-"))
    assert 'aria-label="&quot;a&quot;"' in first
    assert "width: 50%" in first  # of a column of 504 points
    assert 'id="D47"' in first
    assert 'id="D47"' not in second
    assert 'href="#D47"' in second
    assert 'clip-path="url(#f2-0)" style="fill: var(--figure-ink)"' in second
    assert 'clipPath id="f2-0"' in second
    assert "patch_1" not in first + second


# --- A drawing written shorter draws the same


STEP = re.compile(r"[a-z]|-?(?:\d+\.?\d*|\.\d+)")
KINDS = {"m": Path.MOVETO, "l": Path.LINETO, "q": Path.CURVE3, "c": Path.CURVE4}


def walked(d):
    """Return the codes and the points of a path in small letters, as a browser reads it."""
    codes, points, last, start, letter, numbers = [], [], np.zeros(2), np.zeros(2), "", []
    for step in STEP.findall(d):
        if step == "z":
            codes, points, last = [*codes, Path.CLOSEPOLY], [*points, start], start
        elif step.isalpha():
            letter = step
        else:
            numbers.append(float(step))
        size = {"h": 1, "v": 1, "q": 4, "c": 6}.get(letter, 2)
        if step.isalpha() or len(numbers) < size:
            continue
        if letter in "hv":
            numbers = [numbers[0], 0.0] if letter == "h" else [0.0, numbers[0]]
        moved = last + np.reshape(numbers, (-1, 2))
        codes += len(moved) * [KINDS.get(letter, Path.LINETO)]
        points += [*moved]
        last, numbers = moved[-1], []
        if letter == "m":
            start, letter = last, "l"
    return codes, np.array(points)


def written(codes, points):
    """Return the same path in capital letters, as matplotlib writes it."""
    letters = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C"}
    parts, before = [], 0
    for code, (x, y) in zip(codes, points, strict=True):
        again = code == before and code in (Path.CURVE3, Path.CURVE4) and parts[-1] != "end"
        parts += ["z"] if code == Path.CLOSEPOLY else [*([] if again else [letters[code]]), x, y]
        before = code
    return " ".join(str(part) for part in parts)


@pytest.mark.parametrize("kind", [Path.LINETO, Path.CURVE3, Path.CURVE4])
def test_a_path_goes_where_it_went_to_a_hundredth(rng, kind):
    one = [Path.MOVETO, *6 * [Path.LINETO], *{2: [], 3: 2 * [3], 4: 3 * [4]}[kind], Path.CLOSEPOLY]
    codes, points = 2 * one, rng.uniform(-300, 900, (2 * len(one), 2)).round(4)
    points[2, 1], points[4, 0] = points[1, 1], points[3, 0]  # level, and upright
    points[5] = points[4] + 0.3
    points[[len(one) - 1, -1]] = points[[0, len(one)]]
    shorter = shortened(written(codes, points))
    found, there = walked(shorter)
    assert found == codes
    assert np.abs(there - points).max() < 0.0051
    assert {"h", "v"} < {*shorter}


def shortened(d):
    return re.fullmatch('<path d="(.*)"/>', drawing(f'<path d="{d}"/>'))[1]


def drawing(inside):
    text = smaller(f'<svg xmlns="{svg.SVG}">{inside}</svg>')
    return text.removeprefix(f'<svg xmlns="{svg.SVG}">').removesuffix("</svg>")


def test_a_path_is_short():
    assert shortened("M 10 10.50 L 10.25 10 L 10.75 10 L 10.75 12 z") == "m10 10.5 .25-.5h.5v2z"
    assert shortened("M 5 5 L 5 5") == "m5 5h0"  # with round ends, a point


def test_neighbours_say_once_what_they_share():
    one = '<g id="line_{}"><path d="M 0 0 L 1 2" clip-path="url(#c)" style="fill: none"/></g>'
    found = drawing(f'<g id="figure_1">{one.format(1)}{one.format(2)}</g>')
    assert found == (
        f'<g style="{svg.JOINED}"><g style="fill: none" clip-path="url(#c)">'
        '<path d="m0 0 1 2"/><path d="m0 0 1 2"/></g></g>'
    )


@pytest.mark.parametrize(
    "alone",
    [
        'style="fill: red; opacity: 0.5"',  # of a group: of all its parts together
        'clip-path="url(#c)" transform="scale(2)"',  # which moves the edge
    ],
)
def test_what_means_another_thing_on_a_group_stays(alone):
    two = 2 * f'<path d="M 0 0 L 1 2" {alone}/>'
    assert "<g>" not in drawing(f"<g>{two}</g>")
    assert drawing(f"<g>{two}</g>").count(alone.partition(" transform")[0]) == 2


def test_a_use_says_nothing_that_its_mark_says_but_how_opaque_it_is():
    mark = '<defs><path id="m" d="M 0 0 L 0 3" style="stroke: red; opacity: 0.5"/></defs>'
    used = '<use href="#m" x="7" y="9" style="fill: blue; stroke: red; opacity: 0.5"/>'
    plain = used.replace("fill: blue; ", "").replace("; opacity: 0.5", "")
    found = drawing(f"<g>{mark}{used}{plain}</g>")
    assert '<use href="#m" x="7" y="9" style="fill: blue; opacity: 0.5"/>' in found
    assert '<use href="#m" x="7" y="9"/>' in found


def test_only_names_that_something_refers_to_are_left():
    found = drawing(
        '<defs><style>*{stroke-linejoin: round}</style></defs><g id="figure_1">'
        '<g id="patch_1"><path d="M 0 0 L 1 1"/></g><g id="text_1">'
        '<defs><path id="DejaVuSans-47" d="M 0 0 L 9 9"/></defs>'
        '<use href="#DejaVuSans-47" transform="translate(63.6 0)"/></g></g>'
    )
    assert found == (
        f'<g style="{svg.JOINED}"><g id="patch_1"><path d="m0 0 1 1"/></g>'
        '<defs><path id="D47" d="m0 0 9 9"/></defs><use href="#D47" x="64"/></g>'
    )
