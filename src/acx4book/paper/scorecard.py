"""Every number of the paper's Tables 1-4 and that of a run, with a verdict by one rule."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from acx4book.paper import errata
from acx4book.paper import printed as paper
from acx4book.paper.printed import ROLES
from acx4book.typesetting.myst import (
    LABELS,
    TITLES,
    myst_table,
    scientific,
    value_and_sigma,
    with_unit,
)
from acx4book.typesetting.plain_text import Markup, shown
from acx4files.flight.reader import Flight
from acx4files.results import folder
from acx4lib.design import ground_sample_m
from acx4lib.geometry.parameters import AXES

LATITUDE_OF_SIGMA = 0.2
TWO_STEP = "two_step_gnss"
"""The interpretation of the two-step method that gives the printed standard deviations."""


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


def _scorecard(
    results: folder.Results, flight: Flight, *, tables: Collection[int] = (1, 2, 3, 4)
) -> pd.DataFrame:
    """Return one row per printed number."""
    rows = []
    for number, find in ((1, _table_1), (2, _table_2), (3, _table_3), (4, _table_4)):
        if number not in tables:
            continue
        for printed in map(as_printed_row, paper.table(number).to_dict("records")):
            ours = find(results, flight, printed.parameter, printed.column)
            rows.append(line(printed, "value", ours))
            if np.isfinite(printed.sigma):
                spread = _sigma_of(results, flight, number, printed.parameter, printed.column)
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
    rounding = _half_digit(digits, number)
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


def _paper_sigma(printed: Printed, number: str, ours: Ours) -> float:
    """Return the standard deviation of a printed value; for means of Table 4 it is computed."""
    if number != "value" or not np.isfinite(printed.sigma):
        return 0.0
    if printed.table != 4:
        return printed.sigma
    return ours.sharing * printed.sigma / np.sqrt(paper.value(4, "n_points", "single_step"))


def _half_digit(digits: str, number: float) -> float:
    """Return half a unit of the last of a printed number's digits, as `printed.digits` has them."""
    mantissa, _, power = digits.partition("·")
    tens = int(np.floor(np.log10(abs(number)))) if power else 0
    return 0.5 * 10.0 ** (tens - len(mantissa.partition(".")[2]))


# --- the numbers of a run --------------------------------------------------------------------


def _parameter(results: folder.Results, method: str, camera: str, name: str) -> tuple[float, float]:
    listed = folder.parameters(results, method, camera)
    return float(listed["value"][name]), float(listed["sigma"][name])


def _summary(results: folder.Results, key: str, name: str) -> float:
    return float(str(results.summary[key][name]))


def _variance(results: folder.Results, key: str) -> Ours:
    value = _summary(results, key, "sigma0_squared")
    spread = value * np.sqrt(2 / _summary(results, key, "redundancy"))
    return Ours(value=value, sigma=float(spread))


def _table_1(results: folder.Results, flight: Flight, name: str, head: str) -> Ours | None:
    if name == "sigma0_squared":
        return _variance(results, f"heads/bundle/{head}")
    if name == "f_mm":
        return Ours(value=flight.cameras[head].interior.f, sigma=0.0)
    if name in ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg"):
        value, sigma = _parameter(results, "heads/relative_orientation", head, name)
        return Ours(value=value, sigma=sigma)
    if name in folder.parameters(results, "heads/bundle", head).index:
        value, sigma = _parameter(results, "heads/bundle", head, name)
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


def _table_3(results: folder.Results, flight: Flight, name: str, column: str) -> Ours | None:
    method = f"mounting/{_method(column)}"
    if name == "sigma0_squared":
        return _variance(results, method)
    camera = _synthetic(flight)
    if name not in folder.parameters(results, method, camera).index:
        return None
    value, sigma = _parameter(results, method, camera, name)
    return Ours(value=value, sigma=sigma)


def _synthetic(flight: Flight) -> str:
    return flight.synthetic.camera if flight.synthetic else next(iter(flight.cameras))


def _sigma_of(
    results: folder.Results, flight: Flight, number: int, name: str, column: str
) -> Ours | None:
    """Return our standard deviation for a printed one; in Table 4 our scatter."""
    if number == 4:
        return _table_4(results, flight, name.replace("mean", "std"), column)
    find: Callable[..., Ours | None] = _table_1 if number == 1 else _table_3
    ours = find(results, flight, name, column)
    if ours is None:
        return None
    sigma = ours.sigma if number == 1 else _own_sigma(results, flight, name, column)
    return Ours(value=sigma, sigma=LATITUDE_OF_SIGMA * sigma)


