"""Covariances that a planned flight would give: unknowns, check points; a priori, sigma0 = 1.

The plan is flown without errors and adjusted. The wind moves an aircraft, and no plan says how:
`of` takes one wind, or the mean of several.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4book.planning import flown
from acx4book.planning.plan import Plan
from acx4lib.block import Block
from acx4lib.bundle.adjust import designed, mounted_orientation
from acx4lib.calibration import rig, trajectory_errors
from acx4lib.calibration.estimates import Calibration, from_bundle, given, parameters
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.model import Model

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjusted:
    """A planned flight, flown in one wind without errors, and adjusted.

    Attributes
    ----------
    blocks : dict of str to Block
    mountings : dict of str to Mounting
        By method: ``single_step`` of block calibration, or ``rig_calibration`` where that is
        measured in heads, and ``rig`` of block heads. Estimates are the plan's values.
    calibrations : dict of str to Calibration
        Those of the mountings that have all cameras of block validation; ``given`` where the plan
        calibrates nothing.
    validations : dict of str to Validation
        Of block validation, by the method whose calibration is used. Differences are zero; their
        sigma is predicted.
    """

    blocks: Mapping[str, Block]
    mountings: Mapping[str, Mounting]
    calibrations: Mapping[str, Calibration]
    validations: Mapping[str, Validation]


@dataclass(frozen=True, kw_only=True, eq=False)
class Design(Adjusted):
    """The predicted adjustments of a planned flight; its own are those of the even wind.

    Attributes
    ----------
    plan : Plan
    winds : tuple of Adjusted
        In other winds, or the even one alone. The prediction is their mean.
    """

    plan: Plan
    winds: tuple[Adjusted, ...]

    def covariances(self, method: str) -> Array:
        """Return the covariance of a method's reported unknowns in every wind, (n_winds, n, n)."""
        bundles = [wind.mountings[method].bundle for wind in self.winds]
        return np.array([trajectory_errors.reported_covariance(bundle) for bundle in bundles])

    def calibration(self, method: str) -> Calibration:
        """Return the calibration of a method, with the mean covariance of all winds."""
        found = [wind.mountings[method].calibration for wind in self.winds]
        return replace(
            from_bundle(self.mountings[method].bundle),
            cov=np.mean([one.cov for one in found], axis=0),
            open_columns=np.any([one.open_columns for one in found], axis=0),
        )


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
    places = flown.tie_places(plan)
    even, *others = (
        _adjusted(plan, flown.exact(plan, places, wind=wind)) for wind in range(winds + 1)
    )
    return Design(**vars(even), plan=plan, winds=tuple(others) or (even,))


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
    only = replace(plan, blocks={"calibration": plan.blocks["calibration"]})
    (mounting,) = of(only).mountings.values()
    several = len(mounting.calibration.cameras) > 1
    listed = parameters(mounting.calibration)
    return pd.Series({f"{p.camera}/{p.name}" if several else p.name: p.sigma for p in listed})


def _adjusted(plan: Plan, blocks: Mapping[str, Block]) -> Adjusted:
    of_block = {
        "calibration": "rig_calibration" if plan.setup.measured_in_heads else "single_step",
        "heads": "rig",
    }
    mountings = {
        method: _calibrated(plan, blocks[name], method)
        for name, method in of_block.items()
        if name in blocks
    }
    calibrations: dict[str, Calibration] = {}
    if "validation" in blocks:
        calibrations = {method: m.calibration for method, m in mountings.items()} or {
            "given": given(plan.cameras("validation"))
        }
        needed = {camera.name for camera in blocks["validation"].cameras}
        calibrations = {
            method: one
            for method, one in calibrations.items()
            if needed <= {camera.name for camera in one.cameras}
        }
    validations = {
        method: validate(blocks["validation"], one, plan.setup.model, method=method)
        for method, one in calibrations.items()
    }
    return Adjusted(
        blocks=blocks, mountings=mountings, calibrations=calibrations, validations=validations
    )


def _calibrated(plan: Plan, block: Block, method: str) -> Mounting:
    """Return what the stage of a method would estimate of a block without errors."""
    if method == "single_step":
        return _single_step(block, plan.setup.model)
    mounting = rig.calibrate(block, plan.setup.heads_model, step=_single_step)
    return replace(mounting, method=method)


def _single_step(block: Block, model: Model) -> Mounting:
    bundle = designed(mounted_orientation(block, model))
    return Mounting(method="single_step", calibration=from_bundle(bundle), bundle=bundle)
