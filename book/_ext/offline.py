"""Keep the book free of requests to other hosts, and of what no page shows or loads."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

# What `tex-chtml.js` may load while a page is shown: its fonts and the packages of TeX macros.
MATHJAX_USED = ("tex-chtml.js", "output/chtml/fonts", "input/tex/extensions")

UNUSED = (
    *("**/*.map", "**/all-packages.js", "**/fa-brands-400.*", "locales/**/*.?o"),
    *("mathjax/output/chtml/fonts/tex.js", "mathjax/**/MathJax_Fraktur-*"),
    *(f"mathjax/**/MathJax_{name}-*" for name in ("Calligraphic", "Script", "Typewriter")),
    *(f"mathjax/input/tex/extensions/{name}.js" for name in ("ams", "newcommand", "textmacros")),
    *(f"mathjax/input/tex/extensions/{name}.js" for name in ("bussproofs", "mhchem", "physics")),
    *(f"mathjax/input/tex/extensions/{name}.js" for name in ("empheq", "mathtools")),
)
"""For debuggers, for MathJax without its loader, signs of companies,
other languages; what `tex-chtml.js` has itself, and letters and macros of which no page has any."""


def drop_thebe(
    _app: Sphinx, _page: str, _template: str, context: dict[str, Any], _doctree: Any
) -> None:
    """Take sphinx-thebe's scripts off a page.

    Jupyter Book always loads the extension; its constant is declared twice and it names a host.
    """
    context["script_files"] = [
        script
        for script in context.get("script_files", [])
        if "thebe" not in f"{script.filename} {script.attributes.get('body', '')}".lower()
    ]


def prune(app: Sphinx, exception: Exception | None) -> None:
    """Remove what no page loads, after it was copied."""
    static = Path(app.outdir) / "_static"
    if exception is not None or app.builder.format != "html":
        return
    for path in [found for pattern in UNUSED for found in static.glob(pattern)]:
        path.unlink(missing_ok=True)  # by two patterns
    _prune_mathjax(static / "mathjax")


def _prune_mathjax(root: Path) -> None:
    used = [root / name for name in MATHJAX_USED]
    for path in sorted(root.rglob("*"), reverse=True):
        if any(path == u or path.is_relative_to(u) or u.is_relative_to(path) for u in used):
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the two steps, each after the extension that it corrects."""
    app.connect("html-page-context", drop_thebe, priority=900)
    app.connect("build-finished", prune, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