def _own_sigma(results: folder.Results, flight: Flight, name: str, column: str) -> float:
    """Return the standard deviation that a mounting's adjustment gives by itself."""
    rows = folder.rows(results, "parameters", f"mounting/{_method(column)}")
    row = rows[(rows["camera"] == _synthetic(flight)) & (rows["parameter"] == name)].iloc[0]
    before = np.nan_to_num(row["sigma_before"])  # unknown in older results, whose sigma is the own
    return float(np.sqrt(row["sigma"] ** 2 - before**2))


def _table_4(results: folder.Results, flight: Flight, name: str, column: str) -> Ours | None:
    key = f"validation/{_method(column)}"
    entry = results.summary[key]
    n_points, n_pairs = _summary(results, key, "n_points"), _summary(results, key, "n_pairs")
    failed = _summary(results, key, "n_failed_pairs")
    gsd = ground_sample_m(flight.mounted("validation")) if flight.validation else np.nan
    kind, _, rest = name.partition("_")
    axis = {"east": 0, "north": 1, "height": 2}.get(rest.partition("_")[0], -1)
    points = folder.rows(results, "check_points", key)
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
    """Return a mean or an RMS over the pairs, with the sigma of the one over the points."""
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


def _reason(printed: Printed, number: str) -> str:
    """Return the reason why a number does not agree, if it is known."""
    name = printed.parameter if number == "value" else f"sigma:{printed.parameter}"
    for table, prefixes, reason in REASONS:
        if table == printed.table and name.startswith(prefixes):
            return reason
    return "chance, or something that is not understood"


# --- The scorecard as a page of the book


Run = tuple[folder.Results, Flight]
"""A run and its flight."""

RULE = (
    "A number *agrees* where it differs from the printed one by at most two combined standard "
    "deviations, is *near* up to three, and *differs* beyond. Combined are the rounding of the "
    "print, the paper's standard deviation where it prints one, and ours, which is that of "
    "{numref}`tab-our-sigma`. The paper's two-step column is compared with the two-step method "
    "that has GNSS positions in its bundle, since the printed standard deviations are those of "
    "that reading."
)
"""The rule of the verdict, by `scorecard.line`."""

OUR_SIGMA = (
    ("a parameter", "a posteriori, with the part of calibrations before"),
    (
        Markup("a mean over $n$ points that scatter by $s$"),
        Markup("$s/\\sqrt{n}$, times what the covariance between the points adds"),
    ),
    (Markup("a scatter or an RMS over $n$ points"), Markup("$s/\\sqrt{2n}$")),
    (Markup("a number $m$ of pairs"), Markup("$\\sqrt{m}$")),
    (
        Markup("a number of points out of $n$, their share being $q$"),
        Markup("$\\sqrt{n\\,q\\,(1-q)}$, at least 1/2"),
    ),
    (
        "a standard deviation",
        "20 % of the adjustment's own, since it depends on tie points that the paper does not tell",
    ),
)
"""Printed numbers, and our standard deviations of them."""

ALL = "Every number of the paper's Tables 1 to 4 stands below beside that of this copy's run."

IDEAL = (
    "Tables 3 and 4 are judged by the flight with an ideal synthetic camera, `acx4-ideal`. The "
    "column *four heads* has the number of synthetic images that are made of four "
    "heads. The heads were chosen so that the $f$ of the single step comes out. Everything else in "
    "the column follows from them; {doc}`_executed/12-synthetic-cost` explains where it differs."
)
"""Sentence on the source of the numbers of Tables 3 and 4, if there are two flights."""

MORE = (
    "Every number stands on the {doc}`scorecard <scorecard>`; {doc}`reproducibility` lists what "
    "was given and what was chosen."
)

WHY = (
    "The flight of the study is not public. This copy of the book was made from a simulated one, "
    "over the study's own block design, computed from exact geometry by code that shares nothing "
    "with the estimator."
)


