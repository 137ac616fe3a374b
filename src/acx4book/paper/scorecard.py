"""Every number of the paper's Tables 1-4 and that of a run, with a verdict by one rule."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from acx4book.paper import printed as paper
from acx4book.paper.roles import ROLES
from acx4lib.flight.design import ground_sample_m
from acx4lib.flight.reader import Flight
from acx4lib.geometry.parameters import AXES
from acx4lib.results import folder

LATITUDE_OF_SIGMA = 0.2
TWO_STEP = "two_step_gnss"
"""The reading of the two-step method that gives the printed standard deviations."""


@dataclass(frozen=True, kw_only=True)
class Ours:
    """The number of a run for one printed number.

    Attributes
    ----------
    value, sigma : float
        `sigma` is zero for an exact number.
    sharing : float
        Of a mean over points: its sigma over that of independent points.
    """

    value: float
    sigma: float
    sharing: float = 1.0


def scorecard(
    found: folder.Results, flight: Flight, *, tables: Collection[int] = (1, 2, 3, 4)
) -> pd.DataFrame:
    """Return one row per printed number.

    Parameters
    ----------
    found : Results
        Results of the stages behind the tables.
    flight : Flight
        A flight of the paper's design.
    tables : collection of int
        Which of the paper's.

    Returns
    -------
    DataFrame
        table, quantity, column, printed, as_printed (the digits of the print), ours, sigma, unit,
        role (of `roles.ROLES`), deviation (in combined standard deviations), verdict, reason.
    """
    rows = []
    for number, find in ((1, _table_1), (2, _table_2), (3, _table_3), (4, _table_4)):
        if number not in tables:
            continue
        for printed in map(as_printed_row, paper.table(number).to_dict("records")):
            ours = find(found, flight, printed.parameter, printed.column)
            rows.append(line(printed, "value", ours))
            if np.isfinite(printed.sigma):
                spread = _sigma_of(found, flight, number, printed.parameter, printed.column)
                rows.append(line(printed, "sigma", spread))
    return pd.DataFrame([row for row in rows if row is not None])


@dataclass(frozen=True, kw_only=True)
class Printed:
    """One cell of a table of the paper; sigma is NaN where none is printed.

    Attributes are the columns of `printed.table`.
    """

    table: int
    parameter: str
    column: str
    value: float
    sigma: float
    role: str
    sigma_role: str
    unit: str
    as_printed: str


def as_printed_row(row: Mapping[Hashable, Any]) -> Printed:
    """Return a row of `printed.table` as a cell."""
    return Printed(**{name: row[name] for name in Printed.__dataclass_fields__})


def counts(card: pd.DataFrame) -> pd.DataFrame:
    """Count the numbers of every role: by table, in all, and by verdict."""
    roles = pd.Categorical(card["role"], categories=[*ROLES])
    by_table = pd.crosstab(roles, card["table"], dropna=False)
    by_table.columns = pd.Index([f"paper's Table {number}" for number in by_table.columns])
    verdicts = pd.crosstab(roles, card["verdict"], dropna=False)
    verdicts = verdicts.reindex(columns=["agrees", "near", "differs"], fill_value=0)
    counted = pd.concat([by_table, verdicts], axis=1)
    counted.insert(by_table.shape[1], "numbers", by_table.sum(axis=1))
    return counted.rename_axis("role").reset_index()


def line(printed: Printed, what: str, ours: Ours | None) -> dict[str, object] | None:
    """Return one line of the card; None where the paper has no number."""
    number = printed.value if what == "value" else printed.sigma
    if not np.isfinite(number) or ours is None:
        return None
    digits = paper.digits(printed.as_printed, number)
    rounding = half_digit(digits, number)
    combined = np.sqrt(ours.sigma**2 + _paper_sigma(printed, what, ours) ** 2 + rounding**2 / 3)
    deviation = float(abs(ours.value - number) / combined)
    verdict = "agrees" if deviation <= 2 else "near" if deviation <= 3 else "differs"
    return {
        "table": printed.table,
        "quantity": printed.parameter if what == "value" else f"sigma of {printed.parameter}",
        "column": printed.column,
        "printed": number,
        "as_printed": digits,
        "ours": ours.value,
        "sigma": ours.sigma,
        "unit": printed.unit,
        "role": printed.role if what == "value" else printed.sigma_role,
        "deviation": deviation,
        "verdict": verdict,
        "reason": "" if verdict == "agrees" else _reason(printed, what),
    }


def _paper_sigma(printed: Printed, what: str, ours: Ours) -> float:
    """Return the standard deviation of a printed value; for means of Table 4 it is computed."""
    if what != "value" or not np.isfinite(printed.sigma):
        return 0.0
    if printed.table != 4:
        return printed.sigma
    return ours.sharing * printed.sigma / np.sqrt(paper.value(4, "n_points", "single_step"))


def half_digit(digits: str, number: float) -> float:
    """Return half a unit of the last of a printed number's digits, as `printed.digits` has them."""
    mantissa, _, power = digits.partition("·")
    tens = int(np.floor(np.log10(abs(number)))) if power else 0
    return 0.5 * 10.0 ** (tens - len(mantissa.partition(".")[2]))


