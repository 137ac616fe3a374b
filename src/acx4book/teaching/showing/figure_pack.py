"""The figures of the book, taken from its executed notebooks, and all of them in one archive."""

from __future__ import annotations

import base64
import io
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat

KINDS = {"image/svg+xml": "svg", "image/png": "png"}
"""Kinds of pictures in notebooks, the better one first, and what names of files end with."""

EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Date of all files in the archive, so that the same figures are the same bytes."""

LIST = "figures.txt"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of a chapter.

    Attributes
    ----------
    chapter : str
        Name of its notebook, such as ``foundations/1-image``.
    name : str
        Its label, such as ``fig-image-ray``.
    caption, alt : str
    kind : str
        ``svg`` or ``png``.
    content : bytes
    """

    chapter: str
    name: str
    caption: str
    alt: str
    kind: str
    content: bytes

    @property
    def file(self) -> str:
        """Name in the archive."""
        return f"{self.chapter}/{self.name}.{self.kind}"


def figures(executed: Path) -> Iterator[Figure]:
    """Yield the figures of all executed notebooks below a folder, by chapter and place."""
    for path in sorted(executed.rglob("*.ipynb")):
        chapter = path.relative_to(executed).with_suffix("").as_posix()
        notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call] # untyped
        for cell in notebook.cells:
            yield from _of_cell(chapter, cell)


def _of_cell(chapter: str, cell: Mapping[str, Any]) -> Iterator[Figure]:
    said = cell["metadata"].get("mystnb", {})
    name = said.get("figure", {}).get("name", "")
    for output in cell.get("outputs", []):
        kind = next((kind for kind in KINDS if kind in output.get("data", {})), None)
        if name and kind is not None:
            yield Figure(
                chapter=chapter,
                name=name,
                caption=" ".join(said["figure"]["caption"].split()),
                alt=said.get("image", {}).get("alt", ""),
                kind=KINDS[kind],
                content=_content(kind, output["data"][kind]),
            )


def _content(kind: str, data: str | Sequence[str]) -> bytes:
    text = data if isinstance(data, str) else "".join(data)
    return text.encode() if kind == "image/svg+xml" else base64.b64decode(text)


def archive(found: Sequence[Figure]) -> bytes:
    """Return a zip archive of figures with a list of their captions; the same bytes every time."""
    listed = "".join(f"{one.file}\n    {one.caption}\n" for one in found)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as pack:
        for name, content in [(LIST, listed.encode()), *((one.file, one.content) for one in found)]:
            entry = zipfile.ZipInfo(name, date_time=EARLIEST)
            packed = zipfile.ZIP_STORED if name.endswith(".png") else zipfile.ZIP_DEFLATED
            pack.writestr(entry, content, compress_type=packed, compresslevel=9)
    return out.getvalue()
