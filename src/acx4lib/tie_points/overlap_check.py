"""Check that the pictures of an exposure belong together: turned or exchanged, of another one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, permutations

import numpy as np
from scipy import sparse

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera
from acx4lib.least_squares import processors
from acx4lib.tie_points import search
from acx4lib.tie_points.matching import OverlapTask, TieOptions, match_overlap, noise_level
from acx4lib.tie_points.overlaps import GreyExposure, SharedWindow, reduced_exposure, shared_windows

# whether each of two pictures must be turned by 180 degrees to fit the other
Turns = tuple[bool, bool]

LEAST_CELLS = 30  # with texture; with fewer nothing is said
LEAST_SHARE = 0.05  # of these cells, that agree where two pictures show the same; of others none do
MOST_ORDERED = 4  # heads whose pictures are tried in every order
_AS_THEY_ARE: Turns = (False, False)


@dataclass(frozen=True, kw_only=True)
class _Verdict:
    """Result for the overlap of two heads.

    Attributes
    ----------
    head_a, head_b : int
    turns : set of tuple of bool
        Turns with which the pictures fit, if not as they are; empty where they never fit. Heads
        that look the same way fit with either of them turned.
    """

    head_a: int
    head_b: int
    turns: frozenset[Turns]

    def fits(self, turned: AbstractSet[int]) -> bool:
        """Tell whether the pictures fit where those of some heads are turned."""
        return (self.head_a in turned, self.head_b in turned) in self.turns


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
    right = reduced_exposure(images, orientation, synthetic, search.coarse_factor(windows))
    turned = tuple(np.ascontiguousarray(image[::-1, ::-1]) for image in right.images)
    rng = np.random.default_rng(0)  # the same images always give the same result
    noise = [noise_level(image, rng=rng) for image in images]
    names = [head.name for head in orientation.heads]
    tasks = [_task(right, orientation, synthetic, one, noise[one.head_a]) for one in windows]
    found = processors.in_order(lambda task: _verdict(task, right, turned), tasks)
    verdicts = [verdict for one in found for verdict in one]
    if _bound_together(verdicts, len(names)):
        return []
    order = _exchanged(tasks, right, least=sum(bool(v.turns) for v in verdicts))
    return _sentences_of_order(order, names) if order else _sentences(verdicts, names)


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
        shift=search.NO_SHIFT,
        cell=search.LEAST_CELL_PX,
        noise=noise,
        options=TieOptions(),
    )
    return search.coarse_task(whole, right)


def _verdict(
    task: OverlapTask, right: GreyExposure, turned: Sequence[np.ndarray]
) -> list[_Verdict]:
    """Return the result for two pictures; empty where there is too little texture."""
    a, b = task.shared.head_a, task.shared.head_b
    as_they_are = _fitting(task)
    if np.isfinite(as_they_are.shift_px):
        return [_Verdict(head_a=a, head_b=b, turns=frozenset([_AS_THEY_ARE]))]
    turns = []
    for turn_a, turn_b in [(False, True), (True, False), (True, True)]:
        images = list(right.images)
        images[a] = turned[a] if turn_a else images[a]
        images[b] = turned[b] if turn_b else images[b]
        if np.isfinite(_fitting(replace(task, images=images)).shift_px):
            turns.append((turn_a, turn_b))
    enough = turns or (as_they_are.n_textured >= LEAST_CELLS and _has_texture(task, b))
    return [_Verdict(head_a=a, head_b=b, turns=frozenset(turns))] if enough else []


def _bound_together(verdicts: Sequence[_Verdict], n_heads: int) -> bool:
    """Tell whether no picture is turned, and chains of fitting ones lead to those that do not fit.

    Infrared and visible pictures of the same ground need not fit: contrasts are inverted.
    """
    fits = [v for v in verdicts if v.fits(set())]
    ends = ([v.head_a for v in fits], [v.head_b for v in fits])
    links = sparse.coo_array((np.ones(len(fits)), ends), shape=(n_heads, n_heads))
    _, group = sparse.csgraph.connected_components(links, directed=False)
    others = [v for v in verdicts if not v.fits(set())]
    return all(not v.turns and group[v.head_a] == group[v.head_b] for v in others)


def _exchanged(tasks: Sequence[OverlapTask], right: GreyExposure, *, least: int) -> tuple[int, ...]:
    """Return whose picture fits in the place of each head; empty where no exchange explains it.

    Exchanged pictures may fit in two ways, since heads across from each other see the ground
    turned by 180 degrees. The right way needs smaller shifts.

    Parameters
    ----------
    tasks : sequence of OverlapTask
    right : GreyExposure
    least : int
        Number of overlaps that fit without an exchange, turned or not. An exchange must explain
        as many, and more than half of all.
    """
    found = cache(lambda t, i, j: _fitting(_with(tasks[t], right, (i, j))))

    def explained(order: tuple[int, ...]) -> tuple[int, float]:
        pairs = [(order[task.shared.head_a], order[task.shared.head_b]) for task in tasks]
        shifts = [found(t, *pair).shift_px for t, pair in enumerate(pairs)]
        return sum(np.isfinite(shifts)), -float(np.nansum(shifts))

    enough = max(least, len(tasks) // 2 + 1)
    for orders in _orders(right):
        best = max(orders, key=explained, default=())
        if best and explained(best)[0] >= enough:
            return best
    return ()


def _orders(right: GreyExposure) -> Iterator[list[tuple[int, ...]]]:
    """Yield the exchanges of two pictures of one size, and then, of a few, all other orders."""
    shapes = [image.shape for image in right.images]
    own = tuple(range(len(shapes)))
    swaps = [tuple({i: j, j: i}.get(k, k) for k in own) for i, j in combinations(own, 2)]
    yield [one for one in swaps if [shapes[k] for k in one] == shapes]
    if len(own) <= MOST_ORDERED:
        others = set(permutations(own)) - {own, *swaps}
        yield [one for one in sorted(others) if [shapes[k] for k in one] == shapes]


def _with(task: OverlapTask, right: GreyExposure, pictures: tuple[int, int]) -> OverlapTask:
    """Return the matching of an overlap with two other pictures in the places of its heads."""
    images = list(right.images)
    a, b = task.shared.head_a, task.shared.head_b
    images[a], images[b] = (right.images[k] for k in pictures)
    return replace(task, images=images)


@dataclass(frozen=True, kw_only=True)
class _Fitting:
    """How well two pictures fit.

    Attributes
    ----------
    n_textured : int
        Cells with texture.
    shift_px : float
        Usual shift of the points that agree; NaN where the pictures do not fit.
    """

    n_textured: int
    shift_px: float


def _fitting(task: OverlapTask) -> _Fitting:
    """Match two pictures in the places of an overlap's heads."""
    matches = match_overlap(task)
    n_textured = int(matches.counts[1])
    agree = search.consensus(matches, 2 * task.options.consensus_px)
    fits = n_textured >= LEAST_CELLS and agree.sum() > LEAST_SHARE * n_textured
    shifts = np.hypot(*(matches.colrow_b - matches.colrow_a)[agree].T)
    return _Fitting(
        n_textured=n_textured, shift_px=float(np.median(shifts)) if fits else float("nan")
    )


