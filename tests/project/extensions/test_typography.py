"""The extension of the book that sets numbers."""

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


def test_pages_about_code_are_as_they_are():
    found = page(nodes.Text("-0.5 m"))
    typography.set_numbers(None, found, "_generated/api/acx4lib")
    assert found.astext() == "-0.5 m"
