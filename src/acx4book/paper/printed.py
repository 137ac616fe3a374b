"""The paper's printed numbers: Tables 1-4 and the checked statements of its text.

They were transcribed once, into `data/paper`; no other file repeats them. Parameters have the
names of a run's results (`parameters.csv`), so that both can be joined.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import resources
from types import MappingProxyType

import numpy as np
import pandas as pd

from acx4book.typesetting.myst import SUPERSCRIPTS
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM, REPORTED

HEADS = ("CAM1", "CAM2", "CAM3", "CAM4")
"""Columns of Table 1."""

METHODS = ("two_step", "single_step")
"""Columns of Tables 3 and 4."""

NUMBER = re.compile(r"(-?)(\d*\.?\d+)(?:\^-?(\d+)|E([+-]\d+))?")
"""A number of a printed cell: its sign, digits, and power of ten, ``^07`` read as that of -7."""


@cache
def _read(name: str) -> pd.DataFrame:
    """Read a file of `data/paper`; numbers not determined are NaN, empty texts are ''."""
    missing = {"value": [""], "sigma": [""]}
    with resources.files("acx4book.paper").joinpath("tables", name).open(encoding="utf-8") as table:
        return pd.read_csv(table, keep_default_na=False, na_values=missing)


def table(number: int) -> pd.DataFrame:
    """Return a table of the paper, one row per printed number.

    Parameters
    ----------
    number : {1, 2, 3, 4}

    Returns
    -------
    DataFrame
        table, row (as printed), parameter (our name), column (head or method), value, sigma,
        role and sigma_role (of value and sigma in the simulation, names of `ROLES`), unit
        (ours), unit_printed, as_printed, note (where our reading differs from the print).
        `value` is NaN where the paper prints ND, `sigma` where it prints none; roles then are ''.
    """
    if number not in (1, 2, 3, 4):
        msg = f"the paper has Tables 1 to 4, got {number}"
        raise ValueError(msg)
    return _read(f"table{number}.csv").copy()


def statements() -> pd.DataFrame:
    """Return the numeric statements of the paper's text that are checked.

    Returns
    -------
    DataFrame
        section, statement (our name), subject, value, unit, as_printed, note.
    """
    return _read("statements.csv").copy()


def value(number: int, parameter: str, column: str) -> float:
    """Return one printed value; NaN where the paper prints ND.

    Parameters
    ----------
    number : {1, 2, 3, 4}
        Table.
    parameter, column : str
        As in `table`, for instance ``"xp_mm", "CAM3"``.
    """
    return float(_row(number, parameter, column)["value"])


def sigma(number: int, parameter: str, column: str) -> float:
    """Return the standard deviation printed with a value; NaN where there is none."""
    return float(_row(number, parameter, column)["sigma"])


def printed(number: int, parameter: str, column: str) -> str:
    """Return a cell of a table exactly as printed, with misprints."""
    return str(_row(number, parameter, column)["as_printed"])


def shown(number: int, parameter: str, column: str) -> Markup:
    """Return a value of a table, with its standard deviation, to the digits of the print.

    Powers of ten are corrected: ``2.57·10⁻⁷ ± 2.14·10⁻⁸`` is printed as ``2.57^07 +/-
    2.14^08``. ND is what the paper did not determine.
    """
    row = _row(number, parameter, column)
    numbers = [row["value"], row["sigma"]]
    texts = [digits(row["as_printed"], number) for number in numbers if np.isfinite(number)]
    return Markup(" ± ".join(texts) or "ND")


def digits(as_printed: str, number: float) -> str:
    """Return a number with the digits of its printed cell, and a power of ten if it has one.

    Raises
    ------
    ValueError
        If the cell does not have the number.
    """
    for sign, mantissa, power, exponent in NUMBER.findall(as_printed):
        tens = -int(power) if power else int(exponent or 0)
        if np.isclose(float(f"{sign}{mantissa}e{tens}"), number, rtol=1e-9, atol=0.0):
            whole = f"{sign}{'0' if mantissa.startswith('.') else ''}{mantissa}"
            return f"{whole}·10{str(tens).translate(SUPERSCRIPTS)}" if tens else whole
    msg = f"{as_printed!r} does not have the number {number:g}"
    raise ValueError(msg)


@cache
def _row(number: int, parameter: str, column: str) -> pd.Series:
    rows = table(number)
    matches = rows[(rows["parameter"] == parameter) & (rows["column"] == column)]
    if len(matches) != 1:
        msg = f"Table {number} has no parameter {parameter!r} in a column {column!r}"
        raise ValueError(msg)
    return matches.iloc[0]


def statement(name: str) -> float:
    """Return the number of one statement of the text, in the unit given by `statements`."""
    rows = statements()
    matches = rows.loc[rows["statement"] == name, "value"]
    if len(matches) != 1:
        msg = f"no statement {name!r} of the paper is transcribed"
        raise ValueError(msg)
    return float(matches.iloc[0])


def interior(number: int, column: str) -> Interior:
    """Return the printed interior orientation of a head or of the synthetic image.

    Parameters
    ----------
    number : {1, 3}
        Table.
    column : str
        One of `HEADS` (Table 1) or `METHODS` (Table 3).

    Returns
    -------
    Interior
        Parameters that were not determined are zero.
    """
    rows = table(number)
    printed = rows[rows["column"] == column].set_index("parameter")["value"].fillna(0.0)
    names = {name: f"{name}_mm" if name in ("f", "xp", "yp") else name for name in INTERIOR}
    return Interior(**{k: float(printed[v]) for k, v in names.items() if v in printed.index})


def opk(head: str) -> Array:
    """Return omega, phi, kappa of a head in Table 1, shape (3,), rad."""
    return np.radians([value(1, f"{name}_deg", head) for name in ("omega", "phi", "kappa")])


def centre_mm(head: str) -> Array:
    """Return Xc, Yc, Zc of a head in Table 1, shape (3,), mm."""
    return np.array([value(1, f"{name}_mm", head) for name in ("Xc", "Yc", "Zc")])


def pixel_mm(column: str) -> float:
    """Return the pixel size of a head or of the synthetic image (``SYN``), mm."""
    return 1e-3 * (statement("head_pixel_um") if column in HEADS else value(2, "pixel_um", column))


def corners(column: str) -> Array:
    """Return the corners of an image, counter-clockwise from the top right.

    Parameters
    ----------
    column : str
        One of `HEADS`, or ``SYN``.

    Returns
    -------
    xy : ndarray, shape (4, 2)
        Outer edges of the outer pixels, mm from the middle.
    """
    if column in HEADS:
        size_px = [statement("head_width_px"), statement("head_height_px")]
    else:
        size_px = [value(2, "width_px", column), value(2, "height_px", column)]
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    xy: Array = 0.5 * pixel_mm(column) * np.array(size_px) * signs
    return xy


def columns(
    number: int, flight: Flight, titles: Mapping[str, str], *, part: str = "both"
) -> pd.DataFrame:
    """Return columns of a table of the paper, to be joined to estimates of the same parameters.

    Parameters
    ----------
    number : {1, 3}
        Table.
    flight : Flight
        Without the paper's cameras there are no columns.
    titles : mapping of str to str
        Titles of the columns, by the paper's (head or method).
    part : str
        ``"both"``, or ``"sigma"`` for the standard deviations alone.

    Returns
    -------
    DataFrame
        Text to the digits of the print, as in `shown`; the index has the levels ``parameter`` and
        ``unit`` of a calibration's table. The columns have two levels, as those of several tables
        side by side do; standard deviations alone have one.
    """
    rows = table(number)
    names = list(dict.fromkeys(zip(rows["parameter"], rows["unit"], strict=True)))
    index = pd.MultiIndex.from_tuples(
        [(_words(name), _sign(unit)) for name, unit in names], names=["parameter", "unit"]
    )
    chosen = titles if applies(flight) else {}
    cells = [[_cell(number, name, column, part) for name, _ in names] for column in chosen]
    filled = pd.DataFrame(dict(enumerate(cells)), index=index)
    if part == "sigma":
        return filled.set_axis([*chosen.values()], axis=1)
    heads = [(title, "printed") for title in chosen.values()] or [("", "")]
    return filled.set_axis(pd.MultiIndex.from_tuples(heads)[: len(cells)], axis=1)


def heads(flight: Flight, table: pd.DataFrame) -> pd.DataFrame:
    """Return the heads' values of Table 1, to be joined to a table of the same parameters.

    Parameters
    ----------
    flight : Flight
        Without the paper's cameras there are no columns.
    table : DataFrame
        With the levels ``camera``, ``parameter``, ``unit`` and the columns ``value``, ``sigma``.

    Returns
    -------
    DataFrame
        ``paper``, as printed; by how many combined standard deviations the table is ``apart (σ)``
        from it; ``σ over the paper's``, where it prints standard deviations. Rows that Table 1
        does not have are empty.
    """
    if not applies(flight) or "camera" not in table.index.names:
        return pd.DataFrame(index=table.index)
    names = _of_table_1(table)
    spreads = np.array([sigma(1, *name) if all(name) else np.nan for name in names])
    combined = np.hypot(table["sigma"], np.nan_to_num(spreads))
    beside = {
        "paper": [shown(1, *name) if all(name) else "" for name in names],
        "apart (σ)": off_heads(flight, table).abs() / combined,
        "σ over the paper's": table["sigma"] / spreads,
    }
    compared = pd.DataFrame(beside, index=table.index).dropna(axis=1, how="all")
    compared.attrs["formats"] = {"apart (σ)": ".1f", "σ over the paper's": ".1f"}
    return compared


def off_heads(flight: Flight, table: pd.DataFrame) -> pd.Series:
    """Return the values of a table less the heads' values of Table 1.

    Parameters
    ----------
    flight, table
        As in `heads`.

    Returns
    -------
    Series
        NaN where Table 1 has no value; empty for other cameras.
    """
    if not applies(flight) or "camera" not in table.index.names:
        return pd.Series(index=table.index[:0], dtype=float)
    values = [value(1, *name) if all(name) else np.nan for name in _of_table_1(table)]
    return table["value"] - np.array(values)


def _of_table_1(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Return parameter and column of Table 1 by the rows of a table; '' where it has none."""
    names = {_words(name): name for name in _read("table1.csv")["parameter"]}
    parameters, cameras = (table.index.get_level_values(k) for k in ("parameter", "camera"))
    return [
        (names.get(parameter, ""), camera if camera in HEADS else "")
        for parameter, camera in zip(parameters, cameras, strict=True)
    ]


