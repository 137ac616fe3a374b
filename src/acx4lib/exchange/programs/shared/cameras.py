"""Cameras of other programs as those of flight.toml."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acx4lib.exchange import lens
from acx4lib.flight import setup
from acx4lib.flight.problems import RANGES
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, turn

PITCH = "pixel_um"

NOMINAL_UM = 5.0
"""Pixel size where none is known: nothing in px depends on it, and f in mm is nominal."""

FLIP = np.diag([1.0, -1.0, -1.0])
"""Between the library's camera axes and those with y down, z ahead."""

TOP_AHEAD = turn(2, -np.pi / 2)
"""R_b_c of a camera that looks down with the top of its images ahead: yaw, pitch, roll are zero."""

AHEAD = Pose(R=np.eye(3), r=np.zeros(3))
"""Mounting of a camera whose own axes are the body's."""


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A camera as another program has it.

    Attributes
    ----------
    width_px, height_px : int
    pixel_um : float
        0 where it is not known.
    hole : Pinhole
        In the library's pixels.
    ideal : callable
        From the library's pixels to ideal points, shape (n, 2), y down; NaN where there is none.
    mount : Pose
        T_b_c, in the library's axes.
    """

    width_px: int
    height_px: int
    hole: lens.Pinhole
    ideal: lens.Model
    pixel_um: float = 0.0
    mount: Pose = AHEAD


@dataclass(frozen=True, kw_only=True)
class Refitted:
    """Cameras for flight.toml.

    Attributes
    ----------
    cameras : dict of str to Camera
    settings : dict
        ``{"cameras": {...}}`` of flight.toml.
    assumed, found : tuple of str
        Sentences on pixel sizes, and on what the refits leave.
    """

    cameras: dict[str, Camera]
    settings: dict[str, Any]
    assumed: tuple[str, ...]
    found: tuple[str, ...]

    def only(self, names: Collection[str]) -> Refitted:
        """Return some of the cameras."""
        tables = self.settings["cameras"]
        return replace(
            self,
            cameras={name: one for name, one in self.cameras.items() if name in names},
            settings={"cameras": {name: one for name, one in tables.items() if name in names}},
            found=tuple(
                said for name, said in zip(self.cameras, self.found, strict=True) if name in names
            ),
        )


def refitted(lenses: Mapping[str, Lens], *, pixel_um: float | None) -> Refitted:
    """Refit lenses over their whole formats.

    Parameters
    ----------
    lenses : mapping of str to Lens
        By the names of the cameras.
    pixel_um : float, optional
        Pixel size of those that have none.

    Raises
    ------
    ValueError
        For a lens that no camera of a flight has; the message begins with the camera's name.
    """
    cameras, left, tables = {}, {}, {}
    for name, one in lenses.items():
        size = one.pixel_um or pixel_um or NOMINAL_UM
        try:
            camera, left[name] = lens.camera_of(
                one.ideal,
                one.hole,
                name=name,
                width_px=one.width_px,
                height_px=one.height_px,
                pixel_mm=size / 1000,
            )
            cameras[name] = replace(camera, T_b_c=one.mount)
            tables[name] = _table(cameras[name])
        except ValueError as error:
            msg = f"{name}: {error}"
            raise ValueError(msg) from None
    nominal = [name for name, one in lenses.items() if not one.pixel_um]
    assumed: tuple[str, ...] = ()
    if nominal and pixel_um is None:
        assumed = (
            f"Pixels of {', '.join(nominal)}: {NOMINAL_UM:g} µm, since no file says it; only "
            "millimetres depend on it (--pixel-um)",
        )
    found = tuple(
        f"lens of {name}: {camera.width_px} x {camera.height_px} px, f "
        f"{_focal(camera, lenses[name].hole)} px; refitted as Brown's model it differs by "
        f"{left[name]}"
        for name, camera in cameras.items()
    )
    return Refitted(cameras=cameras, settings={"cameras": tables}, assumed=assumed, found=found)


def is_rotation(R: np.ndarray, off: float = 1e-4) -> bool:
    """Tell whether a matrix, shape (3, 3), of any numbers turns, and does not mirror."""
    if not (np.abs(R) < 2).all():
        return False
    return bool(np.abs(R @ R.T - np.eye(3)).max() <= off and np.linalg.det(R) > 0)


def turned(R_cv: np.ndarray) -> np.ndarray:
    """Return rotations between axes with y down, z ahead as those between the library's."""
    return FLIP @ R_cv @ FLIP


def _focal(camera: Camera, hole: lens.Pinhole) -> str:
    """Return the focal length in px, with that of the source where it was refitted."""
    here, there = (f"{f:.2f}" for f in (camera.interior.f / camera.pixel_mm, hole.fy))
    return here if here == there else f"{here} (there {there})"


def _table(camera: Camera) -> dict[str, Any]:
    """Return the table of flight.toml, with ten digits and without what is zero."""
    values = setup.camera_table(camera)
    short = {  # a pixel size is printed from single precision by some programs
        key: float(f"{value:.{7 if key == PITCH else 10}g}") if isinstance(value, float) else value
        for key, value in values.items()
    }
    needed = ("width_px", "height_px", "pixel_um", "focal_mm")
    for key, value in short.items():
        if key in RANGES and value not in RANGES[key]:
            msg = f"{key} {value:g} {RANGES[key]}"
            raise ValueError(msg)
    return {key: value for key, value in short.items() if key in needed or value}
