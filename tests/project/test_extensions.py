"""The book's own extensions of Sphinx."""

from types import SimpleNamespace

import pytest
from bs4 import BeautifulSoup
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace

from support.helpers import ROOT, book_extension

# --- the extension of the book that writes pages at old addresses ----------------------------


forwards_extension = book_extension("forwards")


@pytest.fixture
def app(tmp_path):
    titles = {"new/page": nodes.title(text="A < B"), "old/kept": nodes.title(text="Kept")}
    env = SimpleNamespace(found_docs={*titles}, titles=titles)
    return SimpleNamespace(env=env, outdir=tmp_path)


def test_an_old_address_leads_to_the_new_page_from_its_own_folder(app, monkeypatch):
    monkeypatch.setattr(forwards_extension, "NOW", {"old/page": "new/page"})
    forwards_extension.write(app, None)
    text = (app.outdir / "old" / "page.html").read_text("utf-8")
    assert '<meta http-equiv="refresh" content="0; url=../new/page.html">' in text
    assert '<a href="../new/page.html">A &lt; B</a>' in text


# --- the extension of the book that links the first use of every term on a page --------------


glossary_links = book_extension("glossary_links")

TERMS = dict.fromkeys(("lever arm", "arm", "GNSS", "boresight", "mesh", "Jacobian"), ("page", "a"))
PAGE = """Boresight
=========

A boresight_ and ``boresight`` first, then :math:`boresight`, then two boresights.
Boresight again; the lever
arm.

.. _boresight: https://example.org

========= =========
boresight lever arm
========= =========
lever arm GNSS
========= =========
"""
GLOSSARY = """Glossary
========

.. glossary::

   boresight
     A rotation, and the lever arm a vector.

   lever arm
     A vector.

   GNSS
     Positions.
"""


def found(text, *left):
    return list(glossary_links.pieces(text, TERMS, set(left or TERMS)))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("The lever arm.", ["The ", ("lever arm", "lever arm"), "."]),
        ("Two boresights", ["Two ", ("boresights", "boresight"), ""]),
        ("Meshes meet", ["", ("Meshes", "mesh"), " meet"]),
        ("a lever\narm", ["a ", ("lever\narm", "lever arm"), ""]),
        ("the jacobian", ["the ", ("jacobian", "Jacobian"), ""]),
    ],
)
def test_a_term_is_found_as_it_is_used(text, expected):
    assert found(text) == expected


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Two pages, built by Sphinx with the extension."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("out")
    (source / "index.rst").write_text(PAGE)
    (source / "glossary.rst").write_text(f":orphan:\n\n{GLOSSARY}")
    settings = {"extensions": ["sphinx.ext.mathjax", "glossary_links"], "html_theme": "basic"}
    with pytest.MonkeyPatch.context() as patch, docutils_namespace():
        patch.syspath_prepend(ROOT / "book" / "_ext")
        Sphinx(source, None, out, out / "trees", "html", settings, status=None).build()
    return {
        name: BeautifulSoup((out / f"{name}.html").read_text("utf-8"), "html.parser")
        for name in ("index", "glossary")
    }


def test_running_text_is_linked_and_nothing_else(built):
    links = built["index"].select("a.glossary-term")
    assert [(link.get_text(), link["href"]) for link in links] == [
        ("boresights", "glossary.html#term-boresight"),
        ("lever\narm", "glossary.html#term-lever-arm"),
        ("GNSS", "glossary.html#term-GNSS"),
    ]


# --- the extension of the book that sets numbers ---------------------------------------------


typography = book_extension("typography")


def typography_page(*parts):
    document = nodes.document(None, None)
    paragraph = nodes.paragraph()
    paragraph += list(parts)
    document += paragraph
    return document


def test_text_is_set_and_what_may_be_copied_is_not():
    text = "by -0.5 m"
    found = typography_page(nodes.Text(text), nodes.literal(text, text), nodes.math(text, text))
    typography.set_numbers(None, found, "chapter")
    assert [child.astext() for child in found[0]] == ["by −0.5\u00a0m", text, text]