def of_heads(flight: Flight, parameter: str) -> pd.Series:
    """Return one parameter as Table 1 prints it, by head; empty for other cameras.

    Parameters
    ----------
    flight : Flight
    parameter : str
        As in `table`.
    """
    heads = HEADS if applies(flight) else ()
    return pd.Series({head: shown(1, parameter, head) for head in heads}, dtype=object)


def _words(name: str) -> str:
    """Return the name of a results file's parameter in a calibration's table."""
    words = re.sub(r"_(mm|m|deg)$", "", name).replace("_", " ")
    for word, letter in (("omega", "ω"), ("phi", "φ"), ("kappa", "κ")):
        words = words.replace(word, letter)
    return words


def _sign(unit: str) -> str:
    """Return the sign of a results file's unit in a calibration's table."""
    if unit == "deg":
        return "°"
    return re.sub(r"\^(-\d)", lambda m: m[1].translate(SUPERSCRIPTS), unit)


def _cell(number: int, parameter: str, column: str, part: str) -> str:
    if part == "both":
        return shown(number, parameter, column)
    spread = sigma(number, parameter, column)
    known = np.isfinite(spread)
    return Markup(digits(printed(number, parameter, column), spread) if known else "")


def differences(number: int, column: str, other: str, parameters: Sequence[str]) -> list[float]:
    """Return the printed values of one column less those of another."""
    return [value(number, p, column) - value(number, p, other) for p in parameters]


