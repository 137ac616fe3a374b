"""Tie points of two heads, ours and SIFT's: ``python tie_points.py FLIGHT``, JSON on stdout."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

from acx4lib import flight as flights
from acx4lib.production.head_images import head_files, read_heads
from benchmarks.measure import report
from benchmarks.rendering import matching


def main(flight_path: Path) -> None:
    """Match and report."""
    cv2.setNumThreads(1)
    flight = flights.read(flight_path)
    complete, _ = head_files(flight, matching.HEADS)
    heads = read_heads(
        complete[matching.EXPOSURE].paths, [flight.cameras[name] for name in matching.HEADS]
    )
    pair = matching.pair_of(heads.images, heads.reduction)
    report({"ties": matching.measure(pair)})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
