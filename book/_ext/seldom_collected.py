"""Let Python look for unused objects seldom: those of the pages stay, and are millions."""

from __future__ import annotations

import gc

from sphinx.application import Sphinx

OBJECTS = 200_000
"""New objects after which the new ones are looked through; else it takes half of the build."""


def setup(_app: Sphinx) -> dict[str, bool]:
    """Set how often."""
    gc.set_threshold(OBJECTS, 50, 1000)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
