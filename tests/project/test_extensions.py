"""The book's own extensions of Sphinx."""

import json
from types import SimpleNamespace

import pandas as pd
import pytest
from bs4 import BeautifulSoup
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace

from support.helpers import ROOT, book_extension

# --- the extension of the book that says who made it, and offers notebooks -------------------


extension = book_extension("foot_and_downloads")

SAID = {"name": "a<b", "version": "1.0", "authors": "us", "licence": "MIT"}
MORE = {"doi": "10.1/x", "repository": "https://h.org/us/x"}


def test_the_foot_has_addresses_only_where_there_are_any():
    alone = '<p>a&lt;b 1.0 · © 2026 us · <a href="../licences.html">Licence: MIT</a>'
    assert extension.foot(SAID, "2026", "../licences.html") == f"{alone}</p>"
    assert extension.foot(SAID | MORE, "2026", "../licences.html") == (
        f'{alone} · <a href="https://doi.org/10.1/x">doi:10.1/x</a>'
        ' · <a href="https://h.org/us/x">https://h.org/us/x</a></p>'
    )


def test_a_host_is_offered_only_for_a_repository():
    (copy,) = extension.buttons(SAID, "00-flight", "../00-flight.ipynb")
    assert copy["url"] == "../00-flight.ipynb"
    _, host = extension.buttons(SAID | MORE, "00-flight", "../00-flight.ipynb")
    assert host["url"] == (
        "https://mybinder.org/v2/git/https%3A%2F%2Fh.org%2Fus%2Fx/HEAD"
        "?labpath=notebooks/00-flight.ipynb"
    )


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


@pytest.mark.parametrize(
    ("now", "failed"),
    [
        ({"old/page": "not/there"}, None),
        ({"old/kept": "new/page"}, None),  # a page of this name is in the book
        ({"old/page": "new/page"}, RuntimeError("Sphinx failed")),
    ],
)
def test_there_is_no_forward_without_a_page_to_lead_to(app, monkeypatch, now, failed):
    monkeypatch.setattr(forwards_extension, "NOW", now)
    forwards_extension.write(app, failed)
    assert [path.name for path in app.outdir.rglob("*.html")] == ([] if failed else ["404.html"])


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


# --- the extensions of the book that leave out what nobody sees ------------------------------


short_signatures, offline = map(book_extension, ("short_signatures", "offline"))
foot_and_downloads = book_extension("foot_and_downloads")


def shown(label, kind):
    table = nodes.table("", nodes.title("", "caption"), ids=[label])
    return table if kind == "table" else nodes.figure("", nodes.caption("", "c"), ids=[label])


@pytest.mark.parametrize("kind", ["table", "figure"])
def test_stored_numbers_have_their_own_commit_below_them(tmp_path, kind):
    facts = {
        "commit": "aaaaaaaaaa",
        "flights": {"coverage": "acx4"},
        "stored": {"tab-coverage": "stored: bbb", "tab-coverage-clean": "stored: ccc"},
    }
    provenance = book_extension("provenance")
    facts_file = tmp_path / provenance.MADE_FROM
    facts_file.parent.mkdir()
    facts_file.write_text(json.dumps(facts))
    labels = ("tab-coverage-points", "tab-coverage-clean", "tab-own")
    doctree = nodes.document(None, None, "", *(shown(label, kind) for label in labels))
    app = SimpleNamespace(srcdir=tmp_path, env=SimpleNamespace(domaindata={"py": {"objects": {}}}))
    provenance.tell(app, doctree, "coverage")
    lines = [n.astext() for n in doctree.findall(nodes.paragraph) if "provenance" in n["classes"]]
    assert lines == ["stored: bbb", "stored: ccc", "flight acx4 · commit aaaaaaaaaa"]


def page(name, body):
    context = {"body": body}
    short_signatures.shorten(None, name, "page.html", context, None)
    return context["body"]


def test_a_page_of_the_interface_says_nothing_twice():
    body = (
        '<dt class="sig" id="acx4lib.f"><span class="sig-name descname"><span class="pre">f</span>'
        '</span><span class="sig-paren">(</span><em class="sig-param"><span class="n"><span '
        'class="pre">x</span></span></em><span class="sig-paren">)</span><a class="headerlink" '
        'href="#acx4lib.f" title="Link to this definition">#</a></dt><dd><a class="reference '
        'internal" href="#acx4lib.g" title="acx4lib.g">g</a></dd>'
    )
    assert page("_generated/api/acx4lib", body) == (
        '<dt class="sig" id="acx4lib.f"><span class="sig-name descname">f</span>('
        '<em class="sig-param">x</em>)</dt><dd><a class="reference internal" href="#acx4lib.g">g'
        "</a></dd>"
    )
    assert page("intro", body) == body


def test_an_executed_notebook_is_packed_the_same_way_twice(tmp_path):
    packed = []
    for k in range(2):
        source = tmp_path / f"sources{k}" / "part" / "a.ipynb"
        source.parent.mkdir(parents=True)
        source.write_text("{}")
        foot_and_downloads.pack(tmp_path / f"sources{k}", tmp_path / f"packed{k}")
        packed.append((tmp_path / f"packed{k}" / "part" / "a.zip").read_bytes())
        assert not source.exists()
    assert packed[0] == packed[1]


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


def test_tables_of_pandas_have_minus_signs():
    html = pd.DataFrame({"m": [-0.5, 1.5], "data-1": ["a-1", "b"]}).to_html()
    found = typography_page(
        nodes.raw("", html, format="html"), nodes.raw("", "<td>-1</td>", format="html")
    )
    typography.set_numbers(None, found, "chapter")
    table, other = found[0]
    assert table.astext() == html.replace("<td>-0.5", "<td>−0.5")
    assert other.astext() == "<td>-1</td>"


def test_pages_about_code_are_as_they_are():
    found = typography_page(nodes.Text("-0.5 m"))
    typography.set_numbers(None, found, "_generated/api/acx4lib")
    assert found.astext() == "-0.5 m"


def test_a_comma_stays_behind_its_formula():
    found = typography_page(
        nodes.math("f", "f"), nodes.Text(", and"), nodes.math("h", "h"), nodes.Text(" m")
    )
    typography.keep_stops(None, found, "chapter")
    kept, *rest = found[0]
    assert (kept["classes"], kept.astext()) == (["one-line"], "f,")
    assert [child.astext() for child in rest] == [" and", "h", " m"]


def test_of_equal_stops_only_that_behind_the_formula_moves():
    parts = [nodes.literal("x", "x"), nodes.Text(", "), nodes.math("y", "y"), nodes.Text(", ")]
    found = typography_page(*parts, nodes.math("z", "z"))
    typography.keep_stops(None, found, "chapter")
    assert [child.astext() for child in found[0]] == ["x", ", ", "y,", " ", "z"]


def test_dates_stay_on_one_line_and_ranges_of_pages_are_no_dates():
    found = typography_page(
        nodes.Text("2021-04-14 and 2021-04, 1926-1937, 370-386 and 2021-04-141")
    )
    typography.set_numbers(None, found, "chapter")
    said = "2021\u201104\u201114 and 2021\u201104, 1926-1937, 370-386 and 2021-04-141"
    assert found.astext() == said
