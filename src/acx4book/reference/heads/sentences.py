"""What the chapter says with its numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from acx4book.reference.heads.parallax import BASES_M, predicted_px
from acx4book.typesetting.plain_text import shown
from acx4lib.expected import Array

ROUNDED_DEG = 0.001
"""The last digit of the trial's angles."""


def chain(table: pd.DataFrame) -> str:
    """Say which pairs tie, and which chain binds all heads."""
    pairs: list[Any] = sorted(table.to_dict("records"), key=lambda pair: pair["share"])
    links = [pair for pair in pairs if pair["chain"]]
    tied = int((table["ties"] > 0).sum())
    return (
        f"Of {len(table)} pairs, {tied} tie. {_pair(pairs[-1])} agree best: "
        f"{100 * pairs[-1]['share']:.0f} % of the corners with texture found their partner. "
        f"{_pair(pairs[0])} agree least, with {100 * pairs[0]['share']:.0f} %: much of what is "
        f"bright to one is dark to the other. The strongest chain has {len(links)} links; its "
        f"weakest is {_pair(links[0])}, with {100 * links[0]['share']:.0f} %."
    )


def _pair(pair: Any) -> str:
    return f"{shown(pair['head'])} and {shown(pair['other'])}"


def agreement(pairs: pd.DataFrame, rotations: pd.DataFrame) -> str:
    """Say how well pairs and rotations agree with each other and with the trial."""
    trial, number = _less(rotations, "xyz", "trial"), f"{pairs['ties'].sum():,}"
    sigma = rotations.filter(regex="[xyz]_sigma").to_numpy()
    return (
        f"All {number} tie points together leave {_left_px(pairs):.2f} px in a "
        f"coordinate. The mean of a pair is {pairs['mean_px'].max():.2f} px at most: no pair of "
        "bands pulls in a direction of its own. From the trial the angles differ by "
        f"{_rms(trial):.4f}° (RMS), and by {np.abs(trial).max():.4f}° at most. The noise of "
        f"matching alone would make standard deviations of {rotations['noise_deg'].max():.4f}° "
        "at most. But "
        "neighbouring tie points share errors. By how much pairs contradict each other around "
        f"closed loops does not depend on that; it makes them {sigma.max():.4f}° at most.\n\n"
        f"{_tested(rotations)}"
    )


def chi_square(table: pd.DataFrame) -> tuple[float, int]:
    """Return χ² of the rotations less the trial's, and its degrees of freedom.

    By σ of the loops, and by the trial's rounding.
    """
    trial = _less(table, "xyz", "trial")
    sigma = table.filter(regex="[xyz]_sigma").to_numpy(dtype=float)
    return float(np.sum(trial**2 / (sigma**2 + ROUNDED_DEG**2 / 12))), trial.size


def _tested(table: pd.DataFrame) -> str:
    """Say whether the differences from the trial are as large as σ says."""
    chi2, dof = chi_square(table)
    return (
        "Are the differences from the trial as large as these standard deviations say? No: with "
        f"them, and with the trial's rounding to {ROUNDED_DEG:g}°, χ² of the {dof} differences is "
        f"{chi2:.0f}; they are {np.sqrt(chi2 / dof):.1f} times as large. Errors of the trial, "
        "which states none, do not stand in these standard deviations, nor does what all pairs of "
        "a head share, such as an error of its lens."
    )


def _left_px(pairs: pd.DataFrame) -> float:
    """Return the RMS of all tie points in a coordinate, px."""
    return float(np.sqrt(np.average(pairs["rms_px"] ** 2, weights=pairs["ties"])))


def _less(table: pd.DataFrame, axes: str, whose: str) -> Array:
    """Return the rotations less those of others, degrees."""
    return table.filter(regex=f"[{axes}]_minus_{whose}").to_numpy(dtype=float)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def readings(table: pd.DataFrame) -> str:
    """Say which readings of the factory's angles the pixels allow."""
    best, reversed_order, other, _ = table["median_px"].tolist()
    return (
        "The pixels decide one question of two. As rotations from head to reference the angles "
        f"leave {best:.1f} px, as rotations from reference to head {other:.0f} px. The order of "
        f"the three changes the median by {abs(best - reversed_order):.3f} px only: it hardly "
        "matters "
        "for angles of half a degree. The order in the first line is that of the maker's own "
        "software, and the one that the import takes."
    )


