"""The files of a project of OpenSfM or ODM: which are there, and what is in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acx4lib.exchange.safe import json_tree, opened, text_lines
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.exchange.safe.opened import Opened
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, Range, quoted
from acx4lib.geometry.frames import Pose, exp

OPENSFM = "opensfm"
"""Folder of OpenSfM's files in a project of ODM."""

RECONSTRUCTION, TRACKS = "reconstruction.json", "tracks.csv"
MODELS = ("camera_models.json", "cameras.json")
"""Cameras before the adjustment, by OpenSfM; and by ODM those that it found."""

VERSIONS = ("OPENSFM_TRACKS_VERSION_v1", "OPENSFM_TRACKS_VERSION_v2")
"""First lines of tracks.csv; the first version of all had none."""

NORMALISED = Range(-1e3, 1e3, "must be divided by the longer side of the image")
TURN = Range(-100.0, 100.0, "must be a rotation vector in radians")


@dataclass(frozen=True, kw_only=True)
class Project:
    """A folder with files of OpenSfM, or one of these files.

    Attributes
    ----------
    folder : Path
    names : dict of str to str
        Where a file has another name than usual.
    read : dict of str to Opened
        What was opened so far, by its name.
    """

    folder: Path
    names: dict[str, str] = field(default_factory=dict)
    read: dict[str, Opened] = field(default_factory=dict)

    def maybe(self, *names: str) -> Opened | None:
        """Return the first file of these names that is there."""
        for name in names:
            path = self.folder / self.names.get(name, name)
            if name.startswith("../") and self.folder.name != OPENSFM:
                continue  # above the folder is ODM's only if it has this name
            if path.is_symlink() or path.exists():
                return self.read.setdefault(path.name, opened.read(path))
        return None

    def tree(self, *names: str) -> Node | None:
        """Return the first file of these names that is there, as JSON."""
        source = self.maybe(*names)
        return None if source is None else json_tree.tree(source)


@dataclass(frozen=True, kw_only=True, eq=False)
class Shots:
    """The shots of a reconstruction, one for each image.

    Attributes
    ----------
    names, models : tuple of str
        Images, and their camera models.
    instances, heads : tuple of str
        The rig instance that took them, and as which of its cameras; both are the shot's own name
        and model where there is no rig.
    T_w_v : Pose
        Orientations of cameras with y down, z ahead.
    gps : ndarray, shape (n, 3)
        Measured positions in the same frame, m; NaN where none is.
    """

    names: tuple[str, ...]
    models: tuple[str, ...]
    instances: tuple[str, ...]
    heads: tuple[str, ...]
    T_w_v: Pose
    gps: Array


def project_of(source: Path) -> Project:
    """Return the project at a path: a folder, an ODM project's folder, or a file.

    Raises
    ------
    FlightError
        Where the folder has none of the files.
    """
    if not source.is_dir():
        kind = MODELS[0] if _is_cameras(source) else RECONSTRUCTION
        return Project(folder=source.parent, names={kind: source.name} | _none_but(kind))
    for folder in (source, source / OPENSFM):
        known = Project(folder=folder)
        if any((folder / name).exists() for name in (RECONSTRUCTION, TRACKS, *MODELS)):
            return known
    wanted = f"must hold {RECONSTRUCTION}, {TRACKS} or {MODELS[0]}, as OpenSfM writes them"
    raise opened.refusal(str(source), 1, "folder", "has no file of OpenSfM", wanted)


def _is_cameras(source: Path) -> bool:
    """Tell whether a file holds cameras and no reconstruction."""
    value = json_tree.tree(opened.read(source)).value
    return isinstance(value, dict) and "shots" not in value


def _none_but(kind: str) -> dict[str, str]:
    """Return names that no file has for the other files: one file alone was given."""
    others = {RECONSTRUCTION, TRACKS, *MODELS} - {kind}
    return dict.fromkeys(others, "\0")


def reconstruction(project: Project) -> tuple[Node | None, tuple[str, ...]]:
    """Return the reconstruction with the most shots, and a sentence on the others."""
    tree = project.tree(RECONSTRUCTION)
    if tree is None:
        return None, ()
    if isinstance(tree.value, dict):
        return tree, ()
    parts = list(tree.each())
    if not parts:
        raise tree.wrong("has no reconstruction", "must have one at least")
    sizes = [len(list(part.one("shots").items())) for part in parts]
    best = int(np.argmax(sizes))
    others = sum(sizes) - sizes[best]
    left = (
        f"{len(parts) - 1} more reconstructions with {others} shots: each has a frame of its own",
    )
    return parts[best], left if len(parts) > 1 else ()


