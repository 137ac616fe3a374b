"""A mounting calibration with parts of the flight left out, or with a wrong assumption."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4lib import expected
from acx4lib.calibration.estimates import Calibration, parameters, reported_covariance
from acx4lib.calibration.mounting import METHODS, Mounting, Mountings, single_step
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block, SurveyedPoints, select_images
from acx4lib.flight.design import flying_heights
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.covariance import correlation, propagate, sigmas

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
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
    gnss: Sequence[str] = (),
) -> pd.DataFrame:
    """Repeat the single step with parts of the design left out, or with a wrong assumption.

    Parameters
    ----------
    block : Block
    free, fix, refraction, gnss
        As in `mounting.single_step`.

    Returns
    -------
    DataFrame
        One row per variant: images, variance factor, f, x_p, y_p and lever arm with their
        standard deviations, and the largest correlation of f.
    """

    def run(part: Block, held: Sequence[str] = fix) -> Mounting:
        return single_step(part, free=free, fix=held, refraction=refraction, gnss=gnss)

    lever_free = "lever_arm" not in fix
    variants: dict[str, Callable[[], Mounting]] = {"as flown": lambda: run(block)}
    if lever_free:
        variants["lever arm held at the declared value"] = lambda: run(block, (*fix, "lever_arm"))
    variants |= {
        "lowest flying height only": lambda: run(select_images(block, lowest(block))),
        "one flying direction only": lambda: run(select_images(block, one_direction(block))),
        "without control points": lambda: run(_without_control(block)),
        "the map grid taken for a Cartesian frame": lambda: run(as_if_cartesian(block)),
    }
    return pd.DataFrame([_row(name, variant) for name, variant in variants.items()])


def _row(name: str, variant: Callable[[], Mounting]) -> dict[str, object]:
    try:
        found = variant()
    except AdjustmentError as error:
        return {"variant": name, "says": str(error)}
    listed = parameters(found.calibration)
    row: dict[str, object] = {
        "variant": name,
        "images": len(found.bundle.network.block.images),
        "sigma0_squared": found.calibration.sigma0_sq,
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


def lever_arm_seen(mountings: Mountings) -> pd.DataFrame:
    """Compare what the two-step interior orientation took up with the lever arm it could not see.

    Valid for cameras that look down: a lever arm (x, y, z) in the camera's axes that is taken to
    be zero shifts x_p by -f x / H, y_p by -f y / H and f by -f z / H, at the flying height H.

    Parameters
    ----------
    mountings : Mountings

    Returns
    -------
    DataFrame
        Per camera and axis: shift of two_step_gnss against single_step and its sigma (mm), the
        lever arm that it means, and the one that the single step estimates, with their sigma
        (m). No rows where one of the two methods is missing.
    """
    if not {"single_step", "two_step_gnss"} <= set(mountings.methods):
        return pd.DataFrame(columns=list(SEEN))
    single = mountings["single_step"].calibration
    gnss = mountings["two_step_gnss"].calibration
    block = mountings["single_step"].bundle.network.block
    height = float(flying_heights(block).mean())
    rows: list[tuple[object, ...]] = []
    for k in range(len(single.cameras)):
        rows += _seen_by_camera(single, gnss, k, height)
    return pd.DataFrame(rows, columns=list(SEEN))


SEEN = (
    *("camera", "parameter", "shift_mm", "sigma_shift_mm"),
    *("lever_seen_m", "sigma_seen_m", "lever_estimated_m", "sigma_estimated_m"),
)


def _seen_by_camera(
    single: Calibration, gnss: Calibration, k: int, height: float
) -> list[tuple[object, ...]]:
    camera, other = single.cameras[k], gnss.cameras[k]
    R_c_b = camera.T_b_c.R.T
    estimated, held = R_c_b @ camera.T_b_c.r, R_c_b @ other.T_b_c.r
    columns = single.layout.mount[k, :3]
    cov = np.zeros((3, 3))
    if np.all(columns >= 0):
        cov = single.sigma0_sq * single.cov[np.ix_(columns, columns)]
    sigma_estimated = sigmas(propagate(R_c_b, cov))
    sigma = {p.key: p.sigma for p in parameters(single) if p.camera == camera.name}
    sigma_gnss = {p.key: p.sigma for p in parameters(gnss) if p.camera == camera.name}
    per_metre = -camera.interior.f / height
    rows: list[tuple[object, ...]] = []
    for axis, key in enumerate(("xp", "yp", "f")):
        shift = getattr(other.interior, key) - getattr(camera.interior, key)
        spread = float(np.hypot(sigma.get(key, 0.0), sigma_gnss.get(key, 0.0)))
        seen = shift / per_metre + held[axis]
        rows.append(
            (
                *(camera.name, key, shift, spread, seen, abs(spread / per_metre)),
                *(estimated[axis], sigma_estimated[axis]),
            )
        )
    return rows


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
