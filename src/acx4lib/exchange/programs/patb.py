"""PAT-B's image coordinates (.im), the only one of its files whose layout is simple enough to read.

No layout by its maker, and no file, was at hand: blocks of an image, its points and -99, as other
programs call them. Control (.con) and orientations (.ori) are not read.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from acx4lib.exchange.brought import Brought
from acx4lib.exchange.programs.shared import photo_lists
from acx4lib.exchange.safe import opened

UM = {"mm": 1000.0, "um": 1.0}
"""Micrometres of the units that a .pro file may state."""

NOT_READ = (".con", ".ori", ".at", ".pro")


def read(
    source: Path,
    *,
    unit: str,
    size: tuple[int, int],
    pixel_um: float,
    block: str | None = None,
) -> Brought:
    """Read a list of image coordinates.

    Parameters
    ----------
    source : Path
        A file .im.
    unit : {"um", "mm"}
        Of its coordinates; the file .pro states it.
    size : tuple of int
        Width and height of the images, px.
    pixel_um : float
    block : str, optional
        By default calibration.

    Raises
    ------
    FlightError
        For another file, or another layout.
    """
    file = opened.read(source)
    if source.suffix.lower() in NOT_READ:
        found = f"{source.suffix} of PAT-B is not read: its layout is not known for certain"
        raise file.wrong("file", found, "must be the image coordinates, .im")
    measured = [replace(one, camera=photo_lists.CAMERA) for one in photo_lists.read(file)]
    brought = photo_lists.brought(
        file,
        measured,
        source="PAT-B",
        pixels_per_unit=UM[unit] / pixel_um,
        size=size,
        pixel_um=pixel_um,
        block=block or "calibration",
    )
    left_out = tuple(
        f"{path.name}: not read"
        for path in sorted(source.parent.glob(f"{source.stem}.*"))
        if path.suffix.lower() in NOT_READ
    )
    said = (
        f"x and y are in {unit} from the middle of the image, x right, y up; all images have one "
        "camera; what follows them on a line is no part of them",
        "the layout is untried on a file that PAT-B wrote",
    )
    return replace(brought, assumed=said, left_out=left_out)
