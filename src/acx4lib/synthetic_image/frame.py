"""The geometry of the synthetic image (section 2.1, Table 2, Figure 1).

The synthetic image is the plane Z = 0 of the frame `s`, x right, y up, in mm from the middle of
the image; its perspective centre is (0, 0, f). A head's perspective centre is (Xc, Yc, Zc), and
it sees a synthetic point (X, Y, 0) by eqs (1)-(11). A `HeadMap` has the positions of all synthetic
pixels in a head: exact at the nodes of a grid, bilinear between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import (
    Camera,
    colrow_from_xy,
    correct,
    correct_by_point,
    distort,
    inside,
    xy_from_colrow,
)
from acx4lib.geometry.collinearity import pinhole, to_camera
from acx4lib.geometry.frames import Pose, rotation_from_opk, transform

if TYPE_CHECKING:
    import pandas as pd


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """Visibility of the synthetic image in the heads.

    Attributes
    ----------
    xy : ndarray, shape (rows, cols, 2)
        Nodes over the synthetic image, mm.
    seen : ndarray, shape (n_heads, rows, cols)
    count : ndarray of int, shape (rows - 1, cols - 1)
        Number of heads that see the middle of each mesh between the nodes.
    share : ndarray, shape (n_heads + 1,)
        Share of the image that is seen by 0, 1, ... heads: of the meshes, by their middles.
    """

    xy: Array
    seen: Mask
    count: Index
    share: Array

    @property
    def coincides(self) -> bool:
        """Whether all heads see mostly the same area, as heads of different bands do.

        Then their images are bands of one image, not parts of it.
        """
        return len(self.share) > 2 and bool(self.share[-1] > self.share[1:-1].sum())


def head_pose(orientation: RelativeOrientation, k: int) -> Pose:
    """Return T_s_h of a head, mm."""
    return Pose(R=rotation_from_opk(orientation.opk[k]), r=orientation.xyz_mm[k])


def head_from_synthetic(orientation: RelativeOrientation, k: int, xy: Array) -> Array:
    """Return the pixel coordinates of synthetic image points in a head, eqs (1)-(11).

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    xy : ndarray, shape (n, 2)
        Points of the synthetic image, mm.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Pixels of the head, also outside its sensor; NaN outside the lens model.

    Raises
    ------
    ValueError
        For an unknown head, or points of another shape.
    """
    xy = expected.numbers("xy", xy, ("n", 2))
    T, camera = head_pose(orientation, k), orientation.heads[k]
    x_s = np.column_stack([xy, np.zeros(len(xy))])
    poses = Pose(R=np.broadcast_to(T.R, (len(xy), 3, 3)), r=T.r)
    ideal = pinhole(camera.interior.f, to_camera(poses, x_s))
    colrow = np.full((len(xy), 2), np.nan)
    ahead = np.isfinite(ideal[:, 0])
    colrow[ahead] = colrow_from_xy(camera, distort(camera.interior, ideal[ahead]))
    return colrow


def synthetic_from_head(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return the synthetic image points of a head's measurements, shape (n, 2), mm.

    NaN for a ray that does not meet the plane of the synthetic image.
    """
    colrow = expected.numbers("colrow", colrow, ("n", 2))
    T, ray_s = head_pose(orientation, k), _rays_of_head(orientation, k, colrow)
    return T.r[:2] - ray_s[:, :2] * (T.r[2] / ray_s[:, 2:])