def texts(
    found: folder.Results, flight: Flight, *, simulated: bool, ideal: Run | None = None
) -> dict[str, str]:
    """Return the texts on the printed numbers that pages include, by the names of their files.

    Parameters
    ----------
    found : Results
    flight : Flight
        If it is not the simulated flight of the paper's design, its own parameters are listed
        instead.
    simulated : bool
        Whether the truth of the flight is known.
    ideal : tuple of Results and Flight, optional
        The same flight with an ideal synthetic camera: Tables 3 and 4 are judged by it.

    Returns
    -------
    dict of str to str
        MyST: ``roles.md`` says what is independent, ``standing-out.md`` what stands out,
        ``scorecard.md`` has the rule, the counts, and every number by table.
    """
    if not (simulated and paper.applies(flight)):
        return {
            "roles.md": _other_flight(flight) + "\n",
            "standing-out.md": "\n",
            "scorecard.md": _own_parameters(found),
        }
    card, judged = _scorecard(found, flight), (found, flight)
    if ideal is not None:
        card, judged = beside_chain(card, _scorecard(*ideal, tables=(3, 4))), ideal
    return {
        "roles.md": f"{WHY} {paper.sentence(card)}\n",
        "standing-out.md": _standing_out(card, *judged, heads=found),
        "scorecard.md": _tables(card),
    }


def beside_chain(card: pd.DataFrame, ideal: pd.DataFrame) -> pd.DataFrame:
    """Put the closed chain's numbers beside those of an ideal camera.

    Parameters
    ----------
    card, ideal : DataFrame
        As `_scorecard` returns them: the closed chain's with all tables, and some of the ideal
        camera's, which replace the former.

    Returns
    -------
    DataFrame
        With a column chain: the closed chain's number where the ideal camera's is judged.
    """
    keys = ["table", "quantity", "column"]
    chain = card[[*keys, "ours"]].rename(columns={"ours": "chain"})
    rest = card[~card["table"].isin(ideal["table"])]
    return pd.concat([rest, ideal.merge(chain, on=keys, how="left")], ignore_index=True)


def _tables(card: pd.DataFrame) -> str:
    """Return the roles, the rule, the counts, and every number by table."""
    counted = myst_table(counts(card), "The verdicts, by role", name="tab-verdicts")
    sigma = pd.DataFrame(list(OUR_SIGMA), columns=["Number", "Our standard deviation"])
    combined = myst_table(sigma, "Our standard deviations in the rule", name="tab-our-sigma")
    ideal_text = [IDEAL] if "chain" in card else []
    parts = [ALL, *ideal_text, _roles_table(), counted, RULE, combined]
    for number, lines in card.groupby("table"):
        name = f"tab-card-{number}"
        caption = f"The paper's Table {number}, number by number"
        notes = list(dict.fromkeys(reason for reason in lines["reason"] if reason))
        table = myst_table(_shown(lines, notes), caption, name=name, formats={"off by (σ)": ".1f"})
        reasons = "\n".join(f"- **({_letter(i)})** {note}." for i, note in enumerate(notes))
        title = f"The paper's Table {number}: {len(lines)} numbers"
        parts.append(f"::::{{dropdown}} {title}\n\n{table}\n\n{reasons}\n::::")
    return "\n\n".join(parts) + "\n"


def _roles_table() -> str:
    """Return the roles and what they mean as a MyST table."""
    rows = pd.DataFrame(
        [{"Role": role, "What its agreement means": meaning} for role, meaning in ROLES.items()]
    )
    return myst_table(rows, "Roles of the printed numbers", name="tab-roles")


def _standing_out(
    card: pd.DataFrame, results: folder.Results, flight: Flight, *, heads: folder.Results
) -> str:
    """Return the main findings on Table 1, the methods, Table 3 and Table 4, as a list."""
    lines = (
        *_held(heads),
        _shift_of_methods(
            card, errata.lever_arm_in_interior(errata.absorbed_of_run(flight, results))
        ),
        _sigma_of_table_3(card, flight),
        _rms_of_table_4(card, results),
    )
    return "\n".join(f"- {line}" for line in lines) + f"\n\n{MORE}\n"


def _held(results: folder.Results) -> list[str]:
    """Write what the images say of the held focal length; nothing where they do not reject it."""
    costs = errata.rejected_focal_lengths(results)
    if not costs:
        return []
    summary: Mapping[str, Mapping[str, Any]] = results.summary
    freed = [summary[f"heads/bundle/{head}"]["held"][f"{head}/f_mm"]["moves"] for head in costs]
    points = ("/xp_mm", "/yp_mm")
    moves = [abs(by) for of in freed for name, by in of.items() if name.endswith(points)]
    return [
        f"**Held.** The paper's Table 1 holds $f$ at {paper.statement('head_f_fixed_mm'):g} mm, "
        f"and so do the heads here. The images of {len(costs)} heads reject that: it costs "
        f"{sum(costs.values()):.0f} in $v^TPv$, where right values would cost about {len(costs)}. "
        f"Freeing it moves $x_p$ and $y_p$ by up to {max(moves, default=0):.0f} of their standard "
        "deviations. Where they agree with print, two adjustments have the same held value, and "
        "neither has the camera's. The relative orientation and the synthetic image take it up "
        "({doc}`_executed/01-head-calibration`)."
    ]


