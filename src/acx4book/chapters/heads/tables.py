"""Tables of the heads that are more than a value's own: what a wrong focal length changes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.attempts import Failed
from acx4lib.calibration.heads import Heads, RelativeOrientation, above_gnss
from acx4lib.calibration.lens import corner_radius
from acx4lib.flight.reader import Flight

INTERIOR = ("f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2", "b1")

SYMBOLS = {name: LABELS[name] for name in INTERIOR} | {
    "east_m": Markup("$X_0$"),
    "north_m": Markup("$Y_0$"),
    "height_m": Markup("$Z_0$"),
    "omega_deg": Markup(r"$\omega$"),
    "phi_deg": Markup(r"$\varphi$"),
    "kappa_deg": Markup(r"$\kappa$"),
}
"""The paper's symbols of interior and exterior orientation by their names in results."""


def printed_border_px(flight: Flight) -> dict[str, float]:
    """Return Table 1's radial distortion at the corner by head, px; empty for other cameras."""
    if not printed.applies(flight):
        return {}
    cameras = [flight.cameras[name] for name in printed.HEADS]
    return {
        camera.name: printed.value(1, "k1", camera.name)
        * corner_radius(camera) ** 3
        / camera.pixel_mm
        for camera in cameras
    }


def claim(flight: Flight, statement: str) -> float | None:
    """Return a number of the paper's text; None for other cameras than the paper's."""
    return printed.statement(statement) if printed.applies(flight) else None


# --- a wrong focal length --------------------------------------------------------------------


def held(
    tried: Mapping[str, Heads],
    orientations: Mapping[str, RelativeOrientation | Failed],
    before: Heads,
) -> pd.DataFrame:
    """Return what the heads show when their focal lengths are held at other values.

    Parameters
    ----------
    tried : mapping of str to Heads
        By what is held.
    orientations : mapping of str to RelativeOrientation or Failed
        Of each.
    before : Heads
        With the focal lengths as they were.

    Returns
    -------
    DataFrame
        A row for each that has a head: the mean variance of unit weight; the RMS of all
        components of the residuals at control points; how high the cameras stand above GNSS, and
        by how much they were lifted at most; by how much the principal points moved; and the
        relative orientation.
    """
    rows = {
        title: _reaction(heads, before) | _orientation(orientations[title])
        for title, heads in tried.items()
        if heads.bundles
    }
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index.name = "held f"
    formats = {"Variance of unit weight": ".3f", "RMS at control points (mm)": ".1f"}
    heights = ("Cameras above GNSS, lowest (m)", "highest (m)", "Lifted by up to (m)")
    table.attrs["formats"] = formats | dict.fromkeys(heights, ".1f") | {MOVED: ".3f", PLACE: ".3f"}
    return table


MOVED = Markup("$x_p$, $y_p$ moved by up to (mm)")
PLACE = Markup("$X_c$, $Y_c$ up to (mm)")


def _reaction(heads: Heads, before: Heads) -> dict[str, object]:
    fits, sound = heads.bundles, before.bundles
    rise = {name: above_gnss(fit) for name, fit in fits.items()}
    xy = np.array(
        [[fit.cameras[0].interior.xp, fit.cameras[0].interior.yp] for fit in fits.values()]
    )
    xy_before = np.array(
        [[sound[name].cameras[0].interior.xp, sound[name].cameras[0].interior.yp] for name in fits]
    )
    return {
        "Variance of unit weight": variance(heads),
        "RMS at control points (mm)": 1000 * control_rms(heads),
        "Cameras above GNSS, lowest (m)": min(rise.values()),
        "highest (m)": max(rise.values()),
        "Lifted by up to (m)": max(abs(rise[name] - above_gnss(sound[name])) for name in fits),
        MOVED: np.abs(xy - xy_before).max(),
    }


def variance(heads: Heads) -> float:
    """Return the variance of unit weight, mean of the heads."""
    return float(np.mean([fit.solution.sigma0_sq for fit in heads.bundles.values()]))


def control_rms(heads: Heads) -> float:
    """Return the RMS of all components of the control points' residuals, all heads, m."""
    v = [fit.solution.group("control_point").v.ravel() for fit in heads.bundles.values()]
    squares = np.concatenate(v) ** 2
    return float(np.sqrt(squares.mean())) if len(squares) else np.nan


def _orientation(found: RelativeOrientation | Failed) -> dict[str, object]:
    if isinstance(found, Failed):
        return {}
    xyz = found.xyz_mm
    return {
        PLACE: np.abs(xyz[:, :2]).max(),
        Markup("$Z_c$ less the first head's (mm)"): ", ".join(
            f"{z:.3f}" for z in xyz[1:, 2] - xyz[0, 2]
        ),
    }


def by_wrong_lengths(reactions: pd.DataFrame) -> dict[str, float]:
    """Return what changes at most where all focal lengths are wrong, for a sentence.

    Parameters
    ----------
    reactions : DataFrame
        As `held` returns it, with a row ``unchanged``; the last row is passed over.

    Returns
    -------
    dict of str to float
        ``variance`` in per cent, ``control_mm``, ``moved_mm``, ``lifted_m``; empty where no head
        can be adjusted with its focal length unchanged.
    """
    if "unchanged" not in reactions.index:
        return {}
    right, wrong = reactions.loc["unchanged"], reactions.iloc[:-1].drop(index="unchanged")
    variances, controls = ("Variance of unit weight", "RMS at control points (mm)")
    return {
        "variance": 100 * (wrong[variances].max() / right[variances] - 1),
        "control_mm": wrong[controls].max() - right[controls],
        "moved_mm": wrong[MOVED].max(),
        "lifted_m": wrong["Lifted by up to (m)"].max(),
    }
