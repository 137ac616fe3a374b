"""Names on their way to a reader: shown as they are, in every medium."""

from __future__ import annotations

import html
import unicodedata

import matplotlib.pyplot as plt
import pandas as pd
import pytest
from bs4 import BeautifulSoup
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from matplotlib.textpath import TextPath
from myst_parser.config.main import MdParserConfig
from myst_parser.parsers.mdit import create_md_parser
from markdown_it.renderer import RendererHTML

import payloads
from acx4lib import report
from acx4lib.calibration_report.markdown import Document, to_html
from acx4lib.plain_text import ISOLATE, POP, Markup, code, shown
from acx4lib.plot._style import plain, style

names = pytest.mark.parametrize("name", payloads.NAMES.values(), ids=payloads.NAMES)
ANYTHING = st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=12)
MARKUP = st.text("`*_{}[]()<>#+-.!|$~:^%&='\"\\/@ \na1\N{SOFT HYPHEN}", min_size=1, max_size=12)
EVERYTHING = {
    *("amsmath", "attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"),
    *("fieldlist", "html_admonition", "html_image", "linkify", "replacements", "smartquotes"),
    *("strikethrough", "substitution", "tasklist"),
}


def visible(name: str) -> str:
    """Return a name with its controls as the module shows them."""
    return "".join(
        ascii(c)[1:-1]
        if unicodedata.category(c) in ("Cc", "Zl", "Zp") or ord(c) & 0xFFFE == 0xFFFE
        or 0xFDD0 <= ord(c) <= 0xFDEF
        else c
        for c in name
    )


def of_page(text: str) -> str:
    """Return what stands in a page, without the marks that keep directions apart."""
    inner = text
    while inner.startswith(ISOLATE) and inner.endswith(POP):
        inner = inner[1:-1]
    return inner


def rendered(markdown: str, extensions: set[str] = EVERYTHING) -> BeautifulSoup:
    """Render MyST with every extension that there is."""
    parser = create_md_parser(MdParserConfig(enable_extensions=extensions), RendererHTML)
    return BeautifulSoup(parser.render(markdown), "html.parser")
