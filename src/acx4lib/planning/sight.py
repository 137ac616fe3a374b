"""Which images show which points of the ground, and the tie points that follow from it.

- Tie points fill their area evenly, one after the other, until every camera has as many as are
  asked for in three images or more; those that no camera has in three images do not count.
- Every image that shows a point measures it, if it is not nearer to the edge than `MARGIN_PX`.
- Where the points of a synthetic image are measured in heads, its frame decides what is shown.

A simulated flight of the plan gets the same tie points; its images are moved by wind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, border_distance
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import MappingFrame
from acx4lib.geometry.refraction import as_seen
from acx4lib.planning import ground
from acx4lib.planning.exposures import exposures
from acx4lib.planning.plan import Plan, image_length_m

MARGIN_PX = 25.0
"""Nothing is measured nearer to the edge of an image."""

LEAST_RAYS = 3
"""Number of images of one camera in which a tie point must be."""

REACH = 1.3
"""Radius around an image's middle, in half diagonals, outside which no point is projected."""

MOST_BATCHES = 30
"""How often as many points are tried as are asked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """Points, and where they are measured.

    Attributes
    ----------
    local : ndarray, shape (n, 2)
        Forward and left of the block's middle, m.
    x_g : ndarray, shape (n, 3)
        East, north, height, m.
    shown : ndarray of bool, shape (n_cameras, n_exposures, n)
        In which images they are measured.
    colrow : ndarray, shape (n_cameras, n_exposures, n, 2)
        Pixels; NaN where far outside the image.
    deciding : ndarray of bool
        As `shown`, in the images that decide what is measured: those of the frame, or all.
    """

    local: Array
    x_g: Array
    shown: Mask
    colrow: Array
    deciding: Mask

    def __getitem__(self, keep: Index | Mask) -> Sight:
        """Select points."""
        return Sight(
            local=self.local[keep],
            x_g=self.x_g[keep],
            shown=self.shown[:, :, keep],
            colrow=self.colrow[:, :, keep],
            deciding=self.deciding[:, :, keep],
        )


def joined(sights: list[Sight]) -> Sight:
    """Return the points of several sights, one after the other."""
    return Sight(
        local=np.concatenate([s.local for s in sights]),
        x_g=np.concatenate([s.x_g for s in sights]),
        shown=np.concatenate([s.shown for s in sights], axis=2),
        colrow=np.concatenate([s.colrow for s in sights], axis=2),
        deciding=np.concatenate([s.deciding for s in sights], axis=2),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Over:
    """A planned block in the air.

    Attributes
    ----------
    plan : Plan
    name : str
        Of the block.
    frame : MappingFrame
    T_m_b : Pose
        Of the exposures.
    """

    plan: Plan
    name: str
    frame: MappingFrame
    T_m_b: Pose

    def surveyed(self) -> Sight:
        """Return the sight of the surveyed points."""
        return self.see(ground.places(self.plan.blocks[self.name].points))

    def see(self, local: Array) -> Sight:
        """Return the sight of points at places forward and left of the block's middle."""
        x_g = ground.on_ground(self.plan, self.plan.blocks[self.name].area, local)
        x_m = self.frame.from_grid(x_g)
        parts = [self._in(camera, x_m) for camera in self.plan.cameras(self.name)]
        shown = np.stack([part[0] for part in parts])
        frame = self.plan.frame(self.name)
        deciding = shown if frame is None else self._in(frame, x_m)[0][None]
        return Sight(
            local=local,
            x_g=x_g,
            shown=shown & deciding,
            colrow=np.stack([part[1] for part in parts]),
            deciding=deciding,
        )

    def _in(self, camera: Camera, x_m: Array) -> tuple[Mask, Array]:
        """Return which exposures of a camera show which points, and where."""
        T_m_c = self.T_m_b @ camera.T_b_c
        exposure, point = np.nonzero(_near(camera, T_m_c, x_m))
        at = as_seen(T_m_c.r[exposure], x_m[point], refraction=self.plan.setup.refraction)
        seen = project(camera, T_m_c[exposure], at)
        shown = np.zeros((len(T_m_c), len(x_m)), dtype=bool)
        shown[exposure, point] = border_distance(camera, seen) >= MARGIN_PX
        colrow = np.full((*shown.shape, 2), np.nan)
        colrow[exposure, point] = seen
        return shown, colrow

    def tie_points(self) -> Sight:
        """Return the sight of the tie points.

        Raises
        ------
        FlightError
            Where the images show less than are asked for.
        """
        return self._tried()[0]

    def tie_places(self) -> Array:
        """Return all places that were tried for tie points, forward and left, m, (n, 2)."""
        return self._evenly(self._tried()[1], first=1)

    def ties_at(self, places: Array) -> Sight:
        """Return the sight of those places that three images of a camera show."""
        sight = self.see(places)
        return sight[(sight.deciding.sum(axis=1) >= LEAST_RAYS).any(axis=0)]

    def _tried(self) -> tuple[Sight, int]:
        """Return the sight of the tie points, and how many places were tried for them."""
        wanted = self.plan.blocks[self.name].tie_points
        kept = [self.see(np.empty((0, 2)))]
        n_good = np.zeros(len(kept[0].deciding), dtype=int)
        for batch in range(MOST_BATCHES if wanted else 0):
            sight = self.see(self._evenly(wanted, first=1 + batch * wanted))
            good = sight.deciding.sum(axis=1) >= LEAST_RAYS
            so_far = n_good[:, None] + np.cumsum(good, axis=1)
            enough = np.all(so_far >= wanted, axis=0)
            upto = int(np.argmax(enough)) + 1 if enough.any() else wanted
            kept.append(sight[np.flatnonzero(good[:, :upto].any(axis=0))])
            if enough.any():
                return joined(kept), batch * wanted + upto
            n_good = so_far[:, -1]
        if wanted:
            found = f"{self.name}.tie_points: of {wanted}, three images of every camera show only"
            raise FlightError([f"{found} {n_good.min()}; ask for less, or for a larger overlap"])
        return joined(kept), 0

    def _evenly(self, n: int, *, first: int) -> Array:
        low, high = self._tie_area()
        out: Array = low + (high - low) * ground.evenly(n, first=first)
        return out

    def _tie_area(self) -> tuple[Array, Array]:
        """Return the least and the largest forward and left of the area with tie points."""
        planned = self.plan.blocks[self.name]
        if planned.tie_area_m is not None:
            half = 0.5 * np.array(planned.tie_area_m)
            return -half, half
        camera = self.plan.frame(self.name) or self.plan.cameras(self.name)[0]
        taken = exposures(planned)
        turn = np.radians(taken.course_deg - planned.area.course_deg)
        along = image_length_m(camera, 1.0) * taken.flying_height_m
        across = image_length_m(camera, 1.0, across=True) * taken.flying_height_m
        c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
        half = 0.5 * np.column_stack([c * along + s * across, s * along + c * across])
        return (taken.local - half).min(axis=0), (taken.local + half).max(axis=0)


def _near(camera: Camera, T_m_c: Pose, x_m: Array) -> Mask:
    """Return which points lie in a cone around the images' axes, shape (n_images, n_points)."""
    ray = x_m - T_m_c.r[:, None]
    along = -np.einsum("npi,ni->np", ray, T_m_c.R[:, :, 2])
    tangent = REACH * 0.5 * camera.pixel_mm * camera.diagonal_px / camera.interior.f
    aside_sq = np.einsum("npi,npi->np", ray, ray) - along**2
    near: Mask = (along > 0) & (aside_sq < (tangent * along) ** 2)
    return near
