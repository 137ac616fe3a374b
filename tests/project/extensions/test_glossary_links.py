"""The extension of the book that links the first use of every term on a page."""

import pytest
from bs4 import BeautifulSoup
from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace

from support.helpers import ROOT, book_extension

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


@pytest.mark.parametrize(
    "text", ["alarm", "arm_x", "arm-like", "boresight.csv", "in/boresight", "gnss", "jacobianic"]
)
def test_a_part_of_a_name_is_no_term(text):
    assert found(text) == [text]


def test_each_is_found_once():
    assert found("arm, arm") == ["", ("arm", "arm"), ", arm"]
    assert found("the arm", "mesh") == ["the arm"]


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


def test_the_glossary_does_not_link_itself(built):
    assert built["glossary"].select("dt#term-boresight")
    assert built["glossary"].select("a.glossary-term") == []
