"""What the renderers are compared on: four heads at one exposure, and where they are looked at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acx4files import flight as flights
from acx4files.images.flight_images import read_rig
from acx4files.images.head_images import HeadImages, head_files, read_heads
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads, synthetic_from_head
from acx4lib.synthetic_image.head_map import HeadMap, between_nodes
from acx4lib.synthetic_image.rendering import RenderPlan, render_plan
from acx4lib.synthetic_image.response import Response

EXPOSURE = "H3-04"
FEATHER_PX = 150.0  # the renderer's default, pixels at full size
WINDOW_PX = 2048  # side of what slow renderers do instead of the whole image, at full size
PATCH_PX = 200  # side of the windows where grey values are compared, at any size
TILE_CELLS = 16  # cells of the maps along a side of the tiles that others get
COUNTED = 8  # samples of a pixel are counted in every 8th row and column

Window = tuple[int, int, int, int]
"""First row, row behind the last, first column, column behind the last."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """The heads and the image they make.

    Attributes
    ----------
    files : tuple of Path
    heads : HeadImages
        Mapped from their files.
    orientation : RelativeOrientation
    synthetic : Camera
        Both as large as the images.
    """

    files: tuple[Path, ...]
    heads: HeadImages
    orientation: RelativeOrientation
    synthetic: Camera

    @property
    def reduction(self) -> int:
        return self.heads.reduction

    @property
    def feather_px(self) -> float:
        return FEATHER_PX / self.reduction

    @property
    def shape(self) -> tuple[int, int, int]:
        bands = self.heads.images[0].shape[2]
        return self.synthetic.height_px, self.synthetic.width_px, bands

    def loaded(self) -> Scene:
        """Return the scene with images in memory, and only there."""
        images = []
        for image in self.heads.images:
            images.append(np.array(image))
            self.heads.forget()
        return replace(self, heads=replace(self.heads, images=tuple(images)))

    def plan(self, response: Response | None = None, **how: object) -> RenderPlan:
        """Return the plan by which it is rendered."""
        given = {"feather_px": self.feather_px, **how}
        return render_plan(self.orientation, self.synthetic, response=response, **given)


def read(flight_path: Path, results_path: Path) -> Scene:
    """Read an exposure of a flight, its heads oriented as results have them."""
    rig = read_rig(flights.read(flight_path), results_path)
    complete, _ = head_files(rig.flight, [head.name for head in rig.orientation.heads])
    files = complete[EXPOSURE].paths
    heads = read_heads(files, rig.orientation.heads)
    return Scene(
        files=files,
        heads=heads,
        orientation=reduced_heads(rig.orientation, heads.reduction),
        synthetic=reduced_camera(rig.synthetic, heads.reduction),
    )


# --- windows -------------------------------------------------------------------------------------


def window_of_head(scene: Scene, k: int, side: int) -> Window:
    """Return a square window around the place that the middle of a head's image shows."""
    head = scene.orientation.heads[k]
    middle = np.array([[head.width_px - 1, head.height_px - 1]]) / 2
    return _around(scene.synthetic, synthetic_from_head(scene.orientation, k, middle)[0], side)


def patches(scene: Scene) -> list[Window]:
    """Return windows in the middle and at the corners of the frame, in the heads and on seams."""
    camera = scene.synthetic
    half = np.abs(xy_from_colrow(camera, np.zeros((1, 2)))[0])
    far = half - 2 * PATCH_PX * camera.pixel_mm
    places = [(0, 0), (0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5), (1, 1), (1, -1), (-1, 1), (-1, -1)]
    heads = range(len(scene.orientation.heads))
    return [
        *(window_of_head(scene, k, PATCH_PX) for k in heads),
        *(_around(camera, np.array(place) * far, PATCH_PX) for place in places),
    ]


def _around(camera: Camera, xy: np.ndarray, side: int) -> Window:
    """Return a square window around a point, mm."""
    col = (camera.width_px - side) / 2 + xy[0] / camera.pixel_mm
    row = (camera.height_px - side) / 2 - xy[1] / camera.pixel_mm
    return round(row), round(row) + side, round(col), round(col) + side


# --- which head counts where ---------------------------------------------------------------------


def depth(head: HeadMap, at: np.ndarray) -> np.ndarray:
    """Return how far places lie from the border of a head's image, px; -inf outside."""
    x, y = at[..., 0] + 0.5, at[..., 1] + 0.5
    least = np.minimum(np.minimum(x, head.width_px - x), np.minimum(y, head.height_px - y))
    return np.where(least > 0, least, -np.inf)  # NaN is not > 0


def counts(depths: np.ndarray, feather_px: float) -> np.ndarray:
    """Tell which heads have a weight, from their depths, shape (n_heads, ...)."""
    deepest = depths.max(axis=0)
    if feather_px > 0:
        return (depths > 0) & (depths > deepest - feather_px)
    return (np.argmax(depths, axis=0) == np.arange(len(depths))[:, None, None]) & (depths > 0)


def samples_per_pixel(plan: RenderPlan) -> float:
    """Return how many heads a pixel of the image is made from, on average."""
    rows = np.arange(0, plan.height_px, COUNTED)
    cols = np.arange(0, plan.width_px, COUNTED)
    depths = np.stack([depth(m, between_nodes(m, rows, cols)) for m in plan.maps])
    return float(counts(depths, plan.feather_px).sum(axis=0).mean())


def pieces(plan: RenderPlan) -> Iterator[tuple[int, Window]]:
    """Yield head and window of all that has to be sampled: what counts of each tile's cells."""
    step = plan.step_px
    depths = np.stack([depth(m, m.nodes) for m in plan.maps])
    nodes = counts(depths, plan.feather_px)
    cells = nodes[:, :-1, :-1] | nodes[:, 1:, :-1] | nodes[:, :-1, 1:] | nodes[:, 1:, 1:]
    for i in range(0, cells.shape[1], TILE_CELLS):
        for j in range(0, cells.shape[2], TILE_CELLS):
            for k, used in enumerate(cells[:, i : i + TILE_CELLS, j : j + TILE_CELLS]):
                rows, cols = (np.flatnonzero(used.any(axis=axis)) for axis in (1, 0))
                if len(rows):
                    yield k, _clipped(plan, step * (i + rows[[0, -1]]), step * (j + cols[[0, -1]]))


def _clipped(plan: RenderPlan, rows: Sequence[int], cols: Sequence[int]) -> Window:
    """Return the window from the first to the last of cells, which may reach over the border."""
    step = plan.step_px
    return (
        int(rows[0]),
        min(int(rows[1]) + step, plan.height_px),
        int(cols[0]),
        min(int(cols[1]) + step, plan.width_px),
    )
