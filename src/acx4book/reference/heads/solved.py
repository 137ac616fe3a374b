"""The heads of one exposure: as their metadata declare them, and turned by tie points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from acx4book.reference import data
from acx4lib import shown
from acx4lib.calibration.heads import RelativeOrientation, declared_orientation
from acx4lib.exchange.lens import FLIP
from acx4lib.exchange.pictures import folder as pictures
from acx4lib.exchange.pictures import rig
from acx4lib.exchange.pictures.rig import Head
from acx4lib.exchange.pictures.tags import Tags, read
from acx4lib.expected import Array, Raster
from acx4lib.flight.setup import camera_of
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.production.head_images import read_heads
from acx4lib.tie_points.refinement import FREE, Refined, refine_by_rotations
from acx4lib.tie_points.search import ImageTies, find_ties

TEN, FIVE = "rededge-dual", "rededge3-flight"
"""Sets of the reference data: ten heads of two rigs, and five of one."""

GREEN = "2 Green"
"""To this head the rotations of heads without angles of the factory are printed."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Solved:
    """One exposure of real heads.

    Attributes
    ----------
    heads : tuple of Head
        The reference first.
    tags : tuple of Tags
        Of the picture of each.
    images : tuple of ndarray, shape (rows, cols, 1)
    height_m : float
        Of the metadata: over the sea, and so over ground that lies there.
    factory : RelativeOrientation
        As the metadata declare the heads.
    synthetic : Camera
    found : ImageTies
    fits : dict of str to Refined
        ``rotations``, and ``six`` with the places of the heads.
    """

    heads: tuple[Head, ...]
    tags: tuple[Tags, ...]
    images: tuple[Raster, ...]
    height_m: float
    factory: RelativeOrientation
    synthetic: Camera
    found: ImageTies
    fits: dict[str, Refined]

    @property
    def names(self) -> list[str]:
        """Return the names of the heads."""
        return [head.name for head in self.heads]

    @property
    def pixel_deg(self) -> float:
        """Return the angle of a pixel in the middle of the reference head, degrees."""
        camera = self.factory.heads[0]
        return float(np.degrees(camera.pixel_mm / camera.interior.f))

    def place(self, name: str) -> int:
        """Return the number of a head."""
        return self.names.index(name)

    def reference(self, k: int) -> int:
        """Return the head to which the angles of another are printed."""
        if all(head.reference is None for head in self.heads):
            return self.place(GREEN)
        named = [head.index for head in self.heads]
        own = self.heads[k].reference
        return 0 if own is None or self.leads(k) else named.index(own)

    def leads(self, k: int) -> bool:
        """Tell whether a head is the reference of its rig."""
        return self.heads[k].reference in (None, self.heads[k].index)


@cache
def solved(files: str) -> Solved:
    """Return the heads of a set of the reference data, solved.

    Parameters
    ----------
    files : str
        `TEN` or `FIVE`.

    Raises
    ------
    ReferenceDataError
        Where a picture is missing, or is not the indexed one.
    """
    entries = [one.file for one in data.index() if one.file.startswith(f"{files}/IMG")]
    paths = {path.name: path for path in map(data.path, entries)}
    brought = pictures.bring(data.folder() / files)
    cameras = {name: camera_of(name, t) for name, t in brought.settings["cameras"].items()}
    names, synthetic = brought.settings["synthetic"]["heads"], cameras[pictures.SYNTHETIC]
    factory = declared_orientation([cameras[name] for name in names], synthetic)
    images = brought.tables["heads/images.csv"]
    files_of = dict(zip(images["camera"], images["file"], strict=True))
    own = [paths[Path(files_of[name]).name] for name in names]
    tags = tuple(map(read, own))
    pixels = read_heads(own, factory.heads).images
    found = find_ties(pixels, factory, synthetic)
    return Solved(
        heads=tuple(map(rig.head_of, tags)),
        tags=tags,
        images=pixels,
        height_m=float(brought.tables["heads/trajectory.csv"]["height_m"][0]),
        factory=factory,
        synthetic=synthetic,
        found=found,
        fits={way: refine_by_rotations(factory, found.ties, free=way) for way in FREE},
    )


def here(files: str, *, folder: str = "") -> Solved | None:
    """Return the heads of a set; None where its pictures are not on this machine.

    Parameters
    ----------
    files : str
        `TEN` or `FIVE`.
    folder : str
        Folder of the reference data; if empty, the usual one.
    """
    with data.at(folder):
        return solved(files) if data.is_here(files) else None


def turned_deg(orientation: RelativeOrientation, k: int, reference: int) -> Array:
    """Return three rotations from the reference to a head, degrees; y down, z ahead.

    The vector of the rotation of a ray of the reference head into head `k`, as the independent
    trial has it.
    """
    R = rotation_from_opk(orientation.opk)
    flip = np.diag([*FLIP, -1.0])
    turned = flip @ R[k].T @ R[reference] @ flip
    return np.asarray(Rotation.from_matrix(turned).as_rotvec(degrees=True))
