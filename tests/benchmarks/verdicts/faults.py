"""Flights of five plans, clean or with one fault of a chosen size.

What a plan declares of a mounting with a sigma is drawn about its true value, a new one for every
flight: that is what a sigma promises.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning import plan as plans
from acx4book.planning.flown import simulate
from acx4lib.geometry.frames import exp, opk_from_rotation, rotation_from_opk
from acx4sim.designs import DESIGNS
from acx4sim.files import SimulatedFlight
from acx4sim.plan import Options, SlowErrors

FOLDER = Path(__file__).parent / "plans"
PLANS = ("two-heights-crossing", "one-height", "flat", "oblique-heads", "no-control")
"""In the order of their seeds."""

DECLARED = ("flat", "oblique-heads")
"""Plans that declare a lever arm with its sigma."""

UNDECLARED = tuple(plan for plan in PLANS if plan not in DECLARED)

TRAJECTORY, POINTS = "calibration/trajectory.csv", "calibration/image_points.csv"
VALIDATED = "validation/trajectory.csv"
SURVEYED = ("control_points.csv", "validation/control_points.csv")
LEVER = ("lever_x_m", "lever_y_m", "lever_z_m")
MOUNT = ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg")

Values = dict[str, Any]
Planted = tuple[str, str, str]
"""Kind, image or exposure, and point of a gross error, as in rejected.csv."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One kind of fault.

    Attributes
    ----------
    guess : float or mapping of str to float
        A size that is found often, in general or by plan: where the search for the size begins.
    least : float
        The size at which there is no fault: one for a factor.
    plans : tuple of str
        In whose flights it can occur.
    options : callable
        What the simulator does differently.
    makes : callable
        Changes a flight's tables; returns gross errors that it planted.
    declares : callable
        Changes the values of the plan before the flight.
    known : tuple of str
        Plans for which the guess is not a guess: unknowns take the fault up, so that no size is
        found, or another theory than that of a test says which one is.
    groups : tuple of str
        Groups of observations whose noise becomes larger, as tests of sigma name them.
    """

    guess: float | Mapping[str, float]
    least: float = 0.0
    plans: tuple[str, ...] = PLANS
    options: Callable[[float], Options] = lambda _: Options()
    makes: Callable[[Flown], list[Planted]] = lambda _: []
    declares: Callable[[Values, float], None] = lambda *_: None
    known: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()

    @property
    def scales(self) -> bool:
        """Whether the fault makes noise larger, in the place of a shift."""
        return self.least == 1.0

    def begin(self, plan: str) -> float:
        """Return the guess for a plan."""
        return self.guess if isinstance(self.guess, int | float) else self.guess[plan]


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A flight whose tables may be changed.

    Attributes
    ----------
    tables : dict of str to DataFrame
    size : float
        Of the fault.
    rng : Generator
    again : callable
        Returns the tables of the same flight, flown with other options.
    """

    tables: dict[str, pd.DataFrame]
    size: float
    rng: np.random.Generator
    again: Callable[[Options], dict[str, pd.DataFrame]]


def fly(
    plan: str, seed: int, fault: str = "", size: float = 0.0
) -> tuple[SimulatedFlight, list[Planted]]:
    """Return a flight with its fault, and the gross errors that were planted.

    Parameters
    ----------
    plan : str
        Of `PLANS` or `HELD`.
    seed : int
    fault : str
        Of `FAULTS` or `SLOW`; empty for a clean flight.
    size : float
    """
    if plan in HELD:
        return holding(plan, seed, size), []
    of = {**FAULTS, **SLOW}[fault] if fault else Fault(guess=0.0)
    values = tomllib.loads((FOLDER / f"{plan}.toml").read_text(encoding="utf-8"))
    rng = np.random.default_rng([seed, 1])
    declare(values, rng)
    of.declares(values, size)
    planned = plans.from_values(values)

    def again(options: Options) -> dict[str, pd.DataFrame]:
        return {**simulate(planned, seed=seed, options=options).tables}

    clean = simulate(planned, seed=seed, options=of.options(size))
    tables = {path: table.copy() for path, table in clean.tables.items()}
    planted = of.makes(Flown(tables=tables, size=size, rng=rng, again=again))
    return replace(clean, tables=tables), planted


