"""The adjustments: groups of observations, tests, gross errors, and residuals drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.report.markdown import Text, heading, listed, show, table
from acx4book.report.material import Material, validated
from acx4book.typesetting import style
from acx4book.typesetting.matrix import Residuals, field_figure
from acx4book.typesetting.myst import LABELS, p_value
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.rejections import CRITICAL, noncentrality
from acx4lib.geometry.camera import Camera
from acx4lib.georeferencing.accuracy import rms_limits
from acx4lib.least_squares import statistics

# --- Quality by groups of observations: a posteriori sigma, redundancy, detectable errors
#
# Everything is computed from residuals.csv. Components that have a common weight are one group.


GROUPS = {
    ("image_point", "col_px"): "image points",
    ("image_point", "row_px"): "image points",
    ("control_point", "east_m"): "control, plan",
    ("control_point", "north_m"): "control, plan",
    ("control_point", "height_m"): "control, height",
    ("gnss", "east_m"): "GNSS, plan",
    ("gnss", "north_m"): "GNSS, plan",
    ("gnss", "height_m"): "GNSS, height",
    ("attitude", "roll_deg"): "roll and pitch",
    ("attitude", "pitch_deg"): "roll and pitch",
    ("attitude", "heading_deg"): "heading",
    ("distance", "distance_m"): "distances",
    **{("lever_arm", f"lever_{axis}_m"): "declared lever arm" for axis in "xyz"},
    **{
        ("boresight", f"mount_{angle}_deg"): "declared boresight"
        for angle in ("omega", "phi", "kappa")
    },
    **{("interior", name): "declared interior orientation" for name in ("f_mm", "xp_mm", "yp_mm")},
}
"""The group of every kind and component of an observation."""

DETECTABLE = noncentrality()
"""Baarda's delta_0: the shift of w by an error that is found with `rejections.POWER`."""

