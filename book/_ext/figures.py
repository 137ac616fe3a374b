"""Figures as part of the page, in its colours: by day and by night."""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx

from acx4book.typesetting.svg import inline


def put_in(app: Sphinx, doctree: nodes.document, _page: str) -> None:
    """Replace the images of a page that are drawings by these."""
    if app.builder.format != "html":
        return
    drawings = [image for image in doctree.findall(nodes.image) if image["uri"].endswith(".svg")]
    known: set[str] = set()
    for number, image in enumerate(drawings, 1):
        svg = Path(app.srcdir, image["uri"]).read_text("utf-8")
        text = inline(
            svg[svg.index("<svg") :], alt=image.get("alt", ""), name=f"f{number}-", known=known
        )
        image.replace_self(nodes.raw("", text, format="html"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page when its references are resolved."""
    app.connect("doctree-resolved", put_in)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
