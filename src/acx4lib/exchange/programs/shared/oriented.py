"""Images as another program has them: cameras, orientations, points and their measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange import lens
from acx4lib.exchange.programs.shared import proof, tables
from acx4lib.exchange.safe.opened import Opened
from acx4lib.expected import Array, Index
from acx4lib.flight.problems import quoted
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import MappingFrame


@dataclass(frozen=True, kw_only=True, eq=False)
class Oriented:
    """Images in a Cartesian frame w of their own.

    Attributes
    ----------
    cameras : mapping of str to Camera
    images, camera_of, exposure_of : tuple of str
        Names; one for each image.
    T_w_c : Pose
        Orientations of the images in the library's camera axes; NaN where there is none.
    points : tuple of str
        Names of object points.
    x_w : ndarray, shape (n_points, 3)
        NaN where not known.
    image_idx, point_idx : ndarray of int, shape (n,)
        Of each measurement.
    colrow : ndarray, shape (n, 2)
        Measurements in the library's pixels.
    """

    cameras: Mapping[str, Camera]
    images: tuple[str, ...]
    camera_of: tuple[str, ...]
    exposure_of: tuple[str, ...]
    T_w_c: Pose
    points: tuple[str, ...] = ()
    x_w: Array = field(default_factory=lambda: np.zeros((0, 3)))
    image_idx: Index = field(default_factory=lambda: np.zeros(0, dtype=int))
    point_idx: Index = field(default_factory=lambda: np.zeros(0, dtype=int))
    colrow: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def block(self) -> str:
        """The block to which they belong: several images of one exposure are those of heads."""
        return "heads" if len(set(self.exposure_of)) < len(self.images) else "calibration"


def misfits(images: Oriented) -> Array:
    """Return the distances of measured points from projected ones, px; of what is known."""
    T, x_w = images.T_w_c[images.image_idx], images.x_w[images.point_idx]
    known = np.flatnonzero(np.isfinite(np.hstack([T.r, x_w])).all(axis=1))
    names = [images.camera_of[i] for i in images.image_idx[known]]
    return proof.misfits(images.cameras, names, T[known], x_w[known], images.colrow[known])


def proved(images: Oriented, whose: str) -> str:
    """Return the sentence on how well points are met by what was imported.

    Parameters
    ----------
    images : Oriented
    whose : str
        Which points: "the program's own points".
    """
    apart = misfits(images)
    if not len(apart):
        return f"{whose} prove nothing: the files lack their measurements, or orientations"
    return f"{whose} are reprojected by what was imported to {proof.said(apart)}"


def tables_of(images: Oriented, block: str, source: Opened) -> dict[str, Columns]:
    """Return images.csv of a block, and image_points.csv where anything is measured.

    Raises
    ------
    FlightError
        For a name that no flight may use, in `source`.
    """
    kinds: tuple[tuple[str, Sequence[str]], ...] = (
        ("image", images.images),
        ("camera", images.camera_of),
        ("exposure", images.exposure_of),
        ("point", images.points),
    )
    for what, names in kinds:
        tables.require_names(names, partial(_wrong_name, source, what))
    all_images = tables.images(images.images, images.camera_of, images.exposure_of)
    found: dict[str, Columns] = {f"{block}/images.csv": all_images}
    if len(images.colrow):
        names = [images.images[i] for i in images.image_idx]
        points = [images.points[i] for i in images.point_idx]
        found[f"{block}/image_points.csv"] = tables.image_points(names, points, images.colrow)
    return found


def _wrong_name(source: Opened, what: str, name: str, found: str, expected: str) -> FlightError:
    return source.wrong(what, found if name in found else f"{quoted(name)} {found}", expected)


def trajectory(T_m_b: Pose, exposures: Sequence[str], frame: MappingFrame) -> Columns:
    """Return trajectory.csv of poses in a mapping frame, one for each exposure."""
    return tables.trajectory_in_grid(exposures, *frame.pose_to_grid(T_m_b))


def backwards(forward: lens.Model, hole: lens.Pinhole, start: lens.Model) -> lens.Model:
    """Return the ideal points of pixels, for a program that distorts ideal points.

    Parameters
    ----------
    forward : callable
        From ideal points to those in units of the focal length, shape (n, 2), y down.
    hole : Pinhole
    start : callable
        Approximate inverse of `forward`.
    """

    def ideal(colrow: Array) -> Array:
        measured = hole.points(colrow)
        return lens.inverse(forward, measured, start(measured))

    return ideal
