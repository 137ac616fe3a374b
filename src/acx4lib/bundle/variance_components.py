"""Are the standard deviations right? The variance component of every group of observations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from acx4lib import expected, shown
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.expected import Array, Index
from acx4lib.least_squares import processors, statistics
from acx4lib.least_squares.adjustment import elimination, two_sided_p
from acx4lib.least_squares.normal_equations import Equations
from acx4lib.least_squares.statistics import Group

if TYPE_CHECKING:
    import pandas as pd

PARTS: tuple[tuple[str, str, tuple[int, ...]], ...] = (
    ("control plan", "control_point", (0, 1)),
    ("control height", "control_point", (2,)),
    ("GNSS", "gnss", (0, 1, 2)),
    ("roll, pitch", "attitude", (0, 1)),
    ("heading", "attitude", (2,)),
)
"""Groups besides the image points: name, kind of observation, its components.

GNSS plan and height are one group. Beside roll and pitch, positions in plan have so little
redundancy that their component, estimated alone, may go to zero."""

TESTED: tuple[tuple[str, str, tuple[int, ...]], ...] = (
    ("control, plan", "control_point", (0, 1)),
    ("control, height", "control_point", (2,)),
    ("GNSS, plan", "gnss", (0, 1)),
    ("GNSS, height", "gnss", (2,)),
    ("roll and pitch", "attitude", (0, 1)),
    ("heading", "attitude", (2,)),
)
"""Groups besides the image points whose sigma are tested: a test needs less than an estimate."""

LEAST_REDUNDANCY = 5.0
"""Effective redundancy below which a factor's standard deviation exceeds a third of it."""
LEAST_TESTED = 1e-6
"""Redundancy from which a group is tested: with less, residuals have no information."""
LEAST_TO_ACCUSE = 2.0
"""Effective redundancy that is enough to call a sigma too small, where this is significant."""
ALPHA = 0.001
"""Probability of calling a correct sigma of a group wrong."""
WORTH_SAYING = 1.1
"""Smallest factor that is reported: a change of sigma by a tenth."""
BOUNDS = (1 / 3, 1.5)
"""Smallest and largest factor accepted as a correction of sigma. Above 1.5 the variance is more
than twice the given variance: a systematic error may be the cause. Sigma that are too large hide no
error, but residuals of a third of sigma contradict these sigma."""

MOST_ROWS = 2000  # of groups whose covariances with all others are computed: see `_shares`
AT_A_TIME = 256  # rows of the joint redundancy that are computed together


@dataclass(frozen=True, kw_only=True)
class Component:
    """The size of a group's errors in relation to its sigma.

    Attributes
    ----------
    group : str
    n : int
        Number of observations that took part.
    redundancy : float
        Sum of their redundancy numbers.
    effective : float
        Effective redundancy: the part that separates this group's errors from those of others.
    factor : float
        Estimated factor of the given sigma. Zero where the errors are too small to be seen, NaN
        where they cannot be separated from those of other groups.
    applied : float
        Factor that was applied to the given sigma before the adjustment.
    """

    group: str
    n: int
    redundancy: float
    effective: float
    factor: float
    applied: float = 1.0

    @property
    def sigma(self) -> float:
        """Standard deviation of the factor, if `applied` is right."""
        return self.applied / np.sqrt(2 * self.effective) if self.effective > 0 else np.inf

    @property
    def p(self) -> float:
        """Two-sided probability of a factor at least so far from `applied`, if that is right.

        Chi-square above, normal below, because an estimated variance may be negative.
        """
        ratio = (self.factor / self.applied) ** 2
        above = statistics.chi2_sf(self.effective * ratio, self.effective)
        below = statistics.norm_cdf((ratio - 1) * np.sqrt(self.effective / 2))
        return float(min(1.0, 2 * min(above, below)))

    @property
    def estimable(self) -> bool:
        """Whether there is enough redundancy to estimate the factor.

        Sigma that are far too small reduce their own redundancy, so less of it is then enough.
        """
        too_small = self.factor > self.applied and self.p < ALPHA
        least = LEAST_TO_ACCUSE if too_small else LEAST_REDUNDANCY
        return bool(self.effective >= least)

    @property
    def is_significant(self) -> bool:
        """Whether the sigma used is wrong by more than chance and by a relevant amount."""
        log_ratio = abs(np.log(max(self.factor / self.applied, 1e-12)))
        return self.estimable and self.p < ALPHA and bool(log_ratio > np.log(WORTH_SAYING))

    @property
    def is_beyond(self) -> bool:
        """Whether an applied factor is outside `BOUNDS`, and significantly not one.

        Significance is by the group's chi-square with the given sigma.
        """
        least, most = BOUNDS
        far = not least <= self.applied <= most
        return bool(far and replace(self, factor=self.applied, applied=1.0).p < ALPHA)


