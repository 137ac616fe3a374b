"""Tables and sentences on standard deviations: those of a flight, and of simulated ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, with_unit
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.variance_components import Component, components, sentences
from acx4lib.calibration.mounting import Mounting

NOTHING = "There is no single step, and so no residuals to compare with their sigma."
TOO_FEW = "too little redundancy"
FORMATS = {"Redundancy": ".1f", "Effective": ".1f", "Used": ".2f"}
WRONG_FORMATS = {"Redundancy": ".1f", "Effective": ".1f", "True factor": ".2f"}


def component_table(single: Mounting | None, applied: Mapping[str, float]) -> pd.DataFrame:
    """Return the variance components of the single step.

    Parameters
    ----------
    single : Mounting or None
        None where the single step has no outcome.
    applied : mapping of str to float
        By what the given sigma were multiplied for it.
    """
    if single is None:
        nothing = dict.fromkeys(("Number", *FORMATS), np.nan)
        return pd.DataFrame([{"Observations": "no single step", **nothing}])
    return pd.DataFrame([_row(c) for c in components(single.bundle, applied=applied)])


def _row(c: Component) -> dict[str, object]:
    return {
        "Observations": c.group,
        "Number": c.n,
        "Redundancy": c.redundancy,
        "Effective": c.effective,
        "Factor of σ": _factor(c.factor, c.sigma) if c.estimable else TOO_FEW,
        "Used": c.applied,
    }


def _factor(factor: float, sigma: float) -> Markup:
    return Markup(f"{factor:.2f} ± {sigma:.2f}")


def said(single: Mounting | None, applied: Mapping[str, float]) -> str:
    """Say which sigma are wrong or were multiplied, as a list; or that none is."""
    if single is None:
        return NOTHING
    found = components(single.bundle, applied=applied)
    lines = [f"- {shown(line[0].upper() + line[1:])}." for line in sentences(found)]
    if lines:
        return "\n".join(lines)
    judged = "; ".join(shown(c.group) for c in found if c.estimable)
    return f"The residuals do not contradict any of the sigma that they can judge: {judged}."


# --- simulated flights -----------------------------------------------------------------------


def wrong_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return what was found where sigma were given wrong, for readers.

    Parameters
    ----------
    table : DataFrame
        As `experiments.wrong_sigma` returns it.
    """
    rows = []
    for row in table.to_dict("records"):
        told = np.isfinite(row["factor"])
        estimated = np.isfinite(row["estimated"])
        rows.append(
            {
                "Observations": row["group"],
                "Redundancy": row["redundancy"],
                "Effective": row["effective"],
                "True factor": row["true"],
                "Diagnosis": _factor(row["factor"], row["sigma"]) if told else TOO_FEW,
                "Estimated": f"{row['estimated']:.2f}" if estimated else "as given",
            }
        )
    return pd.DataFrame(rows)


def refraction_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the errors with and without refraction of the parameters that it moves.

    Parameters
    ----------
    table : DataFrame
        As `experiments.refraction_effect` returns it.
    """
    rows = []
    for row in table.to_dict("records"):
        unit = row["parameter"].rpartition("_")[2]
        if unit in ("mm", "m", "deg"):
            rows.append(
                {
                    "Parameter": with_unit(LABELS[row["parameter"]], unit),
                    "σ": f"{row['sigma']:.4f}",
                    "Error, modelled (σ)": _signed(row["with_model"] / row["sigma"]),
                    "Error, left out (σ)": _signed(row["without_model"] / row["sigma"]),
                }
            )
    return pd.DataFrame(rows)


def _signed(value: float) -> str:
    """Return a number with three decimals and its sign; zero has none."""
    text = f"{value:+.3f}"
    return "0.000" if float(text) == 0 else text


def refraction_sentence(table: pd.DataFrame) -> str:
    """Say what refraction does to the focal length and the lever arm where it is left out."""
    wrong = dict(zip(table["parameter"], table["without_model"], strict=True))
    sigma = dict(zip(table["parameter"], table["sigma"], strict=True))
    largest = float(np.max(np.abs(table["with_model"] / table["sigma"])))
    return (
        f"Left out, refraction makes the focal length {1000 * wrong['f_mm']:+.1f} µm wrong, "
        f"{abs(wrong['f_mm'] / sigma['f_mm']):.1f} of its standard deviations, and moves the "
        f"lever arm by {100 * wrong['lever_z_m']:+.1f} cm in $z$. With the model no parameter "
        f"is off by more than {largest:.3f} of its standard deviations."
    )


def height_sentence(table: pd.DataFrame) -> str:
    """Say at which noise of GNSS heights the sigma are those that the paper prints.

    Parameters
    ----------
    table : DataFrame
        As `experiments.height_noise` returns it, noise ascending.
    """
    noise_cm = 100 * table["gnss_height_m"]
    at = [
        np.interp(printed.sigma(3, name, "single_step"), table[f"sigma_{name}"], noise_cm)
        for name in ("f_mm", "lever_z_m")
    ]
    return (
        f"The printed standard deviation of $f$ is met at {at[0]:.1f} cm of white noise in height, "
        f"that of the lever arm's $z$ at {at[1]:.1f} cm. The paper prints one digit of the former."
    )


def scatter_sentence(errors: pd.DataFrame, scatter: pd.DataFrame) -> str:
    """Say how wrong the sigma of boresight and lever arm are, and that no test shows it.

    Parameters
    ----------
    errors : DataFrame
        As `experiments.trajectory_errors` returns it.
    scatter : DataFrame
        As `experiments.scatter` returns it.
    """
    parts = []
    for kind, title in (("white", "independent"), ("slow", "slowly changing")):
        own = scatter[scatter["kind"] == kind]
        spans = []
        for what, prefix in (("boresight", "boresight"), ("lever arm", "lever")):
            ratio = own["ratio"][own["parameter"].str.startswith(prefix)]
            spans.append(f"{ratio.min():.1f} to {ratio.max():.1f} ({what})")
        parts.append(f"With {title} errors it is {' and '.join(spans)}")
    variance = errors.groupby("kind")["sigma0_squared"].mean()
    n = errors["seed"].nunique()
    return (
        f"Over {n} flights, the RMS of the error should be once the stated standard deviation. "
        f"{'. '.join(parts)}. The variance of unit weight is {variance['slow']:.2f} on average "
        f"({variance['white']:.2f} with independent errors): nothing in the adjustment gives the "
        "slow errors away."
    )
