"""Exposures and tie points that are known: over waves, and as a stage hands them to its figures."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np

from acx4book.chapters.image_quality.deviations import known_exposure
from acx4files.stages.pictures import Exposed, Pictures
from acx4files.stages.synthetic import Refinement
from acx4lib.geometry.camera import inside
from acx4lib.synthetic_image.frame import head_from_synthetic, reduced_camera, reduced_heads
from acx4lib.synthetic_image.response import estimate_response
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import TiePoints, refine_by_mean_differences
from acx4sim.drawing import cell_m
from support.pictures import taken

LEVEL, SWING = 30_000.0, 15_000.0
"""Mean of the grey values, and about how far they go to both sides."""

N_WAVES = 24


@dataclass(frozen=True, kw_only=True)
class Waves:
    """Crossed waves of random lengths, none shorter than some pixels of a picture.

    Attributes
    ----------
    shortest_m : float
    """

    shortest_m: float

    def paint(self, window):
        rng = np.random.default_rng(0)
        lengths = self.shortest_m * rng.uniform(1, 4, (2, N_WAVES))
        phases = rng.uniform(0, 2 * np.pi, (2, N_WAVES))
        size = cell_m(window.level)
        north = (window.row + np.arange(window.rows) + 0.5) * size
        east = (window.col + np.arange(window.cols) + 0.5) * size
        up, along = (
            np.sin(2 * np.pi * at[:, None] / length + phase)
            for at, length, phase in zip((north, east), lengths, phases, strict=True)
        )
        waves = up @ along.T / np.sqrt(N_WAVES)  # of variance 1/4
        return (
            np.clip(LEVEL + SWING * waves, 2000, 60_000).astype(np.uint16)[..., None].repeat(3, 2)
        )


@cache
def known(reduce=8):
    """Return an exposure over waves of at least six pixels; 0.12 m is a full-size pixel."""
    return known_exposure(reduce=reduce, ground=Waves(shortest_m=6 * 0.12 * reduce))


def response(exposure):
    """Return the response of the heads of an exposure."""
    return estimate_response(
        exposure.images,
        reduced_heads(exposure.orientation, exposure.reduce),
        reduced_camera(exposure.synthetic, exposure.reduce),
        rng=np.random.default_rng(1),
    ).response


# --- pictures and tie points as a stage hands them to its figures ------------------------------


K = 32
"""Images are reduced by it: 280 x 210 pixels."""

NAMES = ["CAM1", "CAM2", "CAM3", "CAM4"]

PIXEL_MM = 0.0056 * K


def pictured(images, k=K):
    """As the stage hands them to the figures: the exposure in the middle is the second of two."""
    dark = tuple(np.zeros_like(image) for image in images)
    return Pictures(
        exposed=(
            Exposed(exposure="before", exposure_idx=3, images=dark),
            Exposed(exposure="now", exposure_idx=7, images=tuple(images)),
        ),
        reduction=k,
        synthetic=taken.synthetic(k),
        n_complete=2,
    )


def tied(orientation, pair, n, *, shift_mm=(0.0, 0.0), exposure=7):
    """Tie points of a pair whose second head is off by a shift in the synthetic image."""
    xy = np.random.default_rng(1).uniform([-33, -45], [33, 45], (40 * n, 2))
    colrow = [head_from_synthetic(orientation, k, xy) for k in pair]
    both = np.all(
        [inside(orientation.heads[k], c) for k, c in zip(pair, colrow, strict=True)], axis=0
    )
    xy = xy[both][:n]
    a = head_from_synthetic(orientation, pair[0], xy - np.array(shift_mm) / 2)
    b = head_from_synthetic(orientation, pair[1], xy + np.array(shift_mm) / 2)
    ties = TiePoints(
        head_a=np.full(len(xy), pair[0]),
        head_b=np.full(len(xy), pair[1]),
        exposure_idx=np.full(len(xy), exposure),
        point_idx=np.arange(len(xy)),
        colrow_a=a,
        colrow_b=b,
        sigma_px=np.full(len(xy), 1.0),
    )
    return ties, xy


def joined(*parts):
    names = TiePoints.__dataclass_fields__
    return TiePoints(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


def refined(orientation, ties, **others):
    ways = {"before": orientation} | others
    return Refinement(ties=ties, from_pixels=True, orientations=ways, fits={}, reasons={})


# --- refinements beside each other -----------------------------------------------------------


def simulated_ties(
    truth,
    synthetic,
    *,
    rng,
    per_overlap=5000,
    sigma_px=0.1,
):
    """Return tie points at random places of all overlaps, exact but for noise in both heads."""
    half = 0.5 * synthetic.pixel_mm * np.array([synthetic.width_px, synthetic.height_px])
    xy = rng.uniform(-half, half, (12 * per_overlap, 2))
    places = [head_from_synthetic(truth, k, xy) for k in range(len(truth.heads))]
    within = [inside(head, colrow) for head, colrow in zip(truth.heads, places, strict=True)]
    rows = [
        (np.flatnonzero(within[a] & within[b])[:per_overlap], a, b)
        for a, b in combinations(range(len(places)), 2)
    ]
    n = sum(len(points) for points, _, _ in rows)
    return TiePoints(
        head_a=np.concatenate([np.full(len(points), a) for points, a, _ in rows]),
        head_b=np.concatenate([np.full(len(points), b) for points, _, b in rows]),
        exposure_idx=np.zeros(n, dtype=np.intp),
        point_idx=np.concatenate([points for points, _, _ in rows]),
        colrow_a=np.concatenate([places[a][points] for points, a, _ in rows])
        + rng.normal(0, sigma_px, (n, 2)),
        colrow_b=np.concatenate([places[b][points] for points, _, b in rows])
        + rng.normal(0, sigma_px, (n, 2)),
        sigma_px=np.full(n, max(sigma_px, 1e-6)),
    )


def every_refinement(wrong, ties):
    """Return wrong heads refined in every way, the first head held."""
    shifted = refine_by_mean_differences(wrong, ties)
    held = shifted.xyz_mm + wrong.xyz_mm[0] - shifted.xyz_mm[0]
    return {
        "before": wrong,
        "mean shift": replace(shifted, xyz_mm=held),
        "rotations": refine_by_rotations(wrong, ties).orientation,
        "six": refine_by_rotations(wrong, ties, free="six").orientation,
    }
