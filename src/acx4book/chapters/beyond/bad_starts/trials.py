"""Adjustments that start far from the truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from acx4book.notebooks.simulated.flown import fly
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.start.ray_misfits import misfits
from acx4lib.bundle.start.robust import robust_phase
from acx4lib.bundle.start.start_values import recovered
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, exp

OFF_DEG, OFF_FOCAL, OFF_M = 5.0, 0.03, 100.0
"""Error of every angle, share of the focal length, error of every coordinate of a tie point."""

PHASES = ("as given", "cameras turned", "robust phase", "adjusted")


@dataclass(frozen=True, kw_only=True, eq=False)
class FromBadStarts:
    """Adjustments of one network from bad start values.

    Attributes
    ----------
    misfit_deg : ndarray, shape (n, 4, n_images)
        Angles between rays and their points at each of `PHASES`, medians of the images.
    apart : ndarray, shape (n,)
        Largest difference of a calibrated parameter to the given adjustment, in sigmas.
    """

    misfit_deg: Array
    apart: Array


def single_step(design: str, seed: int) -> Bundle:
    """Return a simulated flight, adjusted from its own start values.

    Parameters
    ----------
    design : str
        Of `acx4sim.DESIGNS`.
    seed : int
    """
    flown = fly(design, seed)
    return adjust(mounted_orientation(flown.block, free=flown.flight.estimate_mounting))


def from_bad_starts(bundle: Bundle, *, seeds: Iterable[int]) -> FromBadStarts:
    """Adjust a network from start values with errors as large as users have them.

    Focal length, boresight, attitudes and points are off by the same amounts at every seed, one
    way or the other. The phases are those that `adjust.adjust` runs.

    Parameters
    ----------
    bundle : Bundle
        Adjusted from its own start values.
    seeds : iterable of int
    """
    misfit_deg, apart = [], []
    for seed in seeds:
        network = _badly_started(bundle.network, np.random.default_rng(seed))
        turned = recovered(network)
        states = [network.start, turned, robust_phase(network, turned)]
        found = adjust(network)
        angles = [misfits(network, state) for state in (*states, found.state)]
        misfit_deg.append(np.degrees(angles))
        apart.append(_apart(found, bundle))
    return FromBadStarts(misfit_deg=np.array(misfit_deg), apart=np.array(apart))


def _badly_started(network: Network, rng: np.random.Generator) -> Network:
    start = network.start

    def either(*shape: int) -> Array:
        return rng.choice([-1.0, 1.0], shape)

    def turned(T: Pose) -> Pose:
        return Pose(R=T.R @ exp(np.radians(OFF_DEG) * either(len(T), 3)), r=T.r)

    interiors = tuple(
        replace(i, f=i.f * (1 + OFF_FOCAL * float(sign)))
        for i, sign in zip(start.interiors, either(len(start.interiors)), strict=True)
    )
    bad = replace(
        start,
        interiors=interiors,
        T_b_c=turned(start.T_b_c),
        T_m_b=turned(start.T_m_b),
        x_m=start.x_m + OFF_M * either(*start.x_m.shape),
    )
    return replace(network, start=bad)


def _apart(found: Bundle, expected: Bundle) -> float:
    pairs = zip(parameters(from_bundle(found)), parameters(from_bundle(expected)), strict=True)
    return max(abs(p.value - q.value) / q.sigma for p, q in pairs)