def _rays_of_head(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return the rays of measurements in the synthetic frame, (n, 3), mm; NaN if not downward."""
    camera = orientation.heads[k]
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow))
    ray_h = np.column_stack([ideal, np.full(len(ideal), -camera.interior.f)])
    ray_s = transform(head_pose(orientation, k).R, ray_h)
    return np.where(ray_s[:, 2:] < 0, ray_s, np.nan)


def synthetic_from_head_jacobian(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return d(`synthetic_from_head`) / d(colrow), shape (n, 2, 2), mm per pixel of the head."""
    colrow = expected.numbers("colrow", colrow, ("n", 2))
    T, camera = head_pose(orientation, k), orientation.heads[k]
    ray_s = _rays_of_head(orientation, k, colrow)
    along = ray_s[:, :2, None] / ray_s[:, 2:, None]
    by_ideal = -T.r[2] / ray_s[:, 2:, None] * (T.R[:2, :2] - along * T.R[2, :2])
    by_xy = correct_by_point(camera.interior, xy_from_colrow(camera, colrow))
    return by_ideal @ by_xy * np.array([camera.pixel_mm, -camera.pixel_mm])


def footprint(orientation: RelativeOrientation, k: int, *, per_side: int = 1) -> Array:
    """Return the outline of a head in the synthetic image, shape (4 per_side + 1, 2), mm.

    It follows the outer pixel edges from the upper-left corner clockwise, and is closed.
    """
    camera = orientation.heads[k]
    w, h = camera.width_px, camera.height_px
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]]) - 0.5
    steps = np.linspace(0, 1, per_side, endpoint=False)[:, None]
    sides = [a + steps * (b - a) for a, b in pairwise(corners)]
    return synthetic_from_head(orientation, k, np.concatenate([*sides, corners[:1]]))


def displacements(
    before: RelativeOrientation, after: RelativeOrientation, *, n: int = 9
) -> list[Array]:
    """Return how far the heads' pixels move in the synthetic image by another orientation.

    Without the shift, turn and scale that all have in common: the calibration of the synthetic
    camera takes these up, as x_p, y_p, kappa and f.

    Parameters
    ----------
    before, after : RelativeOrientation
        Of the same heads.
    n : int
        Pixels along each side of a head's format.

    Returns
    -------
    list of ndarray, shape (n^2, 2)
        By head, mm.
    """
    xy, moved = [], []
    for k, head in enumerate(before.heads):
        sides = [np.linspace(0, size - 1, n) for size in (head.width_px, head.height_px)]
        colrow = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
        xy.append(synthetic_from_head(before, k, colrow))
        moved.append(synthetic_from_head(after, k, colrow) - xy[k])
    x, y = np.concatenate(xy).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    A = np.stack([np.stack([one, zero, x, -y], 1), np.stack([zero, one, y, x], 1)], axis=1)
    d = np.concatenate(moved)
    common = np.linalg.lstsq(A.reshape(-1, 4), d.ravel(), rcond=None)[0]
    return list(np.split(d - A @ common, len(xy)))