CONTROLLED = 0.1
"""Redundancy number below which an observation is hardly controlled by the others."""


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Quality of a group of observations in an adjustment.

    Attributes
    ----------
    adjustment, group, unit : str
    n : int
        Number of components.
    redundancy : float
        Sum of their redundancy numbers.
    sigma : float
        Median of the a priori sigma, in `unit`.
    ratio : float
        A posteriori over a priori sigma; NaN without redundancy.
    p : float
        Two-sided probability of a ratio so far from one, if sigma is right; NaN without.
    weak : int
        Number of components with a redundancy number below `CONTROLLED`.
    detectable, detectable_max : float
        Minimal detectable errors, median and largest, in `unit`.
    """

    adjustment: str
    group: str
    unit: str
    n: int
    redundancy: float
    sigma: float
    ratio: float
    p: float
    weak: int
    detectable: float
    detectable_max: float


_FOUND: WeakKeyDictionary[Material, list[Quality]] = WeakKeyDictionary()
"""Qualities of the materials in use; several parts of a report show them."""


def decisive_qualities(material: Material) -> list[Quality]:
    """Return the quality of every group of observations of all decisive adjustments.

    Notes
    -----
    The ratio is the square root of v'Pv, divided by the group's sum of redundancy numbers. The
    expectation of its square is the variance of unit weight, whatever the sizes of the groups.
    This is the first iteration of a variance component estimation, used as a diagnosis. Its test
    is that of `variance_components.sigma_tests`, from summary.json. Results of earlier versions
    have none: there v'Pv is compared with chi-square of the redundancy, whose variance is too
    large, so that wrong sigma of small groups are found more rarely. The minimal detectable error
    of an observation is delta_0 sigma / sqrt(r) [1]_.

    References
    ----------
    .. [1] W. Baarda, "A testing procedure for use in geodetic networks", 1968.
    """
    if material not in _FOUND:
        _FOUND[material] = [q for name in material.decisive for q in _qualities(material, name)]
    return _FOUND[material]


def _qualities(material: Material, adjustment: str) -> list[Quality]:
    """Return the quality of every group of observations of an adjustment."""
    rows = material.residuals[adjustment]
    rows = rows[(rows["sigma"] > 0) & rows["v"].notna()]
    by_kind, kinds = pd.factorize(rows["kind"])
    by_component, components = pd.factorize(rows["component"])
    pair = pd.Series(by_kind * len(components) + by_component, index=rows.index)
    names = {
        k: GROUPS[kinds[k // len(components)], components[k % len(components)]]
        for k in pair.unique()
    }
    group = pair.map(names)
    sigma_tests = material.found.summary[adjustment].get("sigma_tests")
    tests: Mapping[str, Mapping[str, float]] = sigma_tests if isinstance(sigma_tests, dict) else {}
    return [
        _of_group(adjustment, str(name), rows_of_group, tests.get(str(name)))
        for name, rows_of_group in rows.groupby(group, sort=False)
    ]


def _of_group(
    adjustment: str, name: str, rows: pd.DataFrame, test: Mapping[str, float] | None
) -> Quality:
    sigma, v = rows["sigma"].to_numpy(), rows["v"].to_numpy()
    r = rows["redundancy"].clip(0.0, 1.0).to_numpy()
    total = float(r.sum())
    ratio = float(np.sqrt(np.sum((v / sigma) ** 2) / total)) if total > 0 else np.nan
    with np.errstate(divide="ignore"):
        detectable = DETECTABLE * sigma / np.sqrt(r)
    return Quality(
        adjustment=adjustment,
        group=name,
        unit=str(rows["component"].iloc[0]).rpartition("_")[2],
        n=len(rows),
        redundancy=total,
        sigma=float(np.median(sigma)),
        ratio=ratio,
        p=float(test["p"]) if test else _p(ratio, total),
        weak=int(np.sum(r < CONTROLLED)),
        detectable=float(np.median(detectable)),
        detectable_max=float(detectable.max()),
    )


def _p(ratio: float, redundancy: float) -> float:
    if not redundancy > 0:
        return np.nan
    square = ratio**2 * redundancy
    below = statistics.chi2_cdf(square, redundancy)
    return 2 * min(below, statistics.chi2_sf(square, redundancy))


# --- Residuals of image points, drawn over the image plane and by strip


COMPONENTS = {"col": "columns", "row": "rows"}

PROBABILITY = 0.999
"""Probability of the chance limits drawn for each single strip."""


def residual_plane(tables: Mapping[str, pd.DataFrame], cameras: Mapping[str, Camera]) -> Figure:
    """Draw the mean residual vectors over the image plane, a panel per adjustment and camera.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        As `material.image_residuals` returns it, by the title of the adjustment.
    cameras : mapping of str to Camera
    """
    fields = {
        _panel(title, residuals["camera"], name): _of_camera(
            residuals[residuals["camera"] == name], cameras[name]
        )
        for title, residuals in tables.items()
        for name in residuals["camera"].unique()
    }
    if not fields:
        return style.nothing("There are no residuals of image points.")
    return field_figure(fields)


def _panel(title: str, cameras: pd.Series, name: str) -> str:
    """Return a panel's title: the adjustment's, with the camera's name if there are several."""
    several = cameras.iloc[0] != cameras.iloc[-1]
    return f"{title}, {name}" if several else title


def _of_camera(rows: pd.DataFrame, camera: Camera) -> Residuals:
    return Residuals(
        camera=camera,
        colrow=rows[["col_px", "row_px"]].to_numpy(),
        v=rows[["v_col", "v_row"]].to_numpy(),
        sigma_px=rows["sigma"].to_numpy(),
    )


