"""Held values: what the data say of parameters that an adjustment holds, and what they change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from acx4book.report.groups import qualities
from acx4book.report.material import Material
from acx4book.report.words import listed, parameter_title
from acx4book.typesetting.myst import value_and_sigma
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.least_squares.statistics import holm
from acx4lib.least_squares.verdict import DISPLACED

MOVED = 1.0
"""Move of another estimate of the mounting that matters, in its sigma: errors of sigma and a
displacement of as much are 1.4 sigma, and the stated intervals of 95 % hold the truth in 83 %."""

MOST = 2
"""Largest number of moves that are listed for a held value."""


def tested(material: Material) -> dict[str, list[str]]:
    """Return the decisive adjustments whose held values are tested, by stage."""
    names = [n for n in material.decisive if "held" in material.found.summary[n]]
    stages = dict.fromkeys(name.partition("/")[0] for name in names)
    return {stage: [n for n in names if n.startswith(f"{stage}/")] for stage in stages}


def values(material: Material, names: Sequence[str]) -> dict[str, Mapping[str, Any]]:
    """Return the held values of adjustments, by ``camera/parameter``."""
    return {key: told for n in names for key, told in material.entry(n)["held"].items()}


def joint_p(held: Mapping[str, Mapping[str, Any]]) -> float:
    """Return the smallest probability of any held value among all of them, by Holm."""
    p = [float(told["p"]) for told in held.values() if told["p"] is not None]
    return float(np.min(holm(np.array(p)))) if p else np.nan


def rejected(material: Material, names: Sequence[str]) -> list[str]:
    """Return the values that their own adjustments reject, those that cost most first."""
    found = [key for n in names for key in material.entry(n).get("held_rejected", ())]
    held = values(material, names)
    told = [key for key in found if key in held and None not in held[key].values()]
    return sorted(told, key=lambda key: -float(held[key]["cost"]))


def explains(material: Material, name: str) -> bool:
    """Tell whether one held value of a camera explains most of an adjustment's misfit.

    Then groups of observations contradict each other because of it.
    """
    entry = material.entry(name)
    excess = (float(entry["sigma0_squared"]) - 1) * int(entry["redundancy"])
    of_cameras = [key for key in rejected(material, [name]) if "/" in key]
    return any(2 * float(entry["held"][key]["cost"]) > excess for key in of_cameras[:1])


def effect(material: Material, stage: str, names: Sequence[str]) -> tuple[float, float, str]:
    """Return what freeing the rejected values changes, from which size it matters, and the unit.

    Of heads, the change in the synthetic image after what the mounting takes up, and infinite where
    it was not computed: an RMS length in the plane, as its limit is, over two coordinates. Of the
    mounting the largest move of another estimate, or of the ground.
    """
    if stage == "heads":
        by_camera = material.entry("heads/relative_orientation").get("held_effect_px")
        moved = [float(px) for px in by_camera.values()] if isinstance(by_camera, dict) else []
        return max(moved, default=np.inf), DISPLACED * np.sqrt(2) * sigma_px(material, names), "px"
    held = values(material, names)
    moves = [abs(m) for key in rejected(material, names) for m in held[key]["moves"].values()]
    told = [material.entry(n).get("held_effect_sigma") for n in names]
    ground = [float(ratio) for axes in told if isinstance(axes, list) for ratio in axes]
    by_move = max(moves, default=0.0), MOVED, "σ"
    by_ground = max(ground, default=0.0), DISPLACED, "σ on the ground"
    return max(by_move, by_ground, key=lambda of: of[0] / of[1])


def sigma_px(material: Material, names: Sequence[str]) -> float:
    """Return the a priori sigma of an image point: of the certified adjustment, else of heads."""
    points = [g for g in qualities(material) if g.group == "image points"]
    mounted = [g.sigma for g in points if g.adjustment not in names]
    return max(mounted or [g.sigma for g in points], default=np.nan)


# --- in words


def in_words(key: str, told: Mapping[str, Any]) -> str:
    """Return a held value with what the data say of it, and what it moves."""
    camera, _, parameter = key.rpartition("/")
    moves = sorted(told["moves"].items(), key=lambda of: -abs(of[1]))[:MOST]
    moved = listed([f"{parameter_title(name)} by {move:+.1f} σ" for name, move in moves])
    return (
        f"{parameter_title(parameter)}{f' of {camera}' if camera else ''} is held at "
        f"{told['value']:g}, and {value_and_sigma(told['estimate'], told['sigma'])} if it is free"
        + (f", which moves {moved}" if moved else "")
    )


def freeing(material: Material, stage: str, names: Sequence[str]) -> Iterator[str]:
    """Yield the lines of flight.toml that free held values."""
    flight, keys = material.flight, dict.fromkeys(name.rpartition("/")[2] for name in names)
    lens = [key for key in keys if key in {REPORTED[name][0] for name in INTERIOR}]
    if lens:
        estimated = flight.estimate_heads if stage == "heads" else flight.estimate_mounting
        yield _line(stage, "estimate", [*(REPORTED[name][0] for name in estimated), *lens])
    if any(key in {f"gnss_shift_{axis}_m" for axis in AXES} for key in keys):
        yield _line(stage, "gnss", [*dict.fromkeys((*flight.gnss, "shift"))])
    mounts = {part for part in flight.fix for key in keys if key.startswith(part.split("_")[0])}
    if mounts:
        yield _line(stage, "fix", [part for part in flight.fix if part not in mounts])


def _line(stage: str, key: str, names: Sequence[str]) -> str:
    quoted = ", ".join(f'"{name}"' for name in names)
    return f"[stages.{stage}] {key} = [{quoted}]"
