"""What the figures of the chapter show, in words with the numbers of the run."""

from __future__ import annotations

import pandas as pd

from acx4book.typesetting.labels import LABELS


def two_heights(table: pd.DataFrame) -> str:
    """Say what a second height does.

    Parameters
    ----------
    table : DataFrame
        Of `curves.over_ratio`.
    """
    one, two = table[1.0], table[1.5]
    return (
        f"At one height, σ of {LABELS['f_mm']} is {_um(one, 'f_mm')} and that of the "
        f"{LABELS['lever_z_m']} {_cm(one, 'lever_z_m')}. With the second strips half as high again "
        f"they are {_um(two, 'f_mm')} and {_cm(two, 'lever_z_m')}: "
        f"{_times(one, two, 'f_mm')} and {_times(one, two, 'lever_z_m')} times smaller. No other "
        f"parameter gains more than a factor of {_other_gain(one, two, ('f_mm', 'lever_z_m')):.1f}."
    )


def opposite(table: pd.DataFrame) -> str:
    """Say what opposite directions do.

    Parameters
    ----------
    table : DataFrame
        Of `curves.over_turn`.
    """
    same, across, back = table[0.0], table[90.0], table[180.0]
    return (
        f"Turned by 180°, the second strip makes σ of the {LABELS['lever_x_m']} "
        f"{_times(same, back, 'lever_x_m')} times smaller ({_cm(same, 'lever_x_m')} to "
        f"{_cm(back, 'lever_x_m')}), that of {LABELS['boresight_phi_deg']} "
        f"{_times(same, back, 'boresight_phi_deg')} times and that of {LABELS['xp_mm']} "
        f"{_times(same, back, 'xp_mm')} times. A crossing strip, turned by 90°, reaches "
        f"{_cm(across, 'lever_x_m')}: most of this. σ of {LABELS['boresight_kappa_deg']} hardly "
        "depends on the direction: it changes by "
        f"{_percent(_spread(table, 'boresight_kappa_deg'))}."
    )


def number(pairs: pd.DataFrame, same_way: pd.DataFrame) -> str:
    """Say what more strips do, and that their direction does more.

    Parameters
    ----------
    pairs, same_way : DataFrame
        Of `curves.over_pairs` and `curves.over_same_way`.
    """
    few, many = pairs.columns[0], pairs.columns[-1]
    return (
        f"Three times as many strips make σ of {LABELS['boresight_kappa_deg']} "
        f"{_times(pairs[few], pairs[many], 'boresight_kappa_deg')} times smaller, which is the "
        f"root of three: every image measures the heading once more. But {4 * many} strips of one "
        f"direction leave the {LABELS['lever_x_m']} at {_cm(same_way[many], 'lever_x_m')}, and "
        f"{4 * few} strips in opposite directions have {_cm(pairs[few], 'lever_x_m')}."
    )


def control(table: pd.DataFrame) -> str:
    """Say what control points do.

    Parameters
    ----------
    table : DataFrame
        Of `curves.over_control`.
    """
    none, four, most = table[0], table[4], table[table.columns[-1]]
    return (
        f"Without control points the {LABELS['lever_z_m']} has σ = {_cm(none, 'lever_z_m')}: it is "
        f"a shift of the whole ground in height. Four points make it {_cm(four, 'lever_z_m')}, "
        f"{table.columns[-1]} points {_cm(most, 'lever_z_m')}; {LABELS['f_mm']} follows "
        f"({_um(none, 'f_mm')}, {_um(four, 'f_mm')}, {_um(most, 'f_mm')}). The "
        f"{LABELS['lever_x_m']} and {LABELS['boresight_phi_deg']} change by at most "
        f"{_percent(max(_spread(table, 'boresight_phi_deg'), _spread(table, 'lever_x_m')))}: "
        "images in opposite directions and the trajectory tell them without any point on the "
        "ground."
    )


def answer(ratio: pd.DataFrame, turn: pd.DataFrame, compared: pd.DataFrame, allowed: float) -> str:
    """Answer the chapter's question.

    Parameters
    ----------
    ratio, turn : DataFrame
        Of `curves.over_ratio` and `curves.over_turn`.
    compared : DataFrame
        Of `compared.table`.
    allowed : float
        What was wanted of the chosen flight, in the paper's σ.
    """
    paper, cheap, least = (compared[name] for name in ("the paper's", "chosen", "there and back"))
    return (
        f"Two heights tell {LABELS['f_mm']} from the {LABELS['lever_z_m']} "
        f"(σ {_times(ratio[1.0], ratio[1.5], 'f_mm')} times smaller), opposite directions the "
        f"lever arm's x and y from the boresight and from a shift of GNSS "
        f"({_times(turn[0.0], turn[180.0], 'lever_x_m')} times), control points the height. "
        f"The {LABELS['boresight_kappa_deg']} needs no direction, only images. "
        f"The paper's block takes {paper['minutes']:.0f} minutes; {cheap['strips']:.0f} chosen "
        f"strips need {cheap['minutes']:.0f} for σ of at most {allowed:g} times the paper's. Two "
        f"strips, one low and one back at the greater height, take {least['minutes']:.0f} minutes, "
        f"and no σ is more than {(least / paper).iloc[3:].max():.1f} times the paper's."
    )


def _um(sigma: pd.Series, name: str) -> str:
    return f"{1000.0 * sigma[name]:.2g} µm"


def _cm(sigma: pd.Series, name: str) -> str:
    return f"{100.0 * sigma[name]:.2g} cm"


def _times(large: pd.Series, small: pd.Series, name: str) -> str:
    return f"{large[name] / small[name]:.2g}"


def _other_gain(one: pd.Series, two: pd.Series, but: tuple[str, ...]) -> float:
    return float((one / two).drop([*but]).to_numpy(dtype=float).max())


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _spread(table: pd.DataFrame, name: str) -> float:
    """Return by what part of itself a σ changes at most."""
    sigma = table.loc[name].to_numpy(dtype=float)
    return float(sigma.max() / sigma.min() - 1.0)
