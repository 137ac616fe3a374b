"""Names on their way to a reader: shown as they are, in every medium."""

from __future__ import annotations

import html
import io
from xml.etree import ElementTree as ET

import matplotlib as mpl
import pytest
import yaml
from bs4 import BeautifulSoup
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it.renderer import RendererHTML
from myst_parser.config.main import MdParserConfig
from myst_parser.parsers.mdit import create_md_parser

from acx4book.typesetting import myst, style
from acx4book.typesetting.plain_text import ISOLATE, POP, shown
from support.flights import payloads
from support.helpers import ROOT

CONFIG = yaml.safe_load((ROOT / "book" / "_config.yml").read_text("utf-8"))
EXTENSIONS = set(CONFIG["parse"]["myst_enable_extensions"])

every_name = pytest.mark.parametrize("name", payloads.NAMES.values(), ids=payloads.NAMES)
SIGNS = "`*_{}[]()<>#+-.!|$~:^%&=;,'\"\\/@ a1"
ANY = st.text(st.sampled_from(SIGNS), min_size=1, max_size=12) | st.text(
    st.characters(exclude_categories=("C", "Zl", "Zp")), min_size=1, max_size=8
)


def same(text: str) -> str:
    """Return text without the marks around what runs from right to left."""
    while text.startswith(ISOLATE) and text.endswith(POP):
        text = text[1:-1]
    return text


def book(markdown: str) -> BeautifulSoup:
    """Render MyST as the book does."""
    parser = create_md_parser(MdParserConfig(enable_extensions=EXTENSIONS), RendererHTML)
    return BeautifulSoup(parser.render(markdown), "html.parser")


PLACES = {
    "a line": ("{}", "p", ["p"]),
    "a sentence": ("of *{}*, and", "em", ["p", "em"]),
    "an item": ("- {}", "li", ["ul", "li"]),
    "a quotation": ("> {}", "p", ["blockquote", "p"]),
}
"""How a name is put there, the element that holds it, and all elements."""


@pytest.mark.parametrize("place", PLACES)
@every_name
def test_a_name_is_text_on_a_page(name, place):
    pattern, holder, elements = PLACES[place]
    soup = book(pattern.format(shown(name)))
    assert [element.name for element in soup.find_all(True)] == elements
    assert same(soup.find(holder).get_text().strip("\n")) == name
    assert all(not element.attrs for element in soup.find_all(True))


@given(name=ANY)
@example(name=" ")
def test_any_signs_are_text_in_a_table_its_head_and_its_caption(name):
    table = myst.pd.DataFrame({name: [name], "n": [1]})
    head, _, _, *rows, _ = myst.myst_table(table, name, name="tab-x").splitlines()
    soup, caption = book("\n".join(rows)), book(head.removeprefix("```{table} "))
    cells = [same(cell.get_text()) for cell in soup.select("th, td")]
    assert cells == [name, "n", name, "1"]
    # white space that ends a paragraph is none to Markdown
    assert caption.p.get_text().rstrip() == soup.th.get_text().rstrip()
    tags = {element.name for element in (*soup.find_all(True), *caption.find_all(True))}
    assert tags == {"table", "p", "thead", "tbody", "tr", "th", "td"}


@every_name
def test_a_name_is_text_in_html(name):
    soup = BeautifulSoup(f"<p>{shown(name, 'html')}</p>", "html.parser")
    assert [element.name for element in soup.find_all(True)] == ["p"]
    assert same(soup.p.get_text()) == name
    quoted = BeautifulSoup(f'<p title="{shown(name, "html")}">x</p>', "html.parser")
    assert same(quoted.p["title"]) == name


def labels(fig) -> list[str]:
    """Return the labels of a figure; of mathematics what is drawn, part by part."""
    buffer = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none"}):
        fig.savefig(buffer, format="svg")
    found = ET.fromstring(buffer.getvalue()).iter("{http://www.w3.org/2000/svg}text")
    return ["\n".join(part for part in text.itertext() if part.strip()) for text in found]


@every_name
def test_a_name_is_drawn_as_it_is(name):
    with style.applied():
        fig, ax = style.subplots(figsize=(4, 3))
        ax.set(xticks=[], yticks=[])
        ax.set_title(f"{style.plain(name)} and {style.plain(name)}")
        ax.plot([0, 1], label=style.plain(name))
        ax.legend()
        title, label = labels(fig)
    if name.isprintable() and name.isascii() and len(name) <= style.LONGEST and name[0] != "_":
        assert " ".join(title.split()) == " ".join(f"{name} and {name}".split())
        assert " ".join(label.split()) == " ".join(name.split())
    assert "\n" not in title or name[0] == "_"  # one piece: no mathematics


@every_name
def test_a_terminal_obeys_no_name(name):
    line = shown(name, "terminal")
    assert line == name or not line.isascii() or "\\u" in line
    assert not set("\N{RIGHT-TO-LEFT OVERRIDE}\N{POP DIRECTIONAL ISOLATE}\x1b\r\n\a") & set(line)


@pytest.mark.parametrize("medium", ["myst", "html", "tex", "terminal"])
@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("a\nb", r"a\nb"),
        ("\x1b[31m", r"\x1b[31m"),
        ("a\x9bb", r"a\x9bb"),
        ("\ud83d", r"\ud83d"),
        ("a\N{LINE SEPARATOR}b", r"a\u2028b"),
        ("a\uffff", r"a\uffff"),
        ("a\N{RIGHT-TO-LEFT OVERRIDE}b", r"a\u202eb"),
    ],
)
def test_what_nothing_shows_is_an_escape(medium, name, seen):
    text = shown(name, medium)
    assert (html.unescape(text) if medium in ("myst", "html") else text) == seen
