"""The boresight over time: values of all images, and the tests of the certified adjustment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from acx4book.report.material import Material, block_of, exposure_times
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import log, mean_rotation, opk_jacobian
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.results import folder

AXES = ("x", "y", "z")
SOURCES = ("mounting/two_step", "mounting/two_step_gnss")
"""Methods that orient the images without the attitudes of the trajectory."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Turns:
    """A test of the certified adjustment: of steps of the boresight between strips, or a drift.

    Attributes
    ----------
    title : str
    names : tuple of str
        Strips, or of a drift one name.
    turns_deg, sigma_deg : ndarray, shape (n, 3)
        About the body's axes: of strips less the mean, of a drift from the first exposure to the
        last.
    f, redundancy, p : float
    dof : int
    """

    title: str
    names: tuple[str, ...]
    turns_deg: Array
    sigma_deg: Array
    f: float
    dof: int
    redundancy: float
    p: float

    @property
    def sentence(self) -> str:
        """What is said where it is significant: the turn that is largest in its sigma."""
        ratio = np.nan_to_num(np.abs(self.turns_deg / self.sigma_deg))
        i, axis = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        turn, sigma = self.turns_deg[i, axis], self.sigma_deg[i, axis]
        size = f"{turn:+.4f}° ± {sigma:.4f}° about {AXES[axis]}"
        if len(self.names) == 1:
            return f"a drift, most of all {size} from the first exposure to the last"
        return f"differences between strips, most of all {size} of strip {self.names[i]}"


TITLES = {"strips": "differences between strips", "drift": "drift"}


def turns_of(material: Material) -> list[Turns]:
    """Return the tests of the certified adjustment's boresights, from its summary."""
    entry = material.found.summary.get(material.certified, {}).get("boresight_stability")
    told: Mapping[str, Any] = entry if isinstance(entry, dict) else {}
    return [_turns_told(title, told[key]) for key, title in TITLES.items() if told.get(key)]


def _turns_told(title: str, told: Mapping[str, Any]) -> Turns:
    turns, sigma = (np.array(told[key], dtype=float) for key in ("turns_deg", "sigma_deg"))
    return Turns(
        title=title,
        names=tuple(told["names"]),
        turns_deg=turns,
        sigma_deg=np.where(np.isfinite(sigma), sigma, np.inf),
        f=float(told["f"]),
        dof=int(told["dof"]),
        redundancy=float(told["redundancy"]),
        p=float(told["p"]),
    )


def boresights(material: Material) -> pd.DataFrame:
    """Return the boresight of every image, eq. (13), minus the mean of its camera.

    Parameters
    ----------
    material : Material

    Returns
    -------
    DataFrame
        camera, image, strip, number (in order of time), time_s (after the first image; NaN where
        not known), x_deg, y_deg, z_deg about the axes of the body, and their sigma_*_deg from the
        image's orientation and the trajectory's attitude, without the error that all images
        share. Empty where no bundle had free orientations.
    """
    source = next((s for s in SOURCES if folder.has(material.found, s)), "")
    rows = folder.rows(material.found, "exterior_orientation", source) if source else pd.DataFrame()
    if rows.empty:
        return pd.DataFrame()
    block = block_of(material, source)
    image_idx = pd.Index(block.images.names).get_indexer(pd.Index(rows["image"]))
    turns, sigma = _of_images(block, image_idx, rows)
    times = exposure_times(material, block).to_numpy()[block.images.exposure_idx[image_idx]]
    frame = pd.DataFrame(
        {
            "camera": [block.cameras[k].name for k in block.images.camera_idx[image_idx]],
            "image": rows["image"],
            "strip": [block.images.strips[i] for i in image_idx],
            "time_s": times - np.nanmin(times) if np.isfinite(times).any() else times,
            **{f"{axis}_deg": turns[:, i] for i, axis in enumerate(AXES)},
            **{f"sigma_{axis}_deg": sigma[:, i] for i, axis in enumerate(AXES)},
        }
    )
    known = np.isfinite(times).all()
    frame = frame.sort_values("time_s", kind="stable") if known else frame
    return frame.assign(number=np.arange(1, len(frame) + 1)).reset_index(drop=True)


def _of_images(block: Block, image_idx: Index, rows: pd.DataFrame) -> tuple[Array, Array]:
    """Return boresights minus their mean, and their sigma, body axes, degrees, shape (n, 3)."""
    enh = rows[["east_m", "north_m", "height_m"]].to_numpy()
    opk = np.radians(rows[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy())
    T_m_c = block.frame.pose_from_grid(enh, opk)
    R_b_c = np.swapaxes(block.T_m_b_images.R[image_idx], 1, 2) @ T_m_c.R
    turns, camera_idx = np.zeros((len(rows), 3)), block.images.camera_idx[image_idx]
    for k in np.unique(camera_idx):
        own = camera_idx == k
        turns[own] = log(R_b_c[own] @ mean_rotation(R_b_c[own]).T)
    said = rows[["sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"]].to_numpy()
    J = R_b_c @ np.linalg.inv(opk_jacobian(opk))
    by_image = propagate(J, np.apply_along_axis(np.diag, 1, said**2))
    attitude = np.degrees(block.trajectory.sigma_attitude[block.images.exposure_idx[image_idx]])
    return np.degrees(turns), np.sqrt(sigmas(by_image) ** 2 + attitude**2)
