"""Tables of the same measurements with a synthetic image and without one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import geometry, study
from acx4book.chapters.beyond.synthetic_cost.study import RIG, SYNTHETIC, Study
from acx4book.paper import printed
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.estimates import parameters as parameters_of
from acx4lib.expected import Array
from acx4lib.geometry.parameters import REPORTED, SHOWN
from acx4lib.least_squares.covariance import sigmas

SQUARE_ROWS = ("f_mm", "k1", "k2", "k3", "p1", "p2", "lever_x_m", "lever_y_m", "lever_z_m")
"""Parameters of the table of squares; a boresight does not depend on them."""

HEIGHTS_M = (700.0, 1000.0, 1250.0, 1500.0, 2000.0, 3000.0)
"""Flying heights of the table."""

NAMES = {name: SHOWN[key] for key, (name, _) in REPORTED.items()}
"""Names and units in tables that values show, by the names of results."""


def _formatted(table: pd.DataFrame, formats: Mapping[Any, str]) -> pd.DataFrame:
    table.attrs["formats"] = dict(formats)
    return table


def _index(names: Iterable[str]) -> pd.MultiIndex:
    return pd.MultiIndex.from_tuples([NAMES[n] for n in names], names=["parameter", "unit"])


def accuracy(found: Study) -> pd.DataFrame:
    """Return RMS and predicted sigma at check points for both ways, and how much larger one is."""
    own = study.accuracy(found)
    columns = {
        (title, way): own[f"{part}_{way}"]
        for title, part in (("RMS (m)", "rms"), ("predicted (m)", "sigma"))
        for way in (SYNTHETIC, RIG)
    }
    columns |= {
        ("larger by (%)", "value"): own["percent"],
        ("larger by (%)", "sigma"): own["sigma_percent"],
    }
    table = pd.DataFrame(columns)
    axes = [axis.removesuffix("_m") for axis in own["axis"]]
    table.index = pd.MultiIndex.from_arrays([own["over"], axes], names=["over", "axis"])
    return _formatted(table, {f"{title}, {way}": ".3f" for title, way in list(columns)[:4]})


def parameters(found: Study) -> pd.DataFrame:
    """Return the synthetic camera: mean and scatter over flights, and scatter over stated sigma."""
    own = study.scatter(found, SYNTHETIC)
    columns = {
        ("mean and scatter over flights", "value"): own["mean"],
        ("mean and scatter over flights", "sigma"): own["scatter"],
        ("scatter over stated σ", "value"): own["ratio"],
        ("scatter over stated σ", "sigma"): own["sigma_ratio"],
    }
    return pd.DataFrame(columns).set_index(_index(own["parameter"]))


def both_sigma(calibration: Calibration, of_heads: Array) -> pd.DataFrame:
    """Return the stated sigma of a calibration, and that of its heads.

    Parameters
    ----------
    calibration : Calibration
    of_heads : ndarray, shape (n, n)
        From `head_errors.parameter_covariance`.
    """
    own = parameters_of(calibration)
    table = pd.DataFrame({"σ stated": [p.sigma for p in own], "σ of the heads": sigmas(of_heads)})
    return _formatted(table.set_index(_index(p.name for p in own)), dict.fromkeys(table, ".2g"))


def with_heads(found: Study) -> pd.DataFrame:
    """Return the two parts of sigma, and the scatter over flights over both together."""
    own = study.scatter_with_heads(found)
    columns = {
        "σ stated": own["sigma"],
        "σ of the heads": own["sigma_of_heads"],
        "scatter over both": own["ratio"],
        "of noise alone": own["noise"],
        "of exact data": own["exact"],
    }
    table = pd.DataFrame(columns).set_index(_index(own.index))
    return _formatted(
        table, dict.fromkeys(list(columns)[:2], ".2g") | dict.fromkeys(list(columns)[2:], ".2f")
    )


def heights(found: Study, heights_m: Iterable[float] = HEIGHTS_M) -> pd.DataFrame:
    """Return what the synthetic camera leaves at several flying heights.

    Parameters
    ----------
    found : Study
    heights_m : iterable of float
        Above the ground.
    """
    rows = []
    for height_m in heights_m:
        own = geometry.at_height(found.pattern, height_m)
        step = geometry.largest_step_px(own)
        ground_cm = 100 * height_m * printed.pixel_mm("SYN") / printed.value(3, "f_mm", PAPERS)
        rows.append(
            {
                "flying height (m)": height_m,
                "RMS (px)": geometry.rms_px(own),
                "largest (px)": geometry.largest_px(own),
                "largest step at a seam (px)": step,
                "that step on the ground (cm)": step * ground_cm,
            }
        )
    table = pd.DataFrame(rows)
    whole = dict.fromkeys(("flying height (m)", "that step on the ground (cm)"), ".0f")
    return _formatted(table, dict.fromkeys(table, ".2f") | whole)


PAPERS = "single_step"
"""The method whose printed values stand beside."""


def squares(found: Study) -> pd.DataFrame:
    """Return what exact data give for squares of lens centres of different size."""
    own = found.squares.set_index(["side_m", "parameter"])
    columns = {
        (f"square of {100 * side:.0f} cm", part): [own[part][side, name] for name in SQUARE_ROWS]
        for side in np.unique(found.squares["side_m"])
        for part in ("value", "sigma")
    }
    return pd.DataFrame(columns, index=_index(SQUARE_ROWS))


def factors(found: Study) -> pd.DataFrame:
    """Return the variance factors of exact data for squares of lens centres of different size."""
    own = found.squares[found.squares["parameter"] == "sigma0_squared"].set_index("side_m")["value"]
    columns = {f"square of {100 * side:.0f} cm": [own[side]] for side in own.index}
    table = pd.DataFrame(columns, index=["variance of unit weight"])
    return _formatted(table, dict.fromkeys(table, ".4f"))


SHIFTED = {"f_mm": "f", "xp_mm": "x_p", "yp_mm": "y_p"}
"""What the two-step method shifts where it holds a lever arm at zero, and its symbol."""


def shifts(found: Study) -> pd.DataFrame:
    """Return how far the two-step method with GNSS moves f, x_p, y_p, by place of lens centres.

    Returns
    -------
    DataFrame
        A row for each place: side_m, lowered_m, lever_z_m of the single step, and for each name of
        `SHIFTED` the shift against the single step and, as expected_NAME, the one that its lever
        arm must cause; all mm.
    """
    rows = []
    for (side, lowered), own in found.centres.groupby(["side_m", "lowered_m"]):
        by = own.pivot_table(index="parameter", columns="method", values="value")
        shift = by["two_step_gnss"] - by[PAPERS]
        row = {"side_m": side, "lowered_m": lowered, "lever_z_m": by[PAPERS]["lever_z_m"]}
        row |= {name: shift[name] for name in SHIFTED}
        rows.append(row | {f"expected_{name}": by["expected"][name] for name in SHIFTED})
    return pd.DataFrame(rows)


def shifts_beside_print(found: Study) -> pd.DataFrame:
    """Return `shifts` by the place of the lens centres, with the paper's in the last row."""
    own = shifts(found)
    places = [_place(row["side_m"], row["lowered_m"]) for row in own.to_dict("records")]
    table = own.drop(columns=["side_m", "lowered_m"]).set_index(
        pd.Index(places, name="lens centres")
    )
    table.loc["paper", "lever_z_m"] = printed.value(3, "lever_z_m", PAPERS)
    for name in SHIFTED:
        table.loc["paper", name] = print_shift(name)
    table = table.rename(
        columns={"lever_z_m": "lever arm z (m)"}
        | {name: f"{name[:-3]} (mm)" for name in SHIFTED}
        | {f"expected_{name}": f"{name[:-3]}, expected (mm)" for name in SHIFTED}
    )
    return _formatted(table, dict.fromkeys(table, "+.4f") | {"lever arm z (m)": "+.3f"})


def print_shift(name: str) -> float:
    """Return the printed two-step value of a parameter less the single-step one."""
    two, single = (printed.value(3, name, method) for method in ("two_step", PAPERS))
    return two - single


def _place(side_m: float, lowered_m: float) -> str:
    if not side_m:
        return "in one point"
    lower = f", {100 * lowered_m:.0f} cm lower" if lowered_m else ""
    return f"square of {100 * side_m:.0f} cm{lower}"
