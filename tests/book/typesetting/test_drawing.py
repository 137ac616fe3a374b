"""Drawings inside a page: colours that the page may change, and nothing that it did not ask for."""

import xml.etree.ElementTree as ET

import pytest

from acx4book.typesetting import drawing, style


@pytest.fixture
def text():
    with style.applied():
        fig, ax = style.subplots(figsize=(2, 1))
        ax.plot([0, 1], color=style.BLUE)
    return drawing.inline(fig, alt='A "line" & more', caption="```\n<script>")


def test_colours_are_variables_with_the_books_colours_behind_them(text):
    assert f"var(--drawing-blue, {style.BLUE})" in text
    assert "metadata" not in text


def test_the_drawing_is_one_block_of_well_formed_markup(text):
    lines = text.splitlines()
    assert (lines[0], lines[-1]) == ("```{raw} html", "```")
    assert "```" not in "\n".join(lines[1:-1])
    figure = ET.fromstring("\n".join(lines[1:-1]))
    svg, caption = figure
    assert svg.get("role") == "img"
    assert svg.get("aria-label") == 'A "line" & more'
    assert caption.text == "```\n<script>"
