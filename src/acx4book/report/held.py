"""Held values: what the data say of parameters that an adjustment holds, and what they change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from acx4book.report.adjustment import decisive_qualities
from acx4book.report.markdown import listed, parameter_title
from acx4book.report.material import Material
from acx4book.typesetting.myst import value_and_sigma
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.least_squares.statistics import holm
from acx4lib.least_squares.verdict import DISPLACED

MOVED = 1.0
"""Move of another estimate of the mounting that matters, in its sigma: errors of sigma and a
displacement of as much are 1.4 sigma, and the stated intervals of 95 % hold the truth in 83 %."""

MOST = 4
"""Largest number of moves that are listed for a held value."""


def tested(material: Material) -> dict[str, list[str]]:
    """Return the decisive adjustments whose held values are tested, by stage."""
    names = [n for n in material.decisive if "held" in material.found.summary[n]]
    stages = dict.fromkeys(name.partition("/")[0] for name in names)
    return {stage: [n for n in names if n.startswith(f"{stage}/")] for stage in stages}


def values(material: Material, names: Sequence[str]) -> dict[str, Mapping[str, Any]]:
    """Return the held values of adjustments, by ``camera/parameter``."""
    return {key: told for n in names for key, told in _entry(material, n)["held"].items()}


def _entry(material: Material, name: str) -> Mapping[str, Any]:
    return material.found.summary[name]


def joint_p(held: Mapping[str, Mapping[str, Any]]) -> float:
    """Return the smallest probability of any held value among all of them, by Holm."""
    p = [float(told["p"]) for told in held.values() if told["p"] is not None]
    return float(np.min(holm(np.array(p)))) if p else np.nan


def rejected(material: Material, names: Sequence[str]) -> list[str]:
    """Return the values that their own adjustments reject, those that cost most first."""
    found = [key for n in names for key in _entry(material, n).get("held_rejected", ())]
    held = values(material, names)
    told = [key for key in found if key in held and None not in held[key].values()]
    return sorted(told, key=lambda key: -float(held[key]["cost"]))


def explains(material: Material, name: str) -> bool:
    """Tell whether one held value of a camera explains most of an adjustment's misfit.

    Then groups of observations contradict each other because of it.
    """
    entry = _entry(material, name)
    excess = (float(str(entry["sigma0_squared"])) - 1) * int(str(entry["redundancy"]))
    of_cameras = [key for key in rejected(material, [name]) if "/" in key]
    return any(2 * float(entry["held"][key]["cost"]) > excess for key in of_cameras[:1])


def effect(material: Material, stage: str, names: Sequence[str]) -> tuple[float, float, str]:
    """Return what freeing the rejected values changes, from which size it matters, and the unit.

    Of heads, the change in the synthetic image after what the mounting takes up, and infinite where
    it was not computed: an RMS length in the plane, as its limit is, over two coordinates. Of the
    mounting the largest move of another estimate, or of the ground.
    """
    if stage == "heads":
        by_camera = material.found.summary.get("heads/relative_orientation", {}).get(
            "held_effect_px"
        )
        moved = [float(px) for px in by_camera.values()] if isinstance(by_camera, dict) else []
        return max(moved, default=np.inf), DISPLACED * np.sqrt(2) * _sigma_px(material, names), "px"
    held = values(material, names)
    moves = [abs(m) for key in rejected(material, names) for m in held[key]["moves"].values()]
    by_move = max(moves, default=0.0), MOVED, "σ"
    told = [material.found.summary[n].get("held_effect_sigma") for n in names]
    ground = [float(ratio) for axes in told if isinstance(axes, list) for ratio in axes]
    by_ground = max(ground, default=0.0), DISPLACED, "σ on the ground"
    return max(by_move, by_ground, key=lambda of: of[0] / of[1])


def _sigma_px(material: Material, names: Sequence[str]) -> float:
    """Return the a priori sigma of an image point: of the certified adjustment, else of heads."""
    points = [g for g in decisive_qualities(material) if g.group.startswith("image points")]
    mounted = [g.sigma for g in points if g.adjustment not in names]
    return max(mounted or [g.sigma for g in points], default=np.nan)


# --- in words


def in_words(held: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> Markup:
    """Return held values with what the data say of them, and what they move."""
    return Markup("; ".join(_in_words(key, held[key]) for key in names))


def _in_words(key: str, told: Mapping[str, Any]) -> str:
    camera, _, parameter = key.rpartition("/")
    moves = sorted(told["moves"].items(), key=lambda of: -abs(of[1]))[:MOST]
    moved = listed([f"{shown(parameter_title(name))} by {move:+.1f} σ" for name, move in moves])
    of = f" of {shown(camera)}" if camera else ""
    return (
        f"{shown(parameter_title(parameter))}{of} is held at {told['value']:g}, and "
        f"{value_and_sigma(told['estimate'], told['sigma'])} if it is free"
        + (f", which moves {moved}" if moved else "")
    )


def freeing(material: Material, stage: str, names: Sequence[str]) -> Markup:
    """Return the lines of flight.toml that free held values, as code."""
    keys = dict.fromkeys(name.rpartition("/")[2] for name in names)
    return Markup(
        ", ".join(f"`[stages.{stage}] {line}`" for line in _lines(material, stage, [*keys]))
    )


def _lines(material: Material, stage: str, keys: Sequence[str]) -> Iterator[str]:
    flight = material.flight
    lens = [key for key in keys if key in {REPORTED[name][0] for name in INTERIOR}]
    if lens:
        estimated = flight.estimate_heads if stage == "heads" else flight.estimate_mounting
        listed_keys = [*(REPORTED[name][0] for name in estimated), *lens]
        yield f"estimate = [{', '.join(map(_quoted, listed_keys))}]"
    if any(key in {f"gnss_shift_{axis}_m" for axis in AXES} for key in keys):
        yield f"gnss = [{', '.join(map(_quoted, dict.fromkeys((*flight.gnss, 'shift'))))}]"
    mounts = {part for part in flight.fix for key in keys if key.startswith(part.split("_")[0])}
    if mounts:
        yield f"fix = [{', '.join(_quoted(part) for part in flight.fix if part not in mounts)}]"


def _quoted(name: str) -> str:
    return f'"{name}"'
