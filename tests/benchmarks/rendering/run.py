"""One renderer's run: ``python run.py WHAT FLIGHT RESULTS RESPONSE``, JSON on stdout."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from acx4lib.synthetic_image.head_map import between_nodes
from acx4lib.synthetic_image.rendering import RenderPlan, render_rows
from acx4lib.synthetic_image.response import Response
from benchmarks.harness import clocked, memory_mb, report
from benchmarks.rendering import peers
from benchmarks.rendering.scene import (
    WINDOW_PX,
    Scene,
    pieces,
    read,
    samples_per_pixel,
    window_of_head,
)

BLOCK = 1024  # rows that are rendered at a time into memory that has been used before
Run = Callable[[Scene, Response], dict[str, Any]]


def in_memory(threads: int, **how: object) -> Run:
    """Return a run that renders from images in memory, into memory that has been used before."""

    def run(scene: Scene, response: Response) -> dict[str, Any]:
        own = scene.plan(response, **how)
        images = scene.loaded().heads.images
        out = np.full(scene.shape, 1, images[0].dtype)
        _ready(own, images, threads)

        def fill() -> None:
            for start in range(0, own.height_px, BLOCK):
                stop = min(start + BLOCK, own.height_px)
                out[start:stop] = render_rows(own, images, start, stop, threads=threads)

        return _sized(scene, clocked(fill)[1], samples_per_pixel(own))

    return run


def _ready(own: RenderPlan, images: Any, threads: int) -> None:
    """Load what is compiled, and make what the plan makes when it is first asked for it."""
    render_rows(own, images, 0, own.step_px, threads=threads)


def tiled(peer: str) -> Run:
    """Return a run that samples all that the image needs, tile by tile; only that is timed.

    The maps of a tile are computed just before, and the samples are dropped.
    """

    def run(scene: Scene, response: Response) -> dict[str, Any]:
        cv2.setNumThreads(1)
        own = scene.plan(response)
        images = scene.loaded().heads.images
        total, samples = {"wall_s": 0.0, "cpu_s": 0.0}, 0
        for k, (r0, r1, c0, c1) in pieces(own):
            at = between_nodes(own.maps[k], np.arange(r0, r1), np.arange(c0, c1))
            times = clocked(peers.PEERS[peer](images[k], np.nan_to_num(at, nan=-9.0)))[1]
            total = {key: total[key] + times[key] for key in total}
            samples += at.shape[0] * at.shape[1]
        return _sized(scene, total, samples / np.prod(scene.shape[:2]))

    return run


def in_window(peer: str) -> Run:
    """Return a run that samples one head in a window, where no other counts."""

    def run(scene: Scene, response: Response) -> dict[str, Any]:
        cv2.setNumThreads(1)
        window = window_of_head(scene, 0, WINDOW_PX // scene.reduction)
        head = scene.plan(response).maps[0]
        at = between_nodes(head, np.arange(*window[:2]), np.arange(*window[2:]))
        sample = peers.PEERS[peer](*peers.cut(scene.heads.images[0], at))
        sample()
        pixels = at.shape[0] * at.shape[1]
        return {**clocked(sample)[1], "pixels": pixels, "samples": pixels}

    return run


def _sized(scene: Scene, times: dict[str, float], samples: float) -> dict[str, Any]:
    pixels = scene.shape[0] * scene.shape[1]
    return {**times, "pixels": pixels, "samples": round(samples * pixels)}


RUNS: dict[str, Run] = {
    "ours_2": in_memory(2),
    "ours_1": in_memory(1),
    "ours_cubic_1": in_memory(1, interpolation="cubic"),
    "remap_linear": tiled("remap_linear"),
    "remap_cubic": tiled("remap_cubic"),
    **{name: in_window(name) for name in ("pyvips", "scipy", "skimage")},
}


def main(what: str, flight: Path, results: Path, response: Path) -> None:
    """Run and report."""
    scene = read(flight, results)
    found = RUNS[what](scene, Response(coefficients=np.load(response)))
    report({**found, "peak_mb": memory_mb("VmHWM")})


if __name__ == "__main__":
    main(sys.argv[1], *map(Path, sys.argv[2:5]))
