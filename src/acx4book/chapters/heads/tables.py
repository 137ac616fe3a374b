"""Tables of the heads: quality, Table 1, distortion at the border, a wrong focal length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from acx4book.chapters.heads.held_focal_length import HeldFocalLength
from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, value_and_sigma
from acx4book.typesetting.plain_text import Markup
from acx4lib.calibration.estimates import Parameter, from_bundle, parameters
from acx4lib.calibration.lens import corner_radius, largest_at_corners, radial_profile
from acx4lib.flight.reader import Flight
from acx4lib.results.rows import orientation_parameters
from acx4lib.stages.heads import HeadsStage

UNITS = {"deg": "°", "mm^-1": "mm⁻¹", "mm^-2": "mm⁻²", "mm^-4": "mm⁻⁴", "mm^-6": "mm⁻⁶"}
"""Units as a reader sees them."""

SYMBOLS = {
    "f_mm": "$f$",
    "xp_mm": "$x_p$",
    "yp_mm": "$y_p$",
    "east_m": "$X_0$",
    "north_m": "$Y_0$",
    "height_m": "$Z_0$",
    "omega_deg": r"$\omega$",
    "phi_deg": r"$\varphi$",
    "kappa_deg": r"$\kappa$",
    **{name: f"${name[0]}_{name[1]}$" for name in ("k1", "k2", "k3", "p1", "p2", "b1")},
}
"""The paper's symbols of parameters by their names in results."""


def quality(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return how well every head was adjusted, beside the paper's variance factors."""
    rows = []
    for name, fit in stage.heads.bundles.items():
        solution = fit.solution
        row = {
            "Head": name,
            "Measured": f"{len(fit.network.image_points)}",
            "Redundancy": f"{solution.redundancy}",
            "Variance of unit weight": f"{solution.sigma0_sq:.3f}",
        }
        if printed.applies(flight):
            row["Printed"] = printed.printed(1, "sigma0_squared", name)
        row |= {
            "p of χ²": f"{solution.chi_square_p:.3f}",
            "RMS (px)": f"{np.sqrt(np.mean(solution.group('image_point').v ** 2)):.2f}",
            "Rejected": f"{len(fit.rejected)}",
            "Left out": f"{sum(fit.network.left_out.values())}",
        }
        rows.append(row)
    return _table(rows)


def _table(rows: Sequence[Mapping[str, str]]) -> pd.DataFrame:
    """Return rows as a table; one that says so where there is none."""
    return pd.DataFrame(list(rows) or [{"Head": "none could be adjusted"}])


def interior(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return the first part of Table 1: the interior orientation, beside the printed one."""
    listed = [p for fit in stage.heads.bundles.values() for p in parameters(from_bundle(fit))]
    return _beside_table_1(flight, listed)


def orientation(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return the second part of Table 1: the relative orientation, beside the printed one."""
    return _beside_table_1(flight, oriented(stage))


def oriented(stage: HeadsStage) -> list[Parameter]:
    """Return the relative orientation as results report it; empty where there is none."""
    return orientation_parameters(stage.orientation) if stage.orientation else []


def _beside_table_1(flight: Flight, listed: Sequence[Parameter]) -> pd.DataFrame:
    """Return parameters by name and head; the paper's where the flight has its cameras."""
    order = list(dict.fromkeys(p.name for p in listed))
    rows = []
    for p in sorted(listed, key=lambda p: order.index(p.name)):
        row = {
            "Parameter": LABELS[p.name],
            "Unit": UNITS.get(p.unit, p.unit),
            "Head": p.camera,
            "Value": value_and_sigma(p.value, p.sigma),
        }
        if not p.sigma > 0:
            row["Value"] = f"{p.value:.3f}"
        if printed.applies(flight):
            row |= _printed(p)
        rows.append(row)
    return _table(rows)


def _printed(p: Parameter) -> dict[str, str]:
    far = apart(p)
    return {
        "Printed": printed.shown(1, p.name, p.camera),
        "Apart (σ)": f"{far:.1f}" if np.isfinite(far) else "",
    }


def apart(p: Parameter) -> float:
    """Return how far a parameter is from the printed one, in combined standard deviations."""
    value, sigma = printed.value(1, p.name, p.camera), printed.sigma(1, p.name, p.camera)
    combined = float(np.hypot(p.sigma, np.nan_to_num(sigma)))
    return abs(p.value - value) / combined if combined > 0 else np.nan


def border(flight: Flight, stage: HeadsStage) -> pd.DataFrame:
    """Return the distortion at the corners of every head, ours and that of Table 1, px."""
    rows = []
    for name, fit in stage.heads.bundles.items():
        _, px, sigma = radial_profile(fit)
        row = {
            "Head": name,
            "Radial at the corner (px)": Markup(f"{px[-1]:.1f} ± {sigma[-1]:.1f}"),
            "With decentring, worst corner (px)": f"{largest_at_corners(fit.cameras[0]):.1f}",
        }
        if printed.applies(flight):
            row["Radial, Table 1 (px)"] = f"{printed_border_px(flight)[name]:.1f}"
        rows.append(row)
    return _table(rows)


def printed_border_px(flight: Flight) -> dict[str, float]:
    """Return Table 1's radial distortion at the corner by head, px; empty for other cameras."""
    if not printed.applies(flight):
        return {}
    px = {}
    for name in printed.HEADS:
        camera = flight.cameras[name]
        at_corner = corner_radius(camera) ** 3 / camera.pixel_mm
        px[name] = printed.value(1, "k1", name) * at_corner
    return px


def claim(flight: Flight, statement: str) -> float | None:
    """Return a number of the paper's text; None for other cameras than the paper's."""
    return printed.statement(statement) if printed.applies(flight) else None


def held(stage: HeadsStage, tried: Sequence[HeldFocalLength]) -> pd.DataFrame:
    """Return what the heads show when their focal lengths are held at other values.

    Parameters
    ----------
    stage : HeadsStage
    tried : sequence of HeldFocalLength
    """
    return _table([_held_cells(stage, one) for one in tried if one.bundles])


def _held_cells(stage: HeadsStage, one: HeldFocalLength) -> dict[str, str]:
    fits, before = one.bundles, stage.heads.bundles
    changed = [name for name, c in zip(before, one.change_mm, strict=True) if c]
    which = "all heads" if len(changed) == len(before) > 1 else ", ".join(changed)
    change = float(one.change_mm[np.argmax(np.abs(one.change_mm))]) if changed else 0.0
    moved = [
        (fits[n].cameras[0].interior.to_array() - before[n].cameras[0].interior.to_array())[1:3]
        for n in fits
    ]
    rise = list(one.above_gnss_m.values())
    cells = {
        Markup("Held $f$"): f"{which} {change:+.1f} mm" if changed else "unchanged",
        "Variance of unit weight": f"{one.sigma0_sq:.3f}",
        "RMS at control points (mm)": f"{1000 * one.control_rms_m:.1f}",
        "Cameras above GNSS (m)": f"{min(rise):+.1f} to {max(rise):+.1f}",
        Markup("$x_p$, $y_p$ moved by up to (mm)"): f"{np.abs(moved).max():.3f}",
    }
    if one.orientation is not None:
        xyz = one.orientation.xyz_mm
        cells[Markup("$X_c$, $Y_c$ up to (mm)")] = f"{np.abs(xyz[:, :2]).max():.3f}"
        cells[Markup("$Z_c$ less the first head's (mm)")] = ", ".join(
            f"{z:.3f}" for z in xyz[1:, 2] - xyz[0, 2]
        )
    return cells
