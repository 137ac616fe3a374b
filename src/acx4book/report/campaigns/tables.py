"""Tables of a comparison for readers, made of those for programs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from acx4book.report.campaigns.study import Study
from acx4book.report.campaigns.units import cameras_to_say, label, rows_of, scale
from acx4book.typesetting.labels import TITLES, p_value, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup
from acx4lib.results.campaigns.comparison import Difference


def campaigns(study: Study) -> pd.DataFrame:
    """Return the campaigns: when, how warm, how calibrated, how well the σ fit."""
    rows = []
    for row in rows_of(study.tables["campaigns"]):
        warm = row.temperature_c
        rows.append(
            {
                "Campaign": row.campaign,
                "Date": row.date or None,
                "Temperature (°C)": f"{warm:g}" if np.isfinite(warm) else None,
                "Method": TITLES[row.method],
                "Redundancy": f"{row.redundancy:,}",
                "σ₀²": f"{row.sigma0_squared:.3f}",
                "p of σ₀²": p_value(row.chi_square_p) if np.isfinite(row.chi_square_p) else None,
                "σ used": row.sigma,
            }
        )
    return pd.DataFrame(rows)


def tests(study: Study) -> pd.DataFrame:
    """Return the joint tests of all parameters: of stability, of every difference, of trends."""
    table = study.tables["tests"]
    whole = table[table["part"] == "all"]
    equal = {study.title(one): " = ".join(study.names(one)) for one in study.found}
    rows = [
        {"Hypothesis": equal.get(row.test, row.test), **_tested(row, study.level)}
        for row in rows_of(whole)
    ]
    return pd.DataFrame(rows).rename(columns={"Significant": "Rejected"})


def parts(study: Study, one: Difference) -> pd.DataFrame:
    """Return the joint tests of the parts of a difference, with their effects on the ground."""
    table = study.tables["tests"]
    mine = table[(table["test"] == study.title(one)) & (table["part"] != "all")]
    several = cameras_to_say(study.comparison.parameters)
    return pd.DataFrame(
        [
            {
                "Part": f"{row.camera} {row.part}" if several else row.part,
                **_tested(row, study.level),
                "Ground (m)": f"{row.ground_rms_m:.3f}",
                "by chance (m)": f"{row.ground_sigma_m:.3f}",
            }
            for row in rows_of(mine)
        ]
    )


def _tested(row: Any, level: float) -> dict[str, object]:
    return {
        "χ²": f"{row.chi_square:.1f}",
        "Degrees of freedom": row.dof,
        "p, joint": p_value(row.p_joint),
        "Significant": _answer(row.p_joint < level),
    }


def _answer(rejected: bool) -> str:
    return "yes" if rejected else "no"


def _label(row: Any, several: bool) -> Markup:
    return label(row.parameter, row.camera if several else "")


def singles(study: Study, one: Difference) -> pd.DataFrame:
    """Return the parameters of a difference, one by one."""
    table, names = study.tables["differences"], study.names(one)
    mine = table[(table["later"] == names[0]) & (table["earlier"] == names[1])]
    several = cameras_to_say(study.comparison.parameters)
    rows = []
    for row in rows_of(mine):
        factor, unit = scale(row.unit)
        rows.append(
            {
                "Parameter": with_unit(_label(row, several), unit),
                "Difference": value_and_sigma(factor * row.difference, factor * row.sigma),
                "t": f"{row.t:+.1f}",
                "p, joint": p_value(row.p_joint),
                "Significant": _answer(row.p_joint < study.level),
                "Ground (m)": f"{row.ground_rms_m:.3f}",
            }
        )
    return pd.DataFrame(rows)


def pooled(study: Study) -> pd.DataFrame:
    """Return the value of every parameter from all campaigns, and whether it is stable."""
    several = cameras_to_say(study.comparison.parameters)
    return pd.DataFrame(
        [
            {
                "Parameter": with_unit(
                    label(row.parameter, row.camera if several else ""), row.unit
                ),
                "Of all campaigns": value_and_sigma(row.value, row.sigma),
                "χ²": f"{row.chi_square:.1f}",
                "Degrees of freedom": row.dof,
                "p, joint": p_value(row.p_joint),
                "Significant": _answer(row.p_joint < study.level),
            }
            for row in rows_of(study.tables["pooled"])
        ]
    )


def trends(study: Study, what: str) -> pd.DataFrame:
    """Return the slopes over time or temperature.

    Parameters
    ----------
    study : Study
    what : str
        ``"temperature"`` or ``"year"``.
    """
    several = cameras_to_say(study.comparison.parameters)
    table = study.tables["trends"]
    rows = []
    for row in rows_of(table[table["over"] == what]):
        unit, _, per = row.unit.partition(" per ")
        factor, sign = scale(unit)
        rows.append(
            {
                "Parameter": with_unit(_label(row, several), sign),
                f"Slope per {per}": value_and_sigma(factor * row.slope, factor * row.sigma),
                "t": f"{row.t:+.1f}",
                "p, joint": p_value(row.p_joint),
                "Significant": _answer(row.p_joint < study.level),
            }
        )
    return pd.DataFrame(rows)
