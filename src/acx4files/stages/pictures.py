"""The heads' pictures in stage synthetic, and the tie points found in them (2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.images.flight_images import spread
from acx4files.images.head_images import head_files, read_heads
from acx4lib import shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.response import ResponseFit, fit_response, overlap_samples
from acx4lib.tie_points.search import ImageTies, OverlapTies, find_ties
from acx4lib.tie_points.ties import TiePoints

if TYPE_CHECKING:
    import pandas as pd


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Exposed:
    """The pictures of all heads at one exposure.

    Attributes
    ----------
    exposure : str
    exposure_idx : int
    images : tuple of ndarray, shape (rows, cols, bands)
        In the order of the heads.
    """

    exposure: str
    exposure_idx: int
    images: tuple[Raster, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pictures:
    """The pictures of some exposures of a flight, and the synthetic camera at their size.

    Attributes
    ----------
    exposed : tuple of Exposed
        At least one.
    reduction : int
        Size of a pixel over that of the cameras.
    synthetic : Camera
        With pixels larger by this factor.
    n_complete : int
        Exposures of the flight with files of all heads.
    """

    exposed: tuple[Exposed, ...]
    reduction: int
    synthetic: Camera
    n_complete: int

    def __repr__(self) -> str:
        """Summarize the pictures in one line."""
        names = shown.names([exposed.exposure for exposed in self.exposed])
        smaller = f"pixels {self.reduction} times as large" if self.reduction > 1 else ""
        n = shown.count(self.n_complete, "exposure")
        return shown.line("Pictures", f"{names} of {n}", smaller)

    def table(self) -> pd.DataFrame:
        """Return the size of the pictures at every exposure."""
        rows = {}
        for exposed in self.exposed:
            rows_px, cols_px = exposed.images[0].shape[:2]
            rows[exposed.exposure] = {
                "pictures": len(exposed.images),
                "cols": cols_px,
                "rows": rows_px,
            }
        return shown.row_table("exposure", rows)

    @property
    def middle(self) -> Exposed:
        """Exposure in the middle, which the figures show."""
        return self.exposed[len(self.exposed) // 2]


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundTies:
    """Tie points between heads, from their pixels.

    Attributes
    ----------
    ties : TiePoints
        In pixels of the full-size heads.
    overlaps : tuple of OverlapTies
        Outcome of the search in each overlap, exposure by exposure.
    exposures : tuple of str
        Exposure of each of `overlaps`.
    """

    ties: TiePoints
    overlaps: tuple[OverlapTies, ...]
    exposures: tuple[str, ...]

    def __repr__(self) -> str:
        """Summarize the tie points in one line."""
        n = shown.count(len(self.overlaps), "overlap")
        return shown.line("FoundTies", f"{shown.count(len(self.ties), 'tie point')} in {n}")

    @property
    def warnings(self) -> list[str]:
        """Problems of overlaps, each with its exposure."""
        pairs = zip(self.exposures, self.overlaps, strict=True)
        return [
            f"{exposure}, {overlap.sentence}" for exposure, overlap in pairs if overlap.sentence
        ]

    def table(self) -> pd.DataFrame:
        """Return the outcome of the search in every overlap, exposure by exposure."""
        pairs = zip(self.exposures, self.overlaps, strict=True)
        rows = {(exposure, *overlap.names): overlap.row for exposure, overlap in pairs}
        return shown.row_table(("exposure", "head a", "head b"), rows)


def read_pictures(
    flight: Flight, orientation: RelativeOrientation, *, reduce: int = 1
) -> Pictures | None:
    """Read the pictures of a few exposures; None where the flight names no files.

    Parameters
    ----------
    flight : Flight
    orientation : RelativeOrientation
    reduce : int
        Number of pixels in each direction that are averaged first.

    Raises
    ------
    FlightError
        With a sentence for every file that cannot be used.
    """
    synthetic = flight.synthetic_camera
    if flight.heads is None or synthetic is None or not any(flight.image_files["heads"]):
        return None
    names = [camera.name for camera in orientation.heads]
    cameras = [flight.cameras[name] for name in names]
    complete, incomplete = head_files(flight, names)
    if not complete:
        raise FlightError(list(incomplete.values()))
    chosen = spread(list(complete.values()))
    head_images = [read_heads(heads.paths, cameras) for heads in chosen]
    first = head_images[0].reduction
    exposed = tuple(
        Exposed(
            exposure=files.exposure,
            exposure_idx=flight.heads.trajectory.exposures.index(files.exposure),
            images=tuple(_averaged(image, reduce) for image in heads.images),
        )
        for files, heads in zip(chosen, head_images, strict=True)
        if heads.reduction == first
    )
    return Pictures(
        exposed=exposed,
        reduction=first * reduce,
        synthetic=reduced_camera(synthetic, first * reduce),
        n_complete=len(complete),
    )


def _averaged(image: Raster, k: int) -> Raster:
    """Return means of k x k pixels around the middle of an image."""
    if k == 1:
        return image
    rows, cols = image.shape[0] // k, image.shape[1] // k
    top, left = ((n - k * m) // 2 for n, m in zip(image.shape, (rows, cols), strict=False))
    cut = image[top : top + k * rows, left : left + k * cols]
    means = cut.reshape(rows, k, cols, k, -1).mean(axis=(1, 3))
    return np.rint(means).astype(image.dtype)


def find(pictures: Pictures, orientation: RelativeOrientation) -> FoundTies:
    """Find tie points in the overlaps of all pictures.

    Parameters
    ----------
    pictures : Pictures
    orientation : RelativeOrientation
        Of the full-size heads.
    """
    heads = reduced_heads(orientation, pictures.reduction)
    ties_by_exposure = [
        find_ties(exposed.images, heads, pictures.synthetic, exposure=exposed.exposure_idx)
        for exposed in pictures.exposed
    ]
    return FoundTies(
        ties=_joined(ties_by_exposure, orientation, pictures.reduction),
        overlaps=tuple(
            overlap for image_ties in ties_by_exposure for overlap in image_ties.overlaps
        ),
        exposures=tuple(
            exposed.exposure
            for exposed, image_ties in zip(pictures.exposed, ties_by_exposure, strict=True)
            for _ in image_ties.overlaps
        ),
    )


def _joined(image_ties: Sequence[ImageTies], orientation: RelativeOrientation, k: int) -> TiePoints:
    """Return the tie points of all exposures, in pixels of the full-size heads."""
    parts = [image.ties for image in image_ties]
    names = ("head_a", "head_b", "exposure_idx", "colrow_a", "colrow_b", "sigma_px")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    joined["point_idx"] = np.arange(len(joined["head_a"]))
    for side in ("a", "b"):
        joined[f"colrow_{side}"] = full_size(
            joined[f"colrow_{side}"], joined[f"head_{side}"], orientation, k
        )
    joined["sigma_px"] = k * joined["sigma_px"]
    return TiePoints(**joined)


def find_response(
    pictures: Pictures, orientation: RelativeOrientation, *, seed: int
) -> ResponseFit:
    """Estimate the response of the heads from the overlaps of all pictures.

    Parameters
    ----------
    pictures : Pictures
    orientation : RelativeOrientation
        Refined, of the full-size heads.
    seed : int
        Of the places where grey values are compared.
    """
    heads = reduced_heads(orientation, pictures.reduction)
    rng = np.random.default_rng(seed)
    samples = [
        part
        for exposed in pictures.exposed
        for part in overlap_samples(exposed.images, heads, pictures.synthetic, rng=rng)
    ]
    bands = pictures.exposed[0].images[0].shape[2]
    return fit_response(samples, n_heads=len(heads.heads), n_bands=bands)


def full_size(colrow: Array, head: Array, orientation: RelativeOrientation, k: int) -> Array:
    """Convert pixels of images at 1/k of the size to full-size pixels, shape (n, 2)."""
    size = np.array([[h.width_px, h.height_px] for h in orientation.heads])
    return k * (colrow - 0.5 * (size // k - 1)[head]) + 0.5 * (size - 1)[head]
