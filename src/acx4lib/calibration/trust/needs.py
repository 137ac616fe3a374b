"""The flight geometry that determines a parameter, and what of it a flight lacks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.bundle.observations.strips import motion_of, strips_of
from acx4lib.errors import AdjustmentError
from acx4lib.flight.block import Block
from acx4lib.flight.design import SAME_HEIGHT, directions, flying_heights, strip_of_exposure

ALONG, ACROSS = 0.9, 0.3
"""Cosines of flying directions that are opposite, and of those that are crosswise."""

SAME_SPEED = 0.1
"""Strips whose ground speeds differ by less than this share count as flown at one speed."""

OUTER = 0.85
"""Share of half the image diagonal from which a measurement lies in a corner."""

ENOUGH = "more images or measurements of what is there already, or it held"
"""What a parameter needs in a flight that has its geometry."""


BEYOND = 300_000.0
"""Distance from the median of the control points, m, that no point of a block can have."""


@dataclass(frozen=True, kw_only=True)
class Need:
    """One thing that determines a parameter.

    Attributes
    ----------
    text : str
    features : tuple of str
        Features of a flight, any of which is enough, as `features` returns them.
    """

    text: str
    features: tuple[str, ...]


_HEIGHTS = Need(text="two flying heights", features=("heights",))
_CONTROL = Need(text="control points", features=("control",))
_OPPOSITE = Need(text="strips flown in opposite directions", features=("opposite",))
_SIDES = Need(text="measurements on all sides of the images", features=("sides",))
_CORNERS = Need(text="measurements in the corners of the images, or k3 held", features=("corners",))
_HELD = Need(text="two flying heights, or the lever arm held", features=("heights",))
_TIED = Need(
    text="control points or strips flown in opposite directions", features=("control", "opposite")
)

NEEDS: Mapping[str, tuple[Need, ...]] = {
    "f": (
        Need(
            text="two flying heights (hills or tilted images in a bundle on control points alone)",
            features=("heights",),
        ),
        Need(text="control points or accurate GNSS heights", features=("control",)),
    ),
    "xp": (_HELD,),
    "yp": (_HELD,),
    "k1": (
        Need(
            text="measurements from the middle to the corners of the images", features=("corners",)
        ),
    ),
    "k2": (_CORNERS,),
    "k3": (_CORNERS,),
    "p1": (_SIDES, _OPPOSITE),
    "p2": (_SIDES, _OPPOSITE),
    "b1": (_SIDES, Need(text="strips flown crosswise", features=("crosswise",))),
    "lever_x": (_HEIGHTS, _TIED),
    "lever_y": (_HEIGHTS, _TIED),
    "lever_z": (_CONTROL, Need(text="two flying heights or f held", features=("heights",))),
    "boresight_x": (_OPPOSITE, _CONTROL),
    "boresight_y": (_OPPOSITE, _CONTROL),
    "boresight_z": (
        Need(
            text="tie points over overlapping strips, or control points",
            features=("overlap", "control"),
        ),
    ),
    "shift": (
        _CONTROL,
        Need(
            text="strips flown in opposite directions or the lever arm held", features=("opposite",)
        ),
    ),
    "drift": (Need(text="control points along the strip", features=()),),
    "delay": (
        Need(text="strips flown at different speeds, or the lever arm held", features=("speeds",)),
        _TIED,
    ),
    "attitude_delay": (
        Need(text="attitudes that change from one exposure to the next", features=()),
    ),
}
"""What determines each parameter, by the library's name of it."""


def needed(key: str, features: frozenset[str] = frozenset()) -> str:
    """Return what would determine a parameter and a flight does not have.

    Parameters
    ----------
    key : str
        The library's name of the parameter.
    features : frozenset of str
        What the flight has; by default, nothing.
    """
    lacking = [need.text for need in NEEDS[key] if not features.intersection(need.features)]
    return ", and ".join(lacking) or ENOUGH


def features(block: Block) -> frozenset[str]:
    """Return what a block has of what determines parameters.

    Any of ``heights``, ``control``, ``opposite``, ``crosswise``, ``speeds``, ``corners``,
    ``sides`` and ``overlap``.
    """
    way, height = directions(block), flying_heights(block)
    turns = way @ way.T
    found = {
        "heights": bool(height.min() < (1 - SAME_HEIGHT) * height.max()),
        "control": _has_control(block),
        "opposite": bool(np.any(turns < -ALONG)),
        "crosswise": bool(np.any(np.abs(turns) < ACROSS)),
        "overlap": _has_overlap(block),
        "speeds": _has_speeds(block),
        **_places(block),
    }
    return frozenset(name for name, there in found.items() if there)


def _has_control(block: Block) -> bool:
    try:
        require_control(block)
    except AdjustmentError:
        return False
    return True


def require_control(block: Block) -> None:
    """Raise where images do not show three control points that are not on one line.

    Parameters
    ----------
    block : Block

    Raises
    ------
    AdjustmentError
        Without them, exterior orientations that no trajectory observes have no datum.
    """
    expected.instance("block", block, Block)
    rays = block.rays[block.control.point_idx]
    usable = np.isfinite(block.control.sigma_m).all(axis=1) & (rays > 0)
    x_m, spread = block.control.x_m[usable], np.zeros(3)
    if len(x_m):  # seen from an absurdly far point, all others seem to lie in one place
        x_m = x_m[np.abs(x_m - np.median(x_m, axis=0)).max(axis=1) < BEYOND]
        spread = np.linalg.svd(x_m - x_m.mean(axis=0), compute_uv=False)
    if len(x_m) < 3 or spread[1] < 1e-3 * max(spread[0], 1.0):
        needed = "three that do not lie on one line are needed"
        msg = f"{len(x_m)} control points in images do not orient the block: {needed}"
        raise AdjustmentError(msg)


def _has_speeds(block: Block) -> bool:
    """Tell whether strips are flown at different ground speeds; not where there are no times."""
    try:
        speed = np.linalg.norm(motion_of(block, delays=("delay",)).velocity, axis=1)
    except AdjustmentError:
        return False
    strip = strips_of(block).idx
    usual = [float(np.median(speed[strip == k])) for k in range(strip.max() + 1)]
    return min(usual) < (1 - SAME_SPEED) * max(usual)


def _has_overlap(block: Block) -> bool:
    """Tell whether images of two strips share points."""
    names = strip_of_exposure(block)
    number = {name: i for i, name in enumerate(dict.fromkeys(names))}
    strip = np.array([number[name] for name in names])[block.images.exposure_idx]
    points = block.image_points
    own, one = strip[points.image_idx], np.zeros(len(block.points), dtype=np.intp)
    one[points.point_idx] = own  # any of the strips that see a point
    return bool(np.any(one[points.point_idx] != own))


def _places(block: Block) -> dict[str, bool]:
    """Tell where in their images all cameras have measurements."""
    points, cameras = block.image_points, block.cameras
    camera_idx = block.images.camera_idx[points.image_idx]
    size = np.array([[camera.width_px, camera.height_px] for camera in cameras])
    half = (size[camera_idx] - 1) / 2
    place = (points.colrow - half) / half
    corner = np.hypot(*place.T) / np.sqrt(2) > OUTER
    own = [camera_idx == k for k in range(len(cameras))]
    return {
        "corners": all(bool(corner[mine].any()) for mine in own),
        "sides": all(
            bool(np.any(side * place[mine, axis] > 0.5))
            for mine in own
            for axis in (0, 1)
            for side in (-1, 1)
        ),
    }
