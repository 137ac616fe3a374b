"""What the failure clinic says: the commands' own words, and numbers of what a mistake leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from acx4book.chapters.beyond.failures.examined import Examined, standardised, worst
from acx4book.chapters.beyond.failures.figures import SEEN
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup, shown

COUNTED = ("tie points", "control points are not measured", "image points rejected")
"""Words of sentences that count observations and name no mistake."""

REFUSED = "refused"


def table(found: Mapping[str, Examined]) -> pd.DataFrame:
    """Return what every mistake leaves in residuals and parameters.

    Parameters
    ----------
    found : mapping of str to Examined
    """
    return pd.DataFrame([{"Mistake": name, **_cells(one)} for name, one in found.items()])


def _cells(one: Examined) -> dict[str, str]:
    off = worst(one)
    if off is None:
        return {
            "Largest residuals": f"{REFUSED} when it is read",
            "Rejected": "",
            "Parameter that is most wrong": "",
            "wrong by": "",
            "in its own σ": "",
        }
    rms = standardised(one)
    return {
        "Largest residuals": f"{rms.idxmax()}, {rms.max():.3g} σ",
        "Rejected": f"{len(one.rejected)}",
        "Parameter that is most wrong": Markup(LABELS[str(off.name)]),
        "wrong by": _with_unit(float(off["error"]), str(off["unit"])),
        "in its own σ": f"{off['off']:.3g}",
    }


def _with_unit(value: float, unit: str) -> Markup:
    if unit == "deg":
        return Markup(f"{value:+.3g}°")
    number = scientific(value, digits=1) if abs(value) < 1e-3 else f"{value:+.3g}"
    return Markup(f"{number} {unit}")


def said(one: Examined) -> str:
    """Return what the two commands say of a flight, word for word, as MyST text.

    Parameters
    ----------
    one : Examined
    """
    return "\n\n".join(
        f"`acx4 {command}` says:\n\n{_quoted(lines)}"
        for command, lines in (("check", one.check), ("run", one.run))
    )


def _quoted(lines: Sequence[str]) -> str:
    return "\n>\n".join(f"> {shown(line)}" for line in lines) or "> (nothing odd)"


def delay(one: Examined) -> str:
    """Say into which parameter a delay went.

    Parameters
    ----------
    one : Examined
    """
    off = one.parameters.loc["lever_x_m"]
    return (
        f"The lever arm along the flight is wrong by {off['value'] - off['true']:+.2f} m and "
        f"claims a standard deviation of {off['sigma']:.3f} m."
    )


def weakened(one: Examined, all_strips: Examined) -> str:
    """Say how much larger standard deviations are than with all strips.

    Parameters
    ----------
    one, all_strips : Examined
        Flights without a mistake, of few strips and of all.
    """
    ratio = one.parameters["sigma"] / all_strips.parameters["sigma"]
    name = str(ratio.idxmax())
    row, unit = one.parameters.loc[name], name.rpartition("_")[2]
    return (
        f"No group of residuals exceeds {standardised(one).max():.2f} σ. But the standard "
        f"deviations are {ratio.min():.1f} to {ratio.max():.0f} times those of the whole block; "
        f"that of {LABELS[name]} is {row['sigma']:.2g} {unit}."
    )


def caught(one: Examined) -> str:
    """Say how many planted gross errors were found.

    Parameters
    ----------
    one : Examined
    """
    keys = ["kind", "image_or_exposure", "point"]
    planted = pd.DataFrame(one.planted)[keys].fillna("").drop_duplicates()
    rejected = one.rejected[keys].fillna("").drop_duplicates()
    both = planted.merge(rejected, on=keys)
    others = len(rejected) - len(both)
    return (
        f"Of {len(planted)} gross errors {len(both)} were found; {others} other "
        f"{'observation was' if others == 1 else 'observations were'} rejected with them. What was "
        "not found is smaller than what can be told from noise."
    )


def answer(found: Mapping[str, Examined]) -> str:
    """Say how many mistakes residuals show, and how many are named.

    Parameters
    ----------
    found : mapping of str to Examined
        The first is the flight without a mistake.
    """
    planted = dict([*found.items()][1:])
    refused = [name for name, one in planted.items() if not len(one.residuals)]
    shown = [name for name, one in planted.items() if standardised(one).max() > SEEN]
    cleaned = [name for name, one in planted.items() if one.planted]
    named = [name for name, one in planted.items() if _named(one.check) or _named(one.run)]
    silent = [name for name in planted if name not in {*refused, *shown, *cleaned}]
    factors = [float(standardised(planted[name]).max()) for name in shown]
    return (
        f"Of {len(planted)} mistakes, {_list(refused)} is refused when the flight is read; "
        f"{_list(shown)} leave residuals of {min(factors):.0f} to {max(factors):.0f} standard "
        f"deviations in some group; {_list(cleaned)} are rejected one by one. `acx4 check` or "
        f"`acx4 run` names the cause of {len(named)} mistakes. {_list(silent)} leaves no residual, "
        "since residuals show only what contradicts other observations: standard deviations and "
        "correlations must be read, too."
    )


def _named(lines: Sequence[str]) -> bool:
    return any(not any(words in line for words in COUNTED) for line in lines)


def _list(names: Sequence[str]) -> str:
    quoted = [f"*{name}*" for name in names] or ["None of them"]
    *most, last = quoted
    return f"{', '.join(most)} and {last}" if most else last
