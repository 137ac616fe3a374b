"""What the flights with and without a synthetic image say, in sentences."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import (
    figures,
    heights,
    lever_arm,
    radial,
    study,
    tables,
)
from acx4book.chapters.beyond.synthetic_cost.study import RIG, SYNTHETIC, Study
from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import at_commit
from acx4lib.expected import Array

SECONDS = 3600.0
"""Of arc in a degree."""


def made(found: Study) -> str:
    """Say when and from what the numbers of the page were computed."""
    about = found.about
    return (
        f"Computed on {about['date']} at {at_commit(about['commit'])} from {found.n_flights} "
        f"flights of the design `{about['design']}`, seeds {about['first_seed']} to "
        f"{about['last_seed']}, and from flights without noise."
    )


def accuracy(found: Study) -> str:
    """Say what the synthetic image costs at check points."""
    table = study.accuracy(found)
    points, over_pairs = (table.loc[table["over"] == of, "percent"] for of in ("points", "pairs"))
    pairs = found.points[found.points["over"] == "pairs"].groupby("way")["n"].mean()
    return (
        f"With the synthetic image the RMS over check points is larger by {_range(points)} %, by "
        f"axis. Over pairs it differs by {_range(over_pairs)} %, but these are not the same pairs: "
        f"the heads give {pairs[RIG]:.0f} pairs of rays where synthetic images give "
        f"{pairs[SYNTHETIC]:.0f}, since a point near a seam is measured in two heads of one "
        "exposure, and pairs of such rays are among them. Predicted standard deviations are "
        f"{_range(_predicted(table, SYNTHETIC))} times the RMS in synthetic images, and "
        f"{_range(_predicted(table, RIG))} times in the heads."
    )


def _predicted(table: pd.DataFrame, way: str) -> pd.Series:
    return table[f"sigma_{way}"] / table[f"rms_{way}"]


def parameters(found: Study) -> str:
    """Say how far estimates scatter, and what of it comes from the calibration of the heads."""
    own, rig = study.scatter(found, SYNTHETIC), study.scatter(found, RIG)
    shared = study.scatter_of_shared(found)
    units = {"f_mm": (1e3, " µm"), "xp_mm": (1e3, " µm"), "boresight_phi_deg": (SECONDS, "″")}
    each = "; ".join(
        f"{LABELS[row['parameter']]} {_parts(row, *units[row['parameter']])}"
        for row in own.to_dict("records")
        if row["parameter"] in units
    )
    return (
        f"Over {found.n_flights} flights the parameters of the heads scatter by "
        f"{_range(rig['ratio'])} times their stated standard deviations, which for each of the "
        f"{len(rig)} is known to {rig['sigma_ratio'].mean():.2f}; the root mean square is "
        f"{np.sqrt(np.mean(rig['ratio'] ** 2)):.2f}. Those of the synthetic camera scatter by "
        f"{_range(own['ratio'])} times, where the heads are calibrated anew for every flight. What "
        "exceeds the stated σ is the error of the heads' calibration: it is common to all points "
        "that are carried through the same heads, and the single step takes carried points for "
        f"independent measurements. In numbers: {each}. Among flights that are carried through one "
        f"calibration of the heads the parameters scatter by {_range(shared)} times the stated σ "
        f"({found.shared['heads_of'].nunique()} calibrations with "
        f"{found.shared.groupby('heads_of')['seed'].nunique().max()} flights each). The stated σ "
        "is therefore that of a comparison between flights with the same heads. The "
        "lever arm is spared. A deformed image is deformed alike from all flying heights, and a "
        "lever arm is what changes with the height."
    )


def _parts(row: Mapping[Hashable, Any], factor: float, unit: str) -> str:
    """Return the stated part of a scatter and the rest."""
    rest = np.sqrt(max(row["scatter"] ** 2 - row["sigma"] ** 2, 0.0))
    return f"{factor * row['sigma']:.1f}{unit} stated, {factor * rest:.1f}{unit} from the heads"


def chi_square(found: Study) -> str:
    """Say what the variance factor shows of the steps at the seams."""
    single, rig = (study.variance_factors(found, way) for way in (SYNTHETIC, RIG))
    excess = single - rig
    beyond = int(np.sum(single > 1 + 2 * np.std(single, ddof=1)))
    exact = found.squares[found.squares["parameter"] == "sigma0_squared"].set_index("side_m")[
        "value"
    ]
    return (
        f"$\\sigma_0^2$ is {rig.mean():.3f} on average in the rig, and {single.mean():.3f} in the "
        f"single step. On the same flight the difference is {excess.mean():.3f} ± "
        f"{np.std(excess, ddof=1) / np.sqrt(len(excess)):.3f}. Measurements without any noise "
        f"leave {exact.loc[exact.index.max()]:.3f}, and {exact.loc[0]:.3f} if the lens centres are "
        "put into one point. The excess is therefore no noise. It is the steps at the seams, which "
        "the one camera of the synthetic image cannot have. The $\\chi^2$ test says so: in "
        f"{beyond} of {len(single)} flights $\\sigma_0^2$ exceeds one by more than twice its "
        "scatter from flight to flight. A value of σ that is enlarged until the test passes hides "
        "this; the pattern stays."
    )


def lever(found: Study) -> str:
    """Say where the lever arm's height comes from."""
    z = study.scatter(found, SYNTHETIC).set_index("parameter").loc["lever_z_m"]
    true = float(lever_arm.true_centre_m()[2])
    exact = found.squares[found.squares["parameter"] == "lever_z_m"].set_index("side_m")["value"]
    side, size = float(exact.index.max()), np.ptp(printed.corners("SYN"), axis=0)
    rise = lever_arm.apparent_rise_m(side, tables.print_of("f_mm")[0], size)
    return (
        f"The lens centres lie at {true:.3f} m in the body's $z$. The lever arm that is estimated "
        f"is {z['mean']:+.3f} m on average, {(z['mean'] - true) / z['sigma']:.0f} times its stated "
        "standard deviation away. The cause is the square in which the lens centres stand: its "
        f"side is {100 * side:.0f} cm, and every head looks outward. The centre of a head is "
        f"{50 * side:.0f} cm beside that of the synthetic camera in either axis, and so is all "
        "that it sees on the ground. From any flying height this looks as if the camera were "
        f"higher. Least squares over the frame makes it {rise:.2f} m; the adjustment of exact data "
        f"has {exact.loc[side] - true:.2f} m. With a square of {100 * float(exact.index[1]):.0f} "
        f"cm it is {exact.iloc[1] - true:.2f} m, and with all lens centres in one point "
        f"{exact.loc[0] - true:+.3f} m. A surveyed lever arm is thus not confirmed by the one that "
        "a single step of synthetic images estimates."
    )