def shots(root: Node, rigs: Node | None) -> Shots:
    """Return the shots of a reconstruction.

    Parameters
    ----------
    root : Node
    rigs : Node or None
        rig_assignments.json, for reconstructions that say nothing of rigs.
    """
    found = list(root.one("shots").items())
    if not found:
        raise root.one("shots").wrong("has no shot", "must have one at least")
    of_rig = dict(_instances(root)) or (dict(_assigned(rigs)) if rigs is not None else {})
    names = tuple(name for name, _ in found)
    models = tuple(shot.one("camera").text() for _, shot in found)
    R_v_w = exp(np.array([shot.one("rotation").numbers(3, allowed=TURN) for _, shot in found]))
    t = np.array([shot.one("translation").numbers(3, allowed=METRES) for _, shot in found])
    alone = zip(names, names, models, strict=True)
    rows = {name: of_rig.get(name, (instance, model)) for name, instance, model in alone}
    return Shots(
        names=names,
        models=models,
        instances=tuple(instance for instance, _ in rows.values()),
        heads=tuple(head for _, head in rows.values()),
        T_w_v=Pose(R=R_v_w, r=t).inverse,
        gps=np.array([_gps(shot) for _, shot in found]),
    )


def _gps(shot: Node) -> list[float]:
    """Return a measured position; OpenSfM writes a dilution of 999999 where there was none."""
    position, dop = shot.maybe("gps_position"), shot.maybe("gps_dop")
    if position is None or (dop is not None and dop.number() >= 999_999):
        return [np.nan] * 3
    return position.numbers(3, allowed=METRES).tolist()


def _instances(root: Node) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield images with their rig instance and their camera in the rig."""
    rigs = root.maybe("rig_instances")
    for instance, rig in rigs.items() if rigs is not None else ():
        cameras = list(rig.one("rig_camera_ids").items())
        if len(cameras) > 1:
            for image, head in cameras:
                yield image, (instance, head.text())


def _assigned(rigs: Node) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the same of rig_assignments.json: lists of images and cameras, by number or name."""
    by_name = isinstance(rigs.value, dict)
    all_rigs = (
        list(rigs.items()) if by_name else [(f"rig {k}", v) for k, v in enumerate(rigs.each())]
    )
    for instance, rig in all_rigs:
        cameras = [(one.one(0).text(), one.one(1).text()) for one in rig.each()]
        for image, head in cameras if len(cameras) > 1 else ():
            yield image, (instance, head)


def rig_mounts(node: Node | None) -> dict[str, Pose]:
    """Return the places of cameras in their rig, both with y down, z ahead, by camera."""
    if node is None:
        return {}
    return {
        name: Pose(
            R=exp(one.one("rotation").numbers(3, allowed=TURN)),
            r=one.one("translation").numbers(3, allowed=METRES),
        ).inverse
        for name, one in node.items()
    }


def points(node: Node) -> dict[str, list[float]]:
    """Return the coordinates of object points by their names."""
    return {
        name: one.one("coordinates").numbers(3, allowed=METRES).tolist()
        for name, one in node.items()
    }


def tracks(source: Opened) -> tuple[list[str], list[str], Array]:
    """Return images, tracks and normalised points of tracks.csv, shape (n, 2).

    Raises
    ------
    FlightError
        For a version that is not known, or a line with too few columns.
    """
    rows = text_lines.lines(source, separator="\t")
    images, names, points = [], [], []
    for row in rows:
        if row.number == 1 and row.cells[0].startswith("OPENSFM_TRACKS"):
            if row.cells[0] not in VERSIONS:
                raise row.wrong("version", quoted(row.cells[0]), f"must be {' or '.join(VERSIONS)}")
            continue
        images.append(row.cell(0, "image"))
        names.append(row.cell(1, "track"))
        points.append(row.numbers(3, 5, "x, y", NORMALISED))
    return images, names, np.array(points).reshape(-1, 2)


def colrow_of(points: Array, width_px: int, height_px: int) -> Array:
    """Return the library's pixels of normalised points, shape (n, 2)."""
    return points * max(width_px, height_px) + np.array([width_px - 1, height_px - 1]) / 2
