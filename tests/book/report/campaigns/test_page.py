"""The page: one file that asks for nothing, in the book's colours by day and by night."""

import re

from acx4book.report.campaigns.page import ADDED, Drawn, page
from acx4book.typesetting import style
from support.helpers import ROOT

CODE = "A <script> & $x$"


def test_texts_tables_and_figures_are_numbered_and_names_are_shown_as_they_are():
    with style.applied():
        fig, _ = style.subplots(figsize=(style.WIDTH, 1))
    figures = [
        Drawn(figure=fig, name=name, caption="An *a*.", alt="a < b") for name in ("fig-a", "fig-b")
    ]
    text = page("T", CODE, ["## One\n\nSee {numref}`fig-a`.", *figures])
    assert "&lt;script&gt;" in text
    assert "<script" not in text
    assert "See Figure 1." in text
    assert "<b>Figure 2.</b> An <em>a</em>." in text
    assert not re.search(r"<link|src=|url\(http|@import", text)


def test_colours_of_the_night_are_those_of_the_book():
    of_book = (ROOT / "book/_static/acx4.css").read_text(encoding="utf-8")
    night = re.findall(r"(--figure-[\w-]+): (#\w+);", ADDED.read_text(encoding="utf-8"))
    assert {name.removeprefix("--figure-") for name, _ in night} == set(style.NAMES.values())
    own = of_book[of_book.index('data-theme="dark"') :]
    assert dict(night).items() <= dict(re.findall(r"(--figure-[\w-]+): (#\w+);", own)).items()
