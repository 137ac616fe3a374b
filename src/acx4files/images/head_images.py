"""The images of a flight's heads: complete exposures, and their files, read and checked.

An image that is stored in its file as in memory is mapped, not read. Then pixels that are not
used take no time, and the memory of used ones can be given back.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acx4files.flight.reader import Flight
from acx4files.images.image_files import ImageFile, image_from_file
from acx4lib.errors import FlightError
from acx4lib.expected import Raster
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.head_map import forget

MAKE_FILES = (
    "give heads/images.csv a column 'file' with the TIFF of every head's image, relative to heads/"
)


@dataclass(frozen=True, kw_only=True)
class HeadFiles:
    """The files of all heads at one exposure.

    Attributes
    ----------
    exposure : str
        Its name; ``block/name`` where two blocks of a flight have such an exposure.
    paths : tuple of Path
        In the order of the heads; paths for the user.
    """

    exposure: str
    paths: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True)
class FlightFiles:
    """The head images of a flight, in all its blocks that are measured in heads.

    Attributes
    ----------
    complete : dict of str to HeadFiles
        By exposure, in the order of the flight.
    incomplete : dict of str to str
        What is missing, for exposures where only some heads have a file.
    meant : dict of str to tuple of str
        By a plain name or ``block/name``, the exposures that it may mean.
    tables : tuple of Path
        Tables with the names of the files.
    """

    complete: dict[str, HeadFiles]
    incomplete: dict[str, str]
    meant: dict[str, tuple[str, ...]]
    tables: tuple[Path, ...]

    def chosen(self, names: Sequence[str] | None) -> list[str]:
        """Return the names of the chosen exposures; by default of all complete ones.

        Raises
        ------
        FlightError
            Where there is none, or a name matches none or several exposures.
        """
        if names is None:
            if not self.complete:
                raise FlightError(list(self.incomplete.values()))
            return list(self.complete)
        problems = [
            f"exposure {name}: there are {len(self.meant[name])} of this name; say "
            f"{' or '.join(self.meant[name])}"
            for name in names
            if len(self.meant.get(name, ())) > 1
        ]
        unknown = [name for name in dict.fromkeys(names) if name not in self.meant]
        problems += [self._unknown(unknown)] if unknown else []
        if problems:
            raise FlightError(problems)
        return list(dict.fromkeys(self.meant[name][0] for name in names))

    def _unknown(self, names: Sequence[str]) -> str:
        known = [*self.complete][:5] + (["…"] if len(self.complete) > 5 else [])
        return (
            f"{', '.join(map(str, self.tables))}: no files of an exposure {', '.join(names)}; "
            f"complete are {', '.join(known) or 'none'}"
        )


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
        """Release the memory of mapped pixels; they are read again when needed."""
        for image in self.images:
            forget(image)


def flight_files(flight: Flight, heads: Sequence[str]) -> FlightFiles:
    """Return the image files of block heads and of the blocks measured in heads.

    Parameters
    ----------
    flight : Flight
    heads : sequence of str
        Names of the cameras.

    Raises
    ------
    FlightError
        Where no image of a head has a file.
    """
    named = [
        name for name in ("heads", *flight.transferred) if any(flight.image_files.get(name, ()))
    ]
    by_block = {name: head_files(flight, heads, block=name) for name in named or ("heads",)}
    full = [f"{block}/{e}" for block, parts in by_block.items() for part in parts for e in part]
    times = Counter(name.partition("/")[2] for name in full)
    complete, incomplete = {}, {}
    meant: dict[str, tuple[str, ...]] = {}
    for block, (files, missing) in by_block.items():
        for exposure in (*files, *missing):
            is_clear = times[exposure] == 1 and exposure not in full
            label = exposure if is_clear else f"{block}/{exposure}"
            for alias in (exposure, f"{block}/{exposure}"):
                meant[alias] = (*meant.get(alias, ()), label)
            if exposure in files:
                complete[label] = replace(files[exposure], exposure=label)
            else:
                incomplete[label] = missing[exposure]
    tables = tuple(_table(flight, block) for block in by_block)
    return FlightFiles(complete=complete, incomplete=incomplete, meant=meant, tables=tables)


def _table(flight: Flight, block: str) -> Path:
    return flight.path / block / "images.csv"


def head_files(
    flight: Flight, heads: Sequence[str], *, block: str = "heads"
) -> tuple[dict[str, HeadFiles], dict[str, str]]:
    """Return the exposures of a block whose image files exist.

    Parameters
    ----------
    flight : Flight
    heads : sequence of str
        Names of the cameras.
    block : str
        A block that is measured in heads.

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
    table = _table(flight, block)
    by_exposure = _files_by_exposure(flight, heads, block)
    if not by_exposure:
        raise FlightError([f"{table}: names no files of head images; {MAKE_FILES}"])
    complete, incomplete = {}, {}
    for exposure, files in by_exposure.items():
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


def _files_by_exposure(
    flight: Flight, heads: Sequence[str], name: str
) -> dict[str, dict[str, Path]]:
    """Return the existing files of heads by exposure and camera."""
    by_exposure: dict[str, dict[str, Path]] = {}
    if name not in flight.blocks:
        return by_exposure
    block, inside = flight.blocks[name], flight.pictures.resolve()
    images = block.images
    for i, path in enumerate(flight.image_files[name]):
        camera = block.cameras[images.camera_idx[i]].name
        if path is not None and camera in heads:
            exposure = block.trajectory.exposures[images.exposure_idx[i]]
            by_exposure.setdefault(exposure, {})[camera] = flight.pictures / path.relative_to(
                inside
            )
    return by_exposure


def read_heads(paths: Sequence[Path], cameras: Sequence[Camera]) -> HeadImages:
    """Read the images of all heads at one exposure.

    Parameters
    ----------
    paths : sequence of Path
    cameras : sequence of Camera
        At full size, one for each path.

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
        images=tuple(file.image for file in pixels),
        reduction=pixels[0].reduction,
    )


def _unlike(paths: Sequence[Path], pixels: Sequence[ImageFile]) -> list[str]:
    """Return sentences on files that differ from most of the others."""
    kinds = {
        "has pixels of {} bit": [f"{8 * file.image.dtype.itemsize}" for file in pixels],
        "has {} bands": [f"{file.image.shape[2]}" for file in pixels],
        "is at {} of the size": [f"1/{file.reduction}" for file in pixels],
    }
    problems = []
    for message, values in kinds.items():
        usual = Counter(values).most_common(1)[0][0]
        others = f"the other heads have {usual}; all must be alike"
        problems += [
            f"{path}: {message.format(value)}, {others}"
            for path, value in zip(paths, values, strict=True)
            if value != usual
        ]
    return problems