def coverage(
    orientation: RelativeOrientation, synthetic: Camera, *, spacing_px: int = 60
) -> Coverage:
    """Return the visibility of the synthetic image in the heads, on a grid over all of it."""
    w, h = synthetic.width_px, synthetic.height_px
    cols = np.linspace(0, w - 1, max(w // spacing_px, 1) + 1)
    rows = np.linspace(0, h - 1, max(h // spacing_px, 1) + 1)
    grid = np.stack(np.meshgrid(cols, rows), axis=-1)
    middles = (grid[1:, 1:] + grid[:-1, :-1]) / 2
    count = _seen(orientation, xy_from_colrow(synthetic, middles)).sum(axis=0)
    xy = xy_from_colrow(synthetic, grid)
    share = np.bincount(count.ravel(), minlength=len(orientation.heads) + 1) / count.size
    return Coverage(xy=xy, seen=_seen(orientation, xy), count=count, share=share)


def _seen(orientation: RelativeOrientation, xy: Array) -> Mask:
    """Tell which heads see points of shape (rows, cols, 2), mm; shape (n_heads, rows, cols)."""
    flat = xy.reshape(-1, 2)
    return np.stack(
        [
            inside(camera, head_from_synthetic(orientation, k, flat)).reshape(xy.shape[:2])
            for k, camera in enumerate(orientation.heads)
        ]
    )


def reduced_camera(camera: Camera, k: int) -> Camera:
    """Return a camera whose image has 1/k of the size: k x k pixels become one.

    Parameters
    ----------
    camera : Camera
    k : int
        If it does not divide the size, the image covers the middle of the sensor.

    Returns
    -------
    Camera
        With the same interior orientation in mm.

    Raises
    ------
    ValueError
        Where `k` is not positive, no whole number, or larger than the image.
    """
    expected.whole("k", k)
    width, height = camera.width_px // k, camera.height_px // k
    if not (width and height):
        msg = f"{camera.name}: an image of {camera.width_px} x {camera.height_px} px has no 1/{k}"
        raise ValueError(msg)
    return replace(camera, width_px=width, height_px=height, pixel_mm=k * camera.pixel_mm)


def reduced_heads(orientation: RelativeOrientation, k: int) -> RelativeOrientation:
    """Return the same heads with images of 1/k of the size."""
    return replace(orientation, heads=tuple(reduced_camera(h, k) for h in orientation.heads))


# --- Effect of the distance between the heads' lenses on the synthetic image
#
# Two heads a base B apart see ground at the distance H from places f B / H apart in the image.
# Over flat ground this is one shift, which the refinement of the heads at this height absorbs.
# Ground higher by dh is shifted by f B dh / (H (H - dh)) more, which nothing absorbs.


TYPICAL_BASES_M = (0.1, 0.3)
"""Between neighbouring lenses of a rig for an aircraft's camera hole."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Parallax:
    """Shifts between heads in the synthetic image, by base, flying height and relief.

    Attributes
    ----------
    shift_px : ndarray, shape (n,)
        Over flat ground.
    change_px : ndarray, shape (n, m)
        Of ground with the relief.
    """

    shift_px: Array
    change_px: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightParallax:
    """Shifts between the heads of a flight.

    Attributes
    ----------
    labels : tuple of str
        Names of the rows: pairs of heads, or typical bases.
    base_m : ndarray, shape (n,)
    height_m : ndarray, shape (n_exposures,)
        Over the mean ground.
    relief_m : float
        Height of the highest ground above its mean.
    shift_px, change_px : ndarray, shape (n, n_exposures)
        Over flat ground, and of its highest points.
    """

    labels: tuple[str, ...]
    base_m: Array
    height_m: Array
    relief_m: float
    shift_px: Array
    change_px: Array

    def __repr__(self) -> str:
        """Summarize bases, exposures and the largest shift in one line."""
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
    """Return the shifts of bases at flying heights, and their changes by relief.

    Parameters
    ----------
    synthetic : Camera
        Its focal length and pixel count.
    base_m, height_m : ndarray, shape (n,)
        Row by row; the height over the ground.
    relief_m : ndarray, shape (m,)
        Height of ground above the level for which the heads were refined; negative below.

    Returns
    -------
    Parallax
        NaN where a height is not above the ground, or not above its relief.
    """
    base_m, height_m, relief_m = (np.asarray(a, float) for a in (base_m, height_m, relief_m))
    height_m = np.where(height_m > 0, height_m, np.nan)
    clear_m = height_m[:, None] - relief_m
    shift = synthetic.interior.f / synthetic.pixel_mm * base_m / height_m
    change = shift[:, None] * relief_m / np.where(clear_m > 0, clear_m, np.nan)
    return Parallax(shift_px=shift, change_px=change)


def flight_parallax(
    block: Block, heads: Sequence[Camera], synthetic: Camera, *, ground_m: Array | None = None
) -> FlightParallax:
    """Return the shifts between the heads at all exposures of a block.

    Parameters
    ----------
    block : Block
        Its trajectory has the heights of the exposures.
    heads : sequence of Camera
        With lever arms as declared or as a rig's adjustment has them. Equal lever arms mean
        unknown bases; then `TYPICAL_BASES_M` are used.
    synthetic : Camera
    ground_m : ndarray, shape (n,), optional
        Heights of ground points in the mapping frame; by default the control points.

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
    r_b_h = [head.T_b_c.r for head in heads]
    base_m = np.array([np.linalg.norm(a - b) for a, b in combinations(r_b_h, 2)])
    if not np.any(base_m > 0):
        base_m = np.array(TYPICAL_BASES_M)
        labels = tuple(f"{base:g} m, typical" for base in base_m)
    exposures = np.unique(block.images.exposure_idx)
    height_m = block.trajectory.T_m_b.r[exposures, 2] - ground.mean()
    relief = np.array([np.max(ground - ground.mean())])
    rows = [parallax(synthetic, np.full(len(height_m), b), height_m, relief) for b in base_m]
    return FlightParallax(
        labels=labels,
        base_m=base_m,
        height_m=height_m,
        relief_m=float(relief[0]),
        shift_px=np.stack([row.shift_px for row in rows]),
        change_px=np.stack([row.change_px[:, 0] for row in rows]),
    )
