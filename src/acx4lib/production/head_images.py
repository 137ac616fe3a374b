"""The pixels of a flight's heads: which exposures have them, and their files, read and checked.

An image that is stored in its file as in memory is mapped, not read. Then pixels that are not
used take no time, and the memory of used ones can be given back.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acx4lib.errors import FlightError
from acx4lib.expected import Raster
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import Camera
from acx4lib.production.image_files import ImageFile, image_from_file
from acx4lib.synthetic_image.mapped_pixels import forget

MAKE_FILES = (
    "give heads/images.csv a column 'file' with the TIFF of every head's image, relative to heads/"
)


@dataclass(frozen=True, kw_only=True)
class HeadFiles:
    """The files of all heads at one exposure.

    Attributes
    ----------
    exposure : str
    paths : tuple of Path
        In the order of the heads; paths for the user.
    """

    exposure: str
    paths: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadImages:
    """The pixels of all heads at one exposure.

    Attributes
    ----------
    images : tuple of ndarray, shape (rows, cols, bands)
        8 or 16 bit, read-only; all have the same type and number of bands.
    reduction : int
        K, if the images have 1/K of the cameras' size.
    """

    images: tuple[Raster, ...]
    reduction: int

    def forget(self) -> None:
        """Give back the memory of mapped pixels; they are read again when they are needed."""
        for image in self.images:
            forget(image)


def head_files(flight: Flight, heads: Sequence[str]) -> tuple[dict[str, HeadFiles], dict[str, str]]:
    """Return the exposures whose image files exist.

    Parameters
    ----------
    flight : Flight
    heads : sequence of str
        Names of the cameras.

    Returns
    -------
    complete : dict of str to HeadFiles
        Files by exposure, in the order of the flight.
    incomplete : dict of str to str
        What is missing, for exposures where only some heads have a file.

    Raises
    ------
    FlightError
        Where no image of a head has a file.
    """
    table = flight.path / "heads" / "images.csv"
    found = _files_by_exposure(flight, heads)
    if not found:
        raise FlightError([f"{table}: names no files of head images; {MAKE_FILES}"])
    complete, incomplete = {}, {}
    for exposure, files in found.items():
        missing = [name for name in heads if name not in files]
        if missing:
            incomplete[exposure] = (
                f"{table}: exposure {exposure}: no file for {', '.join(missing)}; an exposure is "
                f"rendered from all of {', '.join(heads)}"
            )
        else:
            paths = tuple(files[name] for name in heads)
            complete[exposure] = HeadFiles(exposure=exposure, paths=paths)
    return complete, incomplete


def _files_by_exposure(flight: Flight, heads: Sequence[str]) -> dict[str, dict[str, Path]]:
    """Return the existing files of heads by exposure and camera."""
    block, inside = flight.heads, flight.pictures.resolve()
    found: dict[str, dict[str, Path]] = {}
    if block is None:
        return found
    images = block.images
    for i, path in enumerate(flight.image_files["heads"]):
        camera = block.cameras[images.camera_idx[i]].name
        if path is not None and camera in heads:
            exposure = block.trajectory.exposures[images.exposure_idx[i]]
            found.setdefault(exposure, {})[camera] = flight.pictures / path.relative_to(inside)
    return found


def read_heads(paths: Sequence[Path], cameras: Sequence[Camera]) -> HeadImages:
    """Read the images of all heads at one exposure.

    Parameters
    ----------
    paths : sequence of Path
    cameras : sequence of Camera
        At full size, one for each path.

    Returns
    -------
    HeadImages

    Raises
    ------
    FlightError
        With a sentence for every file that cannot be read, or that differs from the others.
    """
    problems: list[str] = []
    pixels: list[ImageFile] = []
    for path, camera in zip(paths, cameras, strict=True):
        try:
            pixels.append(image_from_file(path, camera))
        except FlightError as error:
            problems += error.problems
    problems = problems or _unlike(paths, pixels)
    if problems:
        raise FlightError(problems)
    return HeadImages(
        images=tuple(one.image for one in pixels),
        reduction=pixels[0].reduction,
    )


def _unlike(paths: Sequence[Path], pixels: Sequence[ImageFile]) -> list[str]:
    """Return sentences on files that differ from most of the others."""
    kinds = {
        "has pixels of {} bit": [f"{8 * one.image.dtype.itemsize}" for one in pixels],
        "has {} bands": [f"{one.image.shape[2]}" for one in pixels],
        "is at {} of the size": [f"1/{one.reduction}" for one in pixels],
    }
    problems = []
    for says, values in kinds.items():
        usual = Counter(values).most_common(1)[0][0]
        others = f"the other heads have {usual}; all must be alike"
        problems += [
            f"{path}: {says.format(value)}, {others}"
            for path, value in zip(paths, values, strict=True)
            if value != usual
        ]
    return problems
