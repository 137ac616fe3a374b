"""Drawings as part of a page, in the page's colours by day and by night."""

from __future__ import annotations

import html
import re

from acx4book.typesetting import style

COLOUR = re.compile("|".join(style.NAMES))
NAMED = re.compile(r'(\bid="|href="#|url\(#)(?!D[\w-]+")([\w.-]+)')
"""Where a name stands, unless it is that of a letter: a letter is the same in all drawings."""

LETTER = re.compile(r'<path id="(D[\w-]+)" [^>]*/>')
SIZE = re.compile(r'<svg [^>]*?viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*>')
GROUND = re.compile(r'<g id="patch_1"><path [^>]*/></g>')
"""The sheet that matplotlib puts under a figure."""

POINTS = 72 * style.WIDTH
"""Width of a figure that takes the whole column."""


def inline(svg: str, *, alt: str, name: str, known: set[str]) -> str:
    """Return a drawing as part of a page; the page's style sheet sets its colours.

    Parameters
    ----------
    svg : str
        As `svg.vector` makes it.
    alt : str
        What is seen.
    name : str
        Beginning of all names in it, so that they are unique on the page.
    known : set of str
        Letters that drawings above it have brought; its own are added.
    """
    width, height = SIZE.findall(svg)[0]
    share = min(1.0, float(width) / POINTS)
    begin = (
        f'<svg role="img" aria-label="{html.escape(alt)}" viewBox="0 0 {width} {height}" '
        f'style="width: {100 * share:.4g}%; min-width: {35 * share:.4g}rem">'
    )
    inside = GROUND.sub("", SIZE.sub("", svg, count=1), count=1)
    coloured = COLOUR.sub(lambda found: f"var(--figure-{style.NAMES[found[0]]})", inside)
    lettered = LETTER.sub(lambda found: _once(found, known), coloured)
    names: dict[str, str] = {}
    named = NAMED.sub(
        lambda found: found[1] + names.setdefault(found[2], f"{name}{len(names)}"), lettered
    )
    return f'<div class="drawing" tabindex="0">{begin}{named}</div>'


def _once(letter: re.Match[str], known: set[str]) -> str:
    """Return the outline of a letter, and nothing where the page has it."""
    if letter[1] in known:
        return ""
    known.add(letter[1])
    return letter[0]
