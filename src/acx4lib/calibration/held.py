"""Held parameters, tested: what the data say of each, from one solved adjustment.

A parameter that an adjustment holds at a value is a hypothesis. Freeing it adds a column to the
normal equations. Their inverse without this column is known, so that the column's Schur complement
S and its right side g are a few products: freed alone, the parameter changes by d = -g / S, its
cofactor is 1 / S, and v'Pv falls by g^2 / S. Nothing is adjusted a second time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import Layout, holding
from acx4lib.calibration.estimates import (
    LIMIT_INTERIOR,
    LIMIT_LEVER_M,
    Calibration,
    from_bundle,
    parameters,
    reported_values,
    to_reported,
)
from acx4lib.calibration.heads import corner_radius
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.frames import opk_jacobian
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM, MOUNT, REPORTED, Prior
from acx4lib.least_squares.adjustment import normals
from acx4lib.least_squares.normal_equations import ROUNDING
from acx4lib.least_squares.reduced_system import SINGULAR
from acx4lib.least_squares.statistics import f_sf, holm
from acx4lib.least_squares.verdict import LEVEL

if TYPE_CHECKING:
    import pandas as pd

FAR = 10.0
"""Change of a parameter, in its sigma, from which the linear step alone is not exact enough."""

ONE_SIGMA = 1.0
"""Least move of an estimate that results list, in its stated sigma."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Held:
    """The held parameters of one adjustment, tested; units are those of parameters.csv.

    Attributes
    ----------
    names, units : tuple of str
        Of n held parameters, such as ``CAM1/f_mm``.
    value : ndarray, shape (n,)
        At which each is held.
    limit : ndarray, shape (n,)
        Standard deviation of the freed parameter above which the data cannot tell.
    gradient, normal : ndarray, shape (n,) and (n, n)
        Right side and normal matrix of the held parameters, all other unknowns eliminated.
    cost : float
        v'Pv of the adjustment.
    redundancy : int
    estimates : tuple of str
        Names of the m estimated parameters.
    by_held : ndarray, shape (m, n)
        Their derivatives by the held ones, in their stated sigma.
    network : Network
        With a column for each held parameter that it knows; the lever arms of the two-step method
        are not among them.
    step : ndarray, shape (n_columns, n)
        Derivatives of its columns by the held parameters.
    correction : ndarray, shape (n,)
        Of the linear change of each parameter that is freed alone, where this is above `FAR`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    value: Array
    limit: Array
    gradient: Array
    normal: Array
    cost: float
    redundancy: int
    estimates: tuple[str, ...]
    by_held: Array
    network: Network
    step: Array
    correction: Array

    # --- each freed alone --------------------------------------------------------------------

    @cached_property
    def _weight(self) -> Array:
        """The diagonal of the normal matrix; NaN where a parameter cannot be freed alone."""
        return np.where(self.normal.diagonal() > 0, self.normal.diagonal(), np.nan)

    @property
    def difference(self) -> Array:
        """The change of each parameter that is freed alone, shape (n,)."""
        return -self.gradient / self._weight + self.correction

    @property
    def estimate(self) -> Array:
        """The estimate of each parameter that is freed alone, shape (n,)."""
        return self.value + self.difference

    @property
    def reduction(self) -> Array:
        """The decrease of v'Pv by freeing each parameter alone, shape (n,)."""
        return self.gradient**2 / self._weight

    @property
    def sigma(self) -> Array:
        """A posteriori sigma of each estimate, with sigma0 of the freed adjustment, shape (n,)."""
        return np.sqrt(_sigma0_sq(self, self.reduction, 1) / self._weight)

    @property
    def told(self) -> Mask:
        """Which held values the data can test: sigma is within its limit."""
        return (np.nan_to_num(self.sigma, nan=np.inf) <= self.limit) & (self.redundancy > 1)

    @property
    def p(self) -> Array:
        """Probability of such a decrease if the held value is right; NaN where untold, (n,).

        By F of 1 and redundancy - 1 degrees of freedom.
        """
        ratio = self.reduction / _sigma0_sq(self, self.reduction, 1)
        return np.array(
            [
                f_sf(float(f), 1, self.redundancy - 1) if told else np.nan
                for f, told in zip(ratio, self.told, strict=True)
            ]
        )

    @property
    def moves(self) -> Array:
        """By how many sigma freeing each alone moves each estimate, shape (n, m)."""
        return (self.by_held * self.difference).T

    # --- all freed together ------------------------------------------------------------------

    @cached_property
    def joint(self) -> tuple[float, int, float]:
        """Decrease of v'Pv by freeing all, degrees of freedom, and p (NaN where untold).

        Only of the combinations that the data can tell, those whose sigma is within the limits.
        """
        scaled = self.limit[:, None] * self.normal * self.limit
        values, vectors = np.linalg.eigh(scaled)
        told = values >= self.cost / max(self.redundancy, 1)
        n = int(told.sum())
        along = vectors[:, told].T @ (self.limit * self.gradient)
        reduction = float(np.sum(along**2 / values[told]))
        freedom = self.redundancy - n
        if n == 0 or freedom <= 0:
            return reduction, n, np.nan
        ratio = reduction / n / float(_sigma0_sq(self, reduction, n))
        return reduction, n, f_sf(ratio, n, freedom)

    def _after(self, names: Sequence[str]) -> Held:
        """Return the tests of the other held values where some parameters are free.

        Parameters
        ----------
        names : sequence of str
        """
        free = np.isin(self.names, names)
        change = np.linalg.solve(self.normal[np.ix_(free, free)], self.normal[free][:, ~free])
        to_free = np.linalg.solve(self.normal[np.ix_(free, free)], self.gradient[free])
        return replace(
            self,
            names=tuple(np.array(self.names)[~free].tolist()),
            units=tuple(np.array(self.units)[~free].tolist()),
            value=self.value[~free],
            limit=self.limit[~free],
            gradient=self.gradient[~free] - change.T @ self.gradient[free],
            normal=self.normal[np.ix_(~free, ~free)] - change.T @ self.normal[free][:, ~free],
            cost=self.cost - float(self.gradient[free] @ to_free),
            redundancy=self.redundancy - int(free.sum()),
            by_held=self.by_held[:, ~free] - self.by_held[:, free] @ change,
            step=self.step[:, ~free] - self.step[:, free] @ change,
            correction=np.zeros(int((~free).sum())),
        )

    @cached_property
    def rejected(self) -> tuple[str, ...]:
        """Held values that the data reject at the joint `LEVEL`, the one that costs most first.

        Each is tested with those before it free: what one of them explains rejects no other.
        """
        if not self.told.any():
            return ()
        worst = int(np.argmax(np.where(self.told, self.reduction, 0.0)))
        if not holm(self.p)[worst] < LEVEL:
            return ()
        name = self.names[worst]
        return (name, *self._after([name]).rejected)

    def change(self, names: Sequence[str]) -> Array:
        """Return the change of all columns of `network` by freeing some parameters together.

        Parameters
        ----------
        names : sequence of str
            Of held parameters.

        Returns
        -------
        ndarray, shape (n_columns,)
        """
        at = [self.names.index(name) for name in names]
        return -self.step[:, at] @ np.linalg.solve(self.normal[np.ix_(at, at)], self.gradient[at])

    def freed(self, bundle: Bundle) -> Bundle:
        """Return the tested bundle with the state that it has if its rejected values are free.

        By the linear step and one of Gauss and Newton: angles turn by milliradians, whose squares
        matter. Its covariances are those of the bundle.
        """
        linear, state = self.change(self.rejected), bundle.state
        state = self.network.moved(state, linear, np.zeros_like(state.x_m))
        stays = [i for i, name in enumerate(self.names) if name not in self.rejected]
        network = bundle.network.with_layout(holding(self.network.layout, np.array(stays, int)))
        return replace(bundle, state=network.moved(state, *normals(network, state).step()))

    def table(self) -> pd.DataFrame:
        """Return value held, estimate if freed alone, its sigma, v'Pv that holding costs, and p.

        Where the data cannot tell, p is NaN.
        """
        values = (self.value, self.estimate, self.sigma, self.reduction, self.p)
        columns = ("held", "freed", "sigma", "v'Pv", "p")
        rows = zip(self.names, self.units, *values, strict=True)
        return shown.row_table(
            ("parameter", "unit"),
            {(name, unit): dict(zip(columns, of, strict=True)) for name, unit, *of in rows},
        )


