"""The adjusted block in space: strips, images, points, rays, and how well points are known."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acx4book.typesetting.moving import scene
from acx4book.typesetting.moving.scene import Layer, Scene
from acx4book.typesetting.moving.shown import Shown
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.style import round_length
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Index
from acx4lib.flight import design
from acx4lib.geometry.collinearity import Measurement, directions

MOST_IMAGES, MOST_POINTS, MOST_ELLIPSOIDS, MOST_LABELS = 400, 1500, 60, 100
"""Of larger blocks every n-th is shown, and the first control points have names."""

COLOURS = ("blue", "orange")
"""Of flying heights, from the highest down, as in the maps."""

DEEP = 0.22
"""Distance from a perspective centre to the image that is drawn, as a share of the height."""

LARGE = 0.03
"""Largest half axis of a median ellipsoid, as a share of the block."""


def view(mounting: Mounting) -> Shown:
    """Return the block of the single step as the reader turns it.

    Parameters
    ----------
    mounting : Mounting
    """
    bundle = mounting.bundle
    layers, ties = [_ground(bundle), *_images(bundle)], tie_points(bundle)
    if len(ties):
        layers += [_ties(bundle, ties), _rays(bundle, ties), _ellipsoids(bundle, ties)]
    layers.append(_control(bundle))
    return scene.view(
        Scene(
            name="block-in-space",
            alt=(
                "Strips of cameras at their heights over a grid on the ground, with control "
                "points, tie points, the rays of one point, and ellipsoids that are long at the "
                "rim and point to the cameras."
            ),
            caption=(
                "The block of the single step, with its adjusted positions and attitudes. Each "
                "pyramid is a camera with its image, far larger than they are. The ellipsoids are "
                "of one standard deviation, a priori. They point towards the cameras, since the "
                "distance along the rays is known least, and are long at the rim of the block, "
                "where the rays come from one side only."
            ),
            layers=[layer for layer in layers if len(layer.at)],
        )
    )


def tie_points(bundle: Bundle) -> Index:
    """Return the tie points of a bundle that have a covariance, shape (n,)."""
    measured = np.unique(bundle.network.image_points.point_idx)
    ties = np.setdiff1d(measured, bundle.network.control.point_idx)
    known = np.trace(bundle.solution.cov_points[ties], axis1=1, axis2=2)
    found: Index = ties[np.isfinite(known) & (known > 0)]
    return found


# --- layers ----------------------------------------------------------------------------------


def _ground(bundle: Bundle) -> Layer:
    """Return a grid of squares of a round length at the mean height of the points."""
    at = bundle.T_m_c.r[:, :2]
    low, high = at.min(axis=0), at.max(axis=0)
    step = round_length(float((high - low).max()) / 4)
    height = float(bundle.state.x_m[bundle.network.image_points.point_idx, 2].mean())
    first, last = np.floor(low / step) * step, np.ceil(high / step) * step
    lines = []
    for axis in (0, 1):
        for line in np.arange(first[axis], last[axis] + step / 2, step):
            ends = np.array([[*first, height], [*last, height]])
            ends[:, axis] = line
            lines.append(ends)
    return Layer(
        name=f"ground, squares of {step:g} m", kind="lines", colour="soft", at=np.concatenate(lines)
    )


def _images(bundle: Bundle) -> Iterator[Layer]:
    """Yield the strips and the cameras of each flying height."""
    block, at = bundle.network.block, bundle.T_m_c.r
    strips = np.array(block.images.strips, dtype=object)
    for level, colour in zip(design.levels(block), COLOURS * 9, strict=False):
        images = np.flatnonzero(np.isin(block.images.exposure_idx, level.exposure_idx))
        name = f"from {level.height_m:.0f} m"
        lines = [at[images[strips[images] == strip]] for strip in level.strips]
        pairs = [np.repeat(line, 2, axis=0)[1:-1] for line in lines if len(line) > 1]
        yield Layer(name=f"strips {name}", kind="lines", colour=colour, at=_joined(pairs))
        chosen = thinned(images, MOST_IMAGES)
        deep = DEEP * level.height_m if np.isfinite(level.height_m) else DEEP * float(np.ptp(at))
        pyramids = [_pyramid(bundle, image, deep) for image in chosen]
        yield Layer(name=f"cameras {name}", kind="lines", colour=colour, at=_joined(pyramids))


def _pyramid(bundle: Bundle, image: int, deep: float) -> Array:
    """Return the ends of the eight edges from a perspective centre to the image and around it."""
    k = bundle.network.block.images.camera_idx[image]
    camera = bundle.cameras[k]
    width, height = camera.width_px - 1.0, camera.height_px - 1.0
    seen = Measurement(
        cameras=bundle.cameras,
        camera_idx=np.full(4, k),
        T_m_c=bundle.T_m_c[np.full(4, image)],
        colrow=np.array([[0, 0], [width, 0], [width, height], [0, height]]),
    )
    centre = bundle.T_m_c.r[image]
    corners = centre + deep * directions(seen)
    around = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    edges = np.stack([np.tile(centre, (4, 1)), corners], axis=1)
    return np.concatenate([edges, around]).reshape(-1, 3)


def _control(bundle: Bundle) -> Layer:
    control = bundle.network.control
    names = bundle.network.block.points
    return Layer(
        name="control points",
        kind="points",
        colour="ink",
        size=7.0,
        at=bundle.state.x_m[control.point_idx],
        labels=[shown(names[k], "terminal") for k in control.point_idx[:MOST_LABELS]],
    )


def _ties(bundle: Bundle, ties: Index) -> Layer:
    at = bundle.state.x_m[thinned(ties, MOST_POINTS)]
    return Layer(name="tie points", kind="points", colour="teal", at=at)


def _rays(bundle: Bundle, ties: Index) -> Layer:
    """Return the rays of the tie point that most images have; of several the first."""
    seen = bundle.network.image_points
    n_rays = np.bincount(seen.point_idx, minlength=len(bundle.state.x_m))
    point = ties[np.argmax(n_rays[ties])]
    name = bundle.network.block.points[point]
    starts = bundle.T_m_c.r[seen.image_idx[seen.point_idx == point]]
    target = np.broadcast_to(bundle.state.x_m[point], starts.shape)
    return Layer(
        name=f"the {len(starts)} rays of point {shown(name, 'terminal')}",
        kind="lines",
        colour="plum",
        at=np.stack([starts, target], axis=1).reshape(-1, 3),
    )


def _ellipsoids(bundle: Bundle, ties: Index) -> Layer:
    chosen = thinned(ties, MOST_ELLIPSOIDS)
    values, vectors = np.linalg.eigh(bundle.solution.cov_points[chosen])
    largest = np.sqrt(np.linalg.eigvalsh(bundle.solution.cov_points[ties])[:, -1])
    extent = float(np.ptp(bundle.T_m_c.r, axis=0).max())
    times = round_length(LARGE * extent / float(np.median(largest)))
    return Layer(
        name=f"error ellipsoids, {times:g} times",
        kind="ellipsoids",
        colour="brick",
        at=bundle.state.x_m[chosen],
        axes=times * np.swapaxes(vectors * np.sqrt(values)[:, None], 1, 2),
    )


def thinned(numbers: Index, most: int) -> Index:
    """Return all numbers, or of more than `most` every n-th."""
    return numbers[:: -(-len(numbers) // most)] if len(numbers) else numbers


def _joined(parts: list[Array]) -> Array:
    return np.concatenate(parts) if parts else np.zeros((0, 3))
