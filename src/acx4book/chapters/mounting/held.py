"""What a held lever arm does to the ground: the two-step method beside the single step.

The two-step method puts the error of the lever arm into the interior orientation and the boresight.
On the ground the parts nearly cancel from the heights of the block, and from no other.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4lib import design
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import Measurement, directions, project
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.intersection import intersect
from acx4lib.georeferencing.budget import MappingFlight, looks_down, spacing


def off_ground(camera: Camera, true: Camera, height_m: float) -> Array:
    """Return a ground point as a camera intersects it; the true camera gives the origin.

    The point lies between two images of a level strip with 60 % of overlap, and is intersected
    from both.

    Parameters
    ----------
    camera, true : Camera
        The first with other parameters than the second.
    height_m : float
        Of the body above ground.

    Returns
    -------
    ndarray, shape (3,)
        Forward, left and up, m.
    """
    flown = MappingFlight(
        height_m=height_m, sigma_position_m=(1, 1, 1), sigma_attitude=(1, 1, 1), sigma_px=1
    )
    half = spacing(true, flown)[0] / 2
    T_m_b = Pose(
        R=np.tile(np.eye(3), (2, 1, 1)), r=np.array([[-half, 0, height_m], [half, 0, height_m]])
    )
    T_m_c = T_m_b @ camera.T_b_c
    measurement = Measurement(
        cameras=(camera,),
        camera_idx=np.zeros(2, dtype=np.intp),
        T_m_c=T_m_c,
        colrow=project(true, T_m_b @ true.T_b_c, np.zeros((2, 3))),
    )
    return intersect(T_m_c.r, directions(measurement), np.zeros(2, dtype=np.intp), 1)[0]


def over_heights(two: Mounting, single: Mounting) -> Figure:
    """Draw the ground point of the two-step method minus that of the single step.

    It is drawn over the flying height, with dashed lines at the heights of the block.

    Parameters
    ----------
    two, single : Mounting
        Outcomes of `two_step_gnss` and `single_step`.
    """
    cameras = [mounting.calibration.cameras for mounting in (two, single)]
    flown_m = [level.height_m for level in design.levels(single.bundle.network.block)]
    if len(cameras[1]) > 1 or not looks_down(cameras[1][0]) or not np.all(np.isfinite(flown_m)):
        return style.nothing("Drawn for one camera that looks down, from known heights.")
    heights_m = np.linspace(0.5 * min(flown_m), 2 * max(flown_m), 31)
    off = np.array([off_ground(cameras[0][0], cameras[1][0], height) for height in heights_m])
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.8))
        for k, axis in enumerate(("x, forward", "y, left", "z, up")):
            ax.plot(heights_m, 100 * off[:, k], color=style.colour(k), label=axis)
        for height in flown_m:
            ax.axvline(height, color=style.SOFT, lw=0.8, ls="--", zorder=1)
        ax.axhline(0, color=style.SOFT, lw=0.8, zorder=1)
        ax.set(xlabel="flying height over ground (m)", ylabel="error on the ground (cm)")
        style.legend_below(fig, ax.get_lines()[:3])
    return fig
