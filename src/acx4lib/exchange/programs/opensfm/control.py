"""Control points of OpenSfM, ground_control_points.json or gcp_list.txt, and their measurements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib.exchange.programs import odm
from acx4lib.exchange.programs.opensfm import project
from acx4lib.exchange.programs.opensfm.place import HEIGHT, LAT, LON
from acx4lib.exchange.safe import json_tree
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.exchange.safe.opened import Opened
from acx4lib.expected import Array
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.geodesy import GridSystem

FILES = ("ground_control_points.json", "gcp_list.txt", "../gcp_list.txt")
"""In the folder of the project, or in that of ODM above it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Control:
    """Control points.

    Attributes
    ----------
    names : tuple of str
        Of the points that have a position.
    lonlath : ndarray, shape (n, 3)
        Longitude, latitude (deg), altitude (m; NaN where none).
    images, points : tuple of str
        Of each measurement.
    normalised : ndarray, shape (n, 2)
    """

    names: tuple[str, ...]
    lonlath: Array
    images: tuple[str, ...]
    points: tuple[str, ...]
    normalised: Array

    def table(self, grid: GridSystem) -> Columns:
        """Return control_points.csv of the points that have an altitude."""
        whole = np.isfinite(self.lonlath[:, 2])
        east, north = np.round(grid.grid_from_lonlat(self.lonlath[whole, :2]), 5).T.tolist()
        names = [name for name, one in zip(self.names, whole, strict=True) if one]
        height = np.round(self.lonlath[whole, 2], 5).tolist()
        return {"point": names, "east_m": east, "north_m": north, "height_m": height}

    @property
    def flat(self) -> int:
        """Count the points without an altitude."""
        return int(np.isnan(self.lonlath[:, 2]).sum())


def read(file: Opened, sizes: Mapping[str, tuple[int, int]], crs: str) -> Control:
    """Return the points of a file, and their measurements in images of known sizes.

    Parameters
    ----------
    file : Opened
        One of `FILES`.
    sizes : mapping of str to tuple of int
        Width and height of the images, px.
    crs : str
        Of the flight, through which the coordinates of a list pass.
    """
    if file.name.endswith(".json"):
        return _of_json(json_tree.tree(file))
    return _of_list(file, sizes, crs)


def _of_json(node: Node) -> Control:
    names, places, images, points, normalised = [], [], [], [], []
    for one in node.one("points").each():
        name = one.one("id").text()
        if (place := one.maybe("position")) is not None:
            names.append(name)
            places.append(_place(place))
        for seen in one.one("observations").each():
            at = seen.maybe("projection")
            if at is not None:
                images.append(seen.one("shot_id").text())
                points.append(name)
                normalised.append([at.one(k).number(project.NORMALISED) for k in (0, 1)])
    return Control(
        names=tuple(names),
        lonlath=np.array(places).reshape(-1, 3),
        images=tuple(images),
        points=tuple(points),
        normalised=np.array(normalised).reshape(-1, 2),
    )


def _of_list(file: Opened, sizes: Mapping[str, tuple[int, int]], crs: str) -> Control:
    listed = odm.read(Path(file.file), crs=crs).tables
    points, seen = listed["control_points.csv"], listed["calibration/image_points.csv"]
    grid = GridSystem(crs=crs, heights="ellipsoidal")
    enh = np.column_stack([points[name] for name in ("east_m", "north_m", "height_m")])
    pixels = zip(seen["image"], seen["col_px"], seen["row_px"], strict=True)
    return Control(
        names=tuple(points["point"]),
        lonlath=np.column_stack([grid.lonlat_from_grid(enh[:, :2]), enh[:, 2]]),
        images=tuple(seen["image"]),
        points=tuple(seen["point"]),
        normalised=np.array([_normalised(*one, sizes) for one in pixels]),
    )


def _normalised(
    image: str, col: float, row: float, sizes: Mapping[str, tuple[int, int]]
) -> list[float]:
    width, height = sizes.get(image, (1, 1))
    longer = max(width, height)
    return [(col - (width - 1) / 2) / longer, (row - (height - 1) / 2) / longer]


def _place(node: Node) -> list[float]:
    height = node.maybe("altitude")
    return [
        node.one("longitude").number(LON),
        node.one("latitude").number(LAT),
        np.nan if height is None else height.number(HEIGHT),
    ]


def colrow(control: Control, sizes: Mapping[str, tuple[int, int]]) -> tuple[list[int], Array]:
    """Return the measurements in images of known sizes: their places, and the library's pixels."""
    known = [k for k, image in enumerate(control.images) if image in sizes]
    pixels = [project.colrow_of(control.normalised[k], *sizes[control.images[k]]) for k in known]
    return known, np.array(pixels).reshape(-1, 2)
