"""Keep the book free of requests to other hosts, and of what no page shows or loads."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from fontTools import subset, ttLib
from sphinx.application import Sphinx

# What `tex-chtml.js` may load while a page is shown: its fonts and the packages of TeX macros.
MATHJAX_USED = ("tex-chtml.js", "output/chtml/fonts", "input/tex/extensions")

UNUSED = (
    *("**/*.map", "**/*.woff2", "**/all-packages.js", "**/fa-brands-400.*", "locales/**/*.?o"),
    *("mathjax/output/chtml/fonts/tex.js", "mathjax/**/MathJax_Fraktur-*"),
    *(f"mathjax/**/MathJax_{name}-*" for name in ("Calligraphic", "Script", "Typewriter")),
    *(f"mathjax/input/tex/extensions/{name}.js" for name in ("ams", "newcommand", "textmacros")),
    *(f"mathjax/input/tex/extensions/{name}.js" for name in ("bussproofs", "mhchem", "physics")),
    *(f"mathjax/input/tex/extensions/{name}.js" for name in ("empheq", "mathtools")),
)
"""For debuggers, fonts that are packed twice, for MathJax without its loader, signs of companies,
other languages; what `tex-chtml.js` has itself, and letters and macros of which no page has any."""

ICON = re.compile(
    r'"?([\w-]+)"?:\[\d+,\d+,\[([^\]]*)\],"[0-9a-f]+",(?:"[^"]*"|\["[^"]*","[^"]*"\])\],?'
)
"""An icon in the script that draws them: name, size, other names, sign, outlines."""

STYLED = re.compile(r'((?:\.fa-[a-z0-9-]+:before,?)+)\{content:"[^"]*"\}')
"""The sign of an icon in the theme's style sheet."""

SHOWN = re.compile(r"\bfa-([a-z0-9-]+)")

SIGN = re.compile(r"\\([ef][0-9a-f]{3})\b")
"""A sign of the icons' font, as style sheets write it."""

PACKED = re.compile(r'url\([^)]*\.woff2\) format\("woff2"\),')
"""A font as the theme's style sheet names it first."""


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
    _prune_icons(Path(app.outdir), static / "scripts" / "fontawesome.js")
    _prune_signs(static)


def _prune_mathjax(root: Path) -> None:
    used = [root / name for name in MATHJAX_USED]
    for path in sorted(root.rglob("*"), reverse=True):
        if any(path == u or path.is_relative_to(u) or u.is_relative_to(path) for u in used):
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _prune_icons(html: Path, script: Path) -> None:
    """Leave the icons that a page or a script names, of two thousand."""
    files = [path for path in html.rglob("*") if path.suffix in {".html", ".js"} and path != script]
    named = {name for path in files for name in SHOWN.findall(path.read_text("utf-8"))}

    def used(icon: re.Match[str]) -> str:
        return icon[0] if named & {icon[1], *re.findall(r"[a-z][\w-]*", icon[2])} else ""

    def styled(rule: re.Match[str]) -> str:
        return rule[0] if named & {*SHOWN.findall(rule[1])} else ""

    script.write_text(ICON.sub(used, script.read_text("utf-8")), encoding="utf-8")
    for sheet in (html / "_static" / "styles").glob("*.css"):
        sheet.write_text(STYLED.sub(styled, sheet.read_text("utf-8")), encoding="utf-8")


def _prune_signs(static: Path) -> None:
    """Leave in the icons' fonts the signs that a style sheet names."""
    sheets = [*static.rglob("*.css")]
    named = {int(sign, 16) for one in sheets for sign in SIGN.findall(one.read_text("utf-8"))}
    for path in static.rglob("fa-*.ttf"):
        font = ttLib.TTFont(path, recalcTimestamp=False)
        subsetter = subset.Subsetter()
        subsetter.populate(unicodes=named)
        subsetter.subset(font)
        font.save(path)
    for sheet in (static / "styles").glob("*.css"):
        sheet.write_text(PACKED.sub("", sheet.read_text("utf-8")), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the two steps, each after the extension that it corrects."""
    app.connect("html-page-context", drop_thebe, priority=900)
    app.connect("build-finished", prune, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