@dataclass(frozen=True, kw_only=True)
class SigmaTest:
    """A test of the sigma of one group of observations; all other sigma are assumed right.

    Attributes
    ----------
    group : str
    ratio : float
        Root of v'Pv over the sum of the redundancy numbers: size of the errors over their sigma,
        as far as they show in the group's own residuals.
    redundancy : float
        Sum of the redundancy numbers.
    effective : float
        Degrees of freedom of the chi-square distribution, times a factor, that has the mean and
        the variance of v'Pv.
    p : float
        Two-sided probability of a ratio so far from one, if all sigma are right.
    """

    group: str
    ratio: float
    redundancy: float
    effective: float
    p: float


class Components(tuple[Component, ...]):
    """Variance components of all groups of an adjustment that took part."""

    __slots__ = ()

    def __repr__(self) -> str:
        """Name the factors in a line."""
        return shown.line("Components", *(f"{c.group} {c.factor:.2f}" for c in self))

    def table(self) -> pd.DataFrame:
        """Return the groups, a row for each.

        Number of observations, their redundancy, the effective one, ``factor of σ`` with ``value``
        and ``sigma`` (NaN where it cannot be estimated), and the factor ``used``.
        """
        import pandas as pd  # noqa: PLC0415 it loads long

        heads = [(name, "") for name in ("number", "redundancy", "effective")]
        heads += [("factor of σ", "value"), ("factor of σ", "sigma"), ("used", "")]
        unknown = (np.nan, np.nan)
        rows = [
            (c.n, c.redundancy, c.effective, *((c.factor, c.sigma) if c.estimable else unknown))
            for c in self
        ]
        table = pd.DataFrame(
            [(*row, c.applied) for row, c in zip(rows, self, strict=True)],
            index=pd.Index([c.group for c in self], name="observations"),
            columns=pd.MultiIndex.from_tuples(heads),
        )
        table.attrs["formats"] = {"redundancy": ".1f", "effective": ".1f", "used": ".2f"}
        return table


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rows:
    """The observations of one group: rows and components of residuals."""

    name: str
    group: Group
    rows: Index
    columns: Index

    def __getitem__(self, part: str) -> Array:
        """Return a field of the residuals, of the components in use."""
        used = np.isfinite(self.group.sigma[np.ix_(self.rows, self.columns)])
        return getattr(self.group, part)[np.ix_(self.rows, self.columns)][used]


