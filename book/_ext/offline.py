"""Keep the book free of requests to other hosts, and its MathJax to what its pages use."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

# What `tex-chtml.js` may load while a page is shown: its fonts and the packages of TeX macros.
MATHJAX_USED = ("tex-chtml.js", "output/chtml/fonts", "input/tex/extensions")


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


def prune_mathjax(app: Sphinx, exception: Exception | None) -> None:
    """Remove the parts of MathJax that no page loads, after they were copied."""
    root = Path(app.outdir) / "_static" / "mathjax"
    if exception is not None or not root.is_dir():
        return
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
    app.connect("build-finished", prune_mathjax, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
