"""Vector drawings: the same twice, all of the figure, and nothing else."""

import re

import pytest

from acx4book.typesetting import style
from acx4book.typesetting.svg import inline, vector


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


# --- Drawings in a page: in its colours, their names apart, every letter once


LETTER = '<defs><path id="DejaVuSans-47" d="m0 0h9"/></defs><use href="#DejaVuSans-47"/>'
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
    assert 'id="DejaVuSans-47"' in first
    assert 'id="DejaVuSans-47"' not in second
    assert 'href="#DejaVuSans-47"' in second
    assert 'clip-path="url(#f2-0)" style="fill: var(--figure-ink)"' in second
    assert 'clipPath id="f2-0"' in second
    assert "patch_1" not in first + second
