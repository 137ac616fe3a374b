"""Pages at addresses that the book had once, and one for addresses that it never had."""

from __future__ import annotations

from html import escape
from pathlib import Path
from posixpath import relpath

from sphinx.application import Sphinx

NOW = {
    "changelog": "reproducibility",
    "rendering-speed": "speed",
    "teaching/slides": "teaching/syllabus",
    "_executed/07-report": "certificate",
    "_executed/13-bad-starts": "_executed/foundations/6-bundle",
    "_executed/17-distortion-models": "_executed/12-synthetic-cost",
    "_executed/18-over-the-years": "commands",
}
"""Pages by what they were called, without their endings."""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={place}">
<title>{title}</title>
<link rel="canonical" href="{place}">
</head>
<body><p>This page has moved: <a href="{place}">{title}</a>.</p></body>
</html>
"""


MISSING = r"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>No such page</title>
<style>
:root { color-scheme: light dark; }
body { font: 1.1rem/1.5 system-ui, sans-serif; margin: 15vh auto; max-width: 36rem; padding: 1rem; }
</style>
</head>
<body>
<h1>No such page</h1>
<p>Nothing stands at this address. <a id="front" href="index.html">The front page of the book</a>
leads to all pages, and its search finds words.</p>
<script>
const folder = location.pathname.replace(/\/(_executed|_generated|teaching)\/.*$|\/[^/]*$/, "/");
document.getElementById("front").href = folder + "index.html";
</script>
</body>
</html>
"""
"""A host shows it at the address that was asked for, in any folder of the book."""


def write(app: Sphinx, exception: Exception | None) -> None:
    """Write a page for every address whose new page this book has, and that for no page."""
    for old, new in NOW.items():
        found = app.env.found_docs
        if exception is None and new in found and old not in found:
            path = Path(app.outdir, f"{old}.html")
            path.parent.mkdir(parents=True, exist_ok=True)
            place = relpath(f"{new}.html", Path(old).parent.as_posix())
            title = escape(app.env.titles[new].astext())
            path.write_text(PAGE.format(place=place, title=title), encoding="utf-8")
    if exception is None:
        Path(app.outdir, "404.html").write_text(MISSING, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect it to the end of the build."""
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
