"""Tie points of one overlap: corners and least-squares matching against SIFT, in one run.

``PYTHONPATH=tests python -m benchmarks.rendering.matching [REDUCE | FLIGHT]`` simulates two heads
of an exposure, or reads those of a flight, and writes JSON on stdout.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from acx4files import flight as flights
from acx4files.images.head_images import head_files, read_heads
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.synthetic_image.frame import head_from_synthetic, reduced_camera, reduced_heads
from acx4lib.tie_points.matching import grey_window, shared_windows
from acx4lib.tie_points.search import find_ties
from acx4sim.designs import acx4_plan
from acx4sim.pictures import (
    Tiles,
    camera_image,
    ground_from_pixels,
    landscape,
    pixels_from_ground,
    reduced,
    station,
)
from benchmarks.harness import clocked, report
from support.pictures import taken

EXPOSURE, HEADS, SEED = "H3-04", ("CAM1", "CAM2"), 1
KEY_POINTS, RATIO, CONSENSUS_PX = 20_000, 0.8, 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """Pictures of two heads that overlap, and where the second sees what the first sees.

    Attributes
    ----------
    images : tuple of ndarray, shape (rows, cols, bands)
    orientation : RelativeOrientation
        Nominal, of the two heads.
    synthetic : Camera
    truth : function
        From col, row in the first head to those in the second, shape (n, 2).
    """

    images: tuple[np.ndarray, ...]
    orientation: RelativeOrientation
    synthetic: Camera
    truth: Callable[[np.ndarray], np.ndarray]


def simulated(reduce: int = 1) -> Pair:
    """Simulate two heads at one exposure; at full size this takes minutes."""
    at = station(acx4_plan(), EXPOSURE, seed=SEED)
    ground = Tiles(ground=landscape(at, seed=SEED))
    images = [camera_image(at, name, ground, reduce=reduce, seed=SEED) for name in HEADS]
    return pair_of(images, reduce)


def pair_of(images: Sequence[np.ndarray], reduce: int) -> Pair:
    """Return simulated images of the two heads, reduced so, as a pair with its truth."""
    at = station(acx4_plan(), EXPOSURE, seed=SEED)
    lenses = [reduced(at.plan.cameras[name], reduce) for name in HEADS]

    def truth(colrow: np.ndarray) -> np.ndarray:
        return pixels_from_ground(at, lenses[1], ground_from_pixels(at, lenses[0], colrow))

    return Pair(
        images=tuple(images),
        orientation=reduced_heads(taken.printed_heads(HEADS), reduce),
        synthetic=reduced_camera(taken.printed_synthetic(), reduce),
        truth=truth,
    )


# --- the two ways ----------------------------------------------------------------------------


def ours(pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Return matched col, row of both heads: `find_ties` as it comes."""
    ties = find_ties(pair.images, pair.orientation, pair.synthetic).ties
    return ties.colrow_a, ties.colrow_b


def sift(pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Return the same by the usual recipe of SIFT over the whole overlap, in the same geometry."""
    window = shared_windows(pair.orientation, pair.synthetic)[0].window
    grey = [
        grey_window(image, pair.orientation, k, pair.synthetic, window)
        for k, image in enumerate(pair.images)
    ]
    detector = cv2.SIFT.create(nfeatures=KEY_POINTS)
    (points_a, words_a), (points_b, words_b) = (
        detector.detectAndCompute(_eight_bit(g), np.isfinite(g).astype(np.uint8)) for g in grey
    )
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(words_a, words_b, k=2)
    good = [first for first, second in pairs if first.distance < RATIO * second.distance]
    a = np.array([points_a[m.queryIdx].pt for m in good])
    b = np.array([points_b[m.trainIdx].pt for m in good])
    _, agree = cv2.findHomography(a, b, cv2.USAC_MAGSAC, CONSENSUS_PX)
    first = np.array([window[2], window[0]])
    xy = [xy_from_colrow(pair.synthetic, c[agree.ravel() > 0] + first) for c in (a, b)]
    found = [head_from_synthetic(pair.orientation, k, one) for k, one in enumerate(xy)]
    return found[0], found[1]


def _eight_bit(grey: np.ndarray) -> np.ndarray:
    low, high = np.nanquantile(grey[::8, ::8], [0.005, 0.995])
    return np.clip(np.nan_to_num((grey - low) * (255 / (high - low))), 0, 255).astype(np.uint8)


METHODS: dict[str, Callable[[Pair], tuple[np.ndarray, np.ndarray]]] = {
    "corners + least-squares matching": ours,
    "SIFT + brute force": sift,
}


def measure(pair: Pair) -> list[dict[str, Any]]:
    """Return points, errors against the truth and times of each method on the same pictures.

    What is compiled has been compiled before; one thread where OpenCV is asked for one.
    """
    find_ties(*_small(pair))
    rows = []
    for name, method in METHODS.items():
        (a, b), times = clocked(lambda method=method: method(pair))
        error = np.hypot(*(b - pair.truth(a)).T)
        near = error < 1
        rows.append(
            {
                "method": name,
                "points": len(a),
                "within_1_px": float(np.mean(near)),
                "within_0.1_px": float(np.mean(error < 0.1)),
                "median_px": float(np.median(error)),
                "rms_px": float(np.sqrt(np.mean(error[near] ** 2))),
                **times,
            }
        )
    for row in rows:
        row["cpu_by_sift"] = row["cpu_s"] / rows[-1]["cpu_s"]
    return rows


def _small(pair: Pair) -> tuple[list[np.ndarray], RelativeOrientation, Camera]:
    """Return every eighth pixel, for a first call that compiles."""
    orientation = reduced_heads(pair.orientation, 8)
    images = [
        np.ascontiguousarray(image[::8, ::8][: head.height_px, : head.width_px])
        for image, head in zip(pair.images, orientation.heads, strict=True)
    ]
    return images, orientation, reduced_camera(pair.synthetic, 8)


def of_flight(flight_path: Path) -> Pair:
    """Return the pictures of the two heads in a flight's folder, with the truth of its design."""
    flight = flights.read(flight_path)
    complete, _ = head_files(flight, HEADS)
    heads = read_heads(complete[EXPOSURE].paths, [flight.cameras[name] for name in HEADS])
    return pair_of(heads.images, heads.reduction)


def main(of: str = "1") -> None:
    """Report on the pictures of a flight, or on simulated ones at 1/REDUCE of their size."""
    cv2.setNumThreads(1)
    report({"ties": measure(simulated(int(of)) if of.isdecimal() else of_flight(Path(of)))})


if __name__ == "__main__":
    main(*sys.argv[1:])
