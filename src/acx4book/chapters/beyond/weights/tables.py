"""Tables and sentences on standard deviations and GNSS shifts of simulated flights."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.weights.shifted import SHIFT_M
from acx4book.chapters.beyond.weights.simulated import MODELLED
from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, with_unit
from acx4book.typesetting.plain_text import Markup

TOO_FEW = "too little redundancy"

WRONG_FORMATS = {"Redundancy": ".1f", "Effective": ".1f", "True factor": ".2f"}


def wrong_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return what was found where sigma were given wrong, for readers.

    Parameters
    ----------
    table : DataFrame
        As `simulated.wrong_sigma` returns it.
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
                "Diagnosis": Markup(f"{row['factor']:.2f} ± {row['sigma']:.2f}")
                if told
                else TOO_FEW,
                "Estimated": f"{row['estimated']:.2f}" if estimated else "as given",
            }
        )
    return pd.DataFrame(rows)


def refraction_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the errors with and without refraction of the parameters that it moves.

    Parameters
    ----------
    table : DataFrame
        As `simulated.refraction_effect` returns it.
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
        As `simulated.height_noise` returns it, noise ascending.
    """
    f, z = (_met(table, name) for name in ("f_mm", "lever_z_m"))
    return (
        f"The printed standard deviation of $f$ is met {f}, that of the lever arm's $z$ {z}. "
        "The paper does not say how many tie points its block had; with another number of them, "
        "the noise is another one."
    )


def _met(table: pd.DataFrame, name: str) -> str:
    """Return the noise of heights at which the sigma of a parameter is the printed one."""
    noise_cm, sigma = 100 * table["gnss_height_m"], table[f"sigma_{name}"]
    wanted = printed.sigma(3, name, "single_step")
    if not sigma.min() <= wanted <= sigma.max():
        return f"at none between {noise_cm.min():.1f} and {noise_cm.max():.1f} cm of white noise"
    return f"at {np.interp(wanted, sigma, noise_cm):.1f} cm of white noise in height"


def scatter_sentence(errors: pd.DataFrame, scatter: pd.DataFrame) -> str:
    """Say how wrong the sigma of boresight and lever arm are, and that no test shows it.

    Parameters
    ----------
    errors : DataFrame
        As `simulated.trajectory_errors` returns it.
    scatter : DataFrame
        As `simulated.scatter` returns it.
    """
    parts = []
    for kind, title in (("white", "independent"), ("slow", "slowly changing")):
        parts.append(f"With {title} errors it is {_spans(scatter, kind)}")
    variance = errors.groupby("kind")["sigma0_squared"].mean()
    n = errors["seed"].nunique()
    return (
        f"Over {n} flights, the RMS of the error should be once the stated standard deviation. "
        f"{'. '.join(parts)}. The variance of unit weight is {variance['slow']:.2f} on average "
        f"({variance['white']:.2f} with independent errors): nothing in the adjustment gives the "
        "slow errors away."
    )


def modelled_sentence(errors: pd.DataFrame, scatter: pd.DataFrame) -> str:
    """Say how large errors are against the sigma of weights that know their correlation.

    Parameters
    ----------
    errors, scatter : DataFrame
        As in `scatter_sentence`.
    """
    variance = errors[errors["kind"] == MODELLED]["sigma0_squared"].mean()
    return (
        "With the correlation in the weights, the RMS of the error over the stated standard "
        f"deviation is {_spans(scatter, MODELLED)}, and the variance of unit weight "
        f"{variance:.2f} on average."
    )


def _spans(scatter: pd.DataFrame, kind: str) -> str:
    """Return the smallest and the largest ratio of boresight and lever arm."""
    own = scatter[scatter["kind"] == kind]
    spans = []
    for what, prefix in (("boresight", "boresight"), ("lever arm", "lever")):
        ratio = own["ratio"][own["parameter"].str.startswith(prefix)]
        spans.append(f"{ratio.min():.1f} to {ratio.max():.1f} ({what})")
    return " and ".join(spans)


# --- a shift of the trajectory --------------------------------------------------------------


def ratio_table(scatter: pd.DataFrame) -> pd.DataFrame:
    """Return how large errors are against their sigma, a column for each kind.

    Parameters
    ----------
    scatter : DataFrame
        `simulated.scatter` of what `shifted.shifted_trajectories` returns.
    """
    rows = []
    for name, own in scatter.groupby("parameter", sort=False):
        if name in LABELS and str(name)[0] not in "kp":  # distortion is the images' alone
            ratio = {k: f"{r:.1f}" for k, r in zip(own["kind"], own["ratio"], strict=True)}
            cells = {_title(kind): ratio.get(kind, "held") for kind in scatter["kind"].unique()}
            rows.append({"Parameter": LABELS[str(name)], **cells})
    return pd.DataFrame(rows)


def _title(kind: str) -> str:
    """Return the heading of a column."""
    flight, _, unknown = kind.partition(", ")
    return f"{flight.capitalize()}; unknown: {unknown}"


def ratio_sentence(errors: pd.DataFrame) -> str:
    """Say what the shift does to the residuals and to the lever arm, with and without unknowns.

    Parameters
    ----------
    errors : DataFrame
        As `shifted.shifted_trajectories` returns it.
    """
    variance = errors.groupby("kind")["sigma0_squared"].mean()
    lever_z = errors[errors["parameter"] == "lever_z_m"].groupby("kind")["error"].mean()
    east, north, height = SHIFT_M
    return (
        f"Over {errors['seed'].nunique()} flights with a shift of {east:+.2f} m, {north:+.2f} m "
        f"and {height:+.2f} m in east, north and height, the variance of unit weight is "
        f"{variance['shifted, none']:.2f} on average, and {variance['shifted, shift']:.2f} with "
        f"the shift as an unknown. The lever arm's $z$ is off by "
        f"{lever_z['shifted, none']:+.2f} m without the unknown, and by "
        f"{lever_z['shifted, shift']:+.2f} m with it."
    )


def answer(errors: pd.DataFrame, scatter: pd.DataFrame, refraction: pd.DataFrame) -> str:
    """Say what an adjustment notices of wrong standard deviations, and what it does not.

    Parameters
    ----------
    errors, scatter, refraction : DataFrame
        As `simulated` returns them.
    """
    boresight, known = (
        scatter[(scatter["kind"] == kind) & scatter["parameter"].str.startswith("boresight")]
        for kind in ("slow", MODELLED)
    )
    variance = errors.groupby("kind")["sigma0_squared"].mean()["slow"]
    off = np.abs(refraction["without_model"] / refraction["sigma"])
    return (
        "A standard deviation that is wrong for a whole group of observations shows in the "
        "residuals, as far as other observations contradict it. Errors that change slowly do not: "
        f"the boresight is then wrong by {boresight['ratio'].min():.1f} to "
        f"{boresight['ratio'].max():.1f} times its stated standard deviation, while the variance "
        f"of unit weight is {variance:.2f}. Weights that know the correlation make it "
        f"{known['ratio'].min():.1f} to {known['ratio'].max():.1f} times; but no adjustment tells "
        "the correlation: the processing of the trajectory has to. A shift "
        "of the trajectory needs control points and an unknown of its own. Refraction that is left "
        f"out costs up to {off.max():.1f} standard deviations."
    )