def cameras(flight: Flight, declared: Sequence[Camera]) -> dict[str, list[Camera]]:
    """Return the camera of Table 3's single step under the title "paper"; nothing for others.

    Parameters
    ----------
    flight : Flight
    declared : sequence of Camera
        Those of the calibration block.
    """
    if not applies(flight) or len(declared) != 1:
        return {}

    def values(keys: Sequence[str]) -> list[float]:
        return [value(3, REPORTED[key][0], "single_step") for key in keys]

    R = rotation_from_opk(np.radians(values(BORESIGHT)))
    mounted = Pose(R=R, r=np.array(values(LEVER_ARM)))
    lens = interior(3, "single_step")
    return {"paper": [replace(declared[0], interior=lens, T_b_c=mounted)]}


def applies(flight: Flight) -> bool:
    """Tell whether a flight has the paper's cameras, so that its numbers can be compared."""
    synthetic = flight.cameras.get("SYN")
    if synthetic is None or not set(HEADS) <= set(flight.cameras):
        return False
    same = (value(2, "width_px", "SYN"), value(2, "height_px", "SYN"))
    if flight.synthetic is not None and flight.synthetic.heads != HEADS:
        return False
    return (synthetic.width_px, synthetic.height_px) == same


def plan_and_height(flight: Flight, column: str) -> tuple[float, float] | None:
    """Return the printed RMS at check points in plan and in height, m; None for other cameras.

    Parameters
    ----------
    flight : Flight
    column : str
        One of `METHODS`.
    """
    if not applies(flight):
        return None
    east, north, height = (value(4, f"rms_{axis}_m", column) for axis in AXES)
    return float(np.hypot(east, north)), height


