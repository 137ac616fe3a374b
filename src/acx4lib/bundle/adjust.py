"""The bundle block adjustment of a network: adjusted cameras and poses, with covariances."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.observations import of_halves
from acx4lib.bundle.rejections import Exchange, Rejection, Stopped
from acx4lib.bundle.start import ASTRAY, far_off, suspects, with_estimates
from acx4lib.bundle.unknowns import State
from acx4lib.bundle.uses import robust_start
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Distances
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import mounted_jacobian
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.adjustment import Solution
from acx4lib.least_squares.covariance import propagate
from acx4lib.least_squares.reduced_system import held_at_zero
from acx4lib.least_squares.statistics import Group

if TYPE_CHECKING:
    import pandas as pd

HIGH = 100.0
"""Variance factor above which it is checked whether the minimum found is the right one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bundle:
    """An adjusted bundle.

    Attributes
    ----------
    network : Network
    state : State
        Estimates.
    solution : Solution
        Precision and residuals; covariances are a priori.
    rejected : tuple of Rejection
    stopped : tuple of Stopped
        Groups with too many rejections, in which none was made.
    exchanged : tuple of Exchange
        Rejected pairs that fit where their names are exchanged.
    """

    network: Network
    state: State
    solution: Solution
    rejected: tuple[Rejection, ...] = ()
    stopped: tuple[Stopped, ...] = ()
    exchanged: tuple[Exchange, ...] = ()

    def __repr__(self) -> str:
        """Describe the adjustment and its fit in one line."""
        n = shown.count(self.solution.n_observations, "observation")
        redundancy = f"redundancy {self.solution.redundancy}"
        return shown.line(f"Bundle of {self.network.block.name!r}", n, redundancy, *self.said)

    @property
    def said(self) -> tuple[str, str, str]:
        """The fit in phrases: variance factor, iterations, rejections."""
        p = self.solution.chi_square_p
        probability = f"p {p:.3f}" if p >= 5e-4 else "p < 0.0005"
        fit = f"σ0² {self.solution.sigma0_sq:.3f} ({probability})"
        n = self.solution.iterations  # none after the last rejections
        steps = shown.count(n, "iteration") if n else ""
        return fit, steps, f"{len(self.rejected)} rejected" if self.rejected else ""

    def quality(self) -> pd.DataFrame:
        """Return the adjustment in a row: its size, redundancy and global test."""
        return qualities("block", {self.network.block.name: self})

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The block's cameras with their estimates: interior orientation, mounting if mounted."""
        return with_estimates(self.network.block.cameras, self.state)

    @property
    def T_m_c(self) -> Pose:
        """Camera poses, one per image."""
        return camera_poses(self.network, self.state)

    @property
    def camera_pose_covariances(self) -> Array:
        """A priori covariances of the camera poses, (n_images, 6, 6), m and rad in camera axes."""
        network, images = self.network, self.network.block.images
        T_m_b = self.state.T_m_b[network.pose_idx]
        by_body, by_mount = mounted_jacobian(T_m_b, self.state.T_b_c[images.camera_idx])
        J = np.concatenate([by_mount, by_body], axis=2)
        columns = np.concatenate(
            [network.layout.mount[images.camera_idx], network.layout.pose[network.pose_idx]], axis=1
        )
        cov = held_at_zero(self.solution.inverse, columns[:, :, None], columns[:, None, :])
        return propagate(J, cov)

    @property
    def oriented(self) -> Mask:
        """Which images are oriented by their measurements, or held, shape (n_images,)."""
        undetermined = np.append(self.solution.undetermined, False)
        is_open: Mask = np.any(undetermined[self.network.layout.pose], axis=1)
        return ~is_open[self.network.pose_idx]


def qualities(name: str, bundles: Mapping[str, Bundle]) -> pd.DataFrame:
    """Return a row for each adjustment: size, redundancy, global test, number of rejections.

    Parameters
    ----------
    name : str
        Name of the index that holds the keys.
    bundles : mapping of str to Bundle
    """
    return shown.row_table(name, {key: _quality(bundle) for key, bundle in bundles.items()})


def _quality(bundle: Bundle) -> dict[str, object]:
    solution = bundle.solution
    return {
        "observations": solution.n_observations,
        "unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "σ0²": solution.sigma0_sq,
        "p of χ²": solution.chi_square_p,
        "iterations": solution.iterations,
        "rejected": len(bundle.rejected),
        "left out": sum(bundle.network.left_out.values()),
    }


def adjust(network: Network) -> Bundle:
    """Adjust a network, with all its observations.

    Approximate values that are far off, or from which it fails, are first replaced by better ones.

    Raises
    ------
    AdjustmentError
        Where it does not converge, or converges to a state that does not fit the measurements.
    """
    expected.instance("network", network, Network)
    if not far_off(network, network.start).any():
        with suppress(AdjustmentError):
            return _adjusted(network, network.start)
    return _adjusted(network, robust_start(network))


def _adjusted(network: Network, start: State) -> Bundle:
    try:
        state, solution = adjustment.solve(network, start)
    except AdjustmentError as error:
        where = suspects(network, start)
        if not where:
            raise
        raise AdjustmentError(f"{error}{where}") from error
    if solution.sigma0_sq > HIGH and far_off(network, state, limit=ASTRAY).any():
        where = suspects(network, start) or suspects(network, state)
        raise AdjustmentError(f"the adjustment went astray{where}")
    return _of(network, state, solution)


def designed(network: Network) -> Bundle:
    """Return the precision of a planned network; its observations have no errors.

    Returns
    -------
    Bundle
        At the start values, which are the true ones; its sigma0 is one.

    Raises
    ------
    AdjustmentError
        Where observations are fewer than unknowns.
    """
    expected.instance("network", network, Network)
    return _of(network, network.start, adjustment.designed(network, network.start))


def _of(network: Network, state: State, solution: Solution) -> Bundle:
    n = len(network.distances)  # adjusted as two halves and an unknown that joins them
    whole_ones = replace(
        solution,
        n_observations=solution.n_observations - n,
        n_unknowns=solution.n_unknowns - n,
        groups=tuple(_whole(group, network.distances) for group in solution.groups),
    )
    return Bundle(network=network, state=state, solution=whole_ones)


def _whole(group: Group, distances: Distances) -> Group:
    """Return a group of residuals, the halves of its distances joined."""
    if group.kind != "distance":
        return group
    return Group(
        kind=group.kind,
        v=of_halves(group.v),
        sigma=distances.sigma_m[:, None],
        redundancy=of_halves(group.redundancy),
    )
