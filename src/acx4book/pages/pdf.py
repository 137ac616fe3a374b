"""The book as one PDF: ``python -m acx4book.pages.pdf HTML CONTENTS PDF``.

Chromium prints the pages one by one, and pypdf joins them. Links between pages lead inside the PDF.
Chromium notes the target of a link only if the page itself links to it. So each page is printed
from a copy with hidden links to all its places that any page links to.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape, unescape
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import yaml
from pypdf import PdfReader, PdfWriter
from pypdf.annotations import Link
from pypdf.generic import Fit

from acx4lib.errors import Acx4Error
from acx4lib.results import whole_files

AT_ONCE = 2
"""Number of pages printed at the same time."""

HREF = re.compile(r'<a\b[^>]*?\bhref="([^"]+)"')
Place = tuple[str, str]
"""Path of a page below the book's folder, and the name of a place on it, or nothing."""


def order(contents: Path) -> list[str]:
    """Return the pages of a book in the order of its table of contents, as files of HTML."""

    def below(entries: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        for entry in entries:
            yield f"{entry['file']}.html"
            yield from below(entry.get("sections", ()))

    read = yaml.safe_load(contents.read_text(encoding="utf-8"))
    parts = read.get("parts", [read])
    return [f"{read['root']}.html", *below([e for part in parts for e in part["chapters"]])]


def _joined(root: str, pdfs: Mapping[str, Path]) -> PdfWriter:
    """Join the printed pages of a book into one document with internal links."""
    readers = {page: PdfReader(pdf) for page, pdf in pdfs.items()}
    writer = PdfWriter()
    targets: dict[Place, tuple[int, Fit]] = {}
    links: list[tuple[int, Any, Place | str]] = []
    for page, reader in readers.items():
        first = len(writer.pages)
        targets[page, ""] = (first, Fit.fit_horizontally())
        for name, destination in reader.named_destinations.items():
            number = reader.get_destination_page_number(destination)
            if number is not None:
                targets[page, name.removeprefix("/")] = (
                    first + number,
                    Fit.xyz(destination.left, destination.top),
                )
        for number, sheet in enumerate(reader.pages, first):
            links += ((number, rect, to) for rect, to in _taken_links(sheet, root, page))
        writer.append(reader, outline_item=_title(reader, page), import_outline=False)
    for number, rect, to in links:
        _link(writer, number, rect, to, targets)
    writer.compress_identical_objects()
    return writer


def _taken_links(sheet: Any, root: str, page: str) -> Iterator[tuple[Any, Place | str]]:
    """Remove the links of a sheet; yield their rectangles and targets."""
    if "/Annots" not in sheet:
        return
    for entry in sheet["/Annots"]:
        link = entry.get_object()
        if "/Dest" in link:
            yield link["/Rect"], (page, unquote(str(link["/Dest"])).removeprefix("/"))
        elif "/A" in link and "/URI" in link["/A"]:
            address = str(link["/A"]["/URI"])
            yield link["/Rect"], _place(root, address) or address
    del sheet["/Annots"]


def _place(root: str, address: str) -> Place | None:
    """Return the place of an address inside the book; None outside it."""
    if not address.startswith(f"{root}/"):
        return None
    url = urlsplit(address[len(root) + 1 :])
    return unquote(url.path), unquote(url.fragment)


def _link(
    writer: PdfWriter,
    number: int,
    rect: Any,
    to: Place | str,
    targets: Mapping[Place, tuple[int, Fit]],
) -> None:
    """Put a link on a sheet, unless its target is a file that is not printed."""
    box, plain = tuple(map(float, rect)), [0, 0, 0]
    if isinstance(to, tuple):
        target = targets.get(to) or targets.get((to[0], ""))
        if target is not None:
            link = Link(rect=box, border=plain, target_page_index=target[0], fit=target[1])  # type: ignore[arg-type] # four
            writer.add_annotation(number, link)
    elif not to.startswith("file:"):
        writer.add_annotation(number, Link(rect=box, border=plain, url=to))  # type: ignore[arg-type] # four


def _title(reader: PdfReader, page: str) -> str:
    """Return the title of a printed page, without that of the book."""
    title = (reader.metadata and reader.metadata.title) or page
    return title.partition(" — ")[0]


def make(html: Path, contents: Path, pdf: Path) -> int:
    """Print a book, and return the number of sheets.

    Parameters
    ----------
    html : Path
        Folder of the built book.
    contents : Path
        Its table of contents.
    pdf : Path
        The file to write.

    Raises
    ------
    PrintError
        Where Chromium is missing, or a page was not printed.
    """
    browser, pages = _chromium(), order(contents)
    with tempfile.TemporaryDirectory(dir=html.resolve().parent) as scratch:  # for hard links
        folder = Path(scratch, "html")
        _prepared(html, folder, pages)
        pdfs = {page: Path(scratch, f"{number}.pdf") for number, page in enumerate(pages)}
        with ThreadPoolExecutor(AT_ONCE) as pool:
            list(pool.map(lambda page: _printed(browser, folder / page, pdfs[page]), pages))
        writer = _joined(folder.as_uri(), pdfs)
        writer.write(pdf)
        return len(writer.pages)


def _chromium() -> str:
    """Return the path of Chromium."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise PrintError(MISSING)
    return path


def _prepared(html: Path, folder: Path, pages: Sequence[str]) -> None:
    """Copy a book for printing, with hidden links on each page to its own linked places."""
    shutil.copytree(html, folder, copy_function=os.link)
    places = _wanted(html, pages)
    for page in pages:
        links = "".join(f'<a href="#{escape(name)}"></a>' for name in sorted(places[page]))
        text = (html / page).read_text(encoding="utf-8")
        hidden = f'<div style="display: none">{links}</div></body>'
        # a new file: the old one is a hard link to the book's own
        whole_files.write(folder / page, text.replace("</body>", hidden))


def _wanted(html: Path, pages: Sequence[str]) -> dict[str, set[str]]:
    """Return the linked places of every page."""
    anchors: dict[str, set[str]] = defaultdict(set)
    for page in pages:
        for address in HREF.findall((html / page).read_text(encoding="utf-8")):
            url = urlsplit(unescape(address))
            if url.fragment and not url.scheme and not url.netloc:
                to = os.path.normpath(Path(page).parent / unquote(url.path)) if url.path else page
                anchors[to].add(unquote(url.fragment))
    return anchors


def _printed(browser: str, page: Path, pdf: Path) -> None:
    """Print a page."""
    with tempfile.TemporaryDirectory() as profile:
        command = [browser, *FLAGS, f"--user-data-dir={profile}", f"--print-to-pdf={pdf.resolve()}"]
        command.append(page.resolve().as_uri())
        try:
            subprocess.run(command, cwd=profile, capture_output=True, timeout=SECONDS, check=True)
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
            msg = f"{page.name}: Chromium did not print it ({error})"
            raise PrintError(msg) from error
    if not pdf.is_file() or END not in pdf.read_bytes()[-1024:]:
        msg = f"{page.name}: Chromium wrote no whole PDF"
        raise PrintError(msg)


# --- Pages of HTML as PDF, printed by Chromium


BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
"""Names of Chromium on different systems."""

MISSING = (
    "the book is printed by Chromium, which is not here: install the package chromium "
    "(Debian, Ubuntu: apt-get install chromium)"
)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"),
    *("--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=60000"),
)
END = b"%%EOF"
"""End of a complete PDF."""

SECONDS = 300
"""Time limit for printing a page, s."""


class PrintError(Acx4Error):
    """A page was not printed."""


if __name__ == "__main__":
    try:
        sheets = make(*map(Path, sys.argv[1:4]))
    except PrintError as error:
        sys.exit(str(error))
    sys.stdout.write(f"{sys.argv[3]}, {sheets} pages\n")
