"""An explorer of the seams: the reader turns one head, and its picture moves off the others.

A turn moves every place of an overlap by another amount, so that no shift of the head takes it
away: the reason to refine heads by rotations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4book.typesetting.moving import Column, Explorer, Linear, Mark, Panel, Plane, Slider
from acx4book.typesetting.plain_text import shown as in_text
from acx4files.stages.synthetic import Refinement
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.frame import (
    coverage,
    footprint,
    head_from_synthetic,
    synthetic_from_head,
)

SLIDERS = tuple(
    Slider(name=f"turn {angle}", unit="°", low=-0.03, high=0.03, step=0.0005) for angle in "ωφκ"
)
STEP_DEG = 0.001
"""Turn of the head for numeric derivatives of its places."""

MOST = 16
"""Largest number of places of an overlap, spread over it."""

NODES = 60
"""Nodes of the grid for the overlaps, along the longer side of the synthetic image."""

LINES, APART_PX, HALF_PX = 7, 8.0, 20.0
"""Lines across the seam: how many, how far apart, and how long each half is, in the drawing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seam:
    """An overlap of the turned head.

    Attributes
    ----------
    head : int
        The other one.
    xy : ndarray, shape (n, 2)
        Places in the synthetic image, mm.
    """

    head: int
    xy: Array

    def line(self) -> tuple[Array, Array]:
        """Return places along the middle of the overlap, and the directions across and along it.

        Returns
        -------
        places : ndarray, shape (LINES, 2)
        axes : ndarray, shape (2, 2)
            Across, to the right or upwards, and along, a quarter turn to the left of it.
        """
        middle = self.xy.mean(axis=0)
        across = np.linalg.svd(self.xy - middle, full_matrices=False)[2][1]
        across = across * np.sign(across[np.argmax(np.abs(across))])
        along = np.array([-across[1], across[0]])
        far = (self.xy - middle) @ along
        positions = np.linspace(0.9 * far.max(), 0.9 * far.min(), LINES)
        return middle + positions[:, None] * along, np.array([across, along])


