"""Check that the pictures of an exposure belong together: turned heads, other exposures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera
from acx4lib.tie_points import large_shifts
from acx4lib.tie_points.harris import noise_level
from acx4lib.tie_points.matching import OverlapTask, TieOptions, match_overlap
from acx4lib.tie_points.overlaps import GreyExposure, SharedWindow, reduced_exposure, shared_windows

# whether each of two pictures must be turned by 180 degrees to fit the other
Turns = tuple[bool, bool]

LEAST_CELLS = 30  # with texture; with fewer nothing is said
LEAST_SHARE = 0.2  # of these cells, that agree where two pictures show the same
_AS_THEY_ARE: Turns = (False, False)


@dataclass(frozen=True, kw_only=True)
class _Verdict:
    """Result for the overlap of two heads.

    Attributes
    ----------
    head_a, head_b : int
    turns : tuple of bool, optional
        Turns with which the pictures fit; None where they never fit.
    """

    head_a: int
    head_b: int
    turns: Turns | None


def check_overlaps(
    images: Sequence[np.ndarray], orientation: RelativeOrientation, synthetic: Camera
) -> list[str]:
    """Return sentences on the pictures of an exposure that do not fit their neighbours.

    A quick check: images are reduced until overlaps are about two hundred pixels wide, and
    shifts are searched up to about 150 full-size pixels. Nothing is said of overlaps without
    texture (water, cloud).

    Parameters
    ----------
    images : sequence of ndarray, shape (rows, cols, bands)
        Images of all heads.
    orientation : RelativeOrientation
        Its heads have the size of the images.
    synthetic : Camera

    Returns
    -------
    list of str
        One sentence per problem; empty where there is none.
    """
    windows = shared_windows(orientation, synthetic)
    largest = max((shared.area_px for shared in windows), default=0.0)
    windows = [shared for shared in windows if shared.area_px > largest / 2]
    right = reduced_exposure(images, orientation, synthetic, large_shifts.coarse_factor(windows))
    turned = tuple(np.ascontiguousarray(image[::-1, ::-1]) for image in right.images)
    rng = np.random.default_rng(0)  # the same images always give the same result
    noise = [noise_level(image, rng=rng) for image in images]
    verdicts = []
    for shared in windows:
        task = _task(right, orientation, synthetic, shared, noise[shared.head_a])
        verdicts += _verdict(task, right, turned)
    return _sentences(verdicts, [head.name for head in orientation.heads])


def _task(
    right: GreyExposure,
    orientation: RelativeOrientation,
    synthetic: Camera,
    shared: SharedWindow,
    noise: float,
) -> OverlapTask:
    """Return the matching of one overlap in the reduced images."""
    whole = OverlapTask(
        images=right.images,
        orientation=orientation,
        synthetic=synthetic,
        shared=shared,
        shift=large_shifts.NO_SHIFT,
        cell=large_shifts.LEAST_CELL_PX,
        noise=noise,
        options=TieOptions(),
    )
    return large_shifts.coarse_task(whole, right)


def _verdict(
    task: OverlapTask, right: GreyExposure, turned: Sequence[np.ndarray]
) -> list[_Verdict]:
    """Return the result for two pictures; empty where there is too little texture."""
    a, b = task.shared.head_a, task.shared.head_b
    enough = False
    for turn_a, turn_b in product((False, True), repeat=2):
        images = list(right.images)
        images[a] = turned[a] if turn_a else images[a]
        images[b] = turned[b] if turn_b else images[b]
        matches = match_overlap(replace(task, images=images))
        n_textured = int(matches.counts[1])
        agree = large_shifts.consensus(matches, 2 * task.options.consensus_px).sum()
        if n_textured >= LEAST_CELLS and agree > LEAST_SHARE * n_textured:
            return [_Verdict(head_a=a, head_b=b, turns=(turn_a, turn_b))]
        if not (turn_a or turn_b):
            enough = n_textured >= LEAST_CELLS and _has_texture(task, b)
    return [_Verdict(head_a=a, head_b=b, turns=None)] if enough else []


def _has_texture(task: OverlapTask, b: int) -> bool:
    """Tell whether the second head sees texture too: only one head may see glitter or a cloud."""
    images = list(task.images)
    shared = replace(task.shared, head_a=b, head_b=task.shared.head_a)
    counts = match_overlap(replace(task, images=images, shared=shared)).counts
    return int(counts[1]) >= LEAST_CELLS


def _sentences(verdicts: Sequence[_Verdict], names: Sequence[str]) -> list[str]:
    """Return a sentence for every wrong head, and for pairs of which either may be wrong."""
    turned, fits = set(), set()
    for verdict in verdicts:
        heads = (verdict.head_a, verdict.head_b)
        if verdict.turns is not None:
            fits |= set(heads)
            turned |= {head for head, turn in zip(heads, verdict.turns, strict=True) if turn}
    out = [
        f"{names[head]}: its picture fits its neighbours only when turned by 180 degrees; turn "
        "the file or set its mount"
        for head in sorted(turned)
    ]
    strangers = [(v.head_a, v.head_b) for v in verdicts if v.turns is None]
    alone = _alone(strangers, fits)
    out += [
        f"{names[head]}: its picture does not show what its neighbours show (of another exposure?)"
        for head in sorted(alone)
    ]
    out += [
        f"{names[a]} and {names[b]}: their pictures do not show the same (of different exposures?)"
        for a, b in strangers
        if not {a, b} & alone
    ]
    return out


def _alone(strangers: Sequence[tuple[int, int]], fits: set[int]) -> set[int]:
    """Return the heads that fit no neighbour, although each neighbour fits another head."""
    neighbours: Mapping[int, set[int]] = {head: set() for pair in strangers for head in pair}
    for a, b in strangers:
        neighbours[a].add(b)
        neighbours[b].add(a)
    return {head for head, others in neighbours.items() if head not in fits and others <= fits}