def focal_length_follows(found: Study) -> str:
    """Say why the two-step f moves with some places of the lens centres, and not with others."""
    table = tables.shifts(found)
    own = table[(table["side_m"] == table["side_m"].max()) & (table["lowered_m"] == 0)].iloc[0]
    lowered = table[table["lowered_m"] > 0].iloc[0]
    one = table[table["side_m"] == 0].iloc[0]
    names = list(tables.SHIFTED)
    worst = max(abs(row[n] - row[f"expected_{n}"]) for _, row in table.iterrows() for n in names)
    off = [abs(row[n] / tables.print_shift(n) - 1) for row in (one, lowered) for n in names]
    return (
        "The shift does not depend on where the lenses are, but on the lever arm that the single "
        f"step finds. Least squares over this block says which shift a lever arm causes "
        "(in brackets), and "
        f"all shifts follow it to {1e3 * worst:.1g} µm. With the square of "
        f"{100 * own['side_m']:.0f} cm that lever arm is {own['lever_z_m']:+.3f} m high. So the "
        f"two-step $f$ moves by {own['f_mm']:+.4f} mm only, where the paper's moves by "
        f"{tables.print_shift('f_mm'):+.4f} mm. If the same lenses stand "
        f"{100 * lowered['lowered_m']:.0f} cm lower, the single step finds the printed lever arm, "
        f"and $f$ moves by {lowered['f_mm']:+.4f} mm; with all centres in one point, by "
        f"{one['f_mm']:+.4f} mm. In both cases $f$, $x_p$ and $y_p$ move by the printed amounts to "
        f"within {100 * max(off):.0f} %.\n\n"
        "Two things follow for the study. What Table 3 of the paper calls a lever arm is the one "
        "that its synthetic images seem to have. And its lenses, if they look outward from such a "
        "square, stand lower than that lever arm says, by the height at which their rays meet."
    )


def other_heights(found: Study) -> str:
    """Say how the pattern depends on the flying height."""
    flown = sorted(found.pattern["height_m"].unique())
    patterns = {h: heights.at_height(found.pattern, h) for h in tables.HEIGHTS_M}
    best = min(patterns, key=lambda h: heights.rms_px(patterns[h]))
    of_flown = " and ".join(
        f"{heights.rms_px(heights.at_height(found.pattern, h)):.2f} px at {h:.0f} m" for h in flown
    )
    lowest = min(patterns)
    return (
        f"At the flying heights of the calibration block the pattern is {of_flown} (RMS by "
        f"coordinate). It is smallest near {best:.0f} m, for which the interior orientation is a "
        f"compromise, and {heights.rms_px(patterns[lowest]):.2f} px at {lowest:.0f} m, with steps "
        f"of up to {heights.largest_step_px(patterns[lowest]):.1f} px at the seams."
    )


