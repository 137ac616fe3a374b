"""The geometry of the synthetic image and its refinement (section 2.1, Table 2, Figure 1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.flight import Flight
from acx4lib.geometry.camera import Camera
from acx4lib.results import folder
from acx4lib.results.read_back import read_relative_orientation
from acx4lib.synthetic_image.frame import coverage

ORIENTED = "heads/relative_orientation"
NO_TIES = {"Heads": "no two of them share a tie point"}


# --- steps -----------------------------------------------------------------------------------


def synthetic_camera(flight: Flight) -> Camera:
    """Return the camera whose image the heads are put together to."""
    if flight.synthetic is None:
        msg = "flight.toml has no table [synthetic]"
        raise ValueError(msg)
    return flight.cameras[flight.synthetic.camera]


def read_heads(flight: Flight, results_path: str | Path) -> RelativeOrientation:
    """Return the oriented heads as the stage before left them.

    Raises
    ------
    FlightError
        Where that stage has not been run.
    AdjustmentError
        Where it could not orient the heads.
    """
    found = folder.read(results_path)
    reasons = folder.messages(found.summary.get(ORIENTED, {}), "left_out")
    if reasons:
        raise AdjustmentError("; ".join(reasons))
    return read_relative_orientation(found, ORIENTED, flight.cameras)


# --- tables ----------------------------------------------------------------------------------


def table_2(flight: Flight) -> pd.DataFrame:
    """Return the main parameters of the synthetic image, beside those of Table 2."""
    camera = synthetic_camera(flight)
    values = {
        "width_px": (camera.width_px, "px"),
        "height_px": (camera.height_px, "px"),
        "pixel_um": (1000 * camera.pixel_mm, "µm"),
        "width_mm": (camera.width_px * camera.pixel_mm, "mm"),
        "height_mm": (camera.height_px * camera.pixel_mm, "mm"),
        "f_mm": (camera.interior.f, "mm"),
    }
    rows = []
    for name, (value, unit) in values.items():
        row = {"Parameter": LABELS[name], "Unit": unit, "Value": f"{value:.6g}"}
        if printed.applies(flight):
            row["Printed"] = printed.printed(2, name, "SYN")
        rows.append(row)
    return pd.DataFrame(rows)


def coverage_table(flight: Flight, orientation: RelativeOrientation) -> pd.DataFrame:
    """Return which share of the synthetic image how many heads see, beside Table 1's heads."""
    synthetic = synthetic_camera(flight)
    shares = {"Share (%)": coverage(orientation, synthetic).share}
    if printed.applies(flight):
        shares["Table 1 as printed (%)"] = coverage(printed_heads(flight), synthetic).share
    cells = {name: [f"{100 * one:.2f}" for one in share] for name, share in shares.items()}
    table = pd.DataFrame(cells)
    table.insert(0, "Seen by", ["no head", "1 head", *(f"{n} heads" for n in table.index[2:])])
    return table


def printed_heads(flight: Flight) -> RelativeOrientation:
    """Return the heads of Table 1 as printed, for a flight with the paper's cameras."""
    n = len(printed.HEADS)
    return RelativeOrientation(
        heads=tuple(
            flight.cameras[name].with_interior(printed.interior(1, name)) for name in printed.HEADS
        ),
        xyz_mm=np.stack([printed.centre_mm(name) for name in printed.HEADS]),
        opk=np.stack([printed.opk(name) for name in printed.HEADS]),
        cov_joint=np.zeros((15 * n, 15 * n)),
        n_exposures=int(printed.statement("block_1_images")),
    )
