"""COLMAP's models as binary files: cameras.bin, images.bin, points3D.bin, rigs.bin, frames.bin.

Little-endian, without padding. Each begins with the number of its entries, 64 bits.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from acx4lib.exchange.programs.colmap import lens, model
from acx4lib.exchange.programs.colmap.model import Camera, Encoding, Image, Rig
from acx4lib.exchange.safe.opened import Opened
from acx4lib.exchange.safe.records import Cursor
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import Pose

MEASUREMENT = np.dtype([("xy", "<f8", 2), ("point", "<i8")])
"""A measurement; without a point its 64 bits are all set, which is -1 with a sign."""

ELEMENT_BYTES = 8
"""Size of an element of a point's track: image and measurement."""

CAMERA = 0
"""Type of a sensor that is a camera."""


def _entries(source: Opened, element: str, least: int) -> tuple[Cursor, int]:
    """Return a cursor behind the number of entries, and that number."""
    cursor = Cursor(source=source)
    (n,) = cursor.take("<Q", "number of entries")
    if n * least > cursor.left:
        found = f"{n} entries in {cursor.left} bytes"
        raise source.wrong(element, found, f"must have {least} bytes or more each")
    return cursor, n


def _cameras(source: Opened) -> dict[int, Camera]:
    cursor, n = _entries(source, "camera", 24)
    found: dict[int, Camera] = {}
    for k in range(n):
        number, kind, width, height = cursor.take("<IiQQ", f"camera {k + 1}")
        wrong = partial(source.wrong, f"camera {number}")
        if kind not in lens.NUMBERS:
            known = ", ".join(f"{i} {name}" for i, name in lens.NUMBERS.items())
            raise wrong(f"lens model {kind}", f"must be one of {known}")
        if number in found:
            raise wrong("is there twice", "must be unique")
        name = lens.NUMBERS[kind]
        values = cursor.take(f"<{len(lens.MODELS[name].names)}d", f"camera {number}")
        found[number] = model.camera(name, width, height, np.array(values), wrong)
    return found


def _images(source: Opened) -> Iterator[Image]:
    cursor, n = _entries(source, "image", 73)
    for k in range(n):
        element = f"image {k + 1}"
        number, *values, camera = cursor.take("<I7dI", element)
        name = cursor.text(element)
        (count,) = cursor.take("<Q", element)
        measured = cursor.array(MEASUREMENT, count, element)
        wrong = partial(source.wrong, element)
        model.require_size(measured["xy"], wrong)
        yield Image(
            number=number,
            name=name,
            camera=camera,
            pose=model.pose(np.array(values), wrong),
            xy=np.array(measured["xy"], dtype=float).reshape(-1, 2),
            points=np.array(measured["point"], dtype=np.int64),
            wrong=wrong,
        )


def _points(source: Opened) -> tuple[Index, Array]:
    cursor, n = _entries(source, "point", 51)
    ids, xyz = np.empty(n, dtype=np.int64), np.empty((n, 3))
    for k in range(n):
        number, *there = cursor.take("<q3d", "point")
        ids[k], xyz[k] = number, there
        _, _, _, _, length = cursor.take("<3BdQ", "point")
        cursor.array(np.dtype(f"V{ELEMENT_BYTES}"), length, f"track of point {number}")
    model.require_size(xyz, partial(source.wrong, "point"))
    return ids, xyz


def _rigs(source: Opened) -> Iterator[Rig]:
    cursor, n = _entries(source, "rig", 8)
    for _ in range(n):
        number, count = cursor.take("<II", "rig")
        element = f"rig {number}"
        if count == 0:
            continue
        kind, reference = cursor.take("<iI", element)
        others: dict[int, Pose | None] = {}
        for _ in range(count - 1):
            other, sensor, has_pose = cursor.take("<iIB", element)
            wrong = partial(source.wrong, element)
            there = model.pose(np.array(cursor.take("<7d", element)), wrong) if has_pose else None
            if other == CAMERA:
                others[sensor] = there
        if kind != CAMERA:
            raise source.wrong(element, f"reference sensor of type {kind}", "must be a camera, 0")
        yield Rig(reference=reference, others=others)


def _frames(source: Opened) -> dict[int, int]:
    cursor, n = _entries(source, "frame", 68)
    found: dict[int, int] = {}
    for _ in range(n):
        number, *_, count = cursor.take("<II7dI", "frame")
        for _ in range(count):
            kind, _, image = cursor.take("<iIQ", f"frame {number}")
            if kind == CAMERA:
                found[image] = number
    return found


BINARY = Encoding(
    ending=".bin", cameras=_cameras, images=_images, points=_points, rigs=_rigs, frames=_frames
)
