"""What a simulated flight was given, as a page of the book."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from acx4book.pages import chosen
from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, UNITS, with_unit
from acx4book.typesetting.myst import myst_table
from acx4book.typesetting.plain_text import shown
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight

Truth = Mapping[str, Any]
"""The content of a flight's ``.truth.json``."""

MOUNT = tuple(f"lever_{axis}_m" for axis in "xyz")
BORESIGHT = tuple(f"boresight_{angle}_deg" for angle in ("omega", "phi", "kappa"))
SHOWN = ("f_mm", "xp_mm", "yp_mm", *MOUNT, *BORESIGHT)
DECIMALS = {"mm": 4, "m": 3, "deg": 6}


def page(flight: Flight, truth: Truth | None) -> str:
    """Return the true values and the noise of a flight as MyST text.

    Parameters
    ----------
    flight : Flight
    truth : mapping or None
        None for a flight that was not simulated.
    """
    if truth is None:
        return (
            f"The flight *{shown(flight.name)}* has no truth beside it: it was measured, or comes "
            "from elsewhere. Nothing is known of it but its tables.\n"
        )
    parts = [
        f"The flight *{shown(flight.name)}* was made by the simulator with the seed "
        f"{truth['seed']}: exact geometry on the ellipsoid, over ground with relief, by code that "
        "shares nothing with the estimator. Its true values lie beside it in a file that no "
        "estimation reads.",
        myst_table(_cameras(truth), "True values of the cameras", name="tab-truth"),
        _of_the_paper(flight, truth) if printed.applies(flight) else "",
        myst_table(_noise(flight), "Noise of the measurements", name="tab-noise"),
        chosen.page(flight, truth) if printed.applies(flight) else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _cameras(truth: Truth) -> pd.DataFrame:
    """Return a row for each true parameter, a column for each camera."""
    cameras = truth["cameras"]
    rows = []
    for name in SHOWN:
        unit = name.rpartition("_")[2]
        true = [f"{values[name]:.{DECIMALS[unit]}f}" for values in cameras.values()]
        rows.append([with_unit(LABELS[name], unit), *true])
    return pd.DataFrame(rows, columns=["Parameter", *cameras])  # a camera has any name


def _of_the_paper(flight: Flight, truth: Truth) -> str:
    """Say which true values are the paper's, and which are not."""
    levers = np.array([[truth["cameras"][h][name] for name in MOUNT] for h in printed.HEADS])
    apart = np.ptp(levers, axis=0).max()
    held, first = flight.cameras["CAM1"].interior.f, truth["cameras"]["CAM1"]["f_mm"]
    return (
        f"{_synthetic_camera(flight, truth)} Table 1 does not print the true values of the heads, "
        f"but the results of adjustments that hold the focal length at {held:g} mm. The true "
        "angles and interior orientation are therefore such that exact data, adjusted in that way, "
        "give Table 1's $\\omega$, $\\varphi$, $\\kappa$, $x_p$, $y_p$, $k_1$, $p_1$, $p_2$ and "
        "$Z_c$. $Z_c$ tells the ratios of the focal lengths only; that of the first head, "
        f"{first:.4f} mm, follows from Table 3: the calibration block, measured in these heads, "
        "carried into the synthetic image and adjusted in a single step, gives the $f$ printed "
        "there. $X_c$ and $Y_c$ of Table 1 would put the heads a metre apart and were not given: "
        f"here the heads sit in a square of {apart:.2f} m around the synthetic camera."
    )


def _synthetic_camera(flight: Flight, truth: Truth) -> str:
    """Say where the synthetic camera comes from."""
    if "SYN" not in truth["cameras"]:
        angles = np.degrees(flight.cameras["SYN"].T_b_c.opk)
        mount = [printed.value(3, name, "single_step") for name in BORESIGHT]
        same = "is" if np.allclose(angles, mount, atol=1e-9) else "is not"
        return (
            "The synthetic camera is made of the heads and has no true values of its own; the "
            f"mount that flight.toml declares for it {same} the boresight of the paper's Table 3."
        )
    given = [
        name
        for name, value in truth["cameras"]["SYN"].items()
        if value == printed.value(3, name, "single_step")
    ]
    return (
        f"The synthetic camera's {len(given)} values are those that the paper's Table 3 prints for "
        "the single-step method; it is ideal, and not made of the heads."
    )


def _noise(flight: Flight) -> pd.DataFrame:
    """Return the standard deviations that noise was drawn with, by block."""
    return pd.DataFrame([{"Block": name, **_sigmas(b)} for name, b in flight.blocks.items()])


def _sigmas(block: Block) -> dict[str, str]:
    surveyed = np.concatenate([block.control.sigma_m, block.check.sigma_m])
    trajectory = block.trajectory
    return {
        "Image points (px)": _range(block.image_points.sigma_px),
        "Survey: plan, height (m)": _plan_height(surveyed),
        "GNSS: plan, height (m)": _plan_height(trajectory.sigma_position),
        f"Roll and pitch, heading ({UNITS['deg']})": _plan_height(
            np.degrees(trajectory.sigma_attitude)
        ),
    }


def _range(values: Array) -> str:
    low, high = (f"{value:g}" for value in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def _plan_height(sigma: Array) -> str:
    """Return the median of the first two columns and of the third."""
    if not len(sigma):
        return ""
    plan, height = np.median(sigma[:, :2]), np.median(sigma[:, 2])
    return f"{plan:.3g}, {height:.3g}"
