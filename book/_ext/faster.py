"""Speed: all cores read and write pages, and Python looks for unused objects seldom."""

from __future__ import annotations

import gc
import os

from sphinx.application import Sphinx

OBJECTS = 200_000
"""New objects after which the new ones are looked through; else it takes half of the build."""

PROCESSES = 4
"""At most; each has a copy of what is known of all pages."""

SILENT = ("sphinx_jupyterbook_latex", "sphinx_multitoc_numbering", "sphinx-mathjax-offline")
"""Extensions that do not say whether pages may be read side by side: they work before and after."""


def use_all_cores(app: Sphinx) -> None:
    """Let Sphinx share the pages out, which jupyter-book has no option for."""
    app.parallel = min(os.cpu_count() or 1, PROCESSES)
    for name in app.extensions.keys() & {*SILENT}:
        app.extensions[name].parallel_read_safe = True


def setup(app: Sphinx) -> dict[str, bool]:
    """Set both."""
    gc.set_threshold(OBJECTS, 50, 1000)
    app.connect("builder-inited", use_all_cores)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