# --- the numbers of a run --------------------------------------------------------------------


def _parameter(found: folder.Results, method: str, camera: str, name: str) -> tuple[float, float]:
    listed = folder.parameters(found, method, camera)
    return float(listed["value"][name]), float(listed["sigma"][name])


def _summary(found: folder.Results, key: str, name: str) -> float:
    return float(str(found.summary[key][name]))


def _variance(found: folder.Results, key: str) -> Ours:
    value = _summary(found, key, "sigma0_squared")
    spread = value * np.sqrt(2 / _summary(found, key, "redundancy"))
    return Ours(value=value, sigma=float(spread))


def _table_1(found: folder.Results, flight: Flight, name: str, head: str) -> Ours | None:
    if name == "sigma0_squared":
        return _variance(found, f"heads/bundle/{head}")
    if name == "f_mm":
        return Ours(value=flight.cameras[head].interior.f, sigma=0.0)
    if name in ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg"):
        value, sigma = _parameter(found, "heads/relative_orientation", head, name)
        return Ours(value=value, sigma=sigma)
    if name in folder.parameters(found, "heads/bundle", head).index:
        value, sigma = _parameter(found, "heads/bundle", head, name)
        return Ours(value=value, sigma=sigma)
    return None


def _table_2(_found: folder.Results, flight: Flight, name: str, camera: str) -> Ours | None:
    synthetic = flight.cameras[camera]
    pixel = synthetic.pixel_mm
    values = {
        "width_px": synthetic.width_px,
        "height_px": synthetic.height_px,
        "pixel_um": 1000 * pixel,
        "width_mm": synthetic.width_px * pixel,
        "height_mm": synthetic.height_px * pixel,
        "f_mm": synthetic.interior.f,
    }
    return Ours(value=float(values[name]), sigma=0.0)


def _method(column: str) -> str:
    return TWO_STEP if column == "two_step" else column


def _table_3(found: folder.Results, flight: Flight, name: str, column: str) -> Ours | None:
    method = f"mounting/{_method(column)}"
    if name == "sigma0_squared":
        return _variance(found, method)
    camera = _synthetic_name(flight)
    if name not in folder.parameters(found, method, camera).index:
        return None
    value, sigma = _parameter(found, method, camera, name)
    return Ours(value=value, sigma=sigma)


def _synthetic_name(flight: Flight) -> str:
    return flight.synthetic.camera if flight.synthetic else next(iter(flight.cameras))


def _sigma_of(
    found: folder.Results, flight: Flight, number: int, name: str, column: str
) -> Ours | None:
    """Return our standard deviation for a printed one; in Table 4 it is the scatter."""
    if number == 4:
        return _table_4(found, flight, name.replace("mean", "std"), column)
    find: Callable[..., Ours | None] = _table_1 if number == 1 else _table_3
    ours = find(found, flight, name, column)
    if ours is None:
        return None
    latitude = LATITUDE_OF_SIGMA * ours.sigma
    return Ours(value=ours.sigma, sigma=latitude)


