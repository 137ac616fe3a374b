"""A synthetic image of wrong heads, and what their refinements make of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from acx4book.paper import printed
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, Interior, inside
from acx4lib.geometry.frames import exp, opk_from_rotation, rotation_from_opk
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points.differences import frame_differences, tie_differences
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import TiePoints, refine_by_mean_differences

TURNED_DEG, TIE_PX = 0.01, 0.1
"""Of `repaired`: errors of the heads' angles, noise of tie points."""


# --- refinements beside each other -----------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameErrors:
    """What is wrong with the synthetic image of several wrong orientations.

    Attributes
    ----------
    overlap_rms_px, overlap_largest_px : ndarray, shape (n,)
        Lengths of the differences between heads, measuring errors left out.
    frame_rms_px, frame_largest_px : ndarray, shape (n,)
        Lengths of the errors of position over the whole frame, against the truth.
    """

    overlap_rms_px: Array
    overlap_largest_px: Array
    frame_rms_px: Array
    frame_largest_px: Array


def simulated_ties(
    truth: RelativeOrientation,
    synthetic: Camera,
    *,
    rng: np.random.Generator,
    per_overlap: int = 5000,
    sigma_px: float = 0.1,
) -> TiePoints:
    """Return tie points at random places of all overlaps, exact but for noise in both heads.

    Parameters
    ----------
    truth : RelativeOrientation
    synthetic : Camera
        Points lie within its frame.
    rng : numpy.random.Generator
    per_overlap : int
        Of the four heads' large overlaps; pairs that share a corner only have some fewer.
    sigma_px : float
        Of a measurement; zero states the rounding of a pixel's millionth.
    """
    half = 0.5 * synthetic.pixel_mm * np.array([synthetic.width_px, synthetic.height_px])
    xy = rng.uniform(-half, half, (12 * per_overlap, 2))
    seen = [head_from_synthetic(truth, k, xy) for k in range(len(truth.heads))]
    within = [inside(head, colrow) for head, colrow in zip(truth.heads, seen, strict=True)]
    rows = [
        (np.flatnonzero(within[a] & within[b])[:per_overlap], a, b)
        for a, b in combinations(range(len(seen)), 2)
    ]
    n = sum(len(own) for own, _, _ in rows)
    return TiePoints(
        head_a=np.concatenate([np.full(len(own), a) for own, a, _ in rows]),
        head_b=np.concatenate([np.full(len(own), b) for own, _, b in rows]),
        exposure_idx=np.zeros(n, dtype=np.intp),
        point_idx=np.concatenate([own for own, _, _ in rows]),
        colrow_a=np.concatenate([seen[a][own] for own, a, _ in rows])
        + rng.normal(0, sigma_px, (n, 2)),
        colrow_b=np.concatenate([seen[b][own] for own, _, b in rows])
        + rng.normal(0, sigma_px, (n, 2)),
        sigma_px=np.full(n, max(sigma_px, 1e-6)),
    )


def with_turned_heads(
    truth: RelativeOrientation, *, rng: np.random.Generator, sigma_deg: float
) -> RelativeOrientation:
    """Return the heads with random rotations about all axes of all but the first."""
    by = np.radians(sigma_deg) * rng.normal(size=(len(truth.heads), 3))
    by[0] = 0.0
    R_s_h = rotation_from_opk(truth.opk) @ exp(by)
    return replace(truth, opk=opk_from_rotation(R_s_h))


def with_wrong_interiors(
    truth: RelativeOrientation, *, rng: np.random.Generator
) -> RelativeOrientation:
    """Return the heads with random errors of their interiors, with Table 1's sigma.

    Parameters
    ----------
    truth : RelativeOrientation
        Its heads have the names of the paper's.
    rng : numpy.random.Generator
    """
    heads = [
        head.with_interior(
            Interior.from_array(
                head.interior.to_array() + printed_sigma(head.name) * rng.normal(size=9)
            )
        )
        for head in truth.heads
    ]
    return replace(truth, heads=tuple(heads))