def _sigma0_sq(held: Held, reduction: Array | float, n: int) -> Array:
    """Return the variance factor after n parameters are freed; one without redundancy."""
    freedom = held.redundancy - n
    if freedom <= 0:
        return np.ones_like(reduction)
    left = np.maximum(held.cost - reduction, ROUNDING * held.cost + np.finfo(float).tiny)
    return np.asarray(left / freedom)


# --- from an adjustment -----------------------------------------------------------------------


def of_bundle(bundle: Bundle) -> Held:
    """Test what a bundle with free orientations holds of its interior orientations.

    Parameters
    ----------
    bundle : Bundle
        Of a head by itself.

    Notes
    -----
    A prior of a held value takes no part: it is tested against the data alone.
    """
    calibration = from_bundle(bundle)
    return _tested(bundle, calibration, np.eye(calibration.n_columns, bundle.network.n_columns))


def of_mounting(mounting: Mounting) -> Held:
    """Test what a method of the mounting, or a rig, holds.

    Interior orientation; lever arm and boresight, where they are parameters of its bundle; and the
    shift of observed positions, held at zero.

    Parameters
    ----------
    mounting : Mounting
    """
    calibration, bundle, J = mounting.calibration, mounting.bundle, mounting.by_bundle
    if J is None:
        J = np.eye(calibration.n_columns, bundle.network.n_columns)
        return _tested(bundle, calibration, J, mounted=True)
    return _tested(bundle, calibration, J, levers=mounting.method == "two_step_gnss")