def components(
    bundle: Bundle, *, applied: Mapping[str, float] | None = None
) -> tuple[Component, ...]:
    """Compare the residuals of every group with their expectation from its sigma.

    Parameters
    ----------
    bundle : Bundle
        An adjustment.
    applied : mapping of str to float, optional
        Factors applied to the given sigma before the adjustment, by group; one by default.

    Returns
    -------
    Components
        The groups that took part.

    Raises
    ------
    ValueError
        For an unknown group.

    Notes
    -----
    Helmert's estimate: with W = P Q_vv, Q_vv the residuals' covariance, the expectation of
    v'P_k v is the sum over all groups l of h_kl s_l^2, h_kl = tr(W_kl W_lk) [1]_. The solutions
    s_k^2 do not depend on whether the sigma of other groups are right. If all s_k^2 are one,
    v'P_k v is the sum of the group's redundancy numbers. The covariance of the estimates is twice
    the inverse of h. For a group that is independent of all others, h is the redundancy r, and
    the factor has a standard deviation of 1/sqrt(2 r).

    Terms h_kl between image points of different cameras are neglected. So if the sigma of one
    camera are wrong, those of others seem wrong too until they are estimated
    (`mounting.estimated_factors`).

    References
    ----------
    .. [1] K.-R. Koch, "Parameter Estimation and Hypothesis Testing in Linear Models", 2nd
       edition, 1999, chapter 3.6.
    """
    expected.names_of("applied", applied or {}, group_names(bundle.network.block))
    groups = [g for g in _groups(bundle) if len(g["sigma"])]
    shares = _shares(bundle, groups)
    known = bool(np.isfinite(shares).all())  # not where a point has no coordinates in numbers
    inverse = np.linalg.pinv(shares if known else np.eye(len(groups)), rcond=1e-8, hermitian=True)
    variance = inverse @ np.array([np.sum(g["squares"]) for g in groups])
    effective = 1 / np.maximum(np.diag(inverse), 1e-12)
    out = []
    for k, g in enumerate(groups):
        before = (applied or {}).get(g.name, 1.0)
        redundancy = float(np.sum(g["redundancy"]))
        is_estimated = known and redundancy > LEAST_TESTED
        out.append(
            Component(
                group=g.name,
                n=len(g["sigma"]),
                redundancy=redundancy,
                effective=min(float(effective[k]), redundancy) if is_estimated else 0.0,
                factor=before * np.sqrt(max(variance[k], 0.0)) if is_estimated else np.nan,
                applied=before,
            )
        )
    return Components(out)


def sigma_tests(bundle: Bundle) -> tuple[SigmaTest, ...]:
    """Test the sigma of every group of observations by the residuals of this group.

    Parameters
    ----------
    bundle : Bundle
        An adjustment.

    Returns
    -------
    tuple of SigmaTest
        The image points of all cameras together, and the groups of `TESTED`; without those that
        have no redundancy.

    Notes
    -----
    The part v'P_k v of a group is a quadratic form of the errors. With W_k = P_k Q_vv, Q_vv the
    residuals' covariance, it has the distribution of a sum of independent squares of standard
    normal values, each times an eigenvalue of W_k [1]_. These lie between zero and one, so the mean
    tr(W_k) is the sum of the redundancy numbers, and the variance 2 tr(W_k^2) is smaller than that
    of a chi-square variable of so many degrees of freedom. The probability is that of the
    chi-square distribution of the same mean and variance [2]_; where tr(W_k^2) is not computed, an
    upper bound takes its place, which neglects the terms with other large groups.

    References
    ----------
    .. [1] K.-R. Koch, "Parameter Estimation and Hypothesis Testing in Linear Models", 2nd
       edition, 1999, chapter 2.6.
    .. [2] F. E. Satterthwaite, "An approximate distribution of estimates of variance components",
       1946.
    """
    images = bundle.solution.group("image_point")
    every = _Rows(
        name="image points", group=images, rows=np.arange(len(images.v)), columns=np.arange(2)
    )
    groups = [g for g in (every, *_parts(bundle, TESTED)) if len(g["sigma"])]
    shares = _shares(bundle, groups)
    if not np.isfinite(shares).all():  # where a point has no coordinates in numbers
        return ()
    tested = []
    for g, square in zip(groups, np.diag(shares).tolist(), strict=True):
        cost, redundancy = float(np.sum(g["squares"])), float(np.sum(g["redundancy"]))
        if redundancy <= LEAST_TESTED:
            continue
        effective = redundancy**2 / min(max(square, redundancy**2 / len(g["sigma"])), redundancy)
        tested.append(
            SigmaTest(
                group=g.name,
                ratio=float(np.sqrt(cost / redundancy)),
                redundancy=redundancy,
                effective=effective,
                p=two_sided_p(effective * cost / redundancy, effective),
            )
        )
    return tuple(tested)


