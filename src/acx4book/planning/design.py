"""Covariances that a planned flight would give: unknowns, check points; a priori, sigma0 = 1.

The wind moves an aircraft, and no plan says how. `of` takes one wind, or the mean of several.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from acx4book.planning import flown
from acx4book.planning.plan import Plan
from acx4lib import expected
from acx4lib.block import Block
from acx4lib.bundle.adjust import designed, mounted_orientation
from acx4lib.bundle.unknowns import free_mount
from acx4lib.calibration import rig, trajectory_errors
from acx4lib.calibration.estimates import RIGS, Calibration, from_bundle, given, parameters
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Mask
from acx4lib.geometry.parameters import ATTITUDE
from acx4lib.georeferencing import budget, weak
from acx4lib.georeferencing.validation import Validation, validate

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Design:
    """The predicted adjustments of a planned flight.

    Attributes
    ----------
    plan : Plan
    blocks : dict of str to Block
        The planned blocks, with image points free of errors.
    mountings : dict of str to Mounting
        By method: ``single_step`` of block calibration, or ``rig_calibration`` where that is
        measured in heads, and ``rig`` of block heads. Estimates are the plan's values.
    validations : dict of str to Validation
        Of block validation, by the method whose calibration is used: ``given`` where the plan
        calibrates nothing. Differences are zero; their sigma is predicted.
    outcomes : tuple of Outcome
        Of other winds, or the one of these blocks. The prediction is their mean.
    """

    plan: Plan
    blocks: Mapping[str, Block]
    mountings: Mapping[str, Mounting]
    validations: Mapping[str, Validation]
    outcomes: tuple[Outcome, ...]


FEWEST, MOST, IMAGES = 4, 16, 1200
"""Numbers of winds, and the number of images of all winds together. Winds differ less from each
other in a block of many images, which also takes longer."""


def usual_winds(plan: Plan) -> int:
    """Return the number of winds whose mean is accurate enough."""
    n = sum(
        strip.n_exposures * len(plan.cameras(name))
        for name, block in plan.blocks.items()
        for strip in block.strips.values()
    )
    return max(FEWEST, min(MOST, IMAGES // max(n, 1)))


def of(plan: Plan, *, winds: int = 0) -> Design:
    """Predict the adjustments of a plan.

    Parameters
    ----------
    plan : Plan
    winds : int
        Number of winds whose mean is predicted, as `usual_winds` returns it. By default the one in
        which numbers are spread evenly: it is sooner, and within a few percent of the mean.

    Returns
    -------
    Design
        The covariances are the inverse normal matrices of the adjustments that `acx4 run` makes of
        such a flight, eq. (14), at the values of the plan.

    Raises
    ------
    FlightError
        Where no image of a block shows a point.
    AdjustmentError
        Where a block has fewer observations than unknowns.
    """
    expected.whole("winds", winds, least=0)
    blocks = {name: flown.block(plan, name) for name in plan.blocks}
    mountings, validations, even = _in_one_wind(plan, blocks)
    places = {name: flown.over(plan, name).tie_places() if winds else None for name in plan.blocks}
    outcomes = [_in_wind(plan, wind, places) for wind in range(1, winds + 1)]
    return Design(
        plan=plan,
        blocks=blocks,
        mountings=mountings,
        validations=validations,
        outcomes=tuple(outcomes) or (even,),
    )


def _in_wind(plan: Plan, wind: int, places: Mapping[str, Array | None]) -> Outcome:
    blocks = {
        name: flown.block(plan, name, wind=wind, tie_places=places[name]) for name in plan.blocks
    }
    return _in_one_wind(plan, blocks)[2]


def _in_one_wind(
    plan: Plan, blocks: Mapping[str, Block]
) -> tuple[dict[str, Mounting], dict[str, Validation], Outcome]:
    """Return the adjustments and the validations of blocks, and their covariances."""
    mountings = {
        method: calibrated(plan, blocks[name], method=method)
        for name, method in methods(plan).items()
    }
    calibrations = _calibrations(plan, blocks, mountings)
    validations = {
        method: validate(
            blocks["validation"], calibration, method=method, refraction=plan.setup.refraction
        )
        for method, calibration in calibrations.items()
    }
    return mountings, validations, _outcome(mountings, validations, calibrations)


def methods(plan: Plan) -> dict[str, str]:
    """Return the method by which each block of a plan is calibrated; a validation by none."""
    calibration = "rig_calibration" if plan.setup.measured_in_heads else "single_step"
    of_block = {"calibration": calibration, "heads": "rig"}
    return {name: method for name, method in of_block.items() if name in plan.blocks}


def sigmas(plan: Plan) -> pd.Series:
    """Return the standard deviations of the cameras' parameters from a plan's calibration block.

    Parameters
    ----------
    plan : Plan
        With a block ``calibration``; its other blocks are not computed.

    Returns
    -------
    Series
        By the names in results, with the camera before them where there are several; in one wind,
        as `of` has it by default.

    Raises
    ------
    FlightError
        Where the plan has no block calibration, or no image of it shows a point.
    """
    import pandas as pd  # noqa: PLC0415 it loads long, and a design needs none

    if "calibration" not in plan.blocks:
        raise FlightError(["a plan without block calibration determines no mounting"])
    method = methods(plan)["calibration"]
    calibration = calibrated(plan, flown.block(plan, "calibration"), method=method).calibration
    several = len(calibration.cameras) > 1
    listed = parameters(calibration)
    return pd.Series({f"{p.camera}/{p.name}" if several else p.name: p.sigma for p in listed})


def calibrated(plan: Plan, block: Block, *, method: str) -> Mounting:
    """Predict the mounting calibration of one planned block.

    Parameters
    ----------
    plan : Plan
    block : Block
        As `flown.block` returns it.
    method : str
        ``single_step``, ``rig`` or ``rig_calibration``.
    """
    expected.one_of("method", method, ("single_step", *RIGS))
    setup = plan.setup
    if method != "single_step":
        turns = [name for name in setup.gnss if name in ATTITUDE]
        step = partial(_single_step, refraction=setup.refraction, gnss=turns)
        mounting = rig.calibrate_by(step, block, free=setup.estimate_heads, fix=setup.fix)
        return replace(mounting, method=method)
    return _single_step(
        block,
        free=setup.estimate_mounting,
        fix=setup.fix,
        gnss=setup.gnss,
        refraction=setup.refraction,
    )


def _single_step(
    block: Block,
    *,
    free: Sequence[str],
    refraction: str,
    fix: Sequence[str] = (),
    gnss: Sequence[str] = (),
) -> Mounting:
    """Return what `mounting.single_step` would estimate of a block without errors."""
    network = mounted_orientation(
        block, free=free, free_mount=free_mount(fix), refraction=refraction, gnss=gnss
    )
    bundle = designed(network)
    return Mounting(method="single_step", calibration=from_bundle(bundle), bundle=bundle)


def _calibrations(
    plan: Plan, blocks: Mapping[str, Block], mountings: Mapping[str, Mounting]
) -> dict[str, Calibration]:
    """Return the calibrations with all cameras of block validation; none without this block."""
    if "validation" not in blocks:
        return {}
    calibrations: dict[str, Calibration] = {
        method: mounting.calibration for method, mounting in mountings.items()
    } or {"given": given(plan.cameras("validation"))}
    needed = {camera.name for camera in blocks["validation"].cameras}
    return {
        method: calibration
        for method, calibration in calibrations.items()
        if needed <= {camera.name for camera in calibration.cameras}
    }


# --- Covariances of a plan in several winds: their mean, and the scatter of single flights
#
# No aircraft flies twice alike. The mean of the variances in many winds is what flights of a plan
# have on average; their scatter is the uncertainty of that mean, and of one flight.


PARTS = ("points", "pairs")
"""Differences at check points: from all rays of a point, and from every pair of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The covariances of a plan in one wind.

    Attributes
    ----------
    covariances : dict of str to ndarray
        By method, of `trajectory_errors.reported_covariance`.
    calibrations : dict of str to ndarray
        By method, the covariances of the calibrations, in the library's units.
    open : dict of str to ndarray of bool
        By method, which columns of the calibrations are left open.
    variances : dict of str to dict of str to ndarray
        By method and `PARTS`, mean variances of differences by their sources, (3, n_sources), m^2.
    counts : dict of str to dict of str to int
        By method and `PARTS`, the number of differences.
    points : dict of str to dict of str to ndarray
        By method and check point, the variances of its differences, shape (3,), m^2.
    n_rays : dict of str to dict of str to int
        By method and check point, the number of its images.
    shares : dict of str to ndarray
        By method, as `weak.shares` returns them.
    """

    covariances: Mapping[str, Array]
    calibrations: Mapping[str, Array]
    open: Mapping[str, Mask]
    variances: Mapping[str, Mapping[str, Array]]
    counts: Mapping[str, Mapping[str, int]]
    points: Mapping[str, Mapping[str, Array]]
    n_rays: Mapping[str, Mapping[str, int]]
    shares: Mapping[str, Array]


def _outcome(
    mountings: Mapping[str, Mounting],
    validations: Mapping[str, Validation],
    calibrations: Mapping[str, Calibration],
) -> Outcome:
    """Collect the covariances of the blocks in one wind."""
    named = {method: _names(validation) for method, validation in validations.items()}
    budgets = {
        method: {
            part: budget.of(getattr(v, part).sources, v.georeferenced.layout) for part in PARTS
        }
        for method, v in validations.items()
    }
    shares = {
        method: weak.shares(v.points.sources, calibrations[method])
        for method, v in validations.items()
    }
    return Outcome(
        covariances={
            method: trajectory_errors.reported_covariance(m.bundle)
            for method, m in mountings.items()
        },
        calibrations={method: m.calibration.cov for method, m in mountings.items()},
        open={method: m.calibration.open_columns for method, m in mountings.items()},
        variances={
            method: {part: b.mean for part, b in parts.items()} for method, parts in budgets.items()
        },
        counts={
            method: {part: len(b) for part, b in parts.items()} for method, parts in budgets.items()
        },
        points={
            method: dict(zip(named[method], v.points.sigma**2, strict=True))
            for method, v in validations.items()
        },
        n_rays={
            method: dict(zip(named[method], map(int, v.points.n_images), strict=True))
            for method, v in validations.items()
        },
        shares={method: share for method, share in shares.items() if share is not None},
    )


def _names(validation: Validation) -> list[str]:
    block, points = validation.block, validation.points
    return [block.points[i] for i in block.check.point_idx[points.point_idx]]


# --- means -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Expected:
    """The expected RMS of differences at check points.

    Attributes
    ----------
    n : float
        Mean number of differences in a flight.
    variance : ndarray, shape (3, n_sources)
        Mean of all winds, m^2.
    of_winds : ndarray, shape (n_winds, 3)
        Mean variances of each wind, m^2.
    """

    n: float
    variance: Array
    of_winds: Array

    @property
    def rms(self) -> Array:
        """RMS of many flights, shape (3,), m."""
        return np.sqrt(self.variance.sum(axis=-1))

    @property
    def tolerance(self) -> Array:
        """Relative uncertainty of `rms`: two standard deviations of the mean of winds, (3,)."""
        return 2 * self.spread / np.sqrt(len(self.of_winds))

    @property
    def spread(self) -> Array:
        """Relative standard deviation of the RMS of single flights, by their wind, (3,)."""
        if len(self.of_winds) < 2:
            return np.full(3, np.nan)
        mean = self.of_winds.mean(axis=0)
        return 0.5 * self.of_winds.std(axis=0, ddof=1) / mean
