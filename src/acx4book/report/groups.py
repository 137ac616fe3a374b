"""Groups of observations with a common weight: a posteriori σ and detectable errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from acx4book.report.material import Material
from acx4lib.bundle.rejections import noncentrality
from acx4lib.least_squares import statistics

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
    **{("lever_arm", f"lever_{axis}_m"): "declared lever arm" for axis in "xyz"},
    **{
        ("boresight", f"mount_{angle}_deg"): "declared boresight"
        for angle in ("omega", "phi", "kappa")
    },
    **{("interior", name): "declared interior orientation" for name in ("f_mm", "xp_mm", "yp_mm")},
}
"""The group of every kind and component of an observation."""

DECLARED = ("declared lever arm", "declared boresight")
"""Groups tested by the question on the declared mounting."""

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
        A posteriori over a priori sigma; NaN without redundancy. It is the square root of v'Pv over
        `redundancy`: the first iteration of a variance component estimation.
    p : float
        Two-sided probability of a ratio so far from one, if sigma is right: as summary.json has it,
        else by chi-square of the redundancy; NaN without.
    weak : int
        Number of components with a redundancy number below `CONTROLLED`.
    detectable, detectable_max : float
        Minimal detectable errors delta_0 sigma / sqrt(r), median and largest, in `unit`.
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
"""Qualities of the materials in use; several questions need them."""


def qualities(material: Material) -> list[Quality]:
    """Return the quality of every group of observations of all decisive adjustments."""
    if material not in _FOUND:
        _FOUND[material] = [q for name in material.decisive for q in _of(material, name)]
    return _FOUND[material]


def _of(material: Material, adjustment: str) -> Iterator[Quality]:
    rows = material.residuals[adjustment]
    rows = rows[(rows["sigma"] > 0) & rows["v"].notna()]
    tests = material.entry(adjustment).get("sigma_tests") or {}
    pairs = rows["kind"].astype(str) + " " + rows["component"].astype(str)
    names = {" ".join(pair): name for pair, name in GROUPS.items()}
    for name, own in rows.groupby(pairs.map(names), sort=False):
        sigma, r = own["sigma"].to_numpy(), own["redundancy"].clip(0.0, 1.0).to_numpy()
        total, cost = float(r.sum()), float(np.sum((own["v"].to_numpy() / sigma) ** 2))
        with np.errstate(divide="ignore"):
            detectable = noncentrality() * sigma / np.sqrt(r)
        yield Quality(
            adjustment=adjustment,
            group=str(name),
            unit=str(own["component"].iloc[0]).rpartition("_")[2],
            n=len(own),
            redundancy=total,
            sigma=float(np.median(sigma)),
            ratio=float(np.sqrt(cost / total)) if total > 0 else np.nan,
            p=float(tests[name]["p"]) if name in tests else _p(cost, total),
            weak=int(np.sum(r < CONTROLLED)),
            detectable=float(np.median(detectable)),
            detectable_max=float(detectable.max()),
        )


def _p(cost: float, redundancy: float) -> float:
    if not redundancy > 0:
        return np.nan
    return 2 * min(statistics.chi2_cdf(cost, redundancy), statistics.chi2_sf(cost, redundancy))