def _groups(bundle: Bundle) -> Iterator[_Rows]:
    """Yield every group; image points by camera."""
    network = bundle.network
    images = bundle.solution.group("image_point")
    camera_idx = network.block.images.camera_idx[network.image_points.image_idx]
    for k, name in enumerate(image_groups(network.block)):
        rows = np.flatnonzero(camera_idx == k)
        yield _Rows(name=name, group=images, rows=rows, columns=np.arange(2))
    yield from _parts(bundle, PARTS)


def _parts(bundle: Bundle, parts: Sequence[tuple[str, str, tuple[int, ...]]]) -> Iterator[_Rows]:
    """Yield groups besides the image points."""
    for name, kind, columns in parts:
        group = bundle.solution.group(kind)
        rows = np.arange(len(group.v))
        yield _Rows(name=name, group=group, rows=rows, columns=np.array(columns))


def _shares(bundle: Bundle, groups: list[_Rows]) -> Array:
    """Return h of every pair of groups.

    W is idempotent, so a row of h sums to the redundancy. The terms of the image points follow
    from the others; they are divided among cameras in proportion to their redundancy. Between two
    groups that are too large together, and between such a group and the image points, they are
    neglected.
    """
    redundancy = np.array([np.sum(g["redundancy"]) for g in groups])
    is_image = np.array([g.group.kind == "image_point" for g in groups])
    others = np.flatnonzero(~is_image)
    chosen = _small([len(groups[k]["sigma"]) for k in others])
    small = others[chosen]
    joint = _joint_redundancy(bundle, [groups[k] for k in others], chosen)
    h = np.zeros((len(groups), len(groups)))
    h[np.ix_(small, others)] = joint
    h[np.ix_(others, small)] = joint.T
    to_images = redundancy[small] - joint.sum(axis=1)
    part = redundancy[is_image] / max(redundancy[is_image].sum(), 1e-12)
    h[np.ix_(small, is_image)] = to_images[:, None] * part
    h[np.ix_(is_image, small)] = h[np.ix_(small, is_image)].T
    large = np.setdiff1d(np.arange(len(groups)), small)
    h[large, large] = redundancy[large] - h[large].sum(axis=1)
    return h


def _small(n_rows: Sequence[int]) -> Index:
    """Return which groups have at most `MOST_ROWS` rows together, the smallest first."""
    order = np.argsort(n_rows, kind="stable")
    return np.sort(order[np.cumsum(np.array(n_rows, dtype=np.intp)[order]) <= MOST_ROWS])


def _joint_redundancy(bundle: Bundle, groups: list[_Rows], chosen: Index) -> Array:
    """Return h of the chosen groups and all of these, shape (n_chosen, n), W made symmetric."""
    out = np.zeros((len(chosen), len(groups)))
    if len(chosen) == 0:
        return out
    W, first = _shown(bundle, groups), _starts(groups)

    def with_all(some: Index) -> Array:
        return np.asarray(np.add.reduceat(np.sum(W(some) ** 2, axis=0), first[:-1]))

    for row, k in enumerate(chosen):
        starts = range(first[k], first[k + 1], AT_A_TIME)
        parts = [np.arange(start, min(start + AT_A_TIME, first[k + 1])) for start in starts]
        out[row] = sum(processors.in_order(with_all, parts))
    return out


