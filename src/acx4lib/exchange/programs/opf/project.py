"""The files of an OPF project by their formats: from project.opf, or all that lie in a folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from acx4lib.exchange.safe import json_tree
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.exchange.safe.opened import Opened, Together, refusal
from acx4lib.flight.problems import quoted

BEGIN, END = "application/opf-", "+json"
"""What stands around the names of JSON formats."""

PROJECT = "project"

READ = (
    "camera-list",
    "input-cameras",
    "calibrated-cameras",
    "input-control-points",
    "calibrated-control-points",
    "scene-reference-frame",
    "gps-bias",
)
"""Names of the formats that are read."""

CALIBRATION, GLTF = "calibration", "model/gltf+json"
"""Type of the item, and format of its file, that has the tie points."""

MAJOR = "1"
"""Major version that is read."""


@dataclass(kw_only=True)
class Project:
    """The documents of a project.

    Attributes
    ----------
    name : str
    program : str
        What wrote it, with its version.
    documents : mapping of str to Node
        The first document of each format of `READ`.
    others : list of str
        Formats of files that are not read, and of second documents.
    tracks : Node or None
        The glTF file of the calibration's tie points.
    sources : tuple of Opened
    files : Together
        All that were read.
    """

    name: str
    program: str = "OPF"
    documents: Mapping[str, Node] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)
    tracks: Node | None = None
    sources: tuple[Opened, ...] = ()
    files: Together = field(default_factory=Together)


def project_of(source: Path) -> Project:
    """Return the documents of a project.

    Parameters
    ----------
    source : Path
        A file .opf, a folder with one, a folder with JSON files of OPF, or one such file.

    Raises
    ------
    FlightError
        Where there are none, or one is not what it should be.
    """
    if source.is_dir():
        listed = sorted(source.glob("*.opf"))
        if len(listed) > 1:
            names = ", ".join(one.name for one in listed)
            raise refusal(str(source), 1, "folder", f"has {names}", "name one of them")
        if not listed:
            return _gathered(source)
        source = listed[0]
    files = Together()
    root = json_tree.tree(files.read(source))
    if _format(root) != PROJECT:
        return _documents(source.stem, "OPF", [root], files)
    return _of_items(source, root, files)


def _gathered(folder: Path) -> Project:
    """Return the documents of a folder without a project."""
    files = Together()
    roots = [json_tree.tree(files.read(path)) for path in sorted(folder.glob("*.json"))]
    roots = [root for root in roots if _format(root, must=False)]
    if not roots:
        found, expected = "has no file of OPF", "must have project.opf, or JSON files of OPF"
        raise refusal(str(folder), 1, "folder", found, expected)
    return _documents(folder.resolve().name, "OPF", roots, files)


def _of_items(path: Path, root: Node, files: Together) -> Project:
    _require_version(root)
    roots: dict[Path, Node] = {}
    others, tracks = [], None
    for kind, resource in _resources(root):
        name = resource.one("format").text()
        if kind == CALIBRATION and name == GLTF and tracks is None:
            place = inside(resource.one("uri"), path.parent)
            if place.exists():
                tracks = json_tree.tree(files.read(place))
                continue
        if name.removeprefix(BEGIN).removesuffix(END) not in READ:
            others.append(name)
            continue
        place = inside(resource.one("uri"), path.parent)
        if place not in roots:
            roots[place] = json_tree.tree(files.read(place))
    generator = root.maybe("generator")
    program = "OPF"
    if generator is not None:
        parts = (generator.maybe("name"), generator.maybe("version"))
        program = " ".join(["OPF of", *(one.text() for one in parts if one is not None)])
    title = root.maybe("name")
    if not roots:
        known = ", ".join(READ)
        raise root.one("items").wrong("has no file that is read", f"must have some of {known}")
    name = path.stem if title is None else title.text()
    found = _documents(name, program, [*roots.values()], files)
    found.others += others
    found.tracks = tracks
    found.sources = (root.source, *found.sources, *(() if tracks is None else (tracks.source,)))
    return found


def _resources(root: Node) -> Iterator[tuple[str, Node]]:
    """Yield the files of a project, with the type of the item that they belong to."""
    for item in root.one("items").each():
        for resource in item.one("resources").each():
            yield item.one("type").text(), resource


def _documents(name: str, program: str, roots: list[Node], files: Together) -> Project:
    documents: dict[str, Node] = {}
    others = []
    for root in roots:
        _require_version(root)
        kind = _format(root)
        if kind in READ and kind not in documents:
            documents[kind] = root
        else:
            others.append(kind if kind not in READ else f"a second {kind}")
    if not documents:
        found = f"{quoted(others[0])} is none that is read"
        raise roots[0].one("format").wrong(found, f"must be one of {', '.join(READ)}")
    return Project(
        name=name,
        program=program,
        documents=documents,
        others=others,
        sources=tuple(root.source for root in documents.values()),
        files=files,
    )


def _format(root: Node, *, must: bool = True) -> str:
    """Return the name of a document's format; empty where it has none and need not."""
    text = root.maybe("format")
    if text is not None and isinstance(text.value, str) and text.value.startswith(BEGIN):
        return text.value.removeprefix(BEGIN).removesuffix(END)
    if not must:
        return ""
    found = "is missing" if text is None else quoted(text.value)
    raise (text or root).wrong(f"format {found}", f"must begin with {BEGIN}")


def _require_version(root: Node) -> None:
    version = root.one("version")
    if version.text().split(".")[0] != MAJOR:
        raise version.wrong(quoted(version.text()), f"must be version {MAJOR}")


def inside(uri: Node, folder: Path) -> Path:
    """Return the path of a file that a project names, which must lie below its folder."""
    text = unquote(uri.text())
    parts = PurePosixPath(text.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or ":" in text or "\0" in text:
        raise uri.wrong(quoted(text), "must lie below the project's folder")
    return folder / parts
