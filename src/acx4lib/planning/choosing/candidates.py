"""All candidates of a target together: what they could give, and what any choice of them gives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import Parameter, parameters, to_reported
from acx4lib.calibration.mounting import Mounting
from acx4lib.calibration.trust.needs import features, needed
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.georeferencing.error_sources import ErrorSources
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.planning import design
from acx4lib.planning.choosing.search import Choice
from acx4lib.planning.choosing.strip_information import StripInformation, of_strips
from acx4lib.planning.choosing.target import BLOCK, CHECK_POINTS, Target
from acx4lib.planning.design import Design
from acx4lib.planning.exposures import flying_time_s
from acx4lib.planning.plan import TURN_S, Plan

AT_CHECK_POINTS = "check points"
"""Stands in the place of a camera where an RMS is wanted."""

Key = tuple[str, str]
"""Camera, and name in results."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """One number that is wanted.

    Attributes
    ----------
    camera, name : str
        A parameter as results name it, of no camera for GNSS; or `AT_CHECK_POINTS` and an axis.
    limit : float
        Largest standard deviation, or RMS.
    with_all : float
        With all candidates.
    needs : str
        What would determine a parameter better, and no candidate has.
    """

    camera: str
    name: str
    limit: float
    with_all: float
    needs: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidates:
    """All candidates of a target.

    Attributes
    ----------
    target : Target
    information : StripInformation
    wanted : tuple of Wanted
        Standard deviations, then RMS.
    by_common : ndarray, shape (n_sigma, k)
        d(wanted parameter) / d(common unknowns).
    own_m2 : ndarray, shape (n_rms,)
        Mean variance of check points from all but the calibration, m^2.
    by_calibration : ndarray, shape (n_rms, k, k)
        The sum of its products with the covariance is the mean variance from the calibration.
    """

    target: Target
    information: StripInformation
    wanted: tuple[Wanted, ...]
    by_common: Array
    own_m2: Array
    by_calibration: Array

    @property
    def limits(self) -> Array:
        """What is wanted at most, shape (n,)."""
        return np.array([one.limit for one in self.wanted])

    @property
    def failing(self) -> tuple[Wanted, ...]:
        """What all candidates together do not give, and so no choice of them does."""
        return tuple(one for one in self.wanted if not one.with_all <= one.limit)

    @cached_property
    def seconds(self) -> Array:
        """Time of every strip and the turn after it, shape (n,)."""
        strips = self.target.plan.blocks[BLOCK].strips.values()
        return np.array([flying_time_s((one,)) + TURN_S for one in strips])

    def minutes(self, chosen: Choice) -> float:
        """Return the flying time from the first exposure to the last."""
        return max(0.0, float(self.seconds[list(chosen)].sum()) - TURN_S) / 60.0

    def given(self, chosen: Choice) -> Array:
        """Return what is wanted as a choice gives it, by the tie points that take part."""
        cov = self.information.covariance(chosen)
        sigma = sigmas(propagate(self.by_common, cov))
        rms = np.sqrt(self.own_m2 + np.sum(self.by_calibration * cov, axis=(1, 2)))
        return np.append(sigma, rms)

    def planned(self, plan: Plan) -> Array:
        """Return what is wanted as a plan gives it, by all of its tie points."""
        found = _found(_designed(self.target, plan))
        return np.array([found[one.camera, one.name] for one in self.wanted])


def of(target: Target) -> Candidates:
    """Return the candidates of a target.

    Raises
    ------
    FlightError
        Where something is wanted that the plan does not estimate.
    """
    full = _designed(target, target.plan)
    mounting = _mounting(full)
    information = of_strips(mounting.bundle.network)
    listed = shared(mounting)
    wanted = [i for name in target.sigma for i in _places(name, listed)]
    n, k = mounting.calibration.n_columns, len(information.names)
    J = np.eye(k)
    J[:n, :n] = to_reported(mounting.calibration)
    own, by_calibration = _at_check_points(target, full, k)
    return Candidates(
        target=target,
        information=information,
        wanted=_wanted(target, full, [listed[i] for i in wanted]),
        by_common=J[wanted],
        own_m2=own,
        by_calibration=by_calibration,
    )


def _designed(target: Target, plan: Plan) -> Design:
    """Return what the blocks determine that a target is about."""
    names = (BLOCK, "validation") if target.check_m else (BLOCK,)
    return design.of(replace(plan, blocks={name: plan.blocks[name] for name in names}))


def _mounting(designed: Design) -> Mounting:
    return designed.mountings[design.methods(designed.plan)[BLOCK]]


def shared(mounting: Mounting) -> list[Parameter]:
    """Return the parameters that belong to no strip, in the order of their columns."""
    of_gnss = [p for p in trajectory_errors.parameters(mounting.bundle) if p.key != "drift"]
    return [*parameters(mounting.calibration), *of_gnss]


def _places(name: str, listed: list[Parameter]) -> list[int]:
    places = [i for i, p in enumerate(listed) if p.name == name]
    if not places:
        known = ", ".join(dict.fromkeys(p.name for p in listed))
        raise FlightError([f"target: sigma.{name}: the plan does not estimate it, but {known}"])
    return places


def _found(designed: Design) -> dict[Key, float]:
    """Return standard deviations and RMS by their names."""
    found = {(p.camera, p.name): p.sigma for p in shared(_mounting(designed))}
    for validation in designed.validations.values():
        rms = np.sqrt(np.mean(validation.points.sigma**2, axis=0))
        found |= {
            (AT_CHECK_POINTS, name): float(one) for name, one in zip(CHECK_POINTS, rms, strict=True)
        }
    return found


def _wanted(target: Target, full: Design, listed: list[Parameter]) -> tuple[Wanted, ...]:
    found, has = _found(full), features(full.blocks[BLOCK])
    return (
        *(
            Wanted(
                camera=p.camera,
                name=p.name,
                limit=target.sigma[p.name],
                with_all=found[p.camera, p.name],
                needs=needed(p.key, has) if p.camera else "",
            )
            for p in listed
        ),
        *(
            Wanted(
                camera=AT_CHECK_POINTS,
                name=name,
                limit=limit,
                with_all=found[AT_CHECK_POINTS, name],
            )
            for name, limit in target.check_m.items()
        ),
    )


def _at_check_points(target: Target, full: Design, k: int) -> tuple[Array, Array]:
    """Return the mean variances at check points, without the calibration and by it."""
    axes = [CHECK_POINTS.index(name) for name in target.check_m]
    if not axes:
        return np.zeros(0), np.zeros((0, k, k))
    (validation,) = full.validations.values()
    sources: ErrorSources = validation.points.sources
    without = replace(sources, cov_parameters=np.zeros_like(sources.cov_parameters))
    own = np.diagonal(without.cov, axis1=1, axis2=2).mean(axis=0)
    G, n = sources.by_parameters, sources.by_parameters.shape[2]
    by_calibration = np.zeros((len(axes), k, k))
    by_calibration[:, :n, :n] = (np.einsum("pai,paj->aij", G, G) / len(G))[axes]
    return own[axes], by_calibration
