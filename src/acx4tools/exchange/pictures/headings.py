"""Where the top of a picture points, by the next picture of its strip and the way between them."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import tifffile

from acx4lib.expected import Array
from acx4lib.production import picture_sizes
from acx4lib.production import tiff as tiff_files
from acx4tools.exchange.flight_folder import number_of
from acx4tools.exchange.pictures.metadata import ANOTHER_COURSE_DEG, apart
from acx4tools.exchange.pictures.tags import BROKEN, Tags
from acx4tools.exchange.safe import opened

SIDE = 1000
"""Pixels of the longer side at which pictures are compared."""

LEAST, RATIO, WITHIN_PX = 12, 0.8, 4.0
"""Of features that agree; of the best distance to the second; from the common shift."""


PAIRS = 7
"""Pairs of pictures that decide between two headings at most."""

Taken = tuple[Tags, tuple[float, float, float]]
"""The metadata of a picture; latitude and longitude, degrees, and height."""

Both = Mapping[int, tuple[float, float]]
"""Headings of the gimbal and of the aircraft, degrees, by the numbers of exposures."""


def decided(taken: Sequence[Taken], both: Both, other: Sequence[int]) -> tuple[bool, str]:
    """Let the pictures decide where gimbal and aircraft look in other directions.

    Parameters
    ----------
    taken : sequence of tuple
        A picture of every exposure, and where it was taken.
    both : mapping of int to tuple of float
    other : sequence of int
        Exposures at which they do.

    Returns
    -------
    bool, str
        Whether the aircraft's headings are right, and what is said of it.
    """
    by = np.median([apart(*both[k]) for k in other])
    begin = (
        f"at {len(other)} of {number_of(len(both), 'exposures')} the yaw of the gimbal and that of "
        f"the aircraft differ by {by:.0f}° (median): "
    )
    votes = _votes(taken, both, other)
    if 3 * max(votes) < 2 * sum(votes) or not any(votes):
        return False, f"{begin}the pictures do not say which is right, and the gimbal's is taken"
    is_aircraft = votes[1] > votes[0]
    return is_aircraft, (
        f"{begin}{max(votes)} of {number_of(sum(votes), 'pairs')} of pictures agree with the "
        f"{'aircraft' if is_aircraft else 'gimbal'}'s, which is taken"
    )


def _votes(taken: Sequence[Taken], both: Both, other: Sequence[int]) -> tuple[int, int]:
    """Count pairs of neighbours whose pictures agree with the gimbal, and with the aircraft."""
    pairs = [k for k in other if k + 1 in other and _is_straight(both[k], both[k + 1])]
    votes = [0, 0]
    for k in pairs[:: max(len(pairs) // PAIRS, 1)][:PAIRS]:
        (a, (lat, lon, _)), (b, (next_lat, next_lon, _)) = taken[k : k + 2]
        step = next_lat - lat, (next_lon - lon) * np.cos(np.radians(lat))
        found = heading_by(a.path, b.path, step, (a.width_px, a.height_px))
        if found is not None:
            off = [apart(found, heading) for heading in both[k]]
            if min(off) < ANOTHER_COURSE_DEG:
                votes[int(off[1] < off[0])] += 1
    return votes[0], votes[1]


def _is_straight(first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Return whether gimbal and aircraft kept their headings from one exposure to the next."""
    return max(apart(a, b) for a, b in zip(first, second, strict=True)) < ANOTHER_COURSE_DEG / 2


def heading_by(
    first: Path, second: Path, step: tuple[float, float], size: tuple[int, int]
) -> float | None:
    """Return the heading of the top of two pictures that look down, taken one after the other.

    What is on the ground moves through the picture against the way of the camera.

    Parameters
    ----------
    first, second : Path
        Their files.
    step : tuple of float
        North and east from the first to the second, in any unit.
    size : tuple of int
        Width and height of the pictures, px, as their headers say.

    Returns
    -------
    float or None
        Degrees from north, clockwise; None where the pictures show too little in common, or lie
        too close together.
    """
    grey = [picture for path in (first, second) if (picture := _grey(path, size)) is not None]
    if len(grey) < 2:
        return None
    sift = cv2.SIFT.create(nfeatures=3000, contrastThreshold=0.02)
    (at_a, words_a), (at_b, words_b) = (sift.detectAndCompute(one, None) for one in grey)
    if min(len(at_a), len(at_b)) < LEAST:
        return None
    pairs = cv2.BFMatcher().knnMatch(words_a, words_b, k=2)
    alike = [two[0] for two in pairs if len(two) == 2 and two[0].distance < RATIO * two[1].distance]
    if len(alike) < LEAST:
        return None
    a, b = (
        np.array([points[getattr(match, which)].pt for match in alike])
        for points, which in ((at_a, "queryIdx"), (at_b, "trainIdx"))
    )
    turn, inside = cv2.estimateAffinePartial2D(a, b, ransacReprojThreshold=WITHIN_PX)
    if turn is None or int(inside.sum()) < LEAST:
        return None
    shift = np.mean(b[inside.ravel() == 1] - a[inside.ravel() == 1], axis=0)
    if np.hypot(*shift) < 5 * WITHIN_PX:
        return None
    right, ahead = -shift[0], shift[1]  # the way of the camera; rows count downwards
    way = np.degrees(np.arctan2(step[1], step[0]) - np.arctan2(right, ahead))
    return float(way % 360.0)


def _grey(path: Path, size: tuple[int, int]) -> Array | None:
    """Return a picture in 8 bit, at most `SIDE` px long; None where it cannot be unpacked."""
    data = opened.read(path).data
    n = size[0] * size[1]
    if picture_sizes.fault(n, len(data), 8 * n):
        return None
    try:
        picture = _pixels(data)
    except (*BROKEN, cv2.error):
        return None
    share = min(1.0, SIDE / max(picture.shape))
    small = cv2.resize(
        picture.astype(np.float32), None, fx=share, fy=share, interpolation=cv2.INTER_AREA
    )
    low, high = np.percentile(small, (0.5, 99.5))
    bright = (small - low) * (255 / max(float(high - low), 1e-6))
    return np.asarray(np.clip(bright, 0, 255).astype(np.uint8))


def _pixels(data: bytes) -> Array:
    """Return the pixels of a JPEG or a TIFF, (rows, cols)."""
    if data[:2] == b"\xff\xd8":
        how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), how)
        if decoded is None:
            raise ValueError("is damaged")
        return np.asarray(decoded, dtype=float)
    with tiff_files.in_silence():
        picture = tifffile.imread(io.BytesIO(data)).astype(float)
    return np.asarray(picture.mean(axis=-1) if picture.ndim > 2 else picture)
