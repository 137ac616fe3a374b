"""What the command no longer does, and what takes its place."""

from __future__ import annotations

import re
from collections.abc import Sequence

GONE = {
    r"(compare)": "papermill notebooks/compare.ipynb OUT.ipynb -p results_a DIR -p results_b DIR",
    r"plan .*(--target)": "leave strips out of a copy of the plan, and acx4 plan it again",
    r"import (bundler|visualsfm)": "write COLMAP's or Metashape's form, and import that",
    r"import (pospac-text)": "acx4 import orientations TEXT --columns pospac",
    r"export .*--to[ =](opensfm|micmac|opf)": "acx4 export --to colmap, metashape or opencv",
    r"export .*--to[ =](pix4d)": "acx4 export --to opencv, and --to opk for orientations",
}
"""Patterns of what was typed, the gone word in a group, and what to do instead."""


def instead(arguments: Sequence[str]) -> str:
    """Return what takes the place of a command or an option that is gone; else nothing."""
    typed = " ".join(arguments)
    for pattern, says in GONE.items():
        if found := re.match(rf"{pattern}([ =]|$)", typed):
            return f"{found[1]} is gone; instead: {says}"
    return ""
