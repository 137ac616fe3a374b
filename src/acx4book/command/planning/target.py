"""``acx4 plan PLAN --target TARGET``: the cheapest strips that give what is wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4lib.planning.choosing.candidates import Wanted
    from acx4lib.planning.choosing.chosen import Chosen
    from acx4lib.planning.plan import Plan

MISSED = 1
"""Exit status where the target is not met."""


def choose(plan: Plan, target: Path) -> Chosen:
    """Return the strips chosen for a target, and show them.

    Where no choice can meet it, this is said; what comes nearest in a limited time is still chosen.
    """
    import numpy as np  # noqa: PLC0415 quick help

    from acx4lib.planning.choosing import candidates, chosen  # noqa: PLC0415 quick help
    from acx4lib.planning.choosing import target as targets  # noqa: PLC0415 quick help

    wanted = targets.read(target, plan)
    all_strips = candidates.of(wanted)
    if all_strips.failing:
        terminal.say(*(unreachable(one, len(all_strips.seconds)) for one in all_strips.failing))
        if not np.isfinite(wanted.minutes):
            raise typer.Exit(MISSED)
    found = chosen.choose(all_strips, minutes=wanted.minutes)
    terminal.show("\n".join(lines(found, len(all_strips.seconds))))
    if not found.met and not all_strips.failing:
        enough = chosen.choose(all_strips)
        terminal.say(
            *(missed(one, float(x), wanted.minutes) for one, x in _missing(found)),
            f"{enough.minutes:.0f} min reach the target: {', '.join(enough.strips)}",
        )
    return found


def unreachable(one: Wanted, n: int) -> str:
    """Say that no choice of the candidates gives what is wanted, and what would."""
    return (
        f"{_named(one)}: no choice of strips gives {one.limit:g}; with all {n} candidates it is "
        f"{one.with_all:.3g}, {one.with_all / one.limit:.2g} times that"
        + (f"; it would need {one.needs}" if one.needs else "")
    )


def missed(one: Wanted, given: float, minutes: float) -> str:
    """Say what a choice misses that must not take longer."""
    return (
        f"{_named(one)}: {given:.3g}, {given / one.limit:.2g} times the {one.limit:g} that is "
        f"wanted; no better choice was found for {minutes:g} min"
    )


def _missing(found: Chosen) -> Iterator[tuple[Wanted, float]]:
    for one, given in zip(found.wanted, found.given, strict=True):
        if given > one.limit:
            yield one, float(given)


def lines(found: Chosen, n: int) -> list[str]:
    """Return what is shown of a choice: what it gives, then what each strip buys.

    Parameters
    ----------
    found : Chosen
    n : int
        Number of candidates.
    """
    names = [_named(one) for one in found.wanted]
    limits = [one.limit for one in found.wanted]
    rows = [
        ["", "", *names],
        ["wanted", "", *map(_digits, limits)],
        [f"all {n} candidates", "", *(_digits(one.with_all) for one in found.wanted)],
        ["chosen", "", *map(_digits, found.given)],
        ["", "min", *[""] * len(names)],
        *(
            [f"{'+ ' if k else '  '}{strip}", f"{minutes:.1f}", *map(_digits, after)]
            for k, (strip, minutes, after) in enumerate(
                zip(found.strips, found.minutes_after, found.after, strict=True)
            )
        ),
    ]
    return [
        f"{len(found.strips)} of {n} strips, {found.minutes:.1f} min from first exposure to last",
        *terminal.aligned(rows),
        *(
            f"without {strip}: {_worst(found, without)}"
            for strip, without in zip(found.strips, found.without, strict=True)
        ),
    ]


def _worst(found: Chosen, without: Sequence[float]) -> str:
    """Say what leaving a strip out does to what suffers most, by what is wanted."""
    shares = [x / one.limit for x, one in zip(without, found.wanted, strict=True)]
    k = shares.index(max(shares))
    return f"{_named(found.wanted[k])} {_digits(found.given[k])} -> {_digits(without[k])}"


def _named(one: Wanted) -> str:
    return f"{one.camera} {one.name}".strip()


def _digits(x: float) -> str:
    return f"{x:#.3g}".rstrip(".")
