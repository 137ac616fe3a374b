"""Tie points of an OPF calibration: a glTF file with its buffers, and matches as an extension.

A point has a range of matches: its first one in 40 bits, their number in 24 bits behind that. The
node's matrix takes positions to glTF's axes, whose y is up; in the processing system z is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.exchange.programs.opf.lens import HALF
from acx4lib.exchange.programs.opf.measured import NOTHING, Measured
from acx4lib.exchange.programs.opf.orientations import Shot
from acx4lib.exchange.programs.opf.project import inside
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.exchange.safe.opened import Together
from acx4lib.expected import Array
from acx4lib.flight.problems import RANGES, quoted

MATCHES = "OPF_mesh_primitive_matches"
"""Extension of a mesh that has the measurements of its points."""

TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Numbers of glTF for types."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From glTF's axes, y up, to those with z up."""

SHARED = 4
"""Times that the bytes of buffers are taken at most: meshes may share some, not all of them."""

COUNT_BITS = 40
"""Bits of a range below the number of its matches."""


@dataclass(kw_only=True, eq=False)
class Scene:
    """A glTF file.

    Attributes
    ----------
    root : Node
    files : Together
        All files of the project.
    buffers : dict of str to bytes
        Those that were read, by their addresses.
    taken : int
        Bytes of all arrays that were taken from them.
    """

    root: Node
    files: Together
    buffers: dict[str, bytes] = field(default_factory=dict)
    taken: int = 0

    def array(self, accessor: Node, *, width: int, kind: str) -> NDArray[Any]:
        """Return the values of an accessor, shape (n, width), of a kind of NumPy: "f" or "u"."""
        node = self.root.one("accessors", accessor.whole())
        layout = TYPES.get(node.one("componentType").whole(), "")
        if WIDTHS.get(node.one("type").text()) != width or layout[1:2] != kind:
            raise node.wrong(quoted(node.value), f"must be {width} values of kind {kind!r}")
        view = self.root.one("bufferViews", node.one("bufferView").whole())
        data = self._buffer(self.root.one("buffers", view.one("buffer").whole()).one("uri"))
        first = view.maybe("byteOffset")
        begin, n = 0 if first is None else first.whole(), node.one("count").whole()
        size = n * width * np.dtype(layout).itemsize
        if begin < 0 or n < 0 or begin + size > len(data):
            raise node.wrong(f"{size} bytes from {begin} of {len(data)}", "must be complete")
        self.taken += size
        if self.taken > SHARED * sum(map(len, self.buffers.values())):
            found = "the same bytes of its buffers are taken again and again"
            raise node.wrong(found, f"must be taken {SHARED} times at most")
        values = np.frombuffer(data, dtype=layout, count=n * width, offset=begin)
        return values.reshape(n, width)

    def _buffer(self, uri: Node) -> bytes:
        if uri.text() not in self.buffers:
            folder = Path(self.root.source.file).parent
            self.buffers[uri.text()] = self.files.read(inside(uri, folder)).data
        return self.buffers[uri.text()]


def read(root: Node, shots: Mapping[str, Shot], files: Together) -> Measured:
    """Return the measurements of tie points, a point once in each image.

    Parameters
    ----------
    root : Node
        The glTF file.
    shots : mapping of str to Shot
    files : Together
        All files of the project.

    Raises
    ------
    FlightError
        Where the file or a buffer of it is not what the format says.
    """
    scene, parts, first = Scene(root=root, files=files), [], 0
    for node in root.one("nodes").each():
        mesh = node.maybe("mesh")
        if mesh is None:
            continue
        primitive = root.one("meshes", mesh.whole(), "primitives", 0)
        matches = primitive.maybe("extensions", MATCHES)
        if matches is None or matches.maybe("imagePoints") is None:
            continue
        xyz = _positions(scene, node, primitive)
        parts.append(_measured(scene, matches, xyz, shots, first))
        first += len(xyz)
    if not parts:
        return NOTHING
    return Measured(
        shots=[shot for one in parts for shot in one.shots],
        points=[point for one in parts for point in one.points],
        colrow=np.concatenate([one.colrow for one in parts]),
        xyz=np.concatenate([one.xyz for one in parts]),
        lost=sum(one.lost for one in parts),
    )


def _positions(scene: Scene, node: Node, primitive: Node) -> Array:
    """Return the points of a mesh in the processing system, shape (n, 3)."""
    xyz = scene.array(primitive.one("attributes", "POSITION"), width=3, kind="f").astype(float)
    matrix = node.maybe("matrix")
    turn = np.eye(4) if matrix is None else matrix.numbers(16).reshape(4, 4).T
    upright: Array = (xyz @ turn[:3, :3].T + turn[:3, 3]) @ UPRIGHT.T
    return upright


def _measured(
    scene: Scene, matches: Node, xyz: Array, shots: Mapping[str, Shot], first: int
) -> Measured:
    """Return the measurements of the points of one mesh; `first` is its first point's number."""
    numbers = [one.text() for one in matches.one("cameraUids").each()]
    camera = scene.array(matches.one("cameraIds"), width=1, kind="u")[:, 0]
    at = matches.one("imagePoints", "pixelCoordinates")
    colrow = scene.array(at, width=2, kind="f").astype(float) - HALF
    point, match = _ranges(scene, matches.one("pointIndexRanges"), len(xyz), len(camera))
    if len(camera) != len(colrow) or (len(camera) and camera.max() >= len(numbers)):
        raise matches.wrong(
            "its matches do not fit together", "must have a camera and a pixel each"
        )
    if not (np.abs(colrow) <= RANGES["col_px"].high).all():
        raise at.wrong("a pixel is too large", str(RANGES["col_px"]))
    pairs = np.stack([point, camera[match]], axis=1)
    once = np.sort(np.unique(pairs, axis=0, return_index=True)[1])
    used = np.array([number in shots for number in numbers], dtype=bool)
    kept = once[used[camera[match[once]]]] if len(once) else once
    return Measured(
        shots=[shots[numbers[k]] for k in camera[match[kept]]],
        points=[f"t{first + k}" for k in point[kept].tolist()],
        colrow=colrow[match[kept]],
        xyz=xyz[point[kept]],
        lost=len(point) - len(kept),
    )


def _ranges(
    scene: Scene, accessor: Node, n_points: int, n_matches: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the point and the place of every match that belongs to a point."""
    pairs = scene.array(accessor, width=2, kind="u").astype(np.uint64)
    packed = pairs[:, 0] | (pairs[:, 1] << np.uint64(32))
    begin = (packed & np.uint64(2**COUNT_BITS - 1)).astype(np.int64)
    count = (packed >> np.uint64(COUNT_BITS)).astype(np.int64)
    if len(count) != n_points or ((begin + count) > n_matches).any() or count.sum() > n_matches:
        raise accessor.wrong("does not fit to its points and matches", "must have a range each")
    point = np.repeat(np.arange(n_points), count)
    within = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    return point, begin[point] + within
