"""Quality by groups of observations: a posteriori sigma, redundancy, detectable errors.

Everything is computed from residuals.csv. Components that have a common weight are one group.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import pandas as pd

from acx4book.report.material import Material
from acx4lib.bundle.gross_errors.rejections import noncentrality
from acx4lib.least_squares.statistical import distributions

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
}
"""The group of every kind and component of an observation."""

DETECTABLE = noncentrality()
"""Baarda's delta_0: the shift of w by an error that is found with `rejections.POWER`."""

CONTROLLED = 0.1
"""Redundancy number below which an observation is hardly controlled by the others."""


@dataclass(frozen=True, kw_only=True)
class Quality:
    """The quality of one group of observations in one adjustment.

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
"""Of materials that are in use: several parts of a report show them."""


def decisive_qualities(material: Material) -> list[Quality]:
    """Return the quality of every group of observations of all decisive adjustments."""
    if material not in _FOUND:
        _FOUND[material] = [q for name in material.decisive for q in qualities(material, name)]
    return _FOUND[material]


def qualities(material: Material, adjustment: str) -> list[Quality]:
    """Return the quality of every group of observations of an adjustment.

    Parameters
    ----------
    material : Material
    adjustment : str
        One of `Material.decisive`.

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
    told = material.found.summary[adjustment].get("sigma_tests")
    tests: Mapping[str, Mapping[str, float]] = told if isinstance(told, dict) else {}
    return [
        _of_group(adjustment, str(name), own, tests.get(str(name)))
        for name, own in rows.groupby(group, sort=False)
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
    below = distributions.chi2_cdf(square, redundancy)
    return 2 * min(below, distributions.chi2_sf(square, redundancy))
