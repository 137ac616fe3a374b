"""Boresight and lever arm: the two-step and the single-step method (section 2.2, Table 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.attempts import Failed, attempt
from acx4lib.bundle.adjust import Bundle, adjust, qualities
from acx4lib.bundle.gross_errors.data_snooping import adjust_rejecting
from acx4lib.bundle.gross_errors.rejections import Rejection, without
from acx4lib.bundle.observations.trajectory import PoseObservations, slow_errors
from acx4lib.bundle.unknowns import State, free_mount
from acx4lib.bundle.uses import free_orientation, mounted_orientation
from acx4lib.calibration.averaged_mountings import averaged
from acx4lib.calibration.estimates import METHODS, Calibration, from_bundle
from acx4lib.calibration.trust.needs import require_control
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import Pose, transform
from acx4lib.geometry.parameters import LEVER_ARM

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounting:
    """The outcome of one method.

    Attributes
    ----------
    method : str
    calibration : Calibration
    bundle : Bundle
        The adjustment from which it comes.
    per_image : Pose, optional
        Two-step only: the mounting T_b_c of every image by eqs (12) and (13).
    averaged : ndarray, optional
        Two-step only: which images entered the mean, shape (n_images,).
    """

    method: str
    calibration: Calibration
    bundle: Bundle
    per_image: Pose | None = None
    averaged: Mask | None = None

    def __repr__(self) -> str:
        """Say in a line what was estimated, and how it fits."""
        of = shown.names([camera.name for camera in self.calibration.cameras])
        n = shown.count(self.calibration.n_columns, "parameter")
        return shown.line(f"Mounting by {self.method}", of, n, *self.bundle.said)

    def table(self) -> pd.DataFrame:
        """Return the calibration's parameters with their units and sigma."""
        return self.calibration.table()

    def quality(self) -> pd.DataFrame:
        """Return the adjustment in a row."""
        return qualities("method", {self.method: self.bundle})


@dataclass(frozen=True, kw_only=True, eq=False)
class Mountings:
    """The outcome of all methods on one block.

    Attributes
    ----------
    methods : dict of str to Mounting
        In the order of `METHODS`.
    failures : dict of str to str
        Methods without an outcome, and why.
    """

    methods: dict[str, Mounting]
    failures: dict[str, str]

    def __repr__(self) -> str:
        """Name the methods in a line."""
        failed = f"without outcome {', '.join(self.failures)}" if self.failures else ""
        return shown.line("Mountings", *self.methods, failed)

    def table(self) -> pd.DataFrame:
        """Return the parameters of all methods side by side."""
        return shown.side_by_side(self.methods)

    def quality(self) -> pd.DataFrame:
        """Return the adjustments, a row for every method."""
        return qualities("method", {name: one.bundle for name, one in self.methods.items()})

    def __getitem__(self, method: str) -> Mounting:
        """Return one method's outcome; raise an AdjustmentError with the reason if it failed."""
        expected.one_of("method", method, METHODS)
        if method not in self.methods:
            raise AdjustmentError(self.failures[method])
        return self.methods[method]


def calibrate(
    block: Block,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    gnss: Sequence[str] = (),
) -> Mountings:
    """Calibrate by all methods; the two-step ones begin with what the single step found.

    Parameters
    ----------
    block, free, fix, refraction, gnss
        As in `single_step`, which alone uses `gnss`.

    Raises
    ------
    AdjustmentError
        Where all methods fail.
    ValueError
        For an unknown name, or if `block` is no Block.
    """
    return together(outcomes(block, free=free, fix=fix, refraction=refraction, gnss=gnss))


def outcomes(
    block: Block,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    gnss: Sequence[str] = (),
) -> list[Mounting | Failed]:
    """Return what every method comes to; arguments are those of `calibrate`."""
    single = attempt(single_step, block, free=free, fix=fix, refraction=refraction, gnss=gnss)
    return [
        single,
        *(
            attempt(method, block, free=free, fix=fix, refraction=refraction, after=single)
            for method in (two_step, two_step_gnss)
        ),
    ]


def together(outcomes: Sequence[Mounting | Failed]) -> Mountings:
    """Return the outcomes of several methods on one block as one value.

    Parameters
    ----------
    outcomes : sequence of Mounting or Failed
        One of each method at most.

    Raises
    ------
    AdjustmentError
        Where no method has an outcome.
    LinAlgError
        Where one of them failed by numbers that nothing can be computed with.
    """
    for outcome in outcomes:
        expected.one_of("method", outcome.method, METHODS)
    expected.different("outcomes", [outcome.method for outcome in outcomes], "methods")
    failed = [outcome for outcome in outcomes if isinstance(outcome, Failed)]
    for failure in failed:
        if isinstance(failure.error, np.linalg.LinAlgError):
            raise failure.error
    found = {outcome.method: outcome for outcome in outcomes if isinstance(outcome, Mounting)}
    if not found:
        raise AdjustmentError("\n".join(f"mounting/{one.method}: {one.reason}" for one in failed))
    return Mountings(
        methods={name: found[name] for name in METHODS if name in found},
        failures={one.method: one.reason for one in failed},
    )


