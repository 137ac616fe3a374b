"""Simulated flights by the name of a design, or by the file of a plan."""

from __future__ import annotations

from pathlib import Path

from acx4book.notebooks.simulated import to_simulator
from acx4lib.planning import text
from acx4sim.designs import DESIGNS
from acx4sim.files.flights import SimulatedFlight
from acx4sim.plan import Options


def is_plan(name: str) -> bool:
    """Tell whether a name is that of a plan's file."""
    return Path(name).suffix == ".toml"


def check(name: str) -> None:
    """Check that a name is of a design, or of a plan without faults.

    Raises
    ------
    FlightError
        Where a plan is not there or has faults, a line each.
    ValueError
        Where there is no such design.
    """
    if is_plan(name):
        text.read(name)
    elif name not in DESIGNS:
        msg = f"unknown flight {name!r}; known: {', '.join(DESIGNS)}; a plan's name ends in .toml"
        raise ValueError(msg)


def fly(name: str, *, seed: int, options: Options | None = None) -> SimulatedFlight:
    """Return the flight of a design, or of the plan in a file.

    Parameters
    ----------
    name : str
        Of a design of the simulator, or a path that ends in ``.toml``.
    seed : int
    options : Options, optional
        As `to_simulator.simulate` takes them.

    Raises
    ------
    FlightError
        Where a plan has faults, a line each.
    ValueError
        For an unknown name, for refraction by an option where a plan has none, or where the
        simulator cannot do what a plan asks for.
    """
    options = options or Options()
    if not is_plan(name):
        check(name)
        return DESIGNS[name](seed=seed, options=options)
    plan = text.read(name)
    if options.refraction == "standard" and plan.setup.refraction == "none":
        msg = 'refraction by an option is for designs; in a plan write refraction = "standard"'
        raise ValueError(msg)
    return to_simulator.simulate(plan, seed=seed, options=options)
