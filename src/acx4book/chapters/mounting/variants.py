"""A mounting calibration with parts of the flight left out, or with a wrong assumption."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.unknowns import free_mount
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration.estimates import METHODS, from_bundle, parameters, reported_covariance
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block, SurveyedPoints, select_images
from acx4lib.flight.design import flying_heights
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.covariance import correlation

SHOWN = ("f_mm", "xp_mm", "yp_mm", "lever_x_m", "lever_y_m", "lever_z_m")


def lowest(block: Block) -> Mask:
    """Tell which images were taken at the lowest flying height, within a tenth of it."""
    height = flying_heights(block)[block.images.exposure_idx]
    return height < 1.1 * height.min()


def one_direction(block: Block) -> Mask:
    """Tell which images were flown within a right angle of the first one's direction."""
    forward = block.T_m_b_images.R[:, :2, 0]
    return forward @ forward[0] > 0


def calibrations(
    block: Block,
    as_flown: Mounting | None,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    gnss: Sequence[str] = (),
) -> pd.DataFrame:
    """Repeat the single step with parts of the design left out, or with a wrong assumption.

    Observations that the single step rejected are left out of all, and no others are looked for.

    Parameters
    ----------
    block : Block
    as_flown : Mounting or None
        The single step of the whole block; None where it has no outcome.
    free, fix, refraction, gnss
        As in `mounting.single_step`.

    Returns
    -------
    DataFrame
        One row per variant: images, variance factor, f, x_p, y_p and lever arm with their
        standard deviations, and the largest correlation of f.
    """

    def run(part: Block, held: Sequence[str] = fix) -> Bundle:
        mount = free_mount(held)
        return adjust(
            mounted_orientation(part, free=free, free_mount=mount, refraction=refraction, gnss=gnss)
        )

    lever_free = "lever_arm" not in fix
    if as_flown is not None:
        block = as_flown.bundle.network.block
    variants: dict[str, Callable[[], Bundle]] = {
        "as flown": lambda: run(block) if as_flown is None else as_flown.bundle
    }
    if lever_free:
        variants["lever arm held at the declared value"] = lambda: run(block, (*fix, "lever_arm"))
    variants |= {
        "lowest flying height only": lambda: run(select_images(block, lowest(block))),
        "one flying direction only": lambda: run(select_images(block, one_direction(block))),
        "without control points": lambda: run(_without_control(block)),
        "the map grid taken for a Cartesian frame": lambda: run(as_if_cartesian(block)),
    }
    return pd.DataFrame([_row(name, variant) for name, variant in variants.items()])


def _row(name: str, variant: Callable[[], Bundle]) -> dict[str, object]:
    try:
        found = variant()
    except AdjustmentError as error:
        return {"variant": name, "says": str(error)}
    listed = parameters(from_bundle(found))
    row: dict[str, object] = {
        "variant": name,
        "images": len(found.network.block.images),
        "sigma0_squared": found.solution.sigma0_sq,
    }
    for p in listed:
        if p.name in SHOWN:
            row[p.name] = p.value
            row[f"sigma_{p.name}"] = p.sigma
    return row


def _without_control(block: Block) -> Block:
    return replace(block, control=block.control[np.zeros(len(block.control), dtype=bool)])


def as_if_cartesian(block: Block) -> Block:
    """Return the block as a program sees it that takes east, north, height for Cartesian.

    Positions and control are the grid's numbers, attitudes those against the grid; curvature of
    the earth and scale of the map are not modelled.

    Parameters
    ----------
    block : Block
    """
    trajectory, frame = block.trajectory, block.frame
    enh = frame.to_grid(trajectory.T_m_b.r)
    origin = np.append(np.round(enh[:, :2].mean(axis=0)), 0.0)
    R_g_b = frame.grid_axes(trajectory.T_m_b.r) @ trajectory.T_m_b.R
    return replace(
        block,
        control=_in_grid(block, origin, block.control),
        check=_in_grid(block, origin, block.check),
        trajectory=replace(
            trajectory,
            T_m_b=Pose(R=R_g_b, r=enh - origin),
            R_g_m=np.broadcast_to(np.eye(3), (len(enh), 3, 3)),
        ),
    )


def _in_grid(block: Block, origin: Array, surveyed: SurveyedPoints) -> SurveyedPoints:
    identity = np.broadcast_to(np.eye(3), (len(surveyed), 3, 3))
    if len(surveyed) == 0:
        return surveyed
    return replace(surveyed, x_m=block.frame.to_grid(surveyed.x_m) - origin, R_g_m=identity)


def correlations(mountings: Mountings, method: str = "single_step") -> pd.DataFrame:
    """Return the correlation matrix of a method's reported parameters; empty without it."""
    expected.one_of("method", method, METHODS)
    if method not in mountings.methods:
        return pd.DataFrame()
    calibration = mountings[method].calibration
    matrix = correlation(reported_covariance(calibration))
    names = [
        p.name if len(calibration.cameras) == 1 else f"{p.camera}/{p.name}"
        for p in parameters(calibration)
    ]
    return pd.DataFrame(matrix, index=names, columns=names)
