"""COLMAP's models as text: cameras.txt, images.txt, points3D.txt, rigs.txt, frames.txt."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from acx4lib.exchange.programs.colmap import model
from acx4lib.exchange.programs.colmap.model import Camera, Encoding, Image, Rig
from acx4lib.exchange.safe.opened import Opened
from acx4lib.exchange.safe.text_lines import LONGEST_LINE, Line
from acx4lib.expected import Array, Index
from acx4lib.flight.problems import quoted
from acx4lib.geometry.frames import Pose


def _lines(source: Opened, *, cells: int = -1) -> Iterator[Line]:
    """Yield all lines but comments, blank ones too; after `cells` cells the rest is one."""
    for number, text in enumerate(source.text().split("\n"), start=1):
        if len(text) > LONGEST_LINE:
            found = f"has {len(text)} characters"
            raise source.wrong("line", found, f"must have at most {LONGEST_LINE}", line=number)
        if not text.lstrip().startswith("#"):
            split = tuple(text.strip().split(maxsplit=cells))
            yield Line(file=source.file, number=number, cells=split)


def _cameras(source: Opened) -> dict[int, Camera]:
    found: dict[int, Camera] = {}
    for line in _lines(source):
        if not line.cells:
            continue
        number = line.whole_at(0, "CAMERA_ID")
        if number in found:
            raise line.wrong("CAMERA_ID", f"{number} is there twice", "must be unique")
        found[number] = model.camera(
            line.cell(1, "MODEL"),
            line.number_at(2, "WIDTH"),
            line.number_at(3, "HEIGHT"),
            line.numbers(4, None, "PARAMS"),
            partial(line.wrong, "camera"),
        )
    return found


def _images(source: Opened) -> Iterator[Image]:
    """Yield images: a line of each, and one with its measurements, which may be blank."""
    lines = _lines(source, cells=9)
    for line in lines:
        if not line.cells:
            continue
        wrong = partial(line.wrong, "image")
        values = line.numbers(1, 8, "QW, QX, QY, QZ, TX, TY, TZ")
        below = next(lines, Line(file=line.file, number=line.number + 1, cells=()))
        xy, points = _measurements(below)
        yield Image(
            number=line.whole_at(0, "IMAGE_ID"),
            name=line.cell(9, "NAME"),
            camera=line.whole_at(8, "CAMERA_ID"),
            pose=model.pose(values, wrong),
            xy=xy,
            points=points,
            wrong=wrong,
        )


def _measurements(line: Line) -> tuple[Array, Index]:
    whole = Line(file=line.file, number=line.number, cells=tuple(" ".join(line.cells).split()))
    if len(whole) % 3:
        raise whole.wrong("POINTS2D", f"{len(whole)} cells", "must be X, Y, POINT3D_ID of each")
    values = whole.numbers(0, None, "POINTS2D").reshape(-1, 3)
    if (values[:, 2] != np.round(values[:, 2])).any() or (np.abs(values[:, 2]) > 2**53).any():
        raise whole.wrong("POINT3D_ID", "is not whole", "must be a whole number, or -1")
    model.require_size(values[:, :2], partial(whole.wrong, "POINTS2D"))
    return values[:, :2], values[:, 2].astype(np.int64)


def _points(source: Opened) -> tuple[Index, Array]:
    ids, xyz = [], []
    for line in _lines(source, cells=4):
        if line.cells:
            ids.append(line.whole_at(0, "POINT3D_ID"))
            xyz.append(line.numbers(1, 4, "X, Y, Z"))
            model.require_size(xyz[-1], partial(line.wrong, "X, Y, Z"))
    return np.array(ids, dtype=np.int64), np.array(xyz, dtype=float).reshape(-1, 3)


def _rigs(source: Opened) -> Iterator[Rig]:
    """Yield rigs: number, count, reference sensor, then type, number and pose of each other."""
    for line in _lines(source):
        if not line.cells or line.whole_at(1, "NUM_SENSORS") < 1:
            continue
        others: dict[int, Pose | None] = {}
        k = 4
        while k < len(line):
            kind, number = line.cell(k, "SENSOR_TYPE"), line.whole_at(k + 1, "SENSOR_ID")
            has_pose = line.whole_at(k + 2, "HAS_POSE") != 0
            there = (
                model.pose(line.numbers(k + 3, k + 10, "pose"), partial(line.wrong, "sensor"))
                if has_pose
                else None
            )
            if kind == "CAMERA":
                others[number] = there
            k += 10 if has_pose else 3
        if line.cell(2, "REF_SENSOR_TYPE") != "CAMERA":
            kind = quoted(line.cells[2])
            raise line.wrong("REF_SENSOR_TYPE", kind, "must be CAMERA")
        yield Rig(reference=line.whole_at(3, "REF_SENSOR_ID"), others=others)


def _frames(source: Opened) -> dict[int, int]:
    """Return the frame of each image: number, rig, pose, count; type, sensor, image of each."""
    found: dict[int, int] = {}
    for line in _lines(source):
        if not line.cells:
            continue
        number, count = line.whole_at(0, "FRAME_ID"), line.whole_at(9, "NUM_DATA_IDS")
        if len(line) != 10 + 3 * count:
            raise line.wrong("DATA_IDS", f"{len(line) - 10} cells", f"must be {count} times 3")
        for k in range(10, len(line), 3):
            if line.cells[k] == "CAMERA":
                found[line.whole_at(k + 2, "DATA_ID")] = number
    return found


TEXT = Encoding(
    ending=".txt", cameras=_cameras, images=_images, points=_points, rigs=_rigs, frames=_frames
)