def holding(design: str, seed: int, off_mm: float) -> SimulatedFlight:
    """Return a flight of a design, with a focal length that the mounting holds at a wrong value.

    Parameters
    ----------
    design : str
        Of `HELD`.
    seed : int
    off_mm : float
        Of the focal length; zero leaves the flight as it is.
    """
    flight = DESIGNS[design](seed=seed)
    if not off_mm:
        return flight
    wrong = re.sub(r"(?<=focal_mm = )\S+", lambda f: f"{float(f[0]) + off_mm}", flight.toml)
    return replace(flight, toml=wrong.replace('estimate = ["f_mm", ', "estimate = ["))


def declare(values: Values, rng: np.random.Generator) -> None:
    """Write declared mountings about their true values, with errors of the declared sigma."""
    for name, camera in values["cameras"].items():
        true = {**camera, **values.get("truth", {}).get(name, {})}
        if "lever_sigma_m" in camera:
            error = camera["lever_sigma_m"] * rng.standard_normal(3)
            camera |= {k: true.get(k, 0.0) + float(e) for k, e in zip(LEVER, error, strict=True)}
        if "mount_sigma_deg" in camera:
            opk = np.radians([true.get(key, 0.0) for key in MOUNT])
            turn = np.radians(camera["mount_sigma_deg"]) * rng.standard_normal(3)
            R = exp(turn[None])[0] @ rotation_from_opk(opk[None])[0]
            camera |= dict(
                zip(MOUNT, np.degrees(opk_from_rotation(R[None])[0]).tolist(), strict=True)
            )


# --- what goes wrong -------------------------------------------------------------------------