def _pick(card: pd.DataFrame, table: int, quantity: str, column: str) -> tuple[float, float]:
    """Return a printed number and ours."""
    row = card[
        (card["table"] == table) & (card["quantity"] == quantity) & (card["column"] == column)
    ]
    return float(row["printed"].iloc[0]), float(row["ours"].iloc[0])


def _shift_of_methods(card: pd.DataFrame, absorbed_arm: pd.DataFrame) -> str:
    """Write the differences of the two methods, in print and here, and their assumptions."""
    names = ", ".join(LABELS[name] for name in paper.STRONG)
    combined = [_apart(name) for name in paper.STRONG]
    text = (
        f"**The effect.** The two-step {names} minus the single-step ones are printed as "
        f"{_shifts(card, 'printed')} mm, {min(combined):.1f} to {max(combined):.1f} of their "
        "combined standard deviations. The interior orientation absorbs the lever arm that the "
        f"two-step method holds at zero. Here they are {_shifts(card, 'ours')} mm"
    )
    if "chain" in card:
        text += (
            " where *one ideal camera* takes the images, and "
            f"{_shifts(card, 'chain')} mm where the images are *made of four heads*, as in the "
            "study. In the latter $f$ does not follow, because four lens centres in a square give "
            "the synthetic camera another lever arm; with lenses that stand lower it does "
            "({doc}`_executed/12-synthetic-cost`)"
        )
    text += (
        ". The agreement rests on two readings: of the two-step method that has GNSS positions in "
        "its bundle, and of the lever arm's axes as forward, left, up. The paper states neither. "
        "They were chosen because they fit, so the agreement explains the numbers and is no "
        "independent evidence for them."
    )
    if "expected_mm" not in absorbed_arm:
        return text
    block = "the block of the ideal camera" if "chain" in card else "this block"
    off_um = 1e3 * (absorbed_arm["shift_mm"] - absorbed_arm["expected_mm"]).abs()
    in_sigma = off_um / (1e3 * absorbed_arm["sigma_mm"])
    rest_mm = 1e3 * absorbed_arm["sum_effective_m"].abs()
    return (
        f"{text} By least squares over {block}, the printed lever arm must shift them by "
        f"{', '.join(f'{x:+.4f}' for x in absorbed_arm['expected_mm'])} mm. The paper's own "
        f"two columns agree with that to {off_um.max():.1f} µm, a lever arm of "
        f"{rest_mm.min():.0f} to {rest_mm.max():.0f} mm; this is {in_sigma.max():.0f} times the "
        "standard deviation that measurements of both methods leave, since the weights of the "
        "paper's adjustments are not known ({doc}`_executed/06-errata`)."
    )


def _shifts(card: pd.DataFrame, column: str) -> str:
    """Return the two-step values of `printed.STRONG` less the single-step ones, mm."""
    rows = card[(card["table"] == 3) & card["quantity"].isin(paper.STRONG)]
    wide = rows.pivot_table(index="quantity", columns="column", values=column)
    shift = wide["two_step"] - wide["single_step"]
    return ", ".join(f"{shift[name]:+.4f}" for name in paper.STRONG)


def _apart(name: str) -> float:
    """Return the distance of the two printed values of a parameter, in combined sigma."""
    values, sigma = (
        [read(3, name, method) for method in paper.METHODS] for read in (paper.value, paper.sigma)
    )
    return float(abs(values[0] - values[1]) / np.linalg.norm(sigma))


def _sigma_of_table_3(card: pd.DataFrame, flight: Flight) -> str:
    is_sigma = (card["table"] == 3) & card["quantity"].str.startswith("sigma of")
    of_interest = card[is_sigma & (card["role"] == "chosen")]
    ratio = of_interest["ours"] / of_interest["printed"]
    block = flight.calibration
    gnss = np.nan if block is None else np.median(block.trajectory.sigma_position)
    return (
        f"**Chosen.** {len(ratio)} standard deviations of the paper's Table 3 come out "
        f"between {ratio.min():.2f} and {ratio.max():.2f} times the printed ones. The number of "
        f"tie points and a GNSS noise of about {100 * gnss:.2g} cm were chosen for that: the paper "
        "gives no number, and a larger noise. Their agreement is no evidence; that two choices "
        "serve all of them shows that the paper's Table 3 is consistent with the paper's block."
    )


