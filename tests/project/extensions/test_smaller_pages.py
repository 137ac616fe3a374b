"""The extensions of the book that leave out what nobody sees."""

from types import SimpleNamespace

import pytest

from support.helpers import book_extension

short_signatures, offline = map(book_extension, ("short_signatures", "offline"))
foot_and_downloads = book_extension("foot_and_downloads")


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


@pytest.fixture
def html(tmp_path):
    """A built book with three icons, one of which is shown, and one by another name."""
    scripts = tmp_path / "_static" / "scripts"
    scripts.mkdir(parents=True)
    icons = (
        'i={"bars":[448,512,["navicon"],"f0c9","M0 9"],plane:[9,9,[],"f1",["M1","M2"]],'
        '"xmark":[384,512,[128473,"times"],"f00d","M3"]};go()'
    )
    (scripts / "fontawesome.js").write_text(icons)
    (scripts / "other.js").write_text('add("fa-times")')
    (tmp_path / "a.html").write_text('<i class="fa-solid fa-bars"></i>')
    (tmp_path / "_static" / "mathjax").mkdir()
    return tmp_path


def test_only_icons_that_a_page_or_a_script_names_are_left(html):
    app = SimpleNamespace(outdir=html, builder=SimpleNamespace(format="html"))
    offline.prune(app, None)
    left = (html / "_static" / "scripts" / "fontawesome.js").read_text()
    assert left.startswith('i={"bars":[448,')
    assert '"xmark"' in left
    assert "plane" not in left
    assert left.endswith("};go()")


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