def parallax(table: pd.DataFrame) -> str:
    """Say how large the parallax should be, and what was found."""
    height, f = table["height_m"].iloc[0], table["f_px"].iloc[0]
    near, far = (predicted_px(base, height_m=height, f_px=f) for base in BASES_M)
    before, after = (
        table[[f"x{way}_px", f"y{way}_px"]].to_numpy(dtype=float) for way in ("", "_left")
    )
    bases = np.hypot(table["base_x_mm"], table["base_y_mm"])
    return (
        f"Predicted for bases of {1000 * BASES_M[0]:.0f} to {1000 * BASES_M[1]:.0f} mm, from "
        f"{height:.0f} m: {near:.2f} to {far:.2f} px. Found by rotations alone: {_rms(before):.2f} "
        f"px in a coordinate (RMS), and {np.hypot(*before.T).max():.2f} px in the head that "
        "differs "
        f"most. With the places free, {_rms(after):.2f} px are left, and heads stand "
        f"{bases.min():.0f} to {bases.max():.0f} mm from their references, with a median of "
        f"{np.median(bases):.0f} mm. So nearly half of what rotations alone differ by is parallax, "
        "and no error of the factory. The rest, and the longest of the bases, say that the lenses "
        "are not quite as they were calibrated: in the corners the effects of a place and of a "
        "rotation differ by a tenth of themselves, and a wrong distortion looks the same."
    )


def falloff(table: pd.DataFrame) -> str:
    """Say how well the response agrees with the factory's vignetting."""
    outer: list[Any] = table.groupby(["head", "other"], sort=False).tail(1).to_dict("records")
    ring = max(outer, key=lambda one: abs(one["factory"]))
    off = (table["library"] - table["factory"]).to_numpy(dtype=float)
    return (
        f"The largest difference of two lenses is that of {_pair(ring)}: at a radius of "
        f"{ring['radius_px']:.0f} px the first has lost {-ring['factory']:.1f} % more than the "
        f"second by the factory, {-ring['seen']:.1f} % at the tie points, "
        f"{-ring['library']:.1f} % by "
        f"the library's response. Over all rings the two differ by {_rms(off):.1f} % (RMS). "
        "What both heads of a pair have in common, most of their falloff, no ratio can tell."
    )


def five(pairs: pd.DataFrame, rotations: pd.DataFrame) -> str:
    """Say the same of the camera with five heads."""
    links = [_pair(pair) for pair in pairs[pairs["chain"]].to_dict("records")]
    return (
        f"The older camera has no angles of the factory. Its tie points leave "
        f"{_left_px(pairs):.2f} px in a coordinate; the chain is {', '.join(links[:-1])}, and "
        f"{links[-1]}. From the trial the angles differ by "
        f"{_rms(_less(rotations, 'xyz', 'trial')):.4f}° (RMS)."
    )


def answer(pairs: pd.DataFrame, rotations: pd.DataFrame, five_rotations: pd.DataFrame) -> str:
    """Return the chapter's answer."""
    trial = np.concatenate([_less(one, "xyz", "trial") for one in (rotations, five_rotations)])
    factory = _rms(_less(rotations, "xy", "factory"))
    chi2, dof = np.sum([chi_square(one) for one in (rotations, five_rotations)], axis=0)
    times = np.sqrt(chi2 / dof)
    return (
        "Yes. Bands that are alike bind all heads, from blue to infrared; three angles a head "
        f"leave {_left_px(pairs):.2f} px in a coordinate, and an independent trial found the same "
        f"angles to {_rms(trial):.4f}°, which is {times:.1f} times what σ from loops and rounding "
        f"explain. The factory's are {factory:.3f}° away, nearly half of it "
        "parallax: at another height the heads need other angles. How the camera sits on the "
        "aircraft these pictures do not tell, since they have no control point and no INS."
    )