def seams(orientation: RelativeOrientation, synthetic: Camera, head: int) -> list[Seam]:
    """Return the overlaps of a head, the largest first."""
    side = max(synthetic.width_px, synthetic.height_px)
    grid = coverage(orientation, synthetic, spacing_px=max(side // NODES, 1))
    counted = [
        (int(shared.sum()), Seam(head=other, xy=_spread(grid.xy[shared])))
        for other in range(len(orientation.heads))
        if other != head and (shared := grid.seen[head] & grid.seen[other]).sum() > LINES
    ]
    return [seam for _, seam in sorted(counted, key=lambda pair: -pair[0])]


def _spread(places: Array) -> Array:
    return places[np.unique(np.linspace(0, len(places) - 1, MOST).astype(np.intp))]


def _by_turns(orientation: RelativeOrientation, head: int, xy: Array) -> Array:
    """Return the moves of a head's places in the synthetic image by turns of the head, mm per °."""
    colrow = head_from_synthetic(orientation, head, xy)
    moved = []
    for angle in range(3):
        opk = orientation.opk.copy()
        opk[head, angle] += np.radians(STEP_DEG)
        moved.append(synthetic_from_head(replace(orientation, opk=opk), head, colrow) - xy)
    return np.stack(moved, axis=-1) / STEP_DEG


def view(refinement: Refinement, synthetic: Camera, *, head: int = 1) -> Explorer | None:
    """Return the explorer; None for a head that shares no ground with another.

    Parameters
    ----------
    refinement : Refinement
    synthetic : Camera
    head : int
        The head that is turned, counted from zero; the first one is held by the refinement.
    """
    if head >= len(refinement.orientation.heads):
        return None
    of_head = seams(refinement.orientation, synthetic, head)
    return _explorer(refinement, synthetic, of_head, head) if of_head else None


def _explorer(
    refinement: Refinement, synthetic: Camera, of_head: Sequence[Seam], head: int
) -> Explorer:
    """Return the explorer, which starts at the orientation of a refinement."""
    orientation = refinement.orientation
    names = [in_text(camera.name, "terminal") for camera in orientation.heads]
    changed = np.degrees(refinement.before.opk[head] - orientation.opk[head])
    limits = [(slider.low, slider.high) for slider in SLIDERS]
    step = SLIDERS[0].step
    as_calibrated = [
        float(np.clip(round(step * round(v / step), 4), low, high))
        for v, (low, high) in zip(changed, limits, strict=True)
    ]
    moved = [_by_turns(orientation, head, seam.xy) / synthetic.pixel_mm for seam in of_head]
    mean = np.concatenate(moved).mean(axis=0)
    everywhere = dict(zip((f"with {names[seam.head]}" for seam in of_head), moved, strict=True))
    everywhere["all overlaps"] = np.concatenate(moved)
    return Explorer(
        name="explorer-turned-head",
        caption=(
            f"{names[head]} is turned from where the refinement has it. Left, the heads in the "
            f"synthetic image; arrows show how far what {names[head]} sees moves in its overlaps. "
            f"Right, {LINES} straight lines across the seam with {names[of_head[0].head]}, from "
            "one end of the overlap to the other, enlarged: the blue halves are those of "
            f"{names[head]}. The table has the RMS of these shifts, and what the best shift of the "
            "head leaves of them."
        ),
        sliders=SLIDERS,
        presets={
            **{f"only {a}": [0.02 * (i == k) for i in range(3)] for k, a in enumerate("ωφκ")},
            "as calibrated": as_calibrated,
            "refined": [0.0, 0.0, 0.0],
        },
        panels=[
            _frame(orientation, synthetic, of_head, moved, head),
            _lines(orientation, synthetic, of_head[0], head),
        ],
        columns=[
            Column(title="shift (px)", digits=2),
            Column(title="left by a shift (px)", digits=2),
        ],
        rows={name: [_rms(moves), _rms(moves - mean)] for name, moves in everywhere.items()},
    )


def _rms(moved: Array) -> Linear:
    """Return places' moves, px, as a vector whose length is the RMS of their lengths."""
    return Linear(matrix=moved.reshape(-1, 3) / np.sqrt(len(moved)))


def _frame(
    orientation: RelativeOrientation,
    synthetic: Camera,
    of_head: Sequence[Seam],
    moved: Sequence[Array],
    head: int,
) -> Panel:
    outlines = [footprint(orientation, k, per_side=6) for k in range(len(orientation.heads))]
    half = synthetic.pixel_mm * np.array([synthetic.width_px, synthetic.height_px]) / 2
    corners = np.concatenate([*outlines, [half, -half]])
    reach = 1.03 * np.nanmax(np.abs(corners), axis=0)
    size = (340.0, 300.0)
    wide = max(reach[0], reach[1] * size[0] / size[1])
    tall = wide * size[1] / size[0]
    plane = Plane(x=(-wide, wide), y=(-tall, tall), size=size)
    fixed = plane.line(half * [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], "ink", 1.4)
    for k, outline in enumerate(outlines):
        if np.all(np.isfinite(outline)):
            fixed += plane.line(outline, "blue" if k == head else "soft")
            fixed += plane.text(
                outline[:-1].mean(axis=0), in_text(orientation.heads[k].name, "terminal")
            )
    arrow = 26.0 / max(
        0.02 * np.linalg.norm(shift, axis=1).max() for shift in moved
    )  # drawing per px
    places, moves = np.concatenate([seam.xy for seam in of_head]), np.concatenate(moved)
    return Panel(
        title="the heads",
        alt="Outlines of the heads over the frame; arrows in the overlaps of the one in blue.",
        size=size,
        fixed=fixed,
        marks=[
            Mark(
                kind="arrows",
                colour="blue",
                at=plane.at(places),
                scale=(arrow, -arrow),
                response=Linear(matrix=moves.reshape(-1, 3)),
            )
        ],
    )


def _lines(orientation: RelativeOrientation, synthetic: Camera, seam: Seam, head: int) -> Panel:
    places, axes = seam.line()
    middle = np.nanmean(footprint(orientation, head)[:4], axis=0)
    side = HALF_PX if axes[0] @ (middle - seam.xy.mean(axis=0)) > 0 else -HALF_PX
    turns = _by_turns(orientation, head, places) / synthetic.pixel_mm
    moved = np.einsum("ij,njk->nik", axes, turns)  # across the seam, along it
    known = np.isfinite(moved).all(axis=(1, 2))
    high = APART_PX * (LINES - 1) / 2 + 0.7 * HALF_PX
    plane = Plane(x=(-HALF_PX, HALF_PX), y=(-high, high), size=(340.0, 300.0))
    rows = APART_PX * (np.arange(LINES)[::-1] - (LINES - 1) / 2)
    names = [in_text(orientation.heads[k].name, "terminal") for k in (seam.head, head)]
    fixed = plane.line([(0, -high), (0, high)], dash="2 3")
    fixed += "".join(plane.line([(-side, y), (0, y)], "ink", 1.6) for y in rows)
    for name, x in zip(names, (-side / 2, side / 2), strict=True):
        fixed += plane.text((x, high), name, shift=(0, 16))
    fixed += plane.line([(-HALF_PX + 2, 3 - high), (-HALF_PX + 7, 3 - high)], "ink", 2.0)
    fixed += plane.text((-HALF_PX + 4.5, 3 - high), "5 px", shift=(0, -5))
    marks = [
        Mark(
            kind="curve",
            colour="blue",
            at=plane.at(np.array([[0.0, y], [side, y]])),
            scale=plane.scale,
            response=Linear(matrix=np.concatenate([shift, shift])),
        )
        for y, shift in zip(rows[known], moved[known], strict=True)
    ]
    return Panel(
        title=f"the seam with {names[0]}",
        alt="Straight lines that break and are set off at a dashed line, the seam.",
        size=plane.size,
        fixed=fixed,
        marks=marks,
    )
