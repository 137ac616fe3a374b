"""The extension of the book that says who made it, and offers notebooks."""

from support.helpers import book_extension

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
