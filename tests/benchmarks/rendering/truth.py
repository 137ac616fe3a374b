"""How true the renderers are: ``python truth.py FLIGHT RESULTS RESPONSE``, JSON.

Estimates the responses of the heads too, and leaves them in the file RESPONSE.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acx4lib.geometry.camera import inside, xy_from_colrow
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.synthetic_image.head_map import between_nodes
from acx4lib.synthetic_image.rendering import render_rows
from acx4lib.synthetic_image.response import Response, ResponseFit, estimate_response
from benchmarks.harness import report
from benchmarks.rendering import peers
from benchmarks.rendering.scene import PATCH_PX, Scene, Window, patches, read, window_of_head
from support.pictures import exact_rendering

EVERY = 11  # row and column where positions are compared; no divisor of any distance of nodes
BATCH = 64  # of these rows at a time
SEED = 1
LINEAR = ("ours_1", "ours_2")
CUBIC = ("ours_cubic_1",)


def main(flight: Path, results: Path, response: Path) -> None:
    """Compare and report."""
    scene = read(flight, results)
    fit = estimate_response(
        scene.heads.images,
        scene.orientation,
        scene.synthetic,
        rng=np.random.default_rng(SEED),
    )
    np.save(response, fit.response.coefficients)
    own = scene.plan(fit.response)
    report(
        {
            "reduction": scene.reduction,
            "width_px": own.width_px,
            "height_px": own.height_px,
            "head_pixels": sum(m.width_px * m.height_px for m in own.maps),
            "step_px": own.step_px,
            "feather_px": own.feather_px,
            "position_px": position_errors(scene),
            "response": disagreement(fit),
            "grey": {**rendered(scene, fit.response), **sampled(scene)},
        }
    )


# --- positions -----------------------------------------------------------------------------------


def position_errors(scene: Scene) -> dict[str, float]:
    """Return the errors of the maps at pixels all over the image, px of the heads."""
    camera, own = scene.synthetic, scene.plan()
    cols = np.arange(0, camera.width_px, EVERY)
    errors = []
    for k, head in enumerate(own.maps):
        for rows in np.array_split(np.arange(0, camera.height_px, EVERY), BATCH):
            colrow = np.stack(np.meshgrid(cols, rows), axis=-1).astype(float)
            between = between_nodes(head, rows, cols)
            seen = inside(scene.orientation.heads[k], between)  # not where it is NaN
            exact = head_from_synthetic(scene.orientation, k, xy_from_colrow(camera, colrow[seen]))
            errors.append(np.linalg.norm(between[seen] - exact, axis=-1))
    apart = np.concatenate(errors)
    return {"max": float(apart.max()), "rms": float(np.sqrt(np.mean(apart**2)))}


# --- response ------------------------------------------------------------------------------------


def disagreement(fit: ResponseFit) -> dict[str, float]:
    """Return how far heads disagree in overlaps, at most of all overlaps and bands, as a ratio.

    `systematic` is what remains `after` without what changes from sample to sample, `floor`.
    """
    before, after, floor = (
        np.stack([getattr(overlap, key) for overlap in fit.overlaps])
        for key in ("before", "after", "floor")
    )
    found = {
        "before": before,
        "after": after,
        "floor": floor,
        "systematic": np.sqrt(np.maximum(after**2 - floor**2, 0)),
    }
    return {key: float(np.nanmax(values)) for key, values in found.items()}


# --- grey values ---------------------------------------------------------------------------------


def rendered(scene: Scene, response: Response) -> dict[str, dict[str, float]]:
    """Return how our images differ from the exact ones, with response and blending."""
    images, windows = scene.heads.images, patches(scene)
    exact = {
        cubic: [
            exact_rendering.blended(
                images,
                exact_rendering.exact_positions(scene.orientation, scene.synthetic, window),
                feather_px=scene.feather_px,
                coefficients=response.coefficients,
                cubic=cubic,
            )
            for window in windows
        ]
        for cubic in (False, True)
    }
    out = {}
    for cubic, names in ((False, LINEAR), (True, CUBIC)):
        own = scene.plan(response, interpolation="cubic" if cubic else "bilinear")
        differences = [
            render_rows(own, images, r0, r1)[:, c0:c1] - true
            for (r0, r1, c0, c1), true in zip(windows, exact[cubic], strict=True)
        ]
        out |= dict.fromkeys(names, spread(differences))
    return out


def sampled(scene: Scene) -> dict[str, dict[str, float]]:
    """Return how the samples of others differ from exact ones at the same places."""
    out = {}
    for name, peer in peers.PEERS.items():
        if name in ("oracle", "remap_cubic") or peers.missing(name):
            continue  # the measure itself; a cubic of another kind
        differences = []
        for k, image in enumerate(scene.heads.images):
            window = window_of_head(scene, k, PATCH_PX)
            at = _exact(scene, k, window)
            differences.append(peer(image, at)() - peers.oracle(image, at)())
        out[name] = spread(differences)
    return out


def _exact(scene: Scene, k: int, window: Window) -> np.ndarray:
    return exact_rendering.exact_positions(scene.orientation, scene.synthetic, window)[k]


def spread(differences: Sequence[np.ndarray]) -> dict[str, float]:
    """Return the root mean square, the 99.9 % quantile and the most of grey differences."""
    apart = np.abs(np.concatenate([d.ravel() for d in differences]))
    return {
        "rms_dn": float(np.sqrt(np.mean(apart**2))),
        "p999_dn": float(np.quantile(apart, 0.999)),
        "max_dn": float(apart.max()),
    }


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))