def _stepping(flown: Flown) -> list[Planted]:
    """Turn the camera about the body's x axis before the second half of the strips."""
    table = flown.tables[TRAJECTORY]
    images = flown.tables["calibration/images.csv"].drop_duplicates("exposure")
    strips = images.set_index("exposure")["strip"].reindex(table["exposure"])
    numbers = pd.factorize(strips)[0]
    # recorded with the old boresight, the attitude is off by the step; roll is about x, the last
    table.loc[numbers > numbers.max() // 2, "roll_deg"] += flown.size
    return []


def _gross(flown: Flown) -> list[Planted]:
    """Plant single gross errors of the calibration: so many times what is just found."""
    return [
        *_off_in_image(flown, 2.0),
        *_off_in_height(flown, 0.16),
        *(_off_in_control(flown, 0.16) if len(flown.tables[SURVEYED[0]]) else []),
    ]


def _off_in_image(flown: Flown, size_px: float) -> list[Planted]:
    """Move one coordinate of one measurement of a tie point."""
    table = flown.tables[POINTS]
    row = flown.rng.choice(np.flatnonzero(table["point"].str.startswith("T")))
    name = flown.rng.choice(["col_px", "row_px"])
    table.loc[row, name] += flown.size * size_px * flown.rng.choice([-1.0, 1.0])
    return [("image_point", table.loc[row, "image"], table.loc[row, "point"])]


def _off_in_height(flown: Flown, size_m: float) -> list[Planted]:
    """Move the height of one recorded position."""
    table = flown.tables[TRAJECTORY]
    row = flown.rng.integers(len(table))
    table.loc[row, "height_m"] += flown.size * size_m * flown.rng.choice([-1.0, 1.0])
    return [("gnss", table.loc[row, "exposure"], "")]


def _off_in_control(flown: Flown, size_m: float) -> list[Planted]:
    """Move the height of one control point."""
    table = flown.tables[SURVEYED[0]]
    row = flown.rng.integers(len(table))
    table.loc[row, "height_m"] += flown.size * size_m * flown.rng.choice([-1.0, 1.0])
    return [("control_point", "", table.loc[row, "point"])]


def _late(flown: Flown) -> list[Planted]:
    """Record the positions of the calibration late, and those of the validation in time."""
    late = flown.again(Options(gnss_delay_s=flown.size))
    flown.tables[TRAJECTORY] = late[TRAJECTORY]
    return []


def _surveyed_off(column: str) -> Callable[[Flown], list[Planted]]:
    def makes(flown: Flown) -> list[Planted]:
        for path in SURVEYED:
            if path in flown.tables:
                flown.tables[path][column] += flown.size
        return []

    return makes


def _lever_off(values: Values, size: float) -> None:
    """Declare the lever arms' z wrongly."""
    for camera in values["cameras"].values():
        camera["lever_z_m"] += size


def _slowly(share: float) -> Options:
    return Options(slow_errors=SlowErrors(gnss=share, attitude=share))


def _slow_validation(flown: Flown) -> list[Planted]:
    """Take the trajectory of the validation from a flight whose errors change slowly."""
    flown.tables[VALIDATED] = flown.again(_slowly(flown.size))[VALIDATED]
    return []


def _correlated(values: Values, share: float) -> None:
    """Declare that errors change slowly; the simulator then lets them."""
    of = SlowErrors(gnss=share, attitude=share)
    values["apriori"] |= {
        "gnss_correlated_share": share,
        "gnss_correlation_s": of.gnss_constant_s,
        "attitude_correlated_share": share,
        "attitude_correlation_s": of.attitude_constant_s,
    }


FAULTS: Mapping[str, Fault] = {
    "step": Fault(guess=0.012, makes=_stepping),
    "sigma of image points": Fault(
        guess=1.115,
        least=1.0,
        options=lambda size: Options(image_noise=size),
        known=PLANS,  # known to a hundredth; a report fails from a tenth on
    ),
    "sigma of GNSS": Fault(
        guess=1.5,
        least=1.0,
        options=lambda size: Options(gnss_noise=size),
        groups=("GNSS, plan", "GNSS, height"),
    ),
    "sigma of attitudes": Fault(
        guess=1.35,
        least=1.0,
        options=lambda size: Options(attitude_noise=size),
        groups=("roll and pitch", "heading"),
    ),
    "gross errors": Fault(guess=1.0, makes=_gross, known=PLANS),
    "delay": Fault(guess=0.0015, makes=_late),
    "delay in both": Fault(
        guess=dict(zip(PLANS, (0.005, 0.005, 0.003, 0.003, 0.005), strict=True)),
        options=lambda size: Options(gnss_delay_s=size),
        known=UNDECLARED,
    ),
    "lever arm": Fault(guess=0.15, declares=_lever_off, plans=DECLARED),
    "datum in plan": Fault(guess=0.07, makes=_surveyed_off("east_m")),
    "datum in height": Fault(
        guess=dict(zip(PLANS, (0.5, 0.5, 0.15, 0.2, 1.5), strict=True)),
        makes=_surveyed_off("height_m"),
        known=PLANS[:2],
    ),
}
"""By their names in the tables. Sizes are in degrees, s and m, and factors: of sigma, and of the
gross errors that `acx4 plan` says are just found."""


SLOW: Mapping[str, Fault] = {
    "declared": Fault(guess=0.95, declares=_correlated),
    "not declared": Fault(guess=0.95, options=_slowly),
    "not declared, in the validation alone": Fault(guess=0.95, makes=_slow_validation),
}
"""Trajectories whose errors change slowly, with the share of each sigma that does."""

HELD: Mapping[str, float] = {"single-head": 0.4, "acx4": 0.0}
"""Designs of flights whose adjustments hold a wrong focal length, and by how many mm that of the
mounting is off: the heads of acx4 hold theirs at the value that the paper states."""