def printed_sigma(head: str) -> Array:
    """Return Table 1's sigma of a head's interior, zero where it has none, shape (9,)."""
    names = {name: f"{name}_mm" if name in ("f", "xp", "yp") else name for name in INTERIOR}
    listed = set(printed.table(1)["parameter"])
    sigma = [printed.sigma(1, key, head) if key in listed else 0.0 for key in names.values()]
    return np.nan_to_num(np.array(sigma))


def refinements(
    truth: RelativeOrientation,
    wrong: Sequence[RelativeOrientation],
    synthetic: Camera,
    ties: TiePoints,
    *,
    exact: TiePoints,
) -> dict[str, FrameErrors]:
    """Return what is wrong before and after all ways to refine, overlaps and frame apart.

    Parameters
    ----------
    truth : RelativeOrientation
    wrong : sequence of RelativeOrientation
        The same heads with errors; at least one.
    synthetic : Camera
    ties, exact : TiePoints
        What the refinements are given, and others without noise that judge the overlaps.

    Returns
    -------
    dict of str to FrameErrors
        By the ways of `every_refinement`.
    """
    found = [every_refinement(heads, ties) for heads in wrong]
    return {
        way: _frame_errors([heads[way] for heads in found], truth, synthetic, exact)
        for way in found[0]
    }


def every_refinement(wrong: RelativeOrientation, ties: TiePoints) -> dict[str, RelativeOrientation]:
    """Return wrong heads refined in every way, the first head held.

    Returns
    -------
    dict of str to RelativeOrientation
        ``before``, ``mean shift``, ``rotations``, ``six``.
    """
    shifted = refine_by_mean_differences(wrong, ties)
    held = shifted.xyz_mm + wrong.xyz_mm[0] - shifted.xyz_mm[0]
    return {
        "before": wrong,
        "mean shift": replace(shifted, xyz_mm=held),
        "rotations": refine_by_rotations(wrong, ties).orientation,
        "six": refine_by_rotations(wrong, ties, free="six").orientation,
    }


def _frame_errors(
    orientations: Sequence[RelativeOrientation],
    truth: RelativeOrientation,
    synthetic: Camera,
    exact: TiePoints,
) -> FrameErrors:
    overlap = [np.hypot(*tie_differences(o, exact).T) / synthetic.pixel_mm for o in orientations]
    frame = [frame_differences(o, truth, synthetic) for o in orientations]
    return FrameErrors(
        overlap_rms_px=np.array([np.sqrt(np.mean(one**2)) for one in overlap]),
        overlap_largest_px=np.array([one.max() for one in overlap]),
        frame_rms_px=np.array([one.rms_px for one in frame]),
        frame_largest_px=np.array([one.largest_px for one in frame]),
    )


def repaired(
    truth: RelativeOrientation, synthetic: Camera, *, seed: int, trials: int = 4
) -> dict[str, dict[str, FrameErrors]]:
    """Return what the ways to refine make of heads that are wrong by known amounts.

    Parameters
    ----------
    truth : RelativeOrientation
        Heads with the names of the paper's.
    synthetic : Camera
    seed : int
    trials : int
        Number of draws.

    Returns
    -------
    dict of str to dict
        By the errors that the heads were given, and by the ways of `every_refinement`.
    """
    rng = np.random.default_rng(seed)
    wrong = {
        f"heads turned by {TURNED_DEG:g}°": [
            with_turned_heads(truth, rng=rng, sigma_deg=TURNED_DEG) for _ in range(trials)
        ],
        "interiors wrong by Table 1's σ": [
            with_wrong_interiors(truth, rng=rng) for _ in range(trials)
        ],
    }
    ties, exact = (
        simulated_ties(truth, synthetic, rng=rng, sigma_px=sigma) for sigma in (TIE_PX, 0.0)
    )
    return {
        errors: refinements(truth, draws, synthetic, ties, exact=exact)
        for errors, draws in wrong.items()
    }
