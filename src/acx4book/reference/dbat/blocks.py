"""DBAT's two projects as blocks; approximate values come from the measurements only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acx4book.reference import data
from acx4book.reference.dbat import files as dbat
from acx4book.reference.dbat.files import Measurements, Surveyed
from acx4lib.bundle import adjust, uses
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.start.resections import resected
from acx4lib.expected import Array
from acx4lib.flight.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose

FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2", "b1")
"""Interior parameters that the project `camcal` estimates: all nine."""

CHECK_POINTS = (351, 410)
"""Points of the project `sxb` that its author used as check points."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Project:
    """A project of DBAT, adjusted here.

    Attributes
    ----------
    bundle : Bundle
    report : Path
        Report that DBAT printed.
    surveyed : Surveyed
        Control and check points as given.
    is_check : ndarray, shape (n_surveyed,)
    origin : ndarray, shape (3,)
        Subtracted from the coordinates before the adjustment.
    free : tuple of str
        Interior parameters that were estimated.
    """

    bundle: Bundle
    report: Path
    surveyed: Surveyed
    is_check: np.ndarray
    origin: Array
    free: tuple[str, ...]


def camcal() -> Project:
    """Calibrate the camera of `camcal`: 21 images of a flat sheet, four points without error."""
    measured = dbat.read_image_points(data.path("dbat-camcal/image_points.txt"))
    # the height of the format is given in mm
    camera = dbat.camera_from_dbat(cc=7.3, pp=None, size_px=(2272, 1704), pixel_mm=5.43764 / 1704)
    return _adjusted("dbat-camcal", camera, measured, free=FREE)


def sxb() -> Project:
    """Adjust `sxb`: five aerial images with weighted control and a known camera.

    Map coordinates are used as if they were Cartesian, as in the reference.
    """
    files = (("image_points_marked.txt", 0.5), ("image_points_tie.txt", 1.0))
    measured = dbat.joined(
        tuple(
            dbat.read_marked_points(data.path(f"dbat-sxb/{file}"), sigma_px=sigma_px)
            for file, sigma_px in files
        )
    )
    camera = dbat.camera_from_dbat(
        cc=123.9392, pp=(26.577, 38.811), size_px=(8858, 12996), pixel_mm=0.006
    )
    return _adjusted("dbat-sxb", camera, measured, free=())


def _adjusted(
    folder: str, camera: Camera, measured: Measurements, *, free: tuple[str, ...]
) -> Project:
    surveyed = dbat.read_surveyed(data.path(f"{folder}/control_points.txt"))
    names = dbat.read_images(data.path(f"{folder}/images.txt"))
    is_check = np.isin(surveyed.point, CHECK_POINTS)
    origin = surveyed.x.mean(axis=0).round(-2)
    block = _block(camera, measured, names, surveyed=surveyed, is_check=is_check, origin=origin)
    network = uses.free_orientation(block, free=free)
    # DBAT corrects the points as they were measured
    adjusted = adjust.adjust(replace(network, distortion_at="measured"))
    return Project(
        bundle=adjusted,
        report=data.path(f"{folder}/reference_report.txt"),
        surveyed=surveyed,
        is_check=is_check,
        origin=origin,
        free=free,
    )


def _block(
    camera: Camera,
    measured: Measurements,
    names: tuple[str, ...],
    *,
    surveyed: Surveyed,
    is_check: np.ndarray,
    origin: Array,
) -> Block:
    """Return the block of measurements, control and resected images."""
    numbers, point_idx = np.unique(measured.point, return_inverse=True)
    given = SurveyedPoints(
        point_idx=np.searchsorted(numbers, surveyed.point),
        x_m=surveyed.x - origin,
        sigma_m=surveyed.sigma,
    )
    n = len(names)
    unknown = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    block = Block(
        cameras=(camera,),
        images=Images(names=names),
        points=tuple(map(str, numbers)),
        image_points=ImagePoints(
            image_idx=measured.image - 1,
            point_idx=point_idx,
            colrow=measured.colrow,
            sigma_px=measured.sigma_px,
        ),
        control=given[~is_check],
        check=given[is_check],
        trajectory=Trajectory(exposures=names, T_m_b=unknown),
    )
    return resected(block)