def _shown(bundle: Bundle, groups: list[_Rows]) -> Callable[[Index], Array]:
    """Return a function that computes rows of the symmetric W of the groups."""
    points = bundle.network.observed_points
    network = _seeing(bundle.network, points)
    equations = {e.kind: e for e in network.equations(bundle.state)}
    J = sparse.csr_array(
        sparse.vstack([_whitened(equations[g.group.kind], g, points, network) for g in groups])
    )
    by_columns, by_points = J[:, : network.n_columns], J[:, network.n_columns :]
    gain, point_covariances = elimination(network, bundle.state, points)
    by_columns = by_columns - by_points @ sparse.csr_array(gain.reshape(-1, network.n_columns))
    spread = sparse.csr_array(
        sparse.block_diag([np.zeros((0, 0)), *point_covariances]) @ by_points.T
    )

    def rows(some: Index) -> Array:
        W = -(by_points[some] @ spread).toarray()
        W[np.arange(len(some)), some] += 1
        W -= (by_columns @ bundle.solution.inverse.times(by_columns[some].toarray()).T).T
        return np.asarray(W)

    return rows


def _starts(groups: list[_Rows]) -> Index:
    """Return the first row of each group, and the number of all rows."""
    return np.cumsum([0, *(len(g["sigma"]) for g in groups)])


def _seeing(network: Network, points: Index) -> Network:
    """Return a network with the image measurements of some points alone."""
    rows = np.isin(network.image_points.point_idx, points)
    return replace(network, image_points=network.image_points[rows], rows=network.rows[rows])


def _whitened(e: Equations, g: _Rows, points: Index, network: Network) -> sparse.csr_array:
    """Return a group's derivatives, of observations that have the unit matrix for weights."""
    J = sparse.csr_array(_derivatives(e, g, points, network).multiply(1 / g["sigma"][:, None]))
    if e.correlation is None:
        return J
    used = np.isfinite(g.group.sigma[:, g.columns])
    place = np.where(used, np.cumsum(used).reshape(used.shape) - 1, -1)
    parts = []
    for places, c in zip(place.T, g.columns, strict=True):
        a, b = np.nonzero(e.correlation.factors[c])
        used_pairs = (places[a] >= 0) & (places[b] >= 0)
        a, b = a[used_pairs], b[used_pairs]
        parts.append((e.correlation.factors[c][a, b], places[a], places[b]))
    values, rows, columns = map(np.concatenate, zip(*parts, strict=True))
    return sparse.csr_array((values, (rows, columns)), shape=(len(J.indptr) - 1,) * 2) @ J


def _derivatives(e: Equations, g: _Rows, points: Index, network: Network) -> sparse.csr_array:
    """Return a group's derivatives by the columns and the given points, a row for each."""
    m, d = e.v.shape
    row = np.arange(m * d).reshape(m, d, 1)
    columns = np.broadcast_to(e.columns[e.unit][:, None], e.A.shape)
    free = columns >= 0
    parts = [(e.A[free], np.broadcast_to(row, e.A.shape)[free], columns[free])]
    if e.B is not None and e.point is not None:
        first = network.n_columns + 3 * np.searchsorted(points, e.point)
        indices = np.broadcast_to(first[:, None, None] + np.arange(3), e.B.shape)
        parts.append((e.B.ravel(), np.broadcast_to(row, e.B.shape).ravel(), indices.ravel()))
    values, rows, indices = map(np.concatenate, zip(*parts, strict=True))
    shape = (m * d, network.n_columns + 3 * len(points))
    J = sparse.csr_array((values, (rows, indices)), shape=shape)
    used = np.isfinite(g.group.sigma[np.ix_(g.rows, g.columns)])
    return J[(g.rows[:, None] * d + g.columns)[used]]


def image_groups(block: Block) -> tuple[str, ...]:
    """Return the names of the groups of image points, one per camera."""
    if len(block.cameras) == 1:
        return ("image points",)
    return tuple(f"image points {camera.name}" for camera in block.cameras)


def group_names(block: Block) -> tuple[str, ...]:
    """Return the names of all groups."""
    return (*image_groups(block), *(name for name, _, _ in PARTS))