def fingerprint(found: Study) -> str:
    """Say what Table 3's k1-k3 tell of the focal length and of the lens centres."""
    refined, calibrated = (radial.in_sigma(found)[heads] for heads in radial.HEADS)
    moved = (refined.max() - refined.min()).max()
    f_1 = radial.focal_lengths(calibrated)
    one, square = radial.squares(found).to_numpy()[[0, -1]]
    side_cm = 100 * found.squares["side_m"].max()
    corner = [
        float(radial.radial_um(ks, radial.radius_mm()[-1:])[0])
        for ks in (radial.printed_with_sigma()[0], square, one)
    ]
    return (
        "Are the $k_1$, $k_2$, $k_3$ of the paper's Table 3 the trace of focal lengths held at "
        "74 mm? Points that are carried through heads as they were calibrated bear such a trace: "
        f"the printed coefficients, one by one, ask for $f_1$ = {f_1[0]:.2f}, {f_1[1]:.2f} and "
        f"{f_1[2]:.2f} mm. Refining the heads by tie points removes it: then no "
        f"coefficient changes by more than {moved:.1f} σ over the whole sweep, and the farthest is "
        f"{refined.abs().max().max():.1f} σ from print.\n\n"
        "What makes these coefficients is the distance of the lens centres. With all centres in "
        f"one point $k_1$ is {100 * one[0] / square[0]:.0f} % of what it is in a square of "
        f"{side_cm:.0f} cm. So the printed signs and sizes are those of a camera with four lens "
        "centres. More they do not say: over flights the coefficients are correlated to "
        f"{radial.weakest_correlation(found):.2f} and more, so that one by one they say little. "
        f"Together they are a curve, which reaches {corner[0]:.0f} µm at the corner as printed, "
        f"{corner[1]:.0f} µm in the square, and {corner[2]:.1f} µm with one point. The square "
        "alone does not make the printed curve."
    )


def centres(found: Study) -> str:
    """Say which focal length the printed X_c and Y_c ask for, and what they can tell."""
    misfit = figures.centre_misfit(found)
    each = ", and ".join(
        f"{LABELS[str(name)]} fits best at {own.idxmin():.1f} mm, to {1000 * own.min():.0f} µm"
        for name, own in misfit.items()
    )
    height_m = float(found.pattern["height_m"].mean())
    ground_cm = 100 * misfit.min().min() * height_m / tables.print_of("f_mm")[0]
    side_cm = 100 * found.squares["side_m"].max()
    return (
        f"Within the sweep {each} (RMS). Neither was put in, and they do not agree on a focal "
        "length. Nor can they place the lens centres. They are differences of whole projections, "
        f"at the scale of the image: from {height_m:.0f} m the smaller of the two misfits alone is "
        f"{ground_cm:.0f} cm on the ground, where the square of lens centres has {side_cm:.0f} cm."
    )


def recommendation(found: Study) -> str:
    """Say what a survey company should do."""
    table = study.accuracy(found).query("over == 'points'")
    ratio = study.scatter(found, SYNTHETIC)["ratio"].max()
    return "\n".join(
        f"{i}. {text}"
        for i, text in enumerate(
            (
                "Map with the synthetic image. From heights between those of its calibration it "
                f"costs at most {table['percent'].max():.2f} % of accuracy at check points.",
                "Keep the measurements in the heads, and calibrate them as a rig. Only the rig's "
                "σ can be believed, and only its $\\chi^2$ test says how good measurements are.",
                "Carry all flights through one calibration of the heads: then the stated σ of the "
                "synthetic camera's parameters holds between flights. Where the heads are "
                f"calibrated anew, the parameters scatter by up to {ratio:.1f} times their "
                "stated σ.",
                "Calibrate at the heights that are flown. {numref}`tab-cost-heights` has what is "
                "left at others, and no parameter of the synthetic camera mends it.",
                "Do not take the estimated lever arm of a synthetic camera for a survey of its "
                "lenses.",
            ),
            start=1,
        )
    )


def _range(values: Iterable[float]) -> str:
    """Return the smallest and the largest of numbers."""
    all_of: Array = np.array(list(values))
    return f"{all_of.min():.2f} to {all_of.max():.2f}"


def answer(found: Study) -> str:
    """Say what the synthetic image costs."""
    percent = study.accuracy(found).query("over == 'points'")["percent"]
    own, rig = (study.scatter(found, way) for way in (SYNTHETIC, RIG))
    centre = own.set_index("parameter")["mean"]["lever_z_m"]
    off_cm = 100 * abs(centre - lever_arm.true_centre_m()[2])
    variance = study.variance_factors(found, SYNTHETIC).mean()
    return (
        f"Little accuracy, and much trust. The RMS at check points is {_range(percent)} % larger, "
        "by axis. But where the heads are calibrated anew for every flight, parameters scatter by "
        f"up to {own['ratio'].max():.2f} times their stated standard deviations; with one "
        f"calibration of the heads by at most {study.scatter_of_shared(found).max():.2f} times, "
        f"and those of the rig by at most {rig['ratio'].max():.2f} times. The lever arm's height "
        f"is {off_cm:.0f} cm away from the lenses, and $\\sigma_0^2$ "
        f"is {variance:.3f} on average, though every measurement is as good as it claims."
    )
