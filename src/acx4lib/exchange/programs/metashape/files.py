"""Where the XML of a Metashape project lies: exported, or in the archives of a project."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from acx4lib.exchange.safe import archive, xml_tree
from acx4lib.exchange.safe.opened import Opened, Together
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.flight.problems import quoted

CALIBRATION = "calibration"
"""Outermost element of a calibration that was saved alone."""

DOCUMENT = "doc.xml"
"""The XML in each of a project's archives."""


@dataclass(frozen=True, kw_only=True)
class Chunk:
    """A chunk's XML.

    Attributes
    ----------
    root : Element
        The element ``chunk``.
    frame : Element or None
        The first of its frames, which has the marker locations.
    sources : tuple of Opened
        Files that were read.
    others : tuple of str
        Labels of the project's other chunks.
    """

    root: Element
    frame: Element | None
    sources: tuple[Opened, ...]
    others: tuple[str, ...] = ()


def chunk(source: Path, *, label: str | None = None) -> Chunk:
    """Return a chunk of a project.

    Parameters
    ----------
    source : Path
        XML of cameras or markers that Metashape exported, or of a calibration alone, a ``.psx``
        beside its folder ``.files``, or a ``chunk.zip``.
    label : str, optional
        Of the chunk; by default the active one.

    Raises
    ------
    FlightError
        Where it is none of these, or has no such chunk.
    """
    files = Together()
    file = files.read(source)
    if file.data[:2] == b"PK":
        return _in_archive(file, files)
    root = xml_tree.tree(file)
    if root.tag == "document" and "path" in root.attributes:
        return _of_project(file, root, label, files)
    if root.tag == CALIBRATION:
        return Chunk(root=root, frame=None, sources=(file,))
    if root.tag == "chunk":
        return _whole(root, (file,), files)
    if root.tag != "document":
        raise root.wrong("is no file of Metashape", "must begin with <document> or <chunk>")
    found = list(root.each("chunk"))
    labels = [one.attributes.get("label", "") for one in found]
    k = _place(root, labels, label, 0)
    others = tuple(labels[:k] + labels[k + 1 :])
    return _whole(found[k], (file,), files, others=others)


def setting(chunk: Chunk, name: str) -> float | None:
    """Return a positive number of the chunk's settings; None where there is none."""
    for one in chunk.root.each("settings", "property"):
        if one.attributes.get("name") == name and (value := one.number("value")) > 0:
            return value
    return None


def _of_project(file: Opened, root: Element, label: str | None, files: Together) -> Chunk:
    """Return a chunk of a .psx, which names an archive, which names the chunks' archives."""
    folder = Path(file.file).parent
    name = root.attribute("path").replace("{projectname}", Path(file.file).stem)
    project = _member(files.read(_inside(root, folder, name)), files)
    document = xml_tree.tree(project)
    listed = list(document.each("chunks", "chunk"))
    within = (folder / name).parent
    active = document.one("chunks").attributes.get("active_id")
    ids = [one.attributes.get("id") for one in listed]
    wanted = ids.index(active) if active in ids else 0
    labels: list[str] = []
    kept: dict[str, Chunk] = {}
    for k, one in enumerate(listed):  # of chunks that are not wanted the label alone is kept
        chunk = _in_archive(files.read(_inside(one, within, one.attribute("path"))), files)
        labels.append(chunk.root.attributes.get("label", ""))
        if k == wanted if label is None else labels[-1] == label:
            kept.setdefault(labels[-1], chunk)
    k = _place(document, labels, label, wanted)
    found = kept[labels[k]]
    return Chunk(
        root=found.root,
        frame=found.frame,
        sources=(file, project, *found.sources),
        others=tuple(labels[:k] + labels[k + 1 :]),
    )


def _in_archive(file: Opened, files: Together) -> Chunk:
    document = _member(file, files)
    root = xml_tree.tree(document)
    if root.tag != "chunk":
        raise root.wrong("is no chunk", "must begin with <chunk>")
    return _whole(root, (document,), files)


def _whole(
    root: Element, sources: tuple[Opened, ...], files: Together, *, others: tuple[str, ...] = ()
) -> Chunk:
    """Return a chunk with its first frame, which may lie in an archive of its own."""
    frame = root.maybe("frames", "frame")
    if frame is not None and "path" in frame.attributes:
        # Below the chunk's archive; an archive's name ends with that of its member.
        folder = Path(sources[0].file.removesuffix(f"/{DOCUMENT}")).parent
        place = _inside(frame, folder, frame.attribute("path"))
        document = _member(files.read(place), files)
        frame, sources = xml_tree.tree(document), (*sources, document)
    return Chunk(root=root, frame=frame, sources=sources, others=others)


def _member(file: Opened, files: Together) -> Opened:
    return files.add(archive.member(file, DOCUMENT))


def _inside(element: Element, folder: Path, name: str) -> Path:
    """Return the path of a file that a project names, which must lie below its folder."""
    parts = PurePosixPath(name.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or ":" in name:
        raise element.wrong(quoted(name), "must lie below the project's folder", attribute="path")
    return folder / parts


def _place(root: Element, labels: list[str], wanted: str | None, active: int) -> int:
    if not labels:
        raise root.wrong("has no <chunk>", "must have one")
    if wanted is None:
        return active
    if wanted not in labels:
        known = ", ".join(map(quoted, labels))
        raise root.wrong(f"has no chunk {quoted(wanted)}", f"must be one of {known}")
    return labels.index(wanted)
