"""Tables and sentences of the rig: the heads together beside the heads one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.rig.deformations import Deformation
from acx4book.chapters.beyond.rig.one_by_one import ONE_BY_ONE, RIG, UNSHARED, WITH_F, gains
from acx4book.typesetting.labels import LABELS, TITLES, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import Camera
from acx4lib.results.files.schemas import RELATIVE
from acx4lib.results.rows import orientation_parameters
from acx4lib.stages.rig import RigStage

COLUMNS = {ONE_BY_ONE: "One by one", WITH_F: Markup("One by one, $f$ estimated"), RIG: "Rig"}
"""The ways to orient the heads that are set beside each other, and their headings."""


# --- tables ----------------------------------------------------------------------------------


def quality(stage: RigStage) -> pd.DataFrame:
    """Return how the adjustment of all heads went."""
    if stage.rig is None:
        return pd.DataFrame([{"Method": "none could be adjusted"}])
    solution, bundle = stage.rig.bundle.solution, stage.rig.bundle
    row = {
        "Method": TITLES["rig"],
        "Observations": solution.n_observations,
        "Unknowns": solution.n_unknowns,
        "Redundancy": solution.redundancy,
        "Variance of unit weight": solution.sigma0_sq,
        "p of χ²": solution.chi_square_p,
        "Rejected": len(bundle.rejected),
        "Left out": sum(bundle.network.left_out.values()),
    }
    return pd.DataFrame([row])


def calibration(stage: RigStage, truth: Sequence[Camera]) -> pd.DataFrame:
    """Return what the rig says of every head, and how far it is from the truth where known.

    Parameters
    ----------
    stage : RigStage
    truth : sequence of Camera
        The heads as they are; empty where nobody knows.
    """
    if stage.rig is None:
        return pd.DataFrame([{"Parameter": "none could be estimated"}])
    listed = parameters(stage.rig.calibration)
    true = _true_values(stage, truth)
    heads = list(dict.fromkeys(p.camera for p in listed))
    rows = []
    for name in dict.fromkeys(p.name for p in listed):
        mine = {p.camera: p for p in listed if p.name == name}
        unit = next(iter(mine.values())).unit
        found = {head: value_and_sigma(p.value, p.sigma) for head, p in mine.items()}
        row: list[object] = [with_unit(LABELS[name], unit), *(found.get(head) for head in heads)]
        if true:
            far = max(abs(p.value - true[head, name]) / p.sigma for head, p in mine.items())
            row.append(f"{far:.1f}")
        rows.append(row)
    ending = ["Farthest from the truth (σ)"] if true else []
    return pd.DataFrame(rows, columns=["Parameter", *heads, *ending])  # heads have any name


def _true_values(stage: RigStage, truth: Sequence[Camera]) -> dict[tuple[str, str], float]:
    """Return the true parameters by camera and name, of all that the rig estimates."""
    if not truth or stage.rig is None:
        return {}
    exact = replace(stage.rig.calibration, cameras=tuple(truth))
    return {(p.camera, p.name): p.value for p in parameters(exact)}


def orientation(ways: Mapping[str, RelativeOrientation]) -> pd.DataFrame:
    """Return the relative orientation, heads one by one beside the rig, and what it gains."""
    if not {ONE_BY_ONE, RIG} <= set(ways):
        return pd.DataFrame([{"Parameter": "the heads are not oriented in both ways"}])
    shown = [title for title in ways if title in COLUMNS]
    listed = {title: orientation_parameters(ways[title]) for title in shown}
    gain = gains(ways[ONE_BY_ONE], ways[RIG]).ravel()
    order = sorted(range(len(gain)), key=lambda i: (i % len(RELATIVE), i))
    rows = []
    for i in order:
        p = listed[RIG][i]
        row = {"Parameter": with_unit(LABELS[p.name], p.unit), "Head": p.camera}
        for title in shown:
            one = listed[title][i]
            row[COLUMNS[title]] = value_and_sigma(one.value, one.sigma)
        row["Gain"] = f"{gain[i]:.1f}" if np.isfinite(gain[i]) else ""
        rows.append(row)
    return pd.DataFrame(rows)


def image(
    flight: Flight, ways: Mapping[str, RelativeOrientation], found: Mapping[str, Deformation]
) -> pd.DataFrame:
    """Return what each way of orienting the heads leaves in the synthetic image, px."""
    synthetic = flight.synthetic_camera
    if synthetic is None or not found:
        return pd.DataFrame([{"Heads": "not oriented"}])
    pixel = synthetic.pixel_mm
    rows = []
    for title in ways:
        one = found[title]
        row = {
            "Heads": Markup(title),
            "Misfit in overlaps, predicted RMS (px)": f"{one.gap_sigma_mm / pixel:.3f}",
        }
        if np.isfinite(one.d).all():
            row["Misfit, true RMS (px)"] = f"{one.gap_rms_mm / pixel:.3f}"
        row["Largest σ over the frame (px)"] = f"{one.sigma.max() / pixel:.2f}"
        if np.isfinite(one.d).all():
            row["Largest true error (px)"] = f"{one.largest_mm / pixel:.2f}"
        rows.append(row)
    return pd.DataFrame(rows)


# --- sentences -------------------------------------------------------------------------------


def shared(stage: RigStage) -> str:
    """Say how many points heads share at an exposure."""
    counts = {k: n for k, n in enumerate(rig.heads_at_once(stage.block)) if k >= 2 and n}
    if not counts:
        return "No point is measured by two heads at one exposure."
    by_count = ", ".join(f"{n} times by {k}" for k, n in counts.items())
    lonely = len(rig.one_exposure_points(stage.block))
    text = f"A point is measured by several heads at one exposure {by_count} of them"
    if not lonely:
        return f"{text}; all of these points are in other exposures too."
    return f"{text}; {lonely} points are in that exposure only and lie as high as the nearest do."


def gain(stage: RigStage, ways: Mapping[str, RelativeOrientation]) -> str:
    """Say by how much the rig's standard deviations are smaller, and what shared points give."""
    if stage.rig is None:
        return f"There is no rig: {shown(stage.left_out)}."
    if not {ONE_BY_ONE, RIG} <= set(ways):
        return "The heads are not oriented in both ways, so there is nothing to compare."
    text = f"Against the heads one by one the standard deviations are {_by_group(ways, ONE_BY_ONE)}"
    if UNSHARED in ways:
        text += f". Shared points alone make them {_by_group(ways, UNSHARED)}"
    return f"{text} (medians of the heads)."


