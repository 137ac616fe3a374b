"""Chapter 18, over the years: whether a camera has changed, and whether a rig is rigid."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.notebooks.simulated import read
from acx4book.typesetting import style
from acx4lib.calibration.stability import Rigidity
from acx4lib.expected import Array
from acx4lib.flight.reader import Flight
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import half, sigmas
from acx4sim.designs import acx4, single_head_plan
from acx4sim.files import SimulatedFlight, simulate_plan
from acx4sim.plan import Options, Plan

# --- Figures of the chapter: a change that hides, and false alarms


LEVEL = 0.05
EACH, HOLM, JOINT = "each at the level", "Holm", "χ² of all"
MARKS: Mapping[str, str] = {EACH: style.BRICK, HOLM: style.BLUE, JOINT: style.TEAL}

Vector = tuple[Array, Array]
"""A difference of two parameters and its covariance."""


def hidden(pair: Vector, rest: Vector, *, label: str, n_tests: int) -> Figure:
    """Draw a difference of f and lever arm z with its limits of chance.

    Parameters
    ----------
    pair : tuple of ndarray
        The difference in micrometres and millimetres, shape (2,), and its covariance.
    rest : tuple of ndarray
        The rest of both after the other parameters, likewise.
    label : str
        Names of both terms of the difference.
    n_tests : int
        Of single parameters, that share a level.

    Returns
    -------
    Figure
        Bands: of each parameter alone, at the joint level. Ellipses: of both together, and of what
        the other parameters leave of both; a dot for each.
    """
    single = statistics.norm_ppf(1 - LEVEL / n_tests / 2) * sigmas(pair[1])
    with style.applied():
        fig, ax = style.subplots(figsize=(0.7 * style.WIDTH, 3.6))
        ax.axvspan(-single[0], single[0], color=style.SHEET, alpha=0.6, lw=0)
        ax.axhspan(-single[1], single[1], color=style.SHEET, alpha=0.6, lw=0)
        for (difference, cov), colour, words in (
            (pair, style.BLUE, label),
            (rest, style.BRICK, "what the other parameters leave"),
        ):
            ax.plot(*_ellipse(cov), color=colour)
            ax.plot(*difference, "o", ms=6, color=colour, label=words)
        ax.plot([], [], "s", color=style.SHEET, ms=8, label="chance, one by one")
        ax.plot([], [], color=style.SOFT, label="chance, both together")
        ax.set(xlabel="difference of $f$ (µm)", ylabel="difference of lever arm $z$ (mm)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


def _ellipse(cov: Array) -> Array:
    """Return the ellipse that chance leaves in one of twenty cases, shape (2, n)."""
    turn = np.linspace(0, 2 * np.pi, 200)
    reach = np.sqrt(statistics.chi2_isf(LEVEL, 2))
    out: Array = reach * half(cov) @ np.array([np.cos(turn), np.sin(turn)])
    return out


def alarms(shares: Mapping[str, Array], levels: Sequence[float] | Array) -> Figure:
    """Draw the share of false alarms over the level of the test.

    Parameters
    ----------
    shares : mapping of str to ndarray, shape (n,)
        By way of testing, as `MARKS` has them.
    levels : ndarray, shape (n,)
    """
    with style.applied():
        fig, ax = style.subplots(figsize=(0.62 * style.WIDTH, 3.0))
        ax.plot(levels, levels, "--", color=style.INK, lw=0.9, label="as promised")
        for way, share in shares.items():
            ax.plot(levels, share, "o-", color=MARKS[way], ms=3, label=way)
        ax.set(xlabel="level of the test (1)", ylabel="share of comparisons with an alarm (1)")
        ax.set(xlim=(0, None), ylim=(0, 1))
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


# --- Six simulated campaigns of one camera, whose focal length follows the temperature


CAMERA, BLOCK = "CAM", "calibration"

UM_PER_DEGREE = 0.6
"""Change of the true focal length with temperature, µm per °C."""

AT_DEGREES = 15.0
"""Temperature at which the camera has the parameters of the design."""

REPAIR_DEG = (0.012, -0.008, 0.015)
"""Change of the true boresight by the repair: omega, phi, kappa."""


@dataclass(frozen=True, kw_only=True)
class Flown:
    """Date and temperature of a campaign, and whether it came after the repair."""

    date: dt.date
    temperature_c: float
    repaired: bool = False


HISTORY = (
    Flown(date=dt.date(2021, 4, 14), temperature_c=8.0),
    Flown(date=dt.date(2021, 8, 30), temperature_c=27.0),
    Flown(date=dt.date(2022, 5, 11), temperature_c=15.0),
    Flown(date=dt.date(2023, 7, 6), temperature_c=31.0),
    Flown(date=dt.date(2024, 3, 22), temperature_c=10.0, repaired=True),
    Flown(date=dt.date(2025, 8, 12), temperature_c=29.0, repaired=True),
)
BEFORE = 4
"""Campaigns before the repair."""


def flights(seed: int) -> tuple[Flight, ...]:
    """Return the flights of all campaigns of `HISTORY`, as their files say.

    Parameters
    ----------
    seed : int
        Of the first; the others follow.
    """
    return tuple(flight(seed + i, flown) for i, flown in enumerate(HISTORY))


def flight(seed: int, flown: Flown) -> Flight:
    """Return the flight of one campaign, with its date and temperature."""
    simulated = simulate_plan(plan_of(flown), seed, Options(blocks=(BLOCK,)))
    session = f"\n[session]\ndate = {flown.date}\ntemperature_c = {flown.temperature_c}\n"
    return read(replace(simulated, toml=simulated.toml + session))


def plan_of(flown: Flown) -> Plan:
    """Return the plan of the design with the camera as it is at a campaign."""
    plan = single_head_plan()
    camera = plan.cameras[CAMERA]
    warm = UM_PER_DEGREE / 1000 * (flown.temperature_c - AT_DEGREES)
    turned = np.add(camera.boresight_deg, REPAIR_DEG if flown.repaired else (0.0, 0.0, 0.0))
    omega, phi, kappa = turned.tolist()
    then = replace(camera, f_mm=camera.f_mm + warm, boresight_deg=(omega, phi, kappa))
    return replace(plan, cameras={CAMERA: then})


# --- A simulated rig of which one head turns at one exposure, by less than a pixel


HEAD, EXPOSURE, ARCSEC = "CAM3", "H2-04", 10.0
"""The head that turns about its own y axis, the exposure, and the angle."""

POINTS = "heads/image_points.csv"


def flown(seed: int) -> SimulatedFlight:
    """Return the heads' block of the paper's flight; the rig is rigid."""
    return acx4(seed=seed, options=Options(blocks=("heads",)))


def turning(flight: SimulatedFlight) -> SimulatedFlight:
    """Return the flight with the head turned at the exposure.

    A turn by a small angle about the camera's y axis moves a point by f + x²/f along x and by x y/f
    along y, times the angle, x and y counted from the principal point.
    """
    camera, table = flight.plan.cameras[HEAD], flight.tables[POINTS].copy()
    images = flight.tables["heads/images.csv"]
    names = images[(images["camera"] == HEAD) & (images["exposure"] == EXPOSURE)]["image"]
    rows = table["image"].isin(names)
    f_px = camera.f_mm / camera.pixel_um * 1000
    x = table.loc[rows, "col_px"] - (camera.width_px - 1) / 2
    y = (camera.height_px - 1) / 2 - table.loc[rows, "row_px"]
    angle = np.radians(ARCSEC / 3600)
    table.loc[rows, "col_px"] += angle * (f_px + x**2 / f_px)
    table.loc[rows, "row_px"] -= angle * x * y / f_px
    return replace(flight, tables={**flight.tables, POINTS: table})


def planted(found: Rigidity) -> pd.Series:
    """Return the test of the exposure where the head turned, with the estimated turn.

    Returns
    -------
    Series
        p_joint, turn_arcsec, sigma_arcsec (about the head's y axis).
    """
    exposure, head = found.exposures.index(EXPOSURE), found.heads.index(HEAD)
    arcsec = 3600 * np.degrees([found.turns[exposure, head, 1], found.sigma[exposure, head, 1]])
    return pd.Series(
        [found.p_joint[exposure], *arcsec], index=["p_joint", "turn_arcsec", "sigma_arcsec"]
    )