def _has_texture(task: OverlapTask, b: int) -> bool:
    """Tell whether the second head sees texture too: only one head may see glitter or a cloud."""
    images = list(task.images)
    shared = replace(task.shared, head_a=b, head_b=task.shared.head_a)
    counts = match_overlap(replace(task, images=images, shared=shared)).counts
    return int(counts[1]) >= LEAST_CELLS


def _sentences_of_order(order: Sequence[int], names: Sequence[str]) -> list[str]:
    """Return a sentence for two pictures that are exchanged, or one for each of several."""
    moved = [k for k, picture in enumerate(order) if picture != k]
    if len(moved) == 2:
        a, b = moved
        return [
            f"{names[a]}: its picture is exchanged with that of {names[b]}; exchange their files"
        ]
    return [
        f"{names[k]}: its picture is that of {names[order.index(k)]}, in whose place it fits"
        for k in moved
    ]


def _sentences(verdicts: Sequence[_Verdict], names: Sequence[str]) -> list[str]:
    """Return a sentence for every wrong head, and for pairs of which either may be wrong."""
    fits = {head for v in verdicts if v.turns for head in (v.head_a, v.head_b)}
    out = [
        f"{names[head]}: its picture fits its neighbours only when turned by 180 degrees; turn "
        "the file or set its mount"
        for head in sorted(_turned(verdicts, fits))
    ]
    strangers = [(v.head_a, v.head_b) for v in verdicts if not v.turns]
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


def _turned(verdicts: Sequence[_Verdict], heads: set[int]) -> set[int]:
    """Return the heads whose pictures are turned: as few as make the others fit, step by step."""
    steps = [{head} for head in sorted(heads)] + [{v.head_a, v.head_b} for v in verdicts]
    turned: set[int] = set()
    while True:
        tried = [turned ^ step for step in steps]
        best = max(tried, key=lambda those: sum(v.fits(those) for v in verdicts), default=turned)
        if sum(v.fits(best) for v in verdicts) <= sum(v.fits(turned) for v in verdicts):
            return turned
        turned = best


def _alone(strangers: Sequence[tuple[int, int]], fits: set[int]) -> set[int]:
    """Return the heads that fit no neighbour, although each neighbour fits another head."""
    neighbours: Mapping[int, set[int]] = {head: set() for pair in strangers for head in pair}
    for a, b in strangers:
        neighbours[a].add(b)
        neighbours[b].add(a)
    return {head for head, others in neighbours.items() if head not in fits and others <= fits}
