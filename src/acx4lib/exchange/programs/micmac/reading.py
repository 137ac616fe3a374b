"""A folder of MicMac as a flight."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.micmac import files, lens
from acx4lib.exchange.programs.micmac.files import Files
from acx4lib.exchange.programs.shared import cameras, oriented, proof, tables
from acx4lib.exchange.programs.shared import crs as coordinates
from acx4lib.exchange.programs.shared.cameras import Lens, Refitted
from acx4lib.exchange.programs.shared.oriented import Oriented
from acx4lib.exchange.safe import opened
from acx4lib.expected import Array
from acx4lib.flight.problems import quoted
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.frames import Pose, opk_from_rotation

CAMERA = "CAM"
"""Name of the camera where no orientation names a calibration."""

ASSUMED = (
    f"{lens.KNOWN}: the matrix takes camera to object axes, x right, y down, z ahead; the "
    "distortion takes ideal pixels to measured ones",
    "pixel 0, 0 is taken as the centre of the top-left one: no file says it",
)


def read(
    source: Path,
    *,
    orientations: str = "initial",
    block: str | None = None,
    crs: str | None = None,
    pixel_um: float | None = None,
) -> Brought:
    """Read MicMac's files of version 1.

    Parameters
    ----------
    source : Path
        A folder with one Ori-*, or an Ori-* in it, measures and surveyed points in XML; or one
        such file.
    orientations : {"initial", "adjusted", "none"}
        Whether the adjusted orientations become the trajectory; the files have no others.
    block : str, optional
        By default calibration.
    crs : str, optional
        Of the flight and of MicMac's coordinates, which do not say it.
    pixel_um : float, optional
        Pixel size.

    Raises
    ------
    FlightError
        For files that are not MicMac's, other conventions or other distortion models.
    """
    found = files.files_of(source)
    refitted = _refitted(found, pixel_um)
    images, control = _images(found, refitted)
    block = block or "calibration"
    brought = Brought(
        source="MicMac",
        sha256=opened.checksums(found.read),
        settings=refitted.settings | _settings(crs),
        tables=_tables(found, images, control, block),
        assumed=(*ASSUMED, *refitted.assumed, *_said_of(crs, control)),
        found=(*_counts(images, control), *_proofs(found, images), *refitted.found),
        left_out=_left_out(found, images, control, orientations),
    )
    if orientations != "adjusted":
        return brought
    return _with_trajectory(brought, source, images, crs, block)


def _refitted(found: Files, pixel_um: float | None) -> Refitted:
    lenses: dict[str, Lens] = {}
    for name, root in found.calibrations.items():
        lenses[_camera(name)] = lens.read(root)
    try:
        return cameras.refitted(lenses, pixel_um=pixel_um)
    except ValueError as error:
        root = next(iter(found.calibrations.values()))
        raise root.wrong(str(error), "must be a lens that a flight can have") from None


def _camera(file: str) -> str:
    return file.removesuffix(".xml").removeprefix("AutoCal_")


def _camera_of(found: Files, image: str) -> str:
    """Return the camera of an image: that of its orientation, or the only one."""
    orientation = found.orientations.get(image)
    if orientation is None:
        return next(iter(map(_camera, found.calibrations)), CAMERA)
    if image in found.interior:
        return _camera(found.interior[image])
    element = orientation.one("FileInterne")
    name = element.text.replace("\\", "/").rpartition("/")[2]
    if name not in found.calibrations:
        raise element.wrong(f"{quoted(name)} is not there", "must be beside the orientations")
    return _camera(name)


def _images(found: Files, refitted: Refitted) -> tuple[Oriented, dict[str, tuple[Array, Array]]]:
    """Return images with their measurements, and surveyed points with their sigma."""
    measured, control = list(files.measured(found.measures)), {}
    for element, name, x_w, sigma in files.surveyed(found.surveyed):
        if name in control:
            raise element.wrong(f"point {quoted(name)} stands twice", "must stand once")
        control[name] = (x_w, sigma)
    seen: set[tuple[str, str]] = set()
    for element, image, name, _ in measured:
        if (image, name) in seen:
            raise element.wrong(f"{quoted(name)} stands twice in {quoted(image)}", "must once")
        seen.add((image, name))
    images = list(dict.fromkeys([*found.orientations, *(image for _, image, _, _ in measured)]))
    row_of = {image: row for row, image in enumerate(images)}
    poses = [_pose(found, image) for image in images]
    points, point_idx = tables.first_use([name for _, _, name, _ in measured])
    places = [control[name][0] if name in control else np.full(3, np.nan) for name in points]
    oriented_images = Oriented(
        cameras=refitted.cameras,
        images=tuple(images),
        camera_of=tuple(_camera_of(found, image) for image in images),
        exposure_of=tuple(images),
        T_w_c=Pose(
            R=np.array([one.R for one in poses]).reshape(-1, 3, 3),
            r=np.array([one.r for one in poses]).reshape(-1, 3),
        ),
        points=tuple(points),
        x_w=np.array(places).reshape(-1, 3),
        image_idx=np.array([row_of[image] for _, image, _, _ in measured], dtype=int),
        point_idx=point_idx,
        colrow=np.array([at for _, _, _, at in measured]).reshape(-1, 2),
    )
    return oriented_images, control


def _pose(found: Files, image: str) -> Pose:
    """Return the orientation of an image, NaN where it has none."""
    orientation = found.orientations.get(image)
    if orientation is None:
        return Pose(R=np.full((3, 3), np.nan), r=np.full(3, np.nan))
    return files.pose(orientation)


def _tables(
    found: Files, images: Oriented, control: dict[str, tuple[Array, Array]], block: str
) -> dict[str, Columns]:
    made: dict[str, Columns] = {}
    if images.images:
        made = oriented.tables_of(images, block, found.read[0])
    if control:
        made["control_points.csv"] = _control_table(control)
    return made


def _control_table(control: dict[str, tuple[Array, Array]]) -> Columns:
    xyz, sigma = (np.array([one[k] for one in control.values()]) for k in (0, 1))
    names = ("east_m", "north_m", "height_m")
    table: dict[str, Any] = {"point": list(control)}
    table |= dict(zip(names, np.round(xyz, 5).T.tolist(), strict=True))
    if (sigma > 0).all():
        sigmas = (f"sigma_{name}" for name in names)
        table |= dict(zip(sigmas, np.round(sigma, 5).T.tolist(), strict=True))
    return table


def _settings(crs: str | None) -> dict[str, str]:
    return {} if crs is None else {"crs": crs, "heights": "ellipsoidal"}


def _said_of(crs: str | None, control: dict[str, tuple[Array, Array]]) -> tuple[str, ...]:
    if not control:
        return ()
    where = "the flight's CRS" if crs is None else crs
    return (
        f"MicMac's coordinates are east, north, height in {where}: its files do not say it",
        "Incertitude of a surveyed point is its standard deviation in metres",
    )


def _counts(images: Oriented, control: dict[str, tuple[Array, Array]]) -> tuple[str, ...]:
    n = int(np.isfinite(images.T_w_c.r).all(axis=1).sum())
    return (
        f"{number_of(len(images.images), 'images')}, {n} of them oriented, "
        f"{number_of(len(images.colrow), 'measurements')} of "
        f"{number_of(len(images.points), 'points')}, "
        f"{number_of(len(control), 'surveyed points')}",
    )


def _proofs(found: Files, images: Oriented) -> tuple[str, ...]:
    """Return sentences on how well surveyed points, and MicMac's own, are met."""
    own = [files.own_points(one) for one in found.orientations.values()]
    names = [images.camera_of[k] for k, (_, colrow) in enumerate(own) for _ in colrow]
    rows = np.array([k for k, (_, colrow) in enumerate(own) for _ in colrow], dtype=int)
    said = [oriented.proved(images, "surveyed points")]
    if len(rows):
        x_w, colrow = (np.concatenate([pair[k] for pair in own]) for k in (0, 1))
        apart = proof.misfits(images.cameras, names, images.T_w_c[rows], x_w, colrow)
        said.append(f"points that MicMac projected itself (Verif): {proof.said(apart)}")
    return tuple(said)