# --- The roles of printed numbers: given, chosen for, following, or independent


GIVEN_READING = "follows, given the reading"
"""Role of the numbers that follow once a reading of the paper was chosen because it fits them."""

ROLES: Mapping[str, str] = MappingProxyType(
    {
        "given": "It is an input of the simulation. That it comes back tests the software.",
        "chosen": "Something that the paper does not tell was set so that it comes out: for the "
        "standard deviations of the paper's Table 3 the tie points and the noise of GNSS, for the "
        "numbers of pairs the places of the targets.",
        "follows": "It is arithmetic from other printed numbers, or the same true value, estimated "
        "a second time.",
        GIVEN_READING: "It is computed from given numbers, by a reading of the paper's method that "
        "was chosen because it fits. Its agreement shows that the effect is understood, and is no "
        "independent evidence.",
        "independent": "Nothing was set for it. Only its agreement says something about the study.",
    }
)
"""The roles of printed numbers, and their meaning."""

STRONG = ("f_mm", "xp_mm", "yp_mm")
"""Parameters whose two-step values, minus the single-step ones, show the lever arm."""

HARDLY = ("mean_east_m", "mean_north_m", "mean_height_m")
"""Independent numbers of the paper's Table 4 that can hardly disagree."""


def sentence(card: pd.DataFrame) -> str:
    """Write the counts of printed numbers by role, and what their agreement is worth.

    Parameters
    ----------
    card : DataFrame
        As `scorecard._scorecard` returns it.
    """
    n = card["role"].value_counts()
    independent = card[card["role"] == "independent"]
    agree = independent[independent["verdict"] == "agrees"]
    means = int(agree["quantity"].isin(HARDLY).sum())
    return (
        f"Of the {len(card)} numbers in the paper's tables, {n['given']} were *given* to the "
        f"simulation. {n['chosen']} were *chosen*: something that the paper does not tell was set "
        f"so that they come out. {n['follows']} *follow* from others, and {n[GIVEN_READING]} "
        "*follow, given the reading*: $f$, $x_p$ and $y_p$ of the two-step method are computed "
        "from the given lever arm and the given single-step values, once the method is read as "
        "the one with GNSS positions in its bundle, a reading that was chosen because it fits. "
        f"Only the remaining {n['independent']} are *independent*, and {len(agree)} of these "
        f"agree. Of these {len(agree)}, {means} are means of differences at check points, which "
        "are small against their scatter and could hardly disagree, and "
        f"{len(agree) - means} depend on the noise that was chosen. So no number of the paper's "
        "Table 3 is independent evidence about the study. That its two columns differ by the "
        "lever arm which one of them holds at zero is a fine result of physics all the same."
    )
