"""Tables for the book."""

from __future__ import annotations

import html

import numpy as np
import pandas as pd
import pytest
from markdown_it import MarkdownIt

from acx4book.typesetting import myst
from acx4book.typesetting.plain_text import Markup


def rows(markdown: str) -> list[list[str]]:
    """Parse the pipe table inside the directive."""
    inner = "\n".join(markdown.splitlines()[3:-1])
    tokens = MarkdownIt("commonmark").enable("table").parse(inner)
    cells: list[list[str]] = []
    for token, after in zip(tokens, [*tokens[1:], None], strict=True):
        if token.type == "tr_open":
            cells.append([])
        elif token.type in ("th_open", "td_open"):
            cells[-1].append(after.content)
    return cells


def test_directive_has_caption_name_and_body():
    frame = pd.DataFrame({"parameter": ["f"], "value": [74.4404]})
    caption = Markup("Interior\norientation")
    got = myst.myst_table(frame, caption, name="tab-f", formats={"value": ".3f"})
    assert got == (
        "```{table} Interior orientation\n:name: tab-f\n\n"
        "| parameter | value |\n| :--- | ---: |\n| f | 74.440 |\n```"
    )


def test_markup_survives_a_markdown_parser():
    cells = [Markup("x | y"), Markup("two\nlines"), Markup("$k_1$")]
    frame = pd.DataFrame({Markup("a|b"): cells, "n": [1, 2, 3]})
    got = rows(myst.myst_table(frame, "c", name="tab-x"))
    assert got == [["a|b", "n"], ["x | y", "1"], ["two lines", "2"], ["$k_1$", "3"]]


def test_missing_values_are_dashes_and_text_takes_no_number_format():
    frame = pd.DataFrame(
        {"v": [np.nan, 0.5], "s": [None, "ND"], "m": pd.Series([1.0, "A"], dtype=object)}
    )
    got = rows(myst.myst_table(frame, "c", name="t", formats={"v": ".1e", "m": ".2f", "s": "f"}))
    assert got[1:] == [[myst.MISSING, myst.MISSING, "1.00"], ["5.0e−01", "ND", "A"]]


def test_no_line_ends_between_plus_minus_and_the_sigma():
    got = myst.myst_table(pd.DataFrame({"v": [Markup("0.5 ± 0.1")]}), "c", name="t")
    assert "0.5 ±\N{NO-BREAK SPACE}0.1" in got


def test_text_is_no_markup_in_a_cell_a_heading_or_a_caption():
    frame = pd.DataFrame({"*a* $x$": ["`b` mm^-2 ± 1", "{{ c }}"], "n": ["-1", "--"]})
    got = myst.myst_table(frame, "*d* {e}`f`", name="t")
    assert not set("*$`{}^") & set(got.replace("```{table}", "").removesuffix("```"))
    said = [[html.unescape(cell) for cell in row] for row in rows(got)]
    assert said == [["*a* $x$", "n"], ["`b` mm^-2 ± 1", "-1"], ["{{ c }}", "--"]]


def test_markup_stays_markup_on_its_way_through_a_table():
    frame = myst.marked(pd.DataFrame({"$a$": ["$b$", "$c$"], "n": [1.5, 2.5]}))
    turned = frame.assign(more=frame["$a$"]).iloc[::-1].rename(columns={"n": "m"})
    got = rows(myst.myst_table(turned, "c", name="t"))
    assert got == [["$a$", "m", "more"], ["$c$", "2.5", "$c$"], ["$b$", "1.5", "$b$"]]


def test_table_without_rows_keeps_its_head():
    frame = pd.DataFrame({"a": pd.Series(dtype=float)})
    assert rows(myst.myst_table(frame, "c", name="t")) == [["a"]]


def test_format_of_an_unknown_column_is_refused():
    with pytest.raises(ValueError, match="sigma"):
        myst.myst_table(pd.DataFrame({"a": [1]}), "c", name="t", formats={"sigma": ".1f"})


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [(2.27e-6, 2, "2.27·10⁻⁶"), (-1.04e-10, 1, "-1.0·10⁻¹⁰"), (4e23, 0, "4·10²³"), (1, 0, "1·10⁰")],
)
def test_scientific_numbers(value, digits, expected):
    assert myst.scientific(value, digits=digits) == expected


@pytest.mark.parametrize(
    ("text", "set_so"),
    [
        ("off by -0.4, -0.4, +0.2 m", "off by −0.4, −0.4, +0.2\u00a0m"),
        ("by -23, +27, -33 m", "by −23, +27, −33\u00a0m"),
        ("(-0.99), p < 0.0005", "(−0.99), p <\u00a00.0005"),
        ("-8.8·10⁻¹¹ ± 1.5 mm", "−8.8·10⁻¹¹ ±\u00a01.5\u00a0mm"),
        ("σ of 3 % at 600 m in 12 min", "σ of 3\u00a0% at 600\u00a0m in 12\u00a0min"),
        *((same, same) for same in ("C5-04", "2026-05-02", "1-2.5", "--seeds 1-20", "a -12 b")),
        *((same, same) for same in ("12 models", "5 sets", "3 hours")),
    ],
)
def test_numbers_have_minus_signs_and_keep_their_units(text, set_so):
    assert myst.numbers(text) == set_so


def test_a_commit_of_stored_numbers_says_how_many_files_differed():
    name = "b689ff0561d516e1a6d076faa26ccdd554320175"
    assert myst.at_commit(name) == "commit `b689ff0`"
    assert myst.at_commit(f"{name}, 4 files differ") == "commit `b689ff0` with changes in 4 files"
    assert myst.at_commit(f"{name}, 1 files differ") == "commit `b689ff0` with changes in one file"
