"""What others made of the built book."""

import pytest

from acx4book.pages.back import licences


@pytest.mark.parametrize(
    ("file", "brought_by"),
    [
        ("_static/mathjax/output/chtml/fonts/woff-v2/MathJax_Zero.woff", "sphinx-mathjax-offline"),
        ("_static/scripts/bootstrap.js", "pydata-sphinx-theme"),
        ("_static/searchtools.js", "Sphinx"),
    ],
)
def test_a_file_belongs_to_who_brings_it(file, brought_by):
    assert licences.of(file).brought_by == brought_by


@pytest.mark.parametrize(
    "file", ["_static/moving/block.js", "_static/acx4.css", "_static/logo.svg", "intro.html"]
)
def test_our_own_belong_to_nobody_else(file):
    assert licences.of(file) is None


def test_the_page_names_licences_and_repositories():
    page = licences.page()
    assert "| MathJax with its fonts | Apache-2.0 | sphinx-mathjax-offline " in page
    assert "| `niclasborlin/dbat` | 15 | BSD-like" in page