def residuals_by_strip(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the size of the image residuals of every strip, and the largest one.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        As for `residual_plane`.

    Returns
    -------
    Figure
        Above: the size of the residuals divided by the size expected from the weights, with 99.9 %
        limits about one. Below: the largest normalised residual and the critical value of w.
    """
    strips = list(dict.fromkeys(name for t in tables.values() for name in t["strip"].unique()))
    if not strips:
        return style.nothing("There are no residuals of image points.")
    with style.applied():
        fig, axes = style.subplots(2, 2, figsize=(style.WIDTH, 3.3), sharex=True, sharey="row")
        for i, (title, table) in enumerate(tables.items()):
            shift = 0.16 * (i - (len(tables) - 1) / 2)
            for column, component in enumerate(COMPONENTS):
                _draw_strips(
                    axes[:, column], table, component, strips, shift=shift, label=style.plain(title)
                )
        for column, name in enumerate(COMPONENTS.values()):
            axes[0, column].set_title(name)
            axes[0, column].axhline(1, color=style.INK, lw=0.7)
            axes[1, column].axhline(CRITICAL, color=style.INK, lw=0.9, ls="--")
            axes[1, column].set_xticks(
                range(len(strips)), [style.plain(s) or "none" for s in strips]
            )
            axes[1, column].set_xlabel("strip")
            axes[1, column].tick_params(axis="x", rotation=90 if len(strips) > 14 else 0)
        axes[0, 0].set_ylabel("ratio of σ (1)")
        axes[1, 0].set_ylabel("largest |w| (1)")
        axes[1, 0].set_ylim(0, 1.08 * axes[1, 0].get_ylim()[1])
        if len(tables) > 1:
            style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0])
    return fig


def _draw_strips(
    axes: Sequence[Axes],
    table: pd.DataFrame,
    component: str,
    strips: Sequence[str],
    *,
    shift: float,
    label: str,
) -> None:
    groups = list(table.groupby("strip", sort=False))
    x = np.array([strips.index(str(strip)) + shift for strip, _ in groups])
    weighted = [
        float(np.sum((residuals[f"v_{component}"] / residuals["sigma"]) ** 2))
        for _, residuals in groups
    ]
    total = np.array([residuals[f"redundancy_{component}"].sum() for _, residuals in groups])
    nothing = (np.nan, np.nan)
    limits = [rms_limits(r, probability=PROBABILITY) if r > 0 else nothing for r in total]
    low, high = np.transpose(limits)
    axes[0].vlines(x, low, high, color=style.SOFT, alpha=0.35, lw=4.5)
    axes[0].plot(x, np.sqrt(weighted / total), "o", ms=3.8, label=label)
    axes[1].plot(
        x, [residuals[f"w_{component}"].abs().max() for _, residuals in groups], "o", ms=3.8
    )


# --- Tables of the adjustments: tests, groups of observations, gross errors


UNIT = {"px": "px", "m": "m", "deg": "°"}

SHOWN = 30
"""Number of rejected observations that are listed; all of them are in rejected.csv."""

FROM_SUMMARY = "summary.json: weighted residuals and redundancy of every adjustment"
FROM_RESIDUALS = "residuals.csv: residuals, a priori σ and redundancy numbers of all components"


def section(material: Material) -> Text:
    """Return the section on the adjustments, their groups of observations, and gross errors."""
    limit = f"w-tests with the critical value {CRITICAL:g}, repeated until none exceeds it"
    chance = f"{limit}; expected: the sum of the probabilities that the test rejects a good one"
    return show(
        table(_test_table(material), TESTS, name="tab-report-tests", obtained=FROM_SUMMARY),
        _weakest_sentence(material),
        table(
            _group_table(material), _GROUPS, name="tab-report-groups",
            obtained=f"{FROM_RESIDUALS}; p: summary.json, sigma_tests",
        ),
        table(
            _reliability_table(material), DETECTED, name="tab-report-reliability",
            obtained=FROM_RESIDUALS,
        ),
        table(
            _rejection_table(material), REJECTIONS, name="tab-report-rejections", obtained=chance
        ),
        _rejected_sentence(material),
        table(_rejected_table(material), LARGEST, name="tab-report-rejected", obtained=limit),
    )  # fmt: skip


TESTS = "The adjustments, with the χ² test"
_GROUPS = "A priori and a posteriori σ by group of observations"
DETECTED = "Reliability by group: redundancy numbers and minimal detectable errors"
REJECTIONS = "Rejected observations, expected and found"
LARGEST = "Rejected observations, the largest first"


def _weakest_sentence(material: Material) -> str:
    """Return a sentence on the weakest combination of unknowns; empty if not in the summary."""
    entry = material.found.summary.get(material.calibration, {})
    weakest = entry.get("weakest")
    if not isinstance(weakest, dict) or not weakest:
        return ""
    parts = [
        f"{shown(_unknown(str(name)))} ({float(share):.2f})" for name, share in weakest.items()
    ]
    return (
        "**Weakest direction.** The unknowns that could change together with the least effect on "
        f"all residuals: {listed(parts)}. In brackets: squares of the components of this "
        "direction, of which all add up to one, with the unknowns scaled alike."
    )


def _unknown(name: str) -> str:
    """Return the title of an unknown by the library's name, ``camera/lever_y_m`` or another."""
    camera, _, parameter = name.rpartition("/")
    if not camera:
        return name
    axis = parameter.removeprefix("boresight_")
    title = LABELS.get(parameter, parameter.replace("_", " "))
    if axis in ("x", "y", "z"):
        title = f"boresight about the camera's {axis}"
    return Markup(f"{shown(title)} of {shown(camera)}")


def _test_table(material: Material) -> pd.DataFrame:
    """Return the size and the global test of every adjustment."""
    rows = []
    for name in material.adjustments:
        entry = material.found.summary[name]
        r, p = int(str(entry["redundancy"])), entry["chi_square_p"]
        rows.append(
            {
                "Adjustment": heading(name),
                "Observations": entry["n_observations"],
                "Unknowns": entry["n_unknowns"],
                "Redundancy": r,
                "σ₀²": entry["sigma0_squared"],
                "p": None if p is None else p_value(float(str(p))),
            }
        )
    return pd.DataFrame(rows)


def _rejection_table(material: Material) -> pd.DataFrame:
    """Return how many observations every adjustment rejected, and how many chance would reject."""
    rows = [
        {
            "Adjustment": heading(name),
            "Observations": entry["n_observations"],
            "Found and rejected": entry["n_rejected"],
            "Expected by chance": entry.get("expected_rejections"),
            "Tie points left out": entry.get("n_left_out", ""),
        }
        for name, entry in ((name, material.found.summary[name]) for name in material.adjustments)
    ]
    return pd.DataFrame(rows)


def _group_table(material: Material) -> pd.DataFrame:
    """Return a priori and a posteriori sigma of every group of observations."""
    rows = [
        {
            "Adjustment": heading(g.adjustment),
            "Group": f"{g.group} ({UNIT.get(g.unit, g.unit)})",
            "Number": g.n,
            "Redundancy": g.redundancy,
            "A priori σ": _short(g.sigma),
            "A posteriori σ": _short(g.sigma * g.ratio),
            "Ratio": g.ratio,
            "p": "" if np.isnan(g.p) else p_value(g.p),
        }
        for g in decisive_qualities(material)
    ]
    return pd.DataFrame(rows)


def _reliability_table(material: Material) -> pd.DataFrame:
    """Return redundancy numbers and minimal detectable errors of every group."""
    rows = [
        {
            "Adjustment": heading(g.adjustment),
            "Group": f"{g.group} ({UNIT.get(g.unit, g.unit)})",
            "Mean redundancy": g.redundancy / g.n,
            "Below 0.1": g.weak,
            "Detectable, median": _short(g.detectable),
            "Detectable, largest": _short(g.detectable_max),
        }
        for g in decisive_qualities(material)
    ]
    return pd.DataFrame(rows)


def _short(value: float) -> float:
    """Return a number rounded to three digits."""
    return float(f"{value:.3g}")


def _rejected_table(material: Material) -> pd.DataFrame:
    """Return the observations rejected as gross errors, the largest first."""
    rows = material.found.rejected
    methods = [n for n in ("heads/bundle", material.calibration, validated(material)) if n]
    rows = rows[(rows["stage"] + "/" + rows["method"]).isin(methods)]
    order = rows["statistic"].abs().sort_values(ascending=False, kind="stable").index
    rows = rows.loc[order[:SHOWN]]
    return pd.DataFrame(
        {
            "Stage": list(rows["stage"]),
            "Observation": [kind.replace("_", " ") for kind in rows["kind"]],
            "Image or exposure": list(rows["image_or_exposure"]),
            "Point": list(rows["point"]),
            f"w (critical {CRITICAL:g})": list(rows["statistic"]),
        }
    )


def _rejected_sentence(material: Material) -> str:
    """Return a sentence on the number of rejected observations, and of those in the table."""
    n, n_listed = len(material.found.rejected), len(_rejected_table(material))
    if n == 0:
        return "Nothing was rejected."
    return (
        f"The table lists {n_listed} rejected observations of the decisive adjustments; "
        f"rejected.csv has all {n} rows, with those that other methods took over."
    )
