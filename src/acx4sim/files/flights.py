"""A flight from its plan: it is flown, points are projected and measured, tables are made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4sim.earth import Array
from acx4sim.files import csv_files as tables
from acx4sim.files.toml_files import flight_toml, truth
from acx4sim.fly import Track, fly, record, stream
from acx4sim.gross_errors import spoil
from acx4sim.observe import ground_points, measure
from acx4sim.pictures.photography import Photography, order, told
from acx4sim.plan import BlockPlan, Options, Plan, stated


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedFlight:
    """A simulated flight: its tables, its truth and its pictures.

    Attributes
    ----------
    name : str
        Name of the design.
    toml : str
        Text of flight.toml.
    tables : mapping of str to DataFrame
        The flight's tables by their path inside the flight's folder.
    truth : dict
        True values, for JSON.
    plan : Plan
        The plan that was flown.
    seed : int
        Seed of its random numbers.
    photography : Photography, optional
        Pictures to take.
    """

    name: str
    toml: str
    tables: Mapping[str, pd.DataFrame]
    truth: dict[str, Any]
    plan: Plan
    seed: int
    photography: Photography | None = None


def simulate_plan(plan: Plan, seed: int, options: Options) -> SimulatedFlight:
    """Simulate a planned flight.

    Raises
    ------
    ValueError
        For a seed that is negative or no whole number, a block that is not in the plan, or more
        tie points than a block sees.
    """
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool):
        msg = f"seed must be a whole number, got {seed!r}"
        raise ValueError(msg)
    if seed < 0:
        msg = f"seed must be zero or positive, got {seed}"
        raise ValueError(msg)
    plan = _as_asked(plan, options)
    files: dict[str, pd.DataFrame] = {}
    tracks: dict[str, Track] = {}
    recorded: dict[str, Track] = {}
    points: dict[str, Array] = {}
    for name, block in plan.blocks.items():
        tracks[name] = fly(plan, block, stream(seed, plan.draws, name, "fly"))
        path, names, x_g = _surveyed(plan, name)
        points.update(zip(names, x_g, strict=True))
        if path not in files:
            rng = stream(seed, plan.draws, path)
            own = len(plan.blocks[name].targets) > 0
            sigma_m = block.target_m if own else plan.noise.control_m
            files[path] = tables.control_points(sigma_m, names, x_g, options, rng)
        recorded[name] = record(
            tracks[name],
            plan.noise,
            options,
            white=stream(seed, plan.draws, name, "trajectory"),
            slow=stream(seed, plan.draws, name, "slow errors"),
        )
        files.update(_block_tables(plan, name, tracks[name], seed, options))
        files[f"{name}/trajectory.csv"] = tables.trajectory(plan, recorded[name])
    told = truth(plan, seed, options, tracks, points)
    if options.gross_errors is not None:
        spoiled = spoil(plan, files, recorded, options.gross_errors, seed)
        files, told["gross_errors"] = dict(spoiled.tables), spoiled.mistakes
    return SimulatedFlight(
        name=plan.name,
        toml=flight_toml(plan, options),
        tables=files,
        truth=told,
        plan=plan,
        seed=seed,
    )


def photograph(
    flight: SimulatedFlight,
    exposures: Sequence[str],
    *,
    reduce: int = 1,
    photo: str | Path | None = None,
) -> SimulatedFlight:
    """Order pictures of some exposures; they are taken when the flight is written.

    Parameters
    ----------
    flight : SimulatedFlight
        The flight.
    exposures : sequence of str
        Their names, of any block.
    reduce : int
        The pictures have 1/reduce of the size, and cover the middle of the sensors.
    photo : str or Path, optional
        File with a picture of the ground, with pixels of 12.5 cm, mirrored beyond its edges; by
        default the ground is the procedural landscape.

    Returns
    -------
    SimulatedFlight
        Its images.csv has the names of the files; its truth has the responses of the cameras.

    Raises
    ------
    ValueError
        For an unknown exposure, for no names or a text instead of names, or where `reduce` leaves
        no pixel.
    OSError
        Where the photo does not exist or cannot be read.
    """
    if isinstance(exposures, str):
        msg = f"exposures must be a sequence of names, got {exposures!r}"
        raise ValueError(msg)
    ordered = order(flight.plan, flight.seed, exposures, reduce, photo)
    return replace(
        flight,
        tables=_with_files(flight.tables, ordered),
        truth={**flight.truth, "pictures": told(ordered)},
        photography=ordered,
    )


def _with_files(
    tables: Mapping[str, pd.DataFrame], ordered: Photography
) -> dict[str, pd.DataFrame]:
    tables = dict(tables)
    for block in {at.block for at in ordered.stations}:
        files = {
            Path(path).stem: path.removeprefix(f"{block}/")
            for path, at, _ in ordered.orders()
            if at.block == block
        }
        images = tables[f"{block}/images.csv"]
        tables[f"{block}/images.csv"] = images.assign(file=images["image"].map(files).fillna(""))
    return tables


def _as_asked(plan: Plan, options: Options) -> Plan:
    """Return the plan with the blocks, the tie points and the refraction of the options."""
    wanted = tuple(plan.blocks) if options.blocks is None else options.blocks
    unknown = sorted({*wanted, *options.tie_points} - set(plan.blocks))
    if unknown or not wanted:
        msg = f"blocks {unknown or 'none'} asked for; {plan.name} has {list(plan.blocks)}"
        raise ValueError(msg)
    return replace(
        plan,
        refraction=options.refraction,
        blocks={
            name: replace(block, tie_points=options.tie_points.get(name, block.tie_points))
            for name, block in plan.blocks.items()
            if name in wanted
        },
    )


def _surveyed(plan: Plan, name: str) -> tuple[str, list[str], Array]:
    """Return file, names and true coordinates of the surveyed points of a block."""
    block = plan.blocks[name]
    if len(block.targets):
        names = [f"N{i:02d}" for i in range(1, len(block.targets) + 1)]
        return f"{name}/control_points.csv", names, ground_points(plan, block, block.targets)
    names = [f"P{i:02d}" for i in range(1, len(plan.control) + 1)]
    return "control_points.csv", names, ground_points(plan, block, plan.control)


def _block_tables(
    plan: Plan, name: str, track: Track, seed: int, options: Options
) -> dict[str, pd.DataFrame]:
    """Tabulate images and measurements of a block."""
    block = plan.blocks[name]
    _, names, x_g = _surveyed(plan, name)
    sight = measure(plan, block, track, x_g, stream(seed, plan.draws, name, "tie points"))
    rng = stream(seed, plan.draws, name, "image points")
    n_ties = sight.seen.shape[2] - len(names)
    points = _pointing(plan, block, names, n_ties, options, rng)
    images = tables.images(block, track)
    measured = tables.image_points(images["image"], points, sight, rng)
    return {f"{name}/images.csv": images, f"{name}/image_points.csv": measured}


def _pointing(
    plan: Plan,
    block: BlockPlan,
    surveyed: list[str],
    n_ties: int,
    options: Options,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Return the standard deviation of measuring each point."""
    sigma = np.full(len(surveyed) + n_ties, plan.noise.image_px)
    if len(block.targets):
        low, high = block.target_px
        sigma[: len(surveyed)] = np.clip(rng.uniform(low, high, len(surveyed)).round(1), low, high)
    points = pd.DataFrame(
        {
            "point": [*surveyed, *(f"T{i:05d}" for i in range(1, n_ties + 1))],
            "noise_px": options.image_noise * sigma,
        }
    )
    if len(block.targets):
        points["sigma_px"] = sigma * stated(options.image_noise)
    return points