def single_step(
    block: Block,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    gnss: Sequence[str] = (),
    snooping: bool = True,
) -> Mounting:
    """Estimate interior orientation, boresight and lever arm in one adjustment, eq. (14).

    Parameters
    ----------
    block : Block
    free : sequence of str
        Interior parameters, names of `camera.INTERIOR`.
    fix : sequence of str
        ``"lever_arm"``, ``"boresight"``: those named keep the values of the cameras.
    refraction : str
        ``"none"`` or ``"standard"``.
    gnss : sequence of str
        ``"shift"``, ``"drift"``: those named are unknowns of the GNSS positions, as in
        `uses.mounted_orientation`.
    snooping : bool
        Whether gross errors are looked for, and rejected.

    Raises
    ------
    AdjustmentError
        Where it does not converge.
    """
    network = partial(
        mounted_orientation,
        free=free,
        free_mount=free_mount(fix),
        refraction=refraction,
        gnss=gnss,
    )
    bundle = adjust_rejecting(block, network) if snooping else adjust(network(block))
    return Mounting(method="single_step", calibration=from_bundle(bundle), bundle=bundle)


def two_step(
    block: Block,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    after: Mounting | Failed | None = None,
) -> Mounting:
    """Estimate the mounting from a bundle on control points alone, eqs (12) and (13).

    Parameters
    ----------
    block : Block
    free, fix, refraction
        As in `single_step`.
    after : Mounting, optional
        Outcome of another method on the same block, of which the rejected gross errors are taken
        over, since none are searched for here, and the estimates as start values. Of one that
        failed nothing is.

    Raises
    ------
    AdjustmentError
        Where the control points do not orient the block, or the bundle does not converge.
    ValueError
        Where `after` is of another block.
    """
    estimated = free_mount(fix)
    rejected, start = _taken_over(block, after)
    cleaned = without(block, rejected)
    network = free_orientation(cleaned, free=free, refraction=refraction, start=start)
    require_control(cleaned)
    bundle = replace(adjust(network), rejected=rejected)
    return _two_step("two_step", bundle, free=free, estimated=estimated)


def two_step_gnss(
    block: Block,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    after: Mounting | Failed | None = None,
) -> Mounting:
    """Estimate the boresight from a bundle whose positions GNSS observes, the lever arm held.

    The cameras' lever arms are held. An unknown one is held at zero, and the estimated interior
    orientation compensates for it.

    Parameters
    ----------
    block, free, fix, refraction, after
        As in `two_step`.

    Raises
    ------
    AdjustmentError
        Where the bundle does not converge.
    """
    estimated = tuple(name for name in free_mount(fix) if name not in LEVER_ARM)
    rejected, start = _taken_over(block, after)
    cleaned = without(block, rejected)
    lever = mountings(block.cameras).r[block.images.camera_idx]
    T_m_b, exposure = cleaned.T_m_b_images, cleaned.images.exposure_idx
    positions = PoseObservations(
        T_m_b=Pose(R=T_m_b.R, r=T_m_b.r + transform(T_m_b.R, lever)),
        R_g_m=cleaned.trajectory.R_g_m[exposure],
        sigma_position=cleaned.trajectory.sigma_position[exposure],
        sigma_attitude=np.full((len(T_m_b), 3), np.inf),
        slow_positions=slow_errors(cleaned.trajectory, "position", exposure),
    )
    network = free_orientation(
        cleaned, free=free, positions=positions, refraction=refraction, start=start
    )
    bundle = replace(adjust(network), rejected=rejected)
    return _two_step("two_step_gnss", bundle, free=free, estimated=estimated)


def _taken_over(
    block: Block, after: Mounting | Failed | None
) -> tuple[tuple[Rejection, ...], State | None]:
    """Return rejections and start values of another method, whose poses are the cameras'.

    Where observations contradict each other, the estimates do not fit, and are no start values.
    """
    expected.instance("block", block, Block)
    if after is None or isinstance(after, Failed):
        return (), None
    expected.instance("after", after, Mounting)
    found, before = after.bundle, after.bundle.network.block
    if (before.images.names, before.points) != (block.images.names, block.points) or len(
        before.image_points
    ) != len(block.image_points):
        msg = "after: expected an outcome on the same block, got one on other images or points"
        raise ValueError(msg)
    if found.stopped:
        return found.rejected, None
    return found.rejected, replace(found.state, T_m_b=found.T_m_c)


def _two_step(
    method: str, bundle: Bundle, *, free: Sequence[str], estimated: Sequence[str]
) -> Mounting:
    """Return the second step of a method whose bundle is the first."""
    calibration, per_image, entering = averaged(bundle, free=free, estimated=estimated)
    return Mounting(
        method=method,
        calibration=calibration,
        bundle=bundle,
        per_image=per_image,
        averaged=entering,
    )
