"""The report as a PDF/A, typeset by Typst from the HTML page, so that both agree.

Every element of the page becomes a call of Typst, every text a string in quotes: nothing of a
flight's text is markup. Fonts are those of matplotlib, and no other is looked for.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from importlib import import_module, resources
from pathlib import Path
from typing import Any

from matplotlib import get_data_path

from acx4book.typesetting import style
from acx4lib.errors import Acx4Error

STANDARDS = ["a-2a", "ua-1"]
"""Archival and accessible: PDF/A-2 with tags, PDF/UA-1."""

STYLE = resources.files("acx4book.report") / "report.typ"

MISSING = "a PDF is set by the package typst, which is not here: pip install 'acx4lib[pdf]'"

VOID = {"meta", "img", "br"}
"""Elements without an end."""

UNSEEN = {"head", "br"}

CALLS = {
    "b": "strong",
    "code": "code",
    "em": "emph",
    "h1": "heading.with(level: 1)",
    "h2": "heading.with(level: 2)",
    "h3": "heading.with(level: 3)",
    "i": "letter",
    "ol": "enum",
    "p": "par",
    "pre": "code",
    "strong": "strong",
    "sub": "sub",
    "sup": "super",
    "ul": "list",
}
"""Functions of Typst, or of ``report.typ``, by element."""

SPACE = re.compile(r"[ \t\n\r]+")
ISOLATES = re.compile("[\u2066-\u2069]")
"""Bidirectional isolates around names in HTML; strings of Typst need none."""

LONG = re.compile(r"\S{24,}")
"""Long words, which may be broken anywhere."""


class TypesetError(Acx4Error):
    """A report was not typeset."""


@dataclass(kw_only=True)
class _Element:
    """An element of the page: tag, attributes and content."""

    tag: str
    attributes: Mapping[str, str]
    inside: list[_Element | str] = field(default_factory=list)

    def all(self, *tags: str) -> Iterator[_Element]:
        """Yield the elements with these names at any depth."""
        for child in self.inside:
            if isinstance(child, _Element):
                if child.tag in tags:
                    yield child
                yield from child.all(*tags)

    def take(self, tag: str) -> _Element | None:
        """Take out the first child with a name."""
        taken = next(
            (child for child in self.inside if isinstance(child, _Element) and child.tag == tag),
            None,
        )
        if isinstance(taken, _Element):
            self.inside.remove(taken)
            return taken
        return None


class _Reader(HTMLParser):
    """Parser of a well-formed page of the report into elements."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open = [_Element(tag="page", attributes={})]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = _Element(tag=tag, attributes={key: value or "" for key, value in attrs})
        self.open[-1].inside.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_endtag(self, tag: str) -> None:
        if self.open[-1].tag == tag:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.open[-1].inside.append(data)


def pdf(page: str) -> bytes:
    """Return a page of the report as PDF, the same bytes every time.

    Parameters
    ----------
    page : str
        HTML as `page.write` writes it.

    Raises
    ------
    TypesetError
        Where the package typst is missing, or does not typeset the page.
    """
    try:
        typst: Any = import_module("typst")  # an extra; its stubs know nothing of files in memory
    except ImportError as error:
        raise TypesetError(MISSING) from error
    reader = _Reader()
    reader.feed(page)
    files = _Files()
    text = files.document(reader.open[0])
    whole = {"main.typ": text.encode(), "report.typ": STYLE.read_bytes(), **files.pictures}
    try:
        document = typst.compile(
            whole,
            format="pdf",
            font_paths=[str(Path(get_data_path(), "fonts", "ttf"))],
            ignore_system_fonts=True,
            pdf_standards=STANDARDS,
        )
    except typst.TypstError as error:
        msg = f"the report was not typeset: {error.message.splitlines()[0]}"
        raise TypesetError(msg) from error
    return bytes(document)


