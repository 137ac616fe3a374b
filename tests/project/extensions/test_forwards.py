"""The extension of the book that writes pages at old addresses."""

from types import SimpleNamespace

import pytest
from docutils import nodes

from support.helpers import book_extension

extension = book_extension("forwards")


@pytest.fixture
def app(tmp_path):
    titles = {"new/page": nodes.title(text="A < B"), "old/kept": nodes.title(text="Kept")}
    env = SimpleNamespace(found_docs={*titles}, titles=titles)
    return SimpleNamespace(env=env, outdir=tmp_path)


def test_an_old_address_leads_to_the_new_page_from_its_own_folder(app, monkeypatch):
    monkeypatch.setattr(extension, "NOW", {"old/page": "new/page"})
    extension.write(app, None)
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
    monkeypatch.setattr(extension, "NOW", now)
    extension.write(app, failed)
    assert [path.name for path in app.outdir.rglob("*.html")] == ([] if failed else ["404.html"])