def _by_group(ways: Mapping[str, RelativeOrientation], title: str) -> str:
    found = gains(ways[title], ways[RIG])
    return ", ".join(
        f"{np.nanmedian(found[:, part]):.1f} times smaller for {words}"
        for part, words in (
            (slice(0, 2), "$X_c$ and $Y_c$"),
            (slice(2, 3), "$Z_c$"),
            (slice(3, 6), "the angles"),
        )
    )


def without_shared_points(flight: Flight, found: Mapping[str, Deformation]) -> str:
    """Say what it costs in the overlaps that heads share no points, px."""
    synthetic = flight.synthetic_camera
    if synthetic is None or not {UNSHARED, RIG} <= set(found):
        return "There is no rig without shared points to compare with."
    without, shared = (found[title].gap_sigma_mm / synthetic.pixel_mm for title in (UNSHARED, RIG))
    return (
        f"In the overlaps the heads misfit by {without:.3f} px without shared points and by "
        f"{shared:.3f} px with them, {without / shared:.1f} times less."
    )


def answer(
    flight: Flight,
    stage: RigStage,
    ways: Mapping[str, RelativeOrientation],
    found: Mapping[str, Deformation],
) -> str:
    """Say what one adjustment of all heads gains."""
    synthetic = flight.synthetic_camera
    if stage.rig is None or synthetic is None or not {ONE_BY_ONE, RIG} <= set(found):
        return "There is nothing to compare: the heads are not oriented in both ways."
    sigma = [1e3 * p.sigma for p in parameters(stage.rig.calibration) if p.key == "f"]
    apart, together = (found[title].sigma.max() / synthetic.pixel_mm for title in (ONE_BY_ONE, RIG))
    said = (
        f"Adjusted together, the heads are better known: standard deviations are "
        f"{_by_group(ways, ONE_BY_ONE)}. The largest standard deviation in the synthetic image "
        f"falls from {apart:.2f} to {together:.2f} px."
    )
    if not sigma:
        return said
    return (
        f"{said} The focal lengths need not be held: they come out with a standard deviation of "
        f"{min(sigma):.1f} to {max(sigma):.1f} µm, because the trajectory observes the flying "
        "height."
    )