@dataclass(kw_only=True)
class _Files:
    """Writer of a Typst document, with its pictures by name."""

    pictures: dict[str, bytes] = field(default_factory=dict)

    def document(self, page: _Element) -> str:
        """Return the Typst document of a page."""
        metas = (meta.attributes for meta in page.all("meta"))
        date = next(
            attributes["content"]
            for attributes in metas
            if attributes.get("name") == "dcterms.date"
        )
        year, month, day = map(int, date.split("-"))
        (title,) = page.all("title")
        head = (
            '#import "report.typ": *\n'
            f"#show: report.with(title: {_quoted(''.join(_words(title)))}, "
            f"date: datetime(year: {year}, month: {month}, day: {day}))\n"
        )
        return head + self.inside(page)

    def inside(self, element: _Element) -> str:
        """Return the content of an element."""
        return "".join(
            f"#{_quoted(_seen(child))};" if isinstance(child, str) else self.element(child)
            for child in element.inside
            if isinstance(child, _Element) or child.strip(" \t\n\r") or element.tag in INLINE
        )

    def element(self, element: _Element) -> str:
        """Return a call of Typst for an element."""
        writers = {
            "table": self.table,
            "figure": self.figure,
            "section": self.first_page,
            "ul": self.listed,
            "ol": self.listed,
            "code": self.code,
            "pre": self.code,
        }
        if element.tag in UNSEEN:
            return ""
        if element.tag in writers:
            return writers[element.tag](element)
        call = self.paragraph(element) if element.tag == "p" else CALLS.get(element.tag)
        ends = "" if element.tag in INLINE else "\n"
        return f"#({call})[{self.inside(element)}];{ends}" if call else self.inside(element)

    def paragraph(self, element: _Element) -> str:
        """Return the Typst function of a paragraph: one of the page head, a note or plain text."""
        kind = element.attributes.get("class", "")
        if [getattr(part, "tag", "") for part in element.inside] == ["em"]:
            return "note"
        return kind if kind in {"kind", "name", "date"} else "par"

    def first_page(self, element: _Element) -> str:
        """Return the certificate on a page of its own, without its heading."""
        element.take("h2")
        return f"{self.inside(element)}#pagebreak(weak: true);\n"

    def listed(self, element: _Element) -> str:
        """Return a list."""
        items = "".join(f"[{self.inside(item)}]" for item in element.all("li"))
        return f"#{CALLS[element.tag]}{items};\n"

    def code(self, element: _Element) -> str:
        """Return text in a monospaced font."""
        return f"#code({_quoted(''.join(_words(element)))});"

    def table(self, element: _Element) -> str:
        """Return a table with its caption, or the lines to sign on."""
        if element.attributes.get("class") == "signatures":
            signed = "".join(f"[{self.inside(cell)}], " for cell in element.all("td"))
            return f"#signatures({signed});\n"
        caption = element.take("caption")
        rows = [[*row.all("td", "th")] for row in element.all("tr")]
        width = max(len(row) for row in rows)
        heads = sum(any(cell.tag == "th" for cell in row) for row in rows)
        cells = [
            "".join(self.cell(cell) for cell in row) + "[], " * (width - len(row)) for row in rows
        ]
        head = f"table.header({''.join(cells[:heads])}), " if heads else ""
        caption_text = f"[{self.inside(caption)}]" if caption else "none"
        body = f"{head}{''.join(cells[heads:])}"
        return f"#numbered({caption_text}, {width}, ({body}));\n"

    def cell(self, element: _Element) -> str:
        """Return a cell of a table."""
        content = self.inside(element)
        state = element.attributes.get("class", "").removeprefix("state ")
        right = "right" if "right" in element.attributes.get("style", "") else "left"
        content = f"#state({_quoted(state)})[{content}]" if state else content
        return f"table.cell(align: {right})[{content}], "

    def figure(self, element: _Element) -> str:
        """Return a figure with its caption and the words in its place."""
        (picture,), caption = element.all("img"), element.take("figcaption")
        name = f"{len(self.pictures)}.svg"
        self.pictures[name] = base64.b64decode(picture.attributes["src"].partition(",")[2])
        caption_text = self.inside(caption) if caption else ""
        return f"#drawing({_quoted(name)}, {_quoted(picture.attributes['alt'])})[{caption_text}];\n"


INLINE = {"b", "code", "em", "i", "strong", "sub", "sup", "p", "td", "th", "caption", "figcaption"}
"""Elements in which white space between others counts."""


def _words(element: _Element) -> Iterator[str]:
    for part in element.inside:
        yield from [part] if isinstance(part, str) else _words(part)


def _seen(text: str) -> str:
    """Collapse spaces as HTML does, and allow breaks in long words."""
    return LONG.sub(lambda word: "\u200b".join(_pieces(word[0])), SPACE.sub(" ", text))


def _pieces(word: str) -> list[str]:
    return [word[i : i + 8] for i in range(0, len(word), 8)]


def _quoted(text: str) -> str:
    """Return a string of Typst; characters without a glyph are escaped, as in figures."""
    known = style.shapes()
    plain = ISOLATES.sub("", text)
    drawn = "".join(c if ord(c) in known or c in "\n\u200b" else ascii(c)[1:-1] for c in plain)
    return '"' + drawn.replace("\\", "\\\\").replace('"', '\\"') + '"'