def _left_out(
    found: Files, images: Oriented, control: dict[str, tuple[Array, Array]], orientations: str
) -> tuple[str, ...]:
    unknown = [name for name in images.points if name not in control] if control else []
    measured = set(images.points)
    unmeasured = [name for name in control if name not in measured]
    said = Counter(
        {
            f"{found.others} other XML files": found.others,
            f"{len(found.orientations)} adjusted orientations (--orientations adjusted)": (
                len(found.orientations) * (orientations != "adjusted")
            ),
            f"coordinates of {len(unknown)} measured points are not there, so that they are tie "
            f"points: {', '.join(unknown[:5])}": len(unknown),
            f"{len(unmeasured)} surveyed points are measured in no image: "
            f"{', '.join(unmeasured[:5])}": len(unmeasured),
        }
    )
    return tuple(one for one, n in said.items() if n)


def _with_trajectory(
    brought: Brought, source: Path, images: Oriented, crs: str | None, block: str
) -> Brought:
    """Return what was brought with the adjusted orientations as the trajectory."""
    if crs is None:
        found = "adjusted orientations are in coordinates whose CRS the files do not say"
        raise FlightError([f"{source}:1: crs: {found}; give it by --crs"])
    try:
        coordinates.chosen("", None, crs)
    except ValueError as error:
        raise FlightError([f"{source}:1: crs: {error}; must be projected, in metres"]) from None
    known = np.flatnonzero(np.isfinite(images.T_w_c.r).all(axis=1))
    T = images.T_w_c[known]
    exposures = [images.exposure_of[k] for k in known]
    table = tables.trajectory_in_grid(exposures, T.r, opk_from_rotation(T.R))
    said = (
        "the adjusted orientations stand for the trajectory, in axes of the grid: the body is the "
        "camera, so that a boresight and a lever arm found with them mean nothing"
    )
    return replace(
        brought,
        tables={**brought.tables, f"{block}/trajectory.csv": table},
        assumed=(*brought.assumed, said),
        found=(*brought.found, f"{len(exposures)} adjusted orientations"),
    )