def _table_4(found: folder.Results, flight: Flight, name: str, column: str) -> Ours | None:
    key = f"validation/{_method(column)}"
    entry = found.summary[key]
    n_points, n_pairs = _summary(found, key, "n_points"), _summary(found, key, "n_pairs")
    failed = _summary(found, key, "n_failed_pairs")
    gsd = ground_sample_m(flight.mounted("validation")) if flight.validation else np.nan
    kind, _, rest = name.partition("_")
    axis = {"east": 0, "north": 1, "height": 2}.get(rest.partition("_")[0], -1)
    points = folder.rows(found, "check_points", key)
    if axis >= 0 and kind in ("mean", "std", "rms"):
        return _moment(entry, name, axis, points=points, gsd=gsd)
    norm = np.linalg.norm(points[["d_east_m", "d_north_m", "d_height_m"]], axis=1)
    within = int(np.sum(norm <= 3 * gsd))
    share = within / max(n_points, 1)
    spread = float(np.sqrt(n_points * max(share * (1 - share), 0.25 / max(n_points, 1))))
    total = max(n_pairs + failed, 1)
    values = {
        "n_pairs": Ours(value=n_pairs, sigma=float(np.sqrt(n_pairs))),
        "n_points": Ours(value=n_points, sigma=0.0),
        "n_success": Ours(value=n_pairs, sigma=float(np.sqrt(n_pairs))),
        "success_percent": Ours(value=100 * n_pairs / total, sigma=0.0),
        "n_fail": Ours(value=failed, sigma=0.0),
        "fail_percent": Ours(value=100 * failed / total, sigma=0.0),
        "n_within_3_gsd": Ours(value=within, sigma=spread),
        "within_3_gsd_percent": Ours(value=100 * share, sigma=100 * spread / max(n_points, 1)),
        "gsd_m": Ours(value=gsd, sigma=0.0),
    }
    return values.get(name)


def _moment(
    entry: dict[str, object], name: str, axis: int, *, points: pd.DataFrame, gsd: float
) -> Ours | None:
    """Return a mean or an RMS over the pairs; it is as precise as that over the points."""
    kind = name.split("_", maxsplit=1)[0]
    values, std = (np.array(entry[key], dtype=float) for key in (kind, "std"))
    scale = 1 / gsd if name.endswith("_px") else 1.0
    sharing = _sharing(entry, points, axis) if kind == "mean" else 1.0
    spread = sharing * std[axis] / np.sqrt(len(points) if kind == "mean" else 2 * len(points))
    return Ours(value=float(scale * values[axis]), sigma=float(scale * spread), sharing=sharing)


def _sharing(entry: Mapping[str, Any], points: pd.DataFrame, axis: int) -> float:
    """Return the sigma of the points' mean along an axis, over that of independent points."""
    sigma = points[f"sigma_{AXES[axis]}_m"].to_numpy()
    return float(entry["points"]["mean_sigma"][axis] * len(sigma) / np.linalg.norm(sigma))


# --- reasons ---------------------------------------------------------------------------------

HEADS_SIGMA = (
    "a bundle on control points alone, over this block and with this noise, determines it no "
    "better; less noise cannot explain the printed one, because that of $k_1$ is larger than ours; "
    "constrained exterior orientations can"
)
REASONS: tuple[tuple[int, tuple[str, ...], str], ...] = (
    (
        1,
        ("sigma0_squared",),
        "ours has the true a priori standard deviations; if the paper expected one, its own were "
        "about twice too large",
    ),
    (1, ("sigma:xp_mm", "sigma:yp_mm", "sigma:p1", "sigma:p2"), HEADS_SIGMA),
    (
        1,
        ("sigma:k1",),
        "depends on how many measurements there are and how many of them reach the corners, which "
        "the paper does not tell; fewer would give the printed one",
    ),
    (
        1,
        ("Xc_mm", "Yc_mm"),
        "0.05 mm in the image is a metre in space, and no head is so far from the others; the "
        "paper does not say what the value means, and the simulation was not given it",
    ),
    (
        1,
        ("omega_deg", "phi_deg", "kappa_deg"),
        "$f$ is held at 74 mm in heads whose true $f$ is another; in a head that looks aslant, "
        "tilt and principal point take up the difference",
    ),
    (
        3,
        ("sigma0_squared",),
        "the unit of weight of the paper's adjustments is not told; ours has the true a priori "
        "standard deviations, which give one",
    ),
    (
        3,
        ("sigma:boresight_omega_deg", "sigma:boresight_phi_deg", "sigma:boresight_kappa_deg"),
        "the printed ones have the size of the scatter of single images; ours are those of their "
        "mean",
    ),
    (
        4,
        ("rms", "mean", "sigma:mean", "n_within", "within"),
        "the paper's RMS, scatter and count contradict each other (see the errata); ours is what "
        "the simulated noise predicts, with the attitude of section 3.1",
    ),
    (4, ("n_pairs", "n_success"), "the places of the natural targets are not published"),
)


def _reason(printed: Printed, what: str) -> str:
    """Return the reason why a number does not agree, if it is known."""
    name = printed.parameter if what == "value" else f"sigma:{printed.parameter}"
    for table, prefixes, reason in REASONS:
        if table == printed.table and name.startswith(prefixes):
            return reason
    return "chance, or something that is not understood"
