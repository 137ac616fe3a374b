"""Checks of the paper's validation: Table 4, its accuracy claims and its error budget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
from scipy import stats

from acx4book.paper import printed as paper
from acx4book.typesetting.labels import TITLES
from acx4book.typesetting.myst import scientific
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy
from acx4lib.georeferencing.accuracy import Accuracy, Triple, from_summary, triple

ROUNDING_M = 0.005
"""Half a unit of Table 4's last digit."""


def printed_accuracy(method: str) -> Accuracy:
    """Return the accuracy in a column of Table 4.

    Parameters
    ----------
    method : str
        One of `printed.METHODS`.
    """
    return from_summary(
        int(paper.value(4, "n_points", method)),
        mean=triple([paper.value(4, f"mean_{axis}_m", method) for axis in AXES]),
        std=triple([paper.sigma(4, f"mean_{axis}_m", method) for axis in AXES]),
        rms=triple([paper.value(4, f"rms_{axis}_m", method) for axis in AXES]),
    )


def least_rms(accuracy: Accuracy) -> Triple:
    """Compute the RMS that belongs to a mean and a standard deviation (n - 1), m."""
    mean, std = np.array(accuracy.mean), np.array(accuracy.std)
    return triple(np.sqrt(mean**2 + (1 - 1 / accuracy.n) * std**2))


def sample_size(mean: float, std: float, rms: float) -> float:
    """Compute the number of errors with the given mean, standard deviation and RMS.

    From rms^2 = mean^2 + (1 - 1/n) std^2; infinite where the RMS is at its upper limit.
    """
    rest = 1 - (rms**2 - mean**2) / std**2
    return 1 / rest if rest > 0 else np.inf


def implied_sample_sizes() -> pd.DataFrame:
    """Compute for every axis of Table 4 the number of errors that its three numbers imply.

    Returns
    -------
    DataFrame
        method, axis, n, n_low, n_high; the limits follow from the rounding of the printed
        numbers.
    """
    rows = []
    for method in paper.METHODS:
        printed = printed_accuracy(method)
        for axis, mean, std, rms in zip(AXES, printed.mean, printed.std, printed.rms, strict=True):
            near, far = abs(mean) - ROUNDING_M, abs(mean) + ROUNDING_M
            rows.append(
                {
                    "method": method,
                    "axis": axis,
                    "n": sample_size(mean, std, rms),
                    "n_low": sample_size(far, std + ROUNDING_M, rms - ROUNDING_M),
                    "n_high": sample_size(near, std - ROUNDING_M, rms + ROUNDING_M),
                }
            )
    return pd.DataFrame(rows)


def matching_sizes(largest: int) -> list[int]:
    """Return the numbers of errors for which every printed RMS comes out to its last digit."""
    columns = [printed_accuracy(method) for method in paper.METHODS]
    return [
        n
        for n in range(2, largest + 1)
        if all(np.allclose(np.round(least_rms(replace(c, n=n)), 2), c.rms) for c in columns)
    ]


def rms_and_sigma() -> tuple[str, str, str]:
    """Item 5: RMS smaller than the standard deviation."""
    printed = printed_accuracy("two_step")
    least = ", ".join(f"{value:.3f}" for value in least_rms(printed))
    sizes = implied_sample_sizes()
    matching = matching_sizes(printed.n)
    return (
        f"mean {printed.mean[0]:.2f} m, standard deviation {printed.std[0]:.2f} m and RMS"
        f" {printed.rms[0]:.2f} m at {printed.n} points",
        f"for n = {printed.n} the two-step's standard deviations demand an RMS of {least} m"
        f" (X, Y, Z); the printed numbers belong together for n = {sizes['n'].min():.1f} to"
        f" {sizes['n'].max():.1f} on all {len(sizes)} axes, rounding allows"
        f" {sizes['n_low'].min():.1f} to {sizes['n_high'].max():.1f}; for n ="
        f" {', '.join(map(str, matching))}, and no other n up to {printed.n}, all {len(sizes)}"
        " printed RMS come out exactly",
        f"As if each RMS were that of {', '.join(map(str, matching))} errors. What they are is not"
        f" told; the RMS of {printed.n} points with these standard deviations it is not.",
    )


