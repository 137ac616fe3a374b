"""What was chosen for the simulated flight, since the paper does not tell it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.myst import myst_table
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4sim.designs import acx4_plan

Row = tuple[str, str, str]
"""What was chosen, its value here, and what the paper says or what comes out by it."""

BEFORE = (
    "The noise of attitude and survey, the blocks, their strips and flying heights are the paper's "
    "(sections 3.1, 3.2 and 4.3). {numref}`tab-chosen` has everything else that a number of the "
    "paper can depend on. What is marked *chosen* was set so that printed numbers come out. "
    "Their agreement is therefore no evidence. The rest are guesses or plain defaults, not tuned."
)


def page(flight: Flight, truth: Mapping[str, Any]) -> str:
    """Return everything that was chosen as MyST text.

    Parameters
    ----------
    flight : Flight
        Of the study's design.
    truth : mapping
        Its truth.
    """
    rows = [
        *(("chosen", *row) for row in _for_printed_numbers(flight, truth)),
        *(("a guess", *row) for row in _guessed(flight, truth)),
    ]
    columns = ["Kind", "What", "Here", "The paper, and what comes out by it"]
    table = pd.DataFrame(rows, columns=columns)
    return f"{BEFORE}\n\n{myst_table(table, 'What was chosen', name='tab-chosen')}"


def _for_printed_numbers(flight: Flight, truth: Mapping[str, Any]) -> list[Row]:
    """Return what was set so that printed numbers come out."""
    best, worst = (printed.statement(f"gnss_{end}_m") for end in ("best", "worst"))
    rows: list[Row] = []
    if flight.calibration is not None:
        gnss = np.median(flight.calibration.trajectory.sigma_position, axis=0)
        rows += [
            (
                "tie points of the calibration block",
                f"{_n_ties(flight.calibration)}",
                "Not told. With the next row: the standard deviations of Table 3.",
            ),
            (
                "noise of GNSS positions, plan and height",
                f"{100 * gnss[0]:g} and {100 * gnss[2]:g} cm",
                f"{best:.2f} to {worst:.2f} m, with which f and the lever arm's height could not "
                "be as precise as Table 3 has them.",
            ),
        ]
    if flight.validation is not None:
        rows += [
            (
                "places of the natural targets",
                _layout(acx4_plan().blocks["validation"].targets),
                "Shown in a small figure only. They lie where strips overlap, which gives about as "
                "many pairs as Table 4 has, and none that fails: 100 and 0 %.",
            )
        ]
    return [
        *rows,
        (
            "focal length of the first head",
            f"{truth['cameras']['CAM1']['f_mm']:.4f} mm",
            Markup("Held at another value in print. Chosen so that Table 3's $f$ comes out."),
        ),
    ]


def _guessed(flight: Flight, truth: Mapping[str, Any]) -> list[Row]:
    """Return what the paper does not tell and nothing was tuned by."""
    plan = acx4_plan()
    levers = np.array(
        [[truth["cameras"][h][f"lever_{axis}_m"] for axis in "xyz"] for h in printed.HEADS]
    )
    low, high = plan.blocks["validation"].target_px
    heads, calibration = plan.blocks["heads"], plan.blocks["calibration"]
    quality = printed.statement("synthetic_quality_px")
    return [
        (
            "noise of image points",
            f"{plan.noise.image_px:g} px",
            f"Not told of measurements; the synthetic image's residuals are {quality:g} px.",
        ),
        (
            "noise of natural targets",
            f"{low:g} to {high:g} px",
            "Not told. Natural targets are measured less well than signals.",
        ),
        (
            "tie points of every head",
            f"{heads.tie_points}",
            "Not told. Standard deviations of Table 1 depend on it.",
        ),
        (
            "ground that has tie points, heads and calibration",
            f"{_area(heads.tie_area_m)} and {_area(calibration.tie_area_m)} km",
            "Not told. It decides how many tie points the corners of the images have.",
        ),
        (
            "control field",
            _layout(plan.control),
            f"{printed.statement('field_points'):.0f} targets in a layout that is shown in a small "
            "figure only.",
        ),
        (
            "side overlap of the validation block",
            f"{100 * _side_overlap():.0f} %",
            "Not told. It decides in how many images a target is.",
        ),
        (
            "places of the heads",
            f"a square of {np.ptp(levers, axis=0).max():.2f} m",
            Markup("$X_c$ and $Y_c$ of Table 1 would put them a metre apart, and were not given."),
        ),
        (
            "axes of the lever arm",
            "forward, left, up",
            "Not told, nor whether the boresight is camera to body.",
        ),
        (
            "site, relief, refraction, seed",
            f"{plan.crs} near Curitiba, hills, {flight.refraction}, {truth['seed']}",
            "Not told.",
        ),
    ]


def _n_ties(block: Block) -> int:
    return int(np.sum(block.rays > 0)) - len(block.control) - len(block.check)


def _side_overlap() -> float:
    """Return the part of an image of the validation block that the next strip has, too."""
    first, second = acx4_plan().blocks["validation"].strips[:2]
    f, width = printed.value(3, "f_mm", "single_step"), printed.value(2, "height_mm", "SYN")
    return 1 - abs(first.left_m - second.left_m) * f / (width * first.height_m)


def _layout(places: Array) -> str:
    """Return number and extent of points on the ground."""
    extent = 1e-3 * np.ptp(places, axis=0)
    return f"{len(places)} over {extent[0]:.1f} × {extent[1]:.1f} km"


def _area(half_m: tuple[float, float]) -> str:
    return f"{2e-3 * half_m[0]:.1f} × {2e-3 * half_m[1]:.1f}"
