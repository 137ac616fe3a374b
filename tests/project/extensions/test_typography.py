"""The extension of the book that sets numbers."""

import pandas as pd
from docutils import nodes

from support.helpers import book_extension

typography = book_extension("typography")


def page(*parts):
    document = nodes.document(None, None)
    paragraph = nodes.paragraph()
    paragraph += list(parts)
    document += paragraph
    return document


def test_text_is_set_and_what_may_be_copied_is_not():
    text = "by -0.5 m"
    found = page(nodes.Text(text), nodes.literal(text, text), nodes.math(text, text))
    typography.set_numbers(None, found, "chapter")
    assert [child.astext() for child in found[0]] == ["by −0.5\u00a0m", text, text]


def test_tables_of_pandas_have_minus_signs():
    html = pd.DataFrame({"m": [-0.5, 1.5], "data-1": ["a-1", "b"]}).to_html()
    found = page(nodes.raw("", html, format="html"), nodes.raw("", "<td>-1</td>", format="html"))
    typography.set_numbers(None, found, "chapter")
    table, other = found[0]
    assert table.astext() == html.replace("<td>-0.5", "<td>−0.5")
    assert other.astext() == "<td>-1</td>"


def test_pages_about_code_are_as_they_are():
    found = page(nodes.Text("-0.5 m"))
    typography.set_numbers(None, found, "_generated/api/acx4lib")
    assert found.astext() == "-0.5 m"


def test_a_comma_stays_behind_its_formula():
    found = page(nodes.math("f", "f"), nodes.Text(", and"), nodes.math("h", "h"), nodes.Text(" m"))
    typography.keep_stops(None, found, "chapter")
    kept, *rest = found[0]
    assert (kept["classes"], kept.astext()) == (["one-line"], "f,")
    assert [child.astext() for child in rest] == [" and", "h", " m"]


def test_of_equal_stops_only_that_behind_the_formula_moves():
    parts = [nodes.literal("x", "x"), nodes.Text(", "), nodes.math("y", "y"), nodes.Text(", ")]
    found = page(*parts, nodes.math("z", "z"))
    typography.keep_stops(None, found, "chapter")
    assert [child.astext() for child in found[0]] == ["x", ", ", "y,", " ", "z"]


def test_dates_stay_on_one_line_and_ranges_of_pages_are_no_dates():
    found = page(nodes.Text("2021-04-14 and 2021-04, 1926-1937, 370-386 and 2021-04-141"))
    typography.set_numbers(None, found, "chapter")
    said = "2021\u201104\u201114 and 2021\u201104, 1926-1937, 370-386 and 2021-04-141"
    assert found.astext() == said