def _tested(
    bundle: Bundle,
    calibration: Calibration,
    J: Array,
    *,
    mounted: bool = False,
    levers: bool = False,
) -> Held:
    """Return the held parameters of a bundle; J is d(calibration) / d(columns of the bundle).

    Its poses are those of bodies if `mounted`. With `levers` they are the cameras' own, and the
    lever arms are held in the observed positions.
    """
    network, cameras = bundle.network, calibration.cameras
    columns, wanted = _extended(network, mounted=mounted)
    n = sum(int(part.sum()) for part in wanted)
    listed = [
        (int(k), keys[i])
        for part, keys in zip(wanted, (INTERIOR, MOUNT), strict=False)
        for k, i in np.argwhere(part)
    ]
    listed += [(-1, AXES[i]) for i in np.flatnonzero(wanted[2])]
    unknown = tuple(replace(camera, prior=Prior()) for camera in network.block.cameras)
    freed = replace(network, block=replace(network.block, cameras=unknown)).with_layout(columns)
    N, g = normals(freed, bundle.state).first_rows(n)
    g = g[:n]  # the others are zero
    if levers:
        N, g = _with_levers(bundle, freed, N, g)
        listed += [(k, key) for k in range(len(cameras)) for key in LEVER_ARM]
    q = len(g)
    by_others = N[:, q:]
    solved = bundle.solution.inverse.times(by_others)
    S = N[:, :q] - solved @ by_others.T
    S[np.diag_indices(q)] *= S.diagonal() > SINGULAR * N.diagonal()
    B = _of_reported(listed, cameras)
    step = np.zeros((freed.n_columns, q))
    step[:n], step[n:] = B[:n], -solved.T @ B
    estimates = parameters(calibration)
    sigma = np.array([p.sigma for p in estimates])
    values = [reported_values(camera) for camera in cameras]
    tested = Held(
        names=tuple(
            f"{cameras[k].name}/{REPORTED[key][0]}" if k >= 0 else f"gnss_shift_{key}_m"
            for k, key in listed
        ),
        units=tuple(REPORTED[key][1] if k >= 0 else "m" for k, key in listed),
        value=np.array([values[k][REPORTED[key][0]] if k >= 0 else 0.0 for k, key in listed]),
        limit=np.array([_limit(calibration, k, key) for k, key in listed]),
        gradient=B.T @ g,
        normal=B.T @ ((S + S.T) / 2) @ B,
        cost=bundle.solution.cost,
        redundancy=bundle.solution.redundancy,
        estimates=tuple(p.full_name for p in estimates),
        by_held=to_reported(calibration) @ J @ step[n:] / sigma[:, None],
        network=freed,
        step=step,
        correction=np.zeros(q),
    )
    # estimates that are far off, by the gradient where the linear step leads to
    far = tested.told & (np.abs(tested.difference) > FAR * tested.sigma)
    for i in np.flatnonzero(far[:n]):
        dx = step[:, i] * tested.difference[i]
        state = freed.moved(bundle.state, dx, np.zeros_like(bundle.state.x_m))
        _, there = normals(freed, state).first_rows(n)
        left = B[:n, i] @ (there[:n] - solved[:n] @ there[n:])
        tested.correction[i] = -left / tested.normal[i, i]
    return tested


