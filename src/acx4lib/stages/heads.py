"""Calibration and relative orientation of the heads (sections 2.1 and 4.1, Table 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from acx4lib import experiments, paper
from acx4lib.bundle import Bundle
from acx4lib.calibration import REPORTED, Parameter, from_bundle, parameters
from acx4lib.camera import Camera, distortion, xy_from_colrow
from acx4lib.correlations import interior_exterior, largest_pairs
from acx4lib.errors import AdjustmentError
from acx4lib.experiments import HeldFocalLength
from acx4lib.flight import Flight
from acx4lib.plot.heads import SYMBOLS, radial_profile
from acx4lib.records import (
    RELATIVE,
    Record,
    of_bundle,
    of_failure,
    of_left_out,
    of_relative_orientation,
)
from acx4lib.relative_orientation import (
    Heads,
    RelativeOrientation,
    calibrate_heads,
    relative_orientation,
)
from acx4lib.tables import LABELS, value_and_sigma


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadsStage:
    """The heads, calibrated each by itself and oriented to each other.

    Attributes
    ----------
    heads : Heads
    orientation : RelativeOrientation or None
    left_out : str
        Why there is no relative orientation; empty where there is one.
    """

    heads: Heads
    orientation: RelativeOrientation | None
    left_out: str = ""


# --- steps -----------------------------------------------------------------------------------


def calibrate(flight: Flight) -> Heads:
    """Adjust every head of a flight by itself.

    Parameters
    ----------
    flight : Flight
        With a block heads. Its [synthetic] says which cameras are heads; without it all of the
        block's are.
    """
    block = flight.blocks["heads"]
    present = tuple(camera.name for camera in block.cameras)
    names = flight.synthetic.heads if flight.synthetic else present
    return calibrate_heads(
        block,
        [name for name in names if name in present],
        free=flight.estimate_heads,
        refraction=flight.refraction,
    )


def orient(flight: Flight, heads: Heads) -> HeadsStage:
    """Orient the heads of a flight in the frame of its synthetic image, where that is possible.

    Parameters
    ----------
    flight : Flight
    heads : Heads
    """
    if flight.synthetic is None:
        return HeadsStage(
            heads=heads, orientation=None, left_out="flight.toml has no table [synthetic]"
        )
    missing = [name for name in flight.synthetic.heads if name not in heads.bundles]
    if missing:
        left_out = f"{', '.join(missing)} could not be adjusted"
        return HeadsStage(heads=heads, orientation=None, left_out=left_out)
    try:
        synthetic = flight.cameras[flight.synthetic.camera]
        orientation = relative_orientation(heads.bundles, synthetic)
    except AdjustmentError as error:
        return HeadsStage(heads=heads, orientation=None, left_out=str(error))
    return HeadsStage(heads=heads, orientation=orientation)


def records(stage: HeadsStage) -> list[Record]:
    """Return what the stage leaves in a results folder, failures included."""
    out = [_record(name, fit) for name, fit in stage.heads.bundles.items()]
    for name, reason in stage.heads.failures.items():
        key = f"heads/bundle/{name}"
        out.append(of_failure("heads", "bundle", f"{key}: {reason}", summary_key=key))
    if stage.orientation is None:
        out.append(of_left_out("heads", "relative_orientation", stage.left_out))
    else:
        out.append(of_relative_orientation("heads", "relative_orientation", stage.orientation))
    return out


def _record(name: str, fit: Bundle) -> Record:
    """Return the record of a head, with its largest correlations in the summary."""
    key = f"heads/bundle/{name}"
    record = of_bundle("heads", "bundle", fit, summary_key=key)
    largest: dict[str, object] = {**largest_pairs(interior_exterior(fit))}
    return replace(record, summary={key: {**record.summary[key], "largest_correlations": largest}})


def hold(flight: Flight, stage: HeadsStage, changes_mm: Sequence[float]) -> list[HeldFocalLength]:
    """Calibrate all heads again with the focal length held at other values.

    Parameters
    ----------
    flight : Flight
    stage : HeadsStage
    changes_mm : sequence of float
        Against the first calibration, the same for all heads.
    """
    n = len(stage.heads.bundles)
    return [_held(flight, stage, np.full(n, float(change))) for change in changes_mm]


def hold_last(flight: Flight, stage: HeadsStage, change_mm: float) -> HeldFocalLength:
    """Calibrate the heads again with the focal length of the last one held at another value."""
    change = np.zeros(len(stage.heads.bundles))
    change[-1:] = change_mm
    return _held(flight, stage, change)


def _held(flight: Flight, stage: HeadsStage, change_mm: np.ndarray) -> HeldFocalLength:
    synthetic = flight.cameras[flight.synthetic.camera] if flight.synthetic else None
    return experiments.held_focal_length(
        stage.heads.bundles,
        flight.estimate_heads,
        synthetic=synthetic if stage.orientation is not None else None,
        change_mm=change_mm,
    )


# --- tables ----------------------------------------------------------------------------------


def quality_table(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return how well every head was adjusted, beside the paper's variance factors."""
    rows = []
    for name, fit in stage.heads.bundles.items():
        solution = fit.solution
        row: dict[str, object] = {
            "Head": name,
            "Images": len(fit.network.block.images),
            "Measurements": len(fit.network.image_points),
            "Redundancy": solution.redundancy,
            "Variance of unit weight": solution.sigma0_sq,
            "Printed": paper.value(1, "sigma0_squared", name) if paper.applies(flight) else None,
            "Chi-square test, p": solution.chi_square_p,
            "Residuals (px)": np.sqrt(np.mean(solution.group("image_point").v ** 2)),
            "Rejected": len(fit.rejected),
            "Left out": sum(fit.network.left_out.values()),
        }
        rows.append(row)
    table = pd.DataFrame(rows)
    return table if paper.applies(flight) or table.empty else table.drop(columns="Printed")


