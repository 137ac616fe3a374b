"""The geometry of the synthetic image (section 2.1, Table 2, Figure 1).

The synthetic image is the plane Z = 0 of the frame `s`, x right, y up, in mm from the middle of
the image; its perspective centre is (0, 0, f). A head's perspective centre is (Xc, Yc, Zc), and
it sees a synthetic point (X, Y, 0) by eqs (1)-(11). A `HeadMap` has the positions of all synthetic
pixels in a head: exact at the nodes of a grid, bilinear between.
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander

from acx4lib import expected, shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import Block
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
    expected.place("k", k, len(orientation.heads))
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
    expected.place("k", k, len(orientation.heads))
    expected.whole("per_side", per_side)
    camera = orientation.heads[k]
    w, h = camera.width_px, camera.height_px
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]]) - 0.5
    steps = np.linspace(0, 1, per_side, endpoint=False)[:, None]
    sides = [a + steps * (b - a) for a, b in pairwise(corners)]
    return synthetic_from_head(orientation, k, np.concatenate([*sides, corners[:1]]))


def coverage(
    orientation: RelativeOrientation, synthetic: Camera, *, spacing_px: int = 60
) -> Coverage:
    """Return the visibility of the synthetic image in the heads, on a grid over all of it."""
    expected.whole("spacing_px", spacing_px)
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
    expected.instance("camera", camera, Camera)
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
    base_m, height_m : ndarray, shape (n,)
    relief_m : ndarray, shape (m,)
        Height of ground above the level for which the heads were refined; negative below.
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
        Names of the rows: pairs of heads, or typical bases.
    declared : bool
        Whether the bases are those of the heads' lever arms.
    base_m : ndarray, shape (n,)
    height_m : ndarray, shape (n_exposures,)
        Over the mean ground.
    relief_m : float
        Height of the highest ground above its mean.
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

    From the lever arms; pairs in the order of `itertools.combinations`.
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


# --- positions of synthetic pixels in the heads -----------------------------------------------


TOLERANCE = 0.0006
"""Largest allowed error of a position between nodes, px: less than rounding to 16 bits."""

STEPS = (16, 8, 4, 2)
"""Distances of the nodes, px, that are tried to reach `TOLERANCE`."""

DEGREE = 16
"""Degree of the polynomial through positions; aerial lenses need less."""

EXACT = 1e-7
"""Largest allowed error of this polynomial, px."""

COARSE = 8  # every eighth node is tested first, to decide whether its neighbours are computed


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadMap:
    """Positions in one head's image of the nodes of a grid over another image.

    There is a node at every `step_px`-th pixel from the first on; the last node lies behind the
    last pixel. Between nodes positions are bilinear. Nodes may come from any geometry.

    Attributes
    ----------
    nodes : ndarray, shape (rows, cols, 2)
        col, row in the head's image, px; NaN where the head sees nothing.
    step_px : int
        Distance of the nodes.
    width_px, height_px : int
        Size of the head's image.
    """

    nodes: Array
    step_px: int
    width_px: int
    height_px: int

    def __post_init__(self) -> None:
        if self.nodes.ndim != 3 or self.nodes.shape[2] != 2 or min(self.nodes.shape[:2]) < 2:
            msg = f"nodes must have shape (rows, cols, 2), two at least, got {self.nodes.shape}"
            raise ValueError(msg)
        if self.step_px < 1 or min(self.width_px, self.height_px) < 2:
            msg = (
                "a map needs a step of 1 px at least and an image of 2 x 2 px at least, got "
                f"{self.step_px} px and {self.width_px} x {self.height_px} px"
            )
            raise ValueError(msg)


def fitting_step(orientation: RelativeOrientation, synthetic: Camera) -> int:
    """Return the largest distance of nodes, px, for which position errors are below `TOLERANCE`.

    The error of a position, px, is proportional to the squared step and to the pixel size. So an
    image at 1/4 of the size needs half the step.
    """
    for step in STEPS[:-1]:
        if _largest_error(orientation, synthetic, step) <= TOLERANCE:
            return step
    return STEPS[-1]


def _largest_error(orientation: RelativeOrientation, synthetic: Camera, step: int) -> float:
    """Return the largest position error in the middle of cells all over the image, px."""
    size = np.array([synthetic.width_px, synthetic.height_px])
    corners = [np.unique(np.linspace(0, n, 40).astype(int) // step * step) for n in size]
    first = np.stack(np.meshgrid(*corners), axis=-1).reshape(-1, 2)
    offsets = step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]])
    xy = xy_from_colrow(synthetic, first[:, None, :] + offsets)
    error = 0.0
    for k, camera in enumerate(orientation.heads):
        colrow = head_from_synthetic(orientation, k, xy.reshape(-1, 2)).reshape(xy.shape)
        colrow = colrow[inside(camera, colrow).any(axis=1)]
        misfits = np.linalg.norm(colrow[:, :4].mean(axis=1) - colrow[:, 4], axis=-1)
        error = max(error, float(np.nanmax(misfits, initial=0.0)))
    return error


def head_map(
    orientation: RelativeOrientation, k: int, synthetic: Camera, *, step_px: int = 16
) -> HeadMap:
    """Return the map from the synthetic image to a head.

    With the heads of Table 1 and a step of 16 px, errors between the nodes are below 0.0022 px;
    they are proportional to the squared step.

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    step_px : int
        Synthetic pixels from node to node.

    Returns
    -------
    HeadMap
        Exact at its nodes; those far outside the head's sensor are NaN.
    """
    window = (0, synthetic.height_px, 0, synthetic.width_px)
    return window_map(orientation, k, synthetic, window, step_px=step_px)


def window_map(
    orientation: RelativeOrientation,
    k: int,
    synthetic: Camera,
    window: tuple[int, int, int, int],
    *,
    step_px: int = 16,
) -> HeadMap:
    """Return the map from a part of the synthetic image to a head; its nodes begin at the part.

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    window : tuple of int
        First row, row after the last, first column, column after the last.
    step_px : int
        Synthetic pixels from node to node.
    """
    expected.place("k", k, len(orientation.heads))
    expected.whole("step_px", step_px)
    row_0, row_1, col_0, col_1 = window
    rows = row_0 + step_px * np.arange(_n_nodes(row_1 - row_0, step_px))
    cols = col_0 + step_px * np.arange(_n_nodes(col_1 - col_0, step_px))
    x = xy_from_colrow(synthetic, np.column_stack([cols, np.zeros(len(cols))]))[:, 0]
    y = xy_from_colrow(synthetic, np.column_stack([np.zeros(len(rows)), rows]))[:, 1]
    camera = orientation.heads[k]
    nodes = np.full((len(y), len(x), 2), np.nan)
    near = _near_sensor(orientation, k, x, y)
    rows, cols = (np.flatnonzero(near.any(axis=axis)) for axis in (1, 0))
    if len(rows):
        box = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
        nodes[box] = _positions(orientation, k, x[box[1]], y[box[0]], near[box])
        nodes[box][~near[box]] = np.nan
    return HeadMap(
        nodes=nodes, step_px=step_px, width_px=camera.width_px, height_px=camera.height_px
    )


def _positions(orientation: RelativeOrientation, k: int, x: Array, y: Array, wanted: Mask) -> Array:
    """Return the positions of a grid's nodes in a head, px, shape (rows, cols, 2).

    The map is smooth. Therefore a polynomial through few points is as good as the map itself, and
    much faster. A few nodes are used to check it; if it is not good enough, all are computed.
    """
    if wanted.sum() > 4 * DEGREE**2:
        (points_x, by_x), (points_y, by_y) = _through_points(x), _through_points(y)
        exact = _exact(orientation, k, *np.meshgrid(points_x, points_y))
        positions = np.stack([by_y @ exact[..., i] @ by_x.T for i in (0, 1)], axis=-1)
        rows, cols = np.nonzero(wanted)
        checked = np.linspace(0, len(rows) - 1, DEGREE**2).astype(int)
        rows, cols = rows[checked], cols[checked]
        error = np.abs(positions[rows, cols] - _exact(orientation, k, x[cols], y[rows]))
        if error.max() < EXACT:  # False for NaN
            return positions
    positions = np.full((len(y), len(x), 2), np.nan)
    rows, cols = np.nonzero(wanted)
    positions[rows, cols] = _exact(orientation, k, x[cols], y[rows])
    return positions


def _exact(orientation: RelativeOrientation, k: int, x: Array, y: Array) -> Array:
    """Return the positions of points x, y of the synthetic image in a head, px, (..., 2)."""
    xy = np.stack([x, y], axis=-1)
    return head_from_synthetic(orientation, k, xy.reshape(-1, 2)).reshape(xy.shape)


def _through_points(positions: Array) -> tuple[Array, Array]:
    """Return the points of an interpolating polynomial, and their weights at given positions."""
    unit = chebpts1(DEGREE + 1)
    middle, half = (positions[0] + positions[-1]) / 2, (positions[-1] - positions[0]) / 2
    from_values = chebvander(unit, DEGREE).T * (2 / (DEGREE + 1))
    from_values[0] /= 2
    return middle + half * unit, chebvander((positions - middle) / half, DEGREE) @ from_values


def _near_sensor(orientation: RelativeOrientation, k: int, x: Array, y: Array) -> Mask:
    """Return the mask of nodes of coarse cells that a head may see, at least in part."""
    camera = orientation.heads[k]
    rows, cols = (np.unique(np.r_[0:n:COARSE, n - 1]) for n in (len(y), len(x)))
    colrow = _exact(orientation, k, *np.meshgrid(x[cols], y[rows]))
    # a point of a coarse cell is at most twice its longest side away from its corners
    sides = [np.abs(np.diff(colrow, axis=axis)).ravel() for axis in (0, 1)]
    reach = 2 * np.nanmax(np.concatenate([*sides, [0.0]]))
    size = np.array([camera.width_px, camera.height_px])
    close = np.all((colrow > -reach) & (colrow < size + reach), axis=-1)
    near = np.zeros((len(y), len(x)), np.uint8)
    near[np.ix_(rows, cols)] = close
    return cv2.dilate(near, np.ones((2 * COARSE + 1, 2 * COARSE + 1), np.uint8)) > 0


def levelled(head: HeadMap) -> HeadMap:
    """Return a map correct on the average of each cell instead of at its nodes.

    Between exact nodes, bilinear positions all have an error to the same side, on average
    h^2 / 12 times the second derivatives. Moving the nodes by it reduces the RMS error to less
    than half, and the largest error to two thirds.

    Parameters
    ----------
    head : HeadMap
        A map that is exact at its nodes.
    """
    moved = head.nodes.copy()
    box = _around_seen(moved)
    for axis in (0, 1):
        nodes, target = (np.moveaxis(part[box], axis, 0) for part in (head.nodes, moved))
        if len(nodes) > 2:
            bend = np.nan_to_num(np.diff(nodes, n=2, axis=0) / 12, copy=False)
            target[1:-1] -= bend
            target[[0, -1]] -= bend[[0, -1]]  # as at their neighbours
    return replace(head, nodes=moved)


def _around_seen(nodes: Array) -> tuple[slice, slice]:
    """Return the slices of rows and columns with visible nodes, and one more on each side."""
    seen = np.isfinite(nodes[..., 0])
    indices = [np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0)]
    first, last = zip(*((f[0], f[-1]) if len(f) else (0, 0) for f in indices), strict=True)
    rows, cols = (slice(max(a - 1, 0), b + 2) for a, b in zip(first, last, strict=True))
    return rows, cols


def _n_nodes(n_px: int, step_px: int) -> int:
    """Return the number of nodes that enclose a line of pixels."""
    return -(-n_px // step_px) + 1


def between_nodes(head: HeadMap, rows: Array, cols: Array) -> Array:
    """Return the bilinear positions, in the head, of rows x columns of the grid's image.

    Parameters
    ----------
    head : HeadMap
    rows, cols : ndarray, shape (n,), (m,)
        px, inside the grid.

    Returns
    -------
    colrow : ndarray, shape (n, m, 2)
        Pixels of the head; NaN in cells with a node that is NaN.
    """
    i, t = _cell(rows, head.step_px, head.nodes.shape[0])
    j, s = _cell(cols, head.step_px, head.nodes.shape[1])
    t, s = t[:, None, None], s[None, :, None]
    upper = (1 - s) * head.nodes[np.ix_(i, j)] + s * head.nodes[np.ix_(i, j + 1)]
    lower = (1 - s) * head.nodes[np.ix_(i + 1, j)] + s * head.nodes[np.ix_(i + 1, j + 1)]
    return (1 - t) * upper + t * lower


def _cell(position: Array, step_px: int, n: int) -> tuple[np.ndarray, Array]:
    """Return the node before each position, and the fraction of the way to the next node."""
    before = np.clip(position // step_px, 0, n - 2).astype(np.intp)
    return before, position / step_px - before


# --- Images mapped from their files: memory of pixels that were read can be given back


def mapped_file(image: np.ndarray) -> mmap.mmap | None:
    """Return the file mapping of an image; None for an image in memory."""
    base: object = image
    while isinstance(base, np.ndarray | memoryview):
        base = base.base if isinstance(base, np.ndarray) else base.obj
    return base if isinstance(base, mmap.mmap) else None


def forget(image: np.ndarray) -> None:
    """Release the memory of mapped pixels; they are read again when needed.

    An image in memory is not changed. The images of four aerial heads are too large to be held in
    memory during rendering.
    """
    mapped = mapped_file(image)
    if mapped is not None and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)