def _extended(network: Network, *, mounted: bool) -> tuple[Layout, list[Mask]]:
    """Return a layout that begins with the columns of held parameters, and which these are.

    Of interior orientations and mountings by camera, and of the shift of observed positions.
    """
    is_observed = np.isfinite(network.observed.sigma_position).any(axis=0)
    before = {field.name: getattr(network.layout, field.name) for field in fields(Layout)}
    may = {"interior": np.True_, "mount": np.bool_(mounted), "shift": is_observed}
    wanted = {name: (before[name] < 0) & allowed for name, allowed in may.items()}
    n, first = sum(int(part.sum()) for part in wanted.values()), 0
    after = {name: np.where(part >= 0, part + n, -1) for name, part in before.items()}
    for name, part in wanted.items():
        after[name][part] = first + np.arange(part.sum())
        first += int(part.sum())
    return Layout(**after), [*wanted.values()]


def _with_levers(bundle: Bundle, freed: Network, N: Array, g: Array) -> tuple[Array, Array]:
    """Return rows and right sides with those of the lever arms that positions are reduced by.

    A camera's observed position is the body's plus R_m_b times the lever arm.
    """
    block, n = freed.block, len(g)
    e = next(e for e in freed.besides_rays(bundle.state) if e.kind == "gnss")
    images = np.arange(len(block.images))
    by_lever = np.zeros((len(images), 3, len(block.cameras), 3))
    by_lever[images, :, block.images.camera_idx] = -freed.observed.R_g_m @ block.T_m_b_images.R
    A = by_lever.reshape(len(images), 3, -1)
    weighted = e.weighed(A)
    rows = np.zeros((freed.n_columns + 1, A.shape[2]))  # the last one collects what is held
    np.add.at(rows, e.columns, np.swapaxes(e.A, 1, 2) @ weighted)
    L, corner = rows[:-1].T, np.einsum("nai,naj->ij", A, weighted)
    with_own = np.block([[N[:, :n], L[:, :n].T, N[:, n:]], [L[:, :n], corner, L[:, n:]]])
    return with_own, np.append(g, np.einsum("nai,na->i", weighted, e.v))


# --- as results report them -------------------------------------------------------------------


def _of_reported(listed: Sequence[tuple[int, str]], cameras: Sequence[Camera]) -> Array:
    """Return d(columns) / d(reported held parameters): boresights are angles in degrees."""
    B = np.eye(len(listed))
    for k, camera in enumerate(cameras):
        at = [i for i, (of, key) in enumerate(listed) if of == k and key in BORESIGHT]
        if at:
            B[np.ix_(at, at)] = np.linalg.inv(np.degrees(opk_jacobian(camera.T_b_c.opk)))
    return B


def _limit(calibration: Calibration, k: int, key: str) -> float:
    """Return the standard deviation above which the data cannot tell a parameter.

    Those of `estimates.is_determined`. There f is known to 0.2 %, and points in the corner of the
    image to 0.2 % of their radius: this is the limit of the distortion, too.
    """
    if k < 0 or key in LEVER_ARM:
        return LIMIT_LEVER_M
    if key in BORESIGHT:
        return calibration.limit_boresight_deg
    camera = calibration.cameras[k]
    r = corner_radius(camera)
    effect = {"k1": r**2, "k2": r**4, "k3": r**6, "p1": 3 * r, "p2": 3 * r, "b1": 1.0, "b2": 1.0}
    return LIMIT_INTERIOR / effect.get(key, 1 / camera.interior.f)
