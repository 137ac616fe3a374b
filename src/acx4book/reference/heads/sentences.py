"""What the chapter says with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.reference.heads.parallax import BASES_M, predicted_px
from acx4book.typesetting.plain_text import shown


def chain(table: pd.DataFrame) -> str:
    """Say which pairs tie, and which chain binds all heads."""
    order = table.sort_values("share")
    least, most = order.iloc[0], order.iloc[-1]
    links = table[table["chain"]]
    weakest = links.sort_values("share").iloc[0]
    tied = int((table["ties"] > 0).sum())
    return (
        f"Of {len(table)} pairs {tied} tie. {_pair(most)} agree best: {most['share']:.0%} of the "
        f"corners with texture found their partner. {_pair(least)} agree least, {least['share']:.0%}: "
        "what is bright to one of them is dark to the other. The strongest chain that binds all "
        f"heads has {len(links)} links, {', '.join(_pair(row) for _, row in links.iterrows())}; its "
        f"weakest is {_pair(weakest)} with {weakest['share']:.0%}."
    )


def _pair(row: pd.Series) -> str:
    return f"{shown(row['head'])} with {shown(row['other'])}"


def agreement(pairs: pd.DataFrame, rotations: pd.DataFrame) -> str:
    """Say how well pairs and rotations agree with each other and with the trial."""
    trial = rotations.filter(like="minus_trial").to_numpy()
    sigma = rotations.filter(regex="[xyz]_sigma").to_numpy()
    return (
        f"All {_grouped(pairs['ties'].sum())} tie points together leave {_left_px(pairs):.2f} px in "
        "a coordinate. "
        f"The mean of a pair is {pairs['mean_px'].max():.2f} px at most, so no pair of bands pulls "
        f"in a direction of its own. From the trial the angles differ by {_rms(trial):.4f}° (RMS) "
        f"and {np.abs(trial).max():.4f}° at most. The noise of matching alone would give standard deviations of "
        f"{rotations['noise_deg'].max():.4f}° at most. Loops of pairs contradict each other by "
        f"more, since neighbouring tie points share errors; they give {sigma.max():.4f}°."
    )


def _grouped(number: float) -> str:
    return f"{int(number):,}".replace(",", " ")


def _left_px(pairs: pd.DataFrame) -> float:
    """Return the RMS of all tie points in a coordinate, px."""
    return float(np.sqrt(np.average(pairs["rms_px"] ** 2, weights=pairs["ties"])))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def readings(table: pd.DataFrame) -> str:
    """Say which readings of the factory's angles the pixels allow."""
    best, other = table["median_px"].iloc[[0, 2]]
    order = abs(table["median_px"].iloc[0] - table["median_px"].iloc[1])
    return (
        f"The pixels decide one question out of two. From head to reference the heads miss each "
        f"other by {best:.1f} px, the other way by {other:.0f} px. The order of the three rotations "
        f"changes the misfit by {order:.3f} px, far less than what parallax leaves: angles of half a "
        "degree commute as well as exactly. The order written first is that of the maker's own "
        "software."
    )


def parallax(table: pd.DataFrame) -> str:
    """Say how large the parallax should be, and what was found."""
    height, f = table["height_m"].iloc[0], table["f_px"].iloc[0]
    near, far = (predicted_px(base, height_m=height, f_px=f) for base in BASES_M)
    before, after = (table[[f"x{way}_px", f"y{way}_px"]].to_numpy() for way in ("", "_left"))
    bases = np.hypot(table["base_x_mm"], table["base_y_mm"])
    return (
        f"Predicted, for bases of {1000 * BASES_M[0]:.0f} to {1000 * BASES_M[1]:.0f} mm at "
        f"{height:.0f} m: {near:.2f} to {far:.2f} px. Found, as the RMS of a coordinate of what "
        f"rotations alone differ from the factory's: {_rms(before):.2f} px, and "
        f"{np.hypot(*before.T).max():.2f} px in the head that differs most. With the places free, "
        f"{_rms(after):.2f} px are left, and the places stand {bases.min():.0f} to "
        f"{bases.max():.0f} mm from their references, {np.median(bases):.0f} mm in the middle. So a "
        "large part of what rotations differ by is no error of the factory, but parallax; the "
        "rest, and bases that are longer than such a camera is wide, are lenses that are not quite "
        "as they were calibrated. A place and a rotation differ by a tenth of their effect, in the "
        "corners of the image; a principal point that is off by a pixel does the same."
    )


def falloff(table: pd.DataFrame) -> str:
    """Say how well the response agrees with the factory's vignetting."""
    last = table.groupby(["head", "other"], sort=False).tail(1)
    row = last.loc[last["factory"].abs().idxmax()]
    off = (table["library"] - table["factory"]).to_numpy()
    return (
        f"Where the lenses differ, it is seen: {shown(row['head'])} falls off against "
        f"{shown(row['other'])} by {row['factory']:.1f} % by the factory, {row['seen']:.1f} % at the "
        f"tie points, {row['library']:.1f} % in the library's response at a radius of "
        f"{row['radius_px']:.0f} px. Over all rings the response differs from the factory's by "
        f"{_rms(off):.1f} % (RMS). What both heads of a pair have in common no ratio can tell: most "
        "of the falloff of every lens."
    )


def five(pairs: pd.DataFrame, rotations: pd.DataFrame) -> str:
    """Say the same of the camera with five heads."""
    trial = rotations.filter(like="minus_trial").to_numpy()
    links = ", ".join(_pair(row) for _, row in pairs[pairs["chain"]].iterrows())
    return (
        f"The five heads of the older camera leave {_left_px(pairs):.2f} px; the chain is {links}. The rotations differ from the trial's by {_rms(trial):.4f}° (RMS)."
    )


def answer(pairs: pd.DataFrame, rotations: pd.DataFrame, five_rotations: pd.DataFrame) -> str:
    """Return the chapter's answer."""
    trial = np.concatenate(
        [table.filter(like="minus_trial").to_numpy() for table in (rotations, five_rotations)]
    )
    factory = rotations.filter(regex="[xy]_minus_factory").to_numpy()
    return (
        "Yes. The pictures and their metadata are enough: tie points bind heads from blue to "
        "infrared through bands that are alike, three angles a head leave "
        f"{_left_px(pairs):.2f} px in a coordinate, and an independent trial found the same angles to {_rms(trial):.4f}°. The factory's angles, "
        f"{_rms(factory):.3f}° away, are right for ground far away; at this height parallax is a "
        "part of the rotations, and whoever flies at another height needs other ones. There is no "
        "control point and no INS: how the camera sits on the aircraft these pictures do not tell."
    )