def within_probability(rms: float, *, axes: int = 3) -> float:
    """Compute the share of normal errors below the counted limit (3 ground pixels).

    Parameters
    ----------
    rms : float
        RMS of each axis, m.
    axes : int
        Number of axes of the resultant.
    """
    return float(stats.chi2.cdf((_limit_m() / rms) ** 2, axes))


def count_probability(rms: float) -> float:
    """Compute the probability of the printed count, or a larger one, for normal errors."""
    count = paper.value(4, "n_within_3_gsd", "two_step")
    n = paper.value(4, "n_points", "two_step")
    return float(stats.binom.sf(count - 1, n, within_probability(rms)))


def rms_of_count() -> float:
    """Compute the RMS per axis of normal errors with the printed share, m."""
    share = paper.value(4, "within_3_gsd_percent", "two_step") / 100
    return float(_limit_m() / np.sqrt(stats.chi2.ppf(share, 3)))


def small_errors() -> tuple[str, str, str]:
    """Item 6: too many small discrepancies."""
    rms = paper.value(4, "rms_east_m", "two_step")
    n = paper.value(4, "n_points", "two_step")
    shares = [100 * within_probability(rms, axes=axes) for axes in (3, 2, 1)]
    return (
        f"{paper.value(4, 'n_within_3_gsd', 'two_step'):.0f} of {n:.0f} discrepancies XYZ within"
        f" {_limit_m():.2f} m, RMS {rms:.2f} m per axis",
        f"normal errors of that RMS: {shares[0]:.1f} % or {n * shares[0] / 100:.1f} points, the"
        f" printed count or more with P = {scientific(count_probability(rms))}; the count needs"
        f" {rms_of_count():.2f} m per axis. In plan alone {shares[1]:.0f} %, on one axis"
        f" {shares[2]:.0f} %",
        "The errors are far from normal (some natural targets grossly misidentified?), or the"
        " count is not three-dimensional.",
    )


def headline() -> tuple[str, str, str]:
    """Item 18: the accuracy of the abstract."""
    rms = [paper.value(4, f"rms_{axis}_m", m) for axis in AXES for m in paper.METHODS]
    px = [paper.value(4, f"rms_{axis}_px", m) for axis in AXES for m in paper.METHODS]
    std = [paper.sigma(4, f"mean_{axis}_m", m) for axis in AXES for m in paper.METHODS]
    return (
        f"around {100 * paper.statement('accuracy_m'):.0f} cm"
        f" ({paper.statement('accuracy_px'):.0f} pixels) in the abstract",
        f"Table 4: RMS {min(rms):.2f} to {max(rms):.2f} m, {min(px):.1f} to {max(px):.1f} pixels",
        "Rounded to the unfavourable side; Table 4's standard deviations,"
        f" {min(std):.2f} to {max(std):.2f} m, would fit, its RMS does not.",
    )


def _map_scale_classes(scales: Sequence[int] = (1000, 2000, 5000, 10000)) -> pd.DataFrame:
    """Classify Table 4 under PEC-PCD."""
    rows = [
        {"method": method, **asdict(accuracy.pec_pcd(printed_accuracy(method), scale))}
        for scale in scales
        for method in paper.METHODS
    ]
    return pd.DataFrame(rows)[["scale", "method", "plan", "plan_by_axis", "height"]]


def map_scale_table() -> pd.DataFrame:
    """Return the classes of `_map_scale_classes` as a table for readers."""
    classes = _map_scale_classes()
    classes["scale"] = [f"1:{scale}" for scale in classes["scale"]]
    classes["method"] = [TITLES[method] for method in classes["method"]]
    classes.columns = pd.Index(["Scale", "Method", "Plan", "Plan, each axis alone", "Height"])
    return classes


