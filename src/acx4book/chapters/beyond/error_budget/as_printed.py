"""The budget of the paper's own flight, from what the paper says of its accuracies.

The rays are those of the simulated flight, whose independent block has the paper's height,
overlaps, number of targets and, nearly, number of pairs. Every standard deviation is the paper's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4book.paper import printed
from acx4lib.bundle.unknowns import Layout, layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import AXES, MOUNT, REPORTED
from acx4lib.georeferencing import budget, differences, direct
from acx4lib.georeferencing.error_sources import ErrorSources
from acx4lib.georeferencing.validation import Validation

PAPERS = "single_step"
"""The method of which the paper's numbers are used."""

NOT_PRINTED = ("b1",)
"""Parameters that the paper does not have."""

SHARED = {
    "lever arm, forward": ("lever_x", "m", 1.0),
    "lever arm, left": ("lever_y", "m", 1.0),
    "boresight ω": ("boresight_x", "°", float(np.degrees(1.0))),
    "boresight φ": ("boresight_y", "°", float(np.degrees(1.0))),
    "boresight κ": ("boresight_z", "°", float(np.degrees(1.0))),
}
"""Errors that all images share: the unknown, and the unit of a table with what one of the library's
units is in it."""


@dataclass(frozen=True, kw_only=True)
class Assumed:
    """What is assumed of the paper's flight where the paper gives a range, or nothing.

    Attributes
    ----------
    sigma_px : float
        Of a natural target in an image.
    sigma_gnss_m : float
        Of a position, each coordinate.
    """

    sigma_px: float
    sigma_gnss_m: float


def assumptions() -> tuple[Assumed, ...]:
    """Return the cases: the paper's best, poorer targets, and poorer positions as well."""
    best, worst = (printed.statement(f"gnss_{name}_m") for name in ("best", "worst"))
    half = printed.statement("synthetic_quality_px")
    return (
        Assumed(sigma_px=half, sigma_gnss_m=best),
        Assumed(sigma_px=3 * half, sigma_gnss_m=best),
        Assumed(sigma_px=3 * half, sigma_gnss_m=worst),
    )


def rms() -> Array:
    """Return the RMS that the paper prints for the single-step method, shape (3,), m."""
    return np.array([printed.value(4, f"rms_{axis}_m", PAPERS) for axis in AXES])


def sources(
    found: Validation, calibration: Calibration, assumed: Assumed
) -> tuple[ErrorSources, Layout]:
    """Return the sources of the errors of pairs of rays with the standard deviations of the paper.

    Parameters
    ----------
    found : Validation
        Its rays and pairs are used.
    calibration : Calibration
        With the standard deviations of Table 3, as `as_calibrated` returns it.
    assumed : Assumed

    Returns
    -------
    sources : ErrorSources
    layout : Layout
        Columns of the calibration, as `budget.of` takes both.
    """
    n, pairs = len(found.block.trajectory), found.pairs
    angle = np.radians(
        [printed.statement(f"{name}_deg") for name in ("roll_pitch", "roll_pitch", "heading")]
    )
    trajectory = replace(
        found.block.trajectory,
        sigma_position=np.full((n, 3), assumed.sigma_gnss_m),
        sigma_attitude=np.tile(angle, (n, 1)),
    )
    plan, height = (printed.statement(f"check_{name}_m") for name in ("horizontal", "vertical"))
    survey = np.tile([plan, plan, height], (len(found.block.check), 1))
    block = replace(
        found.block, trajectory=trajectory, check=replace(found.block.check, sigma_m=survey)
    )
    georeferenced = direct.georeference(block, calibration)
    rays = differences.rays_of_pairs(block, pairs)
    rays = replace(rays, sigma_px=np.full(len(rays.group), assumed.sigma_px))
    at = differences.differences_at(block, georeferenced, rays, pairs.point_idx, "none")
    return at.sources, georeferenced.layout


def as_calibrated(calibration: Calibration) -> Calibration:
    """Return a calibration with the standard deviations of Table 3 and no correlations.

    The paper prints no correlations.
    """
    sigma = {
        key: printed.sigma(3, REPORTED[key][0], PAPERS)
        for key in (*INTERIOR, *MOUNT)
        if key not in NOT_PRINTED
    }
    sigma |= {key: np.radians(value) for key, value in sigma.items() if key in MOUNT[3:]}
    free = tuple(key for key in INTERIOR if key in sigma)
    return Calibration(
        cameras=calibration.cameras,
        layout=layout(1, 0, free=free, free_mount=MOUNT),
        cov=np.diag([sigma[key] ** 2 for key in (*free, *MOUNT)]),
        sigma0_sq=1.0,
        open_columns=np.zeros(len(sigma), dtype=bool),
    )


def unexplained(found_rms: Array, predicted_rms: Array) -> Array:
    """Return what a budget leaves of an RMS, shape (3,), m; zero where it predicts more."""
    left: Array = np.sqrt(np.maximum(found_rms**2 - predicted_rms**2, 0.0))
    return left


# --- which error leaves heights alone ----------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Suspect:
    """An error that alone explains what the budget leaves of the printed RMS in plan.

    Attributes
    ----------
    name, unit : str
    size : float
        How large it has to be, in the unit; of random errors their standard deviation.
    rms : ndarray, shape (3,)
        What it makes of the pairs' differences: east, north, height, m.
    """

    name: str
    unit: str
    size: float
    rms: Array

    @property
    def needed(self) -> str:
        """The size with its unit, two digits."""
        gap = "" if self.unit == "°" else " "
        return f"{self.size:#.2g}{gap}{self.unit}"


def suspects(sources: ErrorSources, columns: Layout, assumed: Assumed) -> list[Suspect]:
    """Return what one error at a time does to the pairs if it alone explains what is left in plan.

    Every error is scaled until its RMS in plan is what the sources leave of the printed one.

    Parameters
    ----------
    sources, columns
        As `sources` returns them.
    assumed : Assumed
        What they are of.
    """
    split = budget.of(sources, columns).mean
    left = unexplained(rms(), np.sqrt(split.sum(axis=-1)))
    size = float(np.sum(left[:2] ** 2))
    degrees = {name: printed.statement(f"{name}_deg") for name in ("roll_pitch", "heading")}
    own = {
        "image points": (assumed.sigma_px, "px"),
        "GNSS": (assumed.sigma_gnss_m, "m"),
        "roll": (degrees["roll_pitch"], "°"),
        "pitch": (degrees["roll_pitch"], "°"),
        "heading": (degrees["heading"], "°"),
    }
    squares = [
        (name, unit, unity, split[:, budget.SOURCES.index(name)])
        for name, (unity, unit) in own.items()
    ]
    by_column = np.mean(sources.by_parameters**2, axis=0)
    squares += [
        (name, unit, unity, by_column[:, columns.mount[0][MOUNT.index(key)]])
        for name, (key, unit, unity) in SHARED.items()
    ]
    squares.append(("the targets themselves, in plan", "m", 1.0, np.array([0.5, 0.5, 0.0])))
    found_all = []
    for name, unit, unity, square in squares:
        factor = np.sqrt(size / square[:2].sum())
        found_all.append(
            Suspect(name=name, unit=unit, size=factor * unity, rms=factor * np.sqrt(square))
        )
    return found_all
