"""What the distance between the heads' lenses does to the synthetic image.

Two heads a base B apart see ground at the distance H from places f B / H apart in the image. Over
flat ground that is one shift, which refining the heads at this height takes up; ground that is
higher by dh is shifted by f B dh / (H (H - dh)) more, and nothing takes that up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera

if TYPE_CHECKING:
    import pandas as pd

TYPICAL_BASES_M = (0.1, 0.3)
"""Between neighbouring lenses of a rig for an aircraft's camera hole."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Parallax:
    """Shifts between heads in the synthetic image, by base, flying height and relief.

    Attributes
    ----------
    base_m, height_m : ndarray, shape (n,)
    relief_m : ndarray, shape (m,)
        Of ground above that for which the heads were refined; negative below.
    shift_px : ndarray, shape (n,)
        Over flat ground.
    change_px : ndarray, shape (n, m)
        Of ground with the relief.
    """

    base_m: Array
    height_m: Array
    relief_m: Array
    shift_px: Array
    change_px: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightParallax:
    """Shifts between the heads of a flight.

    Attributes
    ----------
    labels : tuple of str
        What the rows stand for: pairs of heads, or typical bases.
    declared : bool
        Whether the bases are those of the heads' lever arms.
    base_m : ndarray, shape (n,)
    height_m : ndarray, shape (n_exposures,)
        Over the mean ground.
    relief_m : float
        How far the highest ground stands above its mean.
    shift_px, change_px : ndarray, shape (n, n_exposures)
        Over flat ground, and of its highest points.
    """

    labels: tuple[str, ...]
    declared: bool
    base_m: Array
    height_m: Array
    relief_m: float
    shift_px: Array
    change_px: Array

    def __repr__(self) -> str:
        """Say between what, and by how much at most."""
        most = f"{np.nanmax(self.shift_px, initial=0.0):.2f} px"
        return f"parallax of {len(self.labels)} bases at {len(self.height_m)} exposures: to {most}"

    def table(self) -> pd.DataFrame:
        """Return the shifts at the lowest and the highest exposure, px, a row for each base."""
        import pandas as pd  # noqa: PLC0415 it loads long

        low, high = int(np.argmin(self.height_m)), int(np.argmax(self.height_m))
        columns = {
            "Base (m)": self.base_m,
            f"Shift at {self.height_m[low]:.0f} m (px)": self.shift_px[:, low],
            f"at {self.height_m[high]:.0f} m (px)": self.shift_px[:, high],
            f"more on ground {self.relief_m:.0f} m higher (px)": self.change_px[:, low],
        }
        table = pd.DataFrame(columns, index=pd.Index(self.labels, name="lenses"))
        table.attrs["formats"] = dict.fromkeys(table, ".2f")
        return table


def parallax(synthetic: Camera, base_m: Array, height_m: Array, relief_m: Array) -> Parallax:
    """Return the shifts of bases at flying heights, and what relief changes in them.

    Parameters
    ----------
    synthetic : Camera
        Its focal length and pixel count.
    base_m, height_m : ndarray, shape (n,)
        Row by row; the height over the ground.
    relief_m : ndarray, shape (m,)

    Returns
    -------
    Parallax
        NaN where a height is not above the ground, or not above its relief.
    """
    base_m, height_m = np.asarray(base_m, float), np.asarray(height_m, float)
    if base_m.shape != height_m.shape and 1 not in (base_m.size, height_m.size):
        msg = (
            "base_m and height_m: expected as many of either, got "
            f"{base_m.shape} and {height_m.shape}"
        )
        raise ValueError(msg)
    base_m, height_m = np.broadcast_arrays(base_m, height_m)
    relief_m = expected.numbers("relief_m", relief_m, ("m",))
    height_m = np.where(height_m > 0, height_m, np.nan)
    clear_m = height_m[:, None] - relief_m
    shift = synthetic.interior.f / synthetic.pixel_mm * base_m / height_m
    return Parallax(
        base_m=base_m,
        height_m=height_m,
        relief_m=relief_m,
        shift_px=shift,
        change_px=shift[:, None] * relief_m / np.where(clear_m > 0, clear_m, np.nan),
    )


def bases(heads: Sequence[Camera]) -> Array:
    """Return the distances of the lenses for all pairs of heads, shape (n_pairs,), m.

    From the lever arms; pairs as `itertools.combinations` has them.
    """
    r_b_h = [head.T_b_c.r for head in heads]
    return np.array([np.linalg.norm(a - b) for a, b in combinations(r_b_h, 2)])


def flight_parallax(
    block: Block, heads: Sequence[Camera], synthetic: Camera, *, ground_m: Array | None = None
) -> FlightParallax:
    """Return the shifts between the heads at all exposures of a block.

    Parameters
    ----------
    block : Block
        Its trajectory says how high the exposures are.
    heads : sequence of Camera
        With lever arms as declared or as a rig's adjustment has them. Where they are all alike
        nothing is known of them, and `TYPICAL_BASES_M` are taken.
    synthetic : Camera
    ground_m : ndarray, shape (n,), optional
        Heights of ground points in the mapping frame; by default the control points.

    Returns
    -------
    FlightParallax

    Raises
    ------
    AdjustmentError
        Where there are no ground points.
    """
    ground = block.control.x_m[:, 2] if ground_m is None else np.asarray(ground_m, float)
    if len(ground) == 0:
        msg = "no control points: flying heights over the ground and its relief are not known"
        raise AdjustmentError(msg)
    labels = tuple(f"{a.name} and {b.name}" for a, b in combinations(heads, 2))
    base_m = bases(heads)
    declared = bool(np.any(base_m > 0))
    if not declared:
        base_m = np.array(TYPICAL_BASES_M)
        labels = tuple(f"{base:g} m, typical" for base in base_m)
    exposures = np.unique(block.images.exposure_idx)
    height_m = block.trajectory.T_m_b.r[exposures, 2] - ground.mean()
    relief = np.array([np.max(ground - ground.mean())])
    rows = [parallax(synthetic, np.full(len(height_m), b), height_m, relief) for b in base_m]
    return FlightParallax(
        labels=labels,
        declared=declared,
        base_m=base_m,
        height_m=height_m,
        relief_m=float(relief[0]),
        shift_px=np.stack([row.shift_px for row in rows]),
        change_px=np.stack([row.change_px[:, 0] for row in rows]),
    )