def map_scales() -> tuple[str, str, str]:
    """Item 20: map scales without an accuracy class."""
    small, large = (int(paper.statement(f"{size}_scale")) for size in ("smallest", "largest"))
    texts = [
        f"1:{scale} {' or '.join(both['plan'].unique())} in plan,"
        f" {' or '.join(both['height'].unique())} in height"
        for scale, both in _map_scale_classes((large, small)).groupby("scale")
    ]
    printed = printed_accuracy("two_step")
    sigma = from_summary(printed.n, mean=printed.mean, std=printed.std, rms=printed.std)
    return (
        f"acceptable for 1:{small} to 1:{large} after PEC-PCD, no class named",
        "classes from Table 4's RMS: "
        + "; ".join(texts)
        + "; with its standard deviations in their place"
        f" 1:{large} in height: {accuracy.pec_pcd(sigma, large).height}",
        f"1:{small} holds; 1:{large} holds in the lowest classes only, and hangs on which of two"
        " contradictory rows is right (item 5).",
    )


def attitude_budget_m(side: str) -> tuple[float, float, float]:
    """Compute the errors that the attitude noise alone causes in block 3.

    Parameters
    ----------
    side : {"width_mm", "height_mm"}
        Side of the synthetic image along the flight.

    Returns
    -------
    plan, base_to_height, height : float
        Planimetric error of one ray, m; base-to-height ratio; height error of a pair, m.
    """
    flying_height, f = paper.statement("block_3_m"), paper.value(3, "f_mm", "single_step")
    plan = flying_height * np.tan(np.radians(paper.statement("roll_pitch_deg")))
    advance = 1 - paper.statement("block_3_forward_overlap") / 100
    ratio = advance * paper.value(2, side, "SYN") / f
    return float(plan), float(ratio), float(np.sqrt(2) * plan / ratio)


def error_budget(predicted_m: Array | None = None) -> tuple[str, str, str]:
    """Item 21: errors predicted from the accuracy of the trajectory.

    Parameters
    ----------
    predicted_m : ndarray, shape (3,), optional
        RMS in east, north, height that a run predicts over its pairs.
    """
    plan, ratio_w, height_w = attitude_budget_m("width_mm")
    _, ratio_h, height_h = attitude_budget_m("height_mm")
    width, height = paper.value(2, "width_mm", "SYN"), paper.value(2, "height_mm", "SYN")
    east, up = (paper.value(4, f"rms_{axis}_m", "two_step") for axis in ("east", "height"))
    gnss = np.array([paper.statement("gnss_best_m"), paper.statement("gnss_worst_m")])
    best, worst = np.hypot(plan, gnss)
    computed = (
        f"roll and pitch alone at {paper.statement('block_3_m'):.0f} m: {plan:.3f} m in plan"
        f" ({best:.2f} to {worst:.2f} m with the positions); in"
        f" height {height_w:.2f} m with the {width:.1f} mm along the flight (B/H {ratio_w:.3f}),"
        f" {height_h:.2f} m with the {height:.1f} mm (B/H {ratio_h:.3f})"
    )
    verdict = (
        f"The height RMS of {up:.2f} m is what the attitude noise predicts. The horizontal one of"
        f" {east:.2f} m is {east / plan:.0f} times what roll and pitch alone do to one ray, and"
        f" {east / worst:.1f} times that with the worst positions"
    )
    if predicted_m is not None:
        one_axis = float(np.hypot(*predicted_m[:2]) / np.sqrt(2))
        computed += (
            "; all errors of a pair of images, as a run of this book predicts them in east, north,"
            " height: " + ", ".join(f"{value:.2f}" for value in predicted_m) + " m"
        )
        verdict += f"; it is {east / one_axis:.1f} times what a run predicts over its pairs"
    return (
        f"positions {gnss[0]:.2f} to {gnss[1]:.2f} m, roll and pitch"
        f" {paper.statement('roll_pitch_deg'):g}°, heading {paper.statement('heading_deg'):g}°",
        computed,
        f"{verdict}.",
    )


def _limit_m() -> float:
    return paper.statement("within_factor") * paper.value(4, "gsd_m", "two_step")