def _rms_of_table_4(card: pd.DataFrame, results: folder.Results) -> str:
    """Write the RMS over pairs, as in Table 4, and over points, each from all its rays."""
    points = folder.rows(results, "check_points", "validation/single_step")
    d = points[["d_east_m", "d_north_m", "d_height_m"]].to_numpy()
    over_points = np.sqrt(np.mean(d**2, axis=0))
    pairs = np.array([_pick(card, 4, f"rms_{axis}_m", "single_step") for axis in AXES])
    plan = np.hypot(*pairs[:2])
    return (
        f"**What differs.** The RMS of the single step's differences is printed as {plan[0]:.2f} m "
        f"in plan and {pairs[2, 0]:.2f} m in height. In this one flight it is {plan[1]:.2f} m and "
        f"{pairs[2, 1]:.2f} m over *pairs* of images, as the paper counts, and "
        f"{np.hypot(*over_points[:2]):.2f} m and {over_points[2]:.2f} m over *points*, each "
        "intersected once from all its rays. Ours is what the simulated noise predicts. The "
        "paper's RMS, scatter and count of small errors contradict each other "
        "({doc}`_executed/06-errata`)."
    )


def _other_flight(flight: Flight) -> str:
    return (
        f"This copy of the book was made from the flight *{shown(flight.name)}*, which is not the "
        "study's: the paper's numbers do not stand beside its own. Where the pages speak of the "
        "paper, they explain the method."
    )


def _own_parameters(results: folder.Results) -> str:
    """Return the parameters from the run of another flight."""
    listed = results.parameters
    table = pd.DataFrame(
        {
            "method": listed["stage"] + "/" + listed["method"],
            "camera": listed["camera"],
            "parameter": [
                with_unit(_label(name), unit)
                for name, unit in zip(listed["parameter"], listed["unit"], strict=True)
            ],
            "estimate": [
                value_and_sigma(v, s) for v, s in zip(listed["value"], listed["sigma"], strict=True)
            ],
        }
    )
    return f"{myst_table(table, 'What was estimated', name='tab-estimated')}\n"


def _letter(i: int) -> str:
    return chr(ord("a") + i)


def _shown(lines: pd.DataFrame, notes: Sequence[str]) -> pd.DataFrame:
    """Return the columns of the card for readers; reasons are letters that refer to notes."""
    ours = [
        value_and_sigma(v, s) if s > 0 else f"{v:.4g}" if v % 1 else f"{v:.0f}"
        for v, s in zip(lines["ours"], lines["sigma"], strict=True)
    ]
    chain = _chain(lines)
    return pd.DataFrame(
        {
            "quantity": [
                with_unit(_label(q), u)
                for q, u in zip(lines["quantity"], lines["unit"], strict=True)
            ],
            "column": [TITLES.get(c, c) for c in lines["column"]],
            "paper": [Markup(text) for text in lines["as_printed"]],  # our own transcription
            "this book": ours,
            **chain,
            "off by (σ)": lines["deviation"],
            "role": lines["role"],
            "verdict": [
                f"{verdict}\N{NO-BREAK SPACE}({_letter(notes.index(reason))})"
                if reason
                else verdict
                for verdict, reason in zip(lines["verdict"], lines["reason"], strict=True)
            ],
        }
    )


def _chain(lines: pd.DataFrame) -> dict[str, list[Markup]]:
    """Return the column of the closed chain, to the digits of ours, where it is."""
    if "chain" not in lines or lines["chain"].isna().all():
        return {}
    chain = [
        Markup(value_and_sigma(v, s).partition(" ±")[0] if s > 0 else _plain(float(f"{v:.6g}")))
        for v, s in zip(lines["chain"], lines["sigma"], strict=True)
    ]
    return {"four heads": chain}


def _label(quantity: str) -> str:
    name = quantity.removeprefix("sigma of ")
    label = LABELS.get(name, name)
    if name == quantity:
        return label
    return Markup(label.replace("mean", "scatter") if "mean" in label else f"σ of {shown(label)}")


def _plain(value: float) -> str:
    """Return a number as text, with a power of ten if it is very small."""
    return scientific(value, digits=2) if 0 < abs(value) < 1e-3 else f"{value:.9g}"