QUALITY_FORMATS = {
    "Variance of unit weight": ".3f",
    "Chi-square test, p": ".3f",
    "Residuals (px)": ".2f",
}
"""Formats of `quality_table`."""


def interior_table(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return the first part of Table 1: the interior orientation, beside the printed one."""
    listed = [p for fit in stage.heads.bundles.values() for p in parameters(from_bundle(fit))]
    return _beside_table_1(flight, listed)


def orientation_table(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return the second part of Table 1: the relative orientation, beside the printed one."""
    return _beside_table_1(flight, _oriented(stage))


def _oriented(stage: HeadsStage) -> list[Parameter]:
    orientation = stage.orientation
    if orientation is None:
        return []
    values = np.hstack([orientation.xyz_mm, np.degrees(orientation.opk)])
    sigma = orientation.sigma * np.repeat([1.0, np.degrees(1.0)], 3)
    return [
        Parameter(
            camera=head.name,
            name=name,
            key=name,
            unit="mm" if j < 3 else "deg",
            value=float(values[k, j]),
            sigma=float(sigma[k, j]),
        )
        for k, head in enumerate(orientation.heads)
        for j, name in enumerate(RELATIVE)
    ]


def _beside_table_1(flight: Flight, listed: Sequence[Parameter]) -> pd.DataFrame:
    """Return parameters by name and head; the paper's where the flight has its cameras."""
    order = list(dict.fromkeys(p.name for p in listed))
    rows = []
    for p in sorted(listed, key=lambda p: order.index(p.name)):
        row = {
            "Parameter": LABELS[p.name],
            "Unit": p.unit,
            "Head": p.camera,
            "Value": value_and_sigma(p.value, p.sigma),
        }
        if not p.sigma > 0:
            row["Value"] = f"{p.value:.3f}"
        if paper.applies(flight):
            row |= _printed(p)
        rows.append(row)
    return pd.DataFrame(rows)


def _printed(p: Parameter) -> dict[str, str]:
    value, sigma = paper.value(1, p.name, p.camera), paper.sigma(1, p.name, p.camera)
    apart = _apart(p)
    digits = 3 if p.unit == "mm" else 4
    return {
        "Printed": value_and_sigma(value, sigma) if sigma > 0 else f"{value:.{digits}f}",
        "Apart (sigma)": f"{apart:.1f}" if np.isfinite(apart) else "",
    }


def _apart(p: Parameter) -> float:
    """Return how far a parameter is from the printed one, in combined standard deviations."""
    value, sigma = paper.value(1, p.name, p.camera), paper.sigma(1, p.name, p.camera)
    combined = float(np.hypot(p.sigma, np.nan_to_num(sigma)))
    return abs(p.value - value) / combined if combined > 0 else np.nan


def border_table(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return the distortion at the corners of every head, ours and that of Table 1, px."""
    rows = []
    for name, fit in stage.heads.bundles.items():
        _, px, sigma = radial_profile(fit)
        row = {
            "Head": name,
            "Radial at the corner (px)": f"{px[-1]:.1f} ± {sigma[-1]:.1f}",
            "With decentring, worst corner (px)": f"{_worst_corner(fit.cameras[0]):.1f}",
        }
        if paper.applies(flight):
            row["Radial, Table 1 (px)"] = f"{printed_border_px(flight)[name]:.1f}"
        rows.append(row)
    return pd.DataFrame(rows)


def _worst_corner(camera: Camera) -> float:
    """Return the distortion where it is largest among the four corners, px."""
    w, h = camera.width_px - 0.5, camera.height_px - 0.5
    corners = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
    dxy = distortion(camera.interior, xy_from_colrow(camera, corners))
    return float(np.hypot(*dxy.T).max() / camera.pixel_mm)


def printed_border_px(flight: Flight) -> dict[str, float]:
    """Return Table 1's radial distortion at the corner by head, px; empty for other cameras."""
    if not paper.applies(flight):
        return {}
    px = {}
    for name in paper.HEADS:
        camera = flight.cameras[name]
        half = 0.5 * camera.pixel_mm * camera.diagonal_px
        px[name] = paper.value(1, "k1", name) * half**3 / camera.pixel_mm
    return px


def claim(flight: Flight, statement: str) -> float | None:
    """Return a number of the paper's text; None for other cameras than the paper's."""
    return paper.statement(statement) if paper.applies(flight) else None


def held_table(stage: HeadsStage, held: Sequence[HeldFocalLength]) -> pd.DataFrame:
    """Return what the heads show when their focal lengths are held at other values.

    Parameters
    ----------
    stage : HeadsStage
    held : sequence of HeldFocalLength
    """
    return pd.DataFrame([_held_cells(stage, h) for h in held])


def _held_cells(stage: HeadsStage, held: HeldFocalLength) -> dict[str, str]:
    fits, before = held.bundles, stage.heads.bundles
    changed = [name for name, c in zip(before, held.change_mm, strict=True) if c]
    which = "all heads" if len(changed) == len(before) > 1 else ", ".join(changed)
    change = float(held.change_mm[np.argmax(np.abs(held.change_mm))]) if changed else 0.0
    moved = [
        (fits[n].cameras[0].interior.to_array() - before[n].cameras[0].interior.to_array())[1:3]
        for n in fits
    ]
    rise = list(held.above_gnss_m.values())
    cells = {
        "Held $f$": f"{which} {change:+.1f} mm" if changed else "as declared",
        "Variance of unit weight": f"{held.sigma0_sq:.3f}",
        "RMS at control points (mm)": f"{1000 * held.control_rms_m:.1f}",
        "Cameras above GNSS (m)": f"{min(rise):+.1f} to {max(rise):+.1f}",
        "$x_p$, $y_p$ moved by up to (mm)": f"{np.abs(moved).max():.3f}",
    }
    if held.orientation is not None:
        xyz = held.orientation.xyz_mm
        cells["$X_c$, $Y_c$ up to (mm)"] = f"{np.abs(xyz[:, :2]).max():.3f}"
        cells["$Z_c$ less the first head's (mm)"] = ", ".join(
            f"{z:.3f}" for z in xyz[1:, 2] - xyz[0, 2]
        )
    return cells


# --- sentences -------------------------------------------------------------------------------


def agreement(flight: Flight, stage: HeadsStage) -> str:
    """Say how the interior orientation compares with the printed one."""
    if not paper.applies(flight):
        return "The paper's Table 1 belongs to other cameras; nothing is compared with it."
    listed = [
        p
        for fit in stage.heads.bundles.values()
        for p in parameters(from_bundle(fit))
        if np.isfinite(_apart(p))
    ]
    if not listed:
        return "There is nothing to compare with the paper's Table 1."
    apart = np.array([_apart(p) for p in listed])
    worst = listed[int(apart.argmax())]
    ratio = {
        key: np.median([p.sigma / paper.sigma(1, p.name, p.camera) for p in listed if p.key == key])
        for key in dict.fromkeys(p.key for p in listed)
    }
    ratios = ", ".join(f"{value:.1f} for {LABELS[REPORTED[k][0]]}" for k, value in ratio.items())
    return (
        f"Of {len(listed)} parameters {int(np.sum(apart <= 2))} lie within two combined standard "
        f"deviations of the printed value; the farthest is {LABELS[worst.name]} of {worst.camera}, "
        f"{apart.max():.1f} off. Our standard deviations are those of the paper times {ratios} (medians "
        "of the heads)."
    )


def border(flight: Flight, stage: HeadsStage) -> str:
    """Say how large the distortion at the border is, beside the paper's statement."""
    px = [radial_profile(fit)[1][-1] for fit in stage.heads.bundles.values()]
    if not px:
        return "No head could be adjusted."
    found = f"At the corner the radial distortion is {min(px):.1f} to {max(px):.1f} px"
    if not paper.applies(flight):
        return f"{found}."
    said = paper.statement("head_border_distortion_px")
    printed = printed_border_px(flight).values()
    return (
        f"{found}. The paper's text says approximately {said:.0f} pixels; $k_1$ of its Table 1 "
        f"gives {min(printed):.1f} to {max(printed):.1f} px."
    )


def correlation(flight: Flight, stage: HeadsStage) -> str:
    """Say how large the correlations are, beside the paper's statement."""
    found = {name: interior_exterior(fit) for name, fit in stage.heads.bundles.items()}
    if not found:
        return "No head could be adjusted."
    every = np.concatenate([np.abs(c.values).ravel() for c in found.values()])
    head = max(found, key=lambda name: float(found[name].largest.max()))
    pair = next(iter(largest_pairs(found[head], n=1)))
    inner, outer = (SYMBOLS[name] for name in pair.split("/"))
    ours = (
        f"The largest correlation is {every.max():.2f}, between {inner} and {outer} of {head}; the "
        f"median of all is {np.median(every):.2f}"
    )
    bound = claim(flight, "max_correlation")
    if bound is None:
        return f"{ours}."
    return (
        f"{ours}, and {100 * np.mean(every < bound):.0f} % are below {100 * bound:.0f} %. The paper "
        f"says that all were below {100 * bound:.0f} %. With exterior orientation free and control "
        "points on the ground this cannot hold for the maximum: tilt and principal point move "
        "the image in nearly the same way."
    )


def gnss(held: Sequence[HeldFocalLength]) -> str:
    """Say which focal lengths would put the cameras at the trajectory's heights."""
    asked = experiments.asked_by_gnss(held)
    if not asked:
        return "No head could be adjusted."
    fits = held[int(np.argmin([np.abs(h.change_mm).max() for h in held]))].bundles
    each = ", ".join(f"{f:.3f} mm ({name})" for name, f in asked.items())
    declared = ", ".join(
        f"{f:g}" for f in sorted({fits[name].cameras[0].interior.f for name in asked})
    )
    slope = np.mean([_slope(held, name) for name in asked])
    return (
        f"Each 0.1 mm of focal length lifts the cameras by {0.1 * slope:.1f} m above where GNSS has "
        f"them. The cameras would stand where GNSS has them with focal lengths of {each}, instead of "
        f"{declared} mm."
    )


def _slope(held: Sequence[HeldFocalLength], name: str) -> float:
    """Return by how many m a head rises with one mm of focal length."""
    f = [h.bundles[name].cameras[0].interior.f for h in held]
    rise = [h.above_gnss_m[name] for h in held]
    return float((rise[-1] - rise[0]) / (f[-1] - f[0]))
