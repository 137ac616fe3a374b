"""Pictures taken on a simulated flight."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Event
from typing import Any

import tifffile
from threadpoolctl import threadpool_limits

from acx4sim.pictures.ground_rays import Station, reduced, station
from acx4sim.pictures.pictures import BANDS, Ground, Tiles, camera_image, camera_response
from acx4sim.plan import Plan
from acx4sim.scenery.country import Country
from acx4sim.scenery.photo import Photo, read_photo
from acx4sim.scenery.scenery import Landscape

Tell = Callable[[str, int, int], None]
_THREADS = 2


class _StoppedError(Exception):
    """Another picture failed, or the command was interrupted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Photography:
    """The exposures of a flight with pictures, and the ground that they show.

    Attributes
    ----------
    stations : tuple of Station
        The exposures.
    reduce : int
        The pictures have 1/reduce of the size.
    photo : Photo, optional
        Photograph on the ground; by default it is the procedural landscape.
    seed : int
        Seed of the flight.
    """

    stations: tuple[Station, ...]
    reduce: int
    photo: Photo | None
    seed: int

    def orders(self) -> list[tuple[str, Station, str]]:
        """Return path inside the flight, exposure and camera of every picture."""
        return [
            (f"{at.block}/images/{image_name(at, camera)}.tif", at, camera)
            for at in self.stations
            for camera in at.cameras
        ]


def image_name(at: Station, camera: str) -> str:
    """Return the name of a camera's image in images.csv."""
    return f"{at.exposure}_{camera}" if len(at.cameras) > 1 else at.exposure


def order(
    plan: Plan, seed: int, exposures: Sequence[str], reduce: int, photo: str | Path | None
) -> Photography:
    """Order pictures of exposures.

    Raises
    ------
    ValueError
        Where the plan has no such exposure, none is named, or `reduce` leaves no pixel.
    OSError
        Where the photo does not exist or cannot be read.
    """
    names = list(dict.fromkeys(exposures))
    if not names:
        msg = "no exposure is named that is to have pictures"
        raise ValueError(msg)
    stations = tuple(station(plan, name, seed=seed) for name in names)
    for at in stations:
        for camera in at.cameras:
            reduced(plan.cameras[camera], reduce)
    return Photography(
        stations=stations,
        reduce=reduce,
        photo=None if photo is None else read_photo(photo),
        seed=seed,
    )


def told(ordered: Photography) -> dict[str, Any]:
    """Return the true values of the pictures, for JSON."""
    cameras = dict.fromkeys(camera for _, _, camera in ordered.orders())
    return {
        "note": (
            "A camera's DN are the ground's times gain times the cosine of the angle off the axis "
            "(through the middle of the image, at the true focal length) to a power."
        ),
        "exposures": [at.exposure for at in ordered.stations],
        "reduce": ordered.reduce,
        "ground": "landscape" if ordered.photo is None else ordered.photo.name,
        "bands": list(BANDS),
        "response": {name: asdict(camera_response(name, ordered.seed)) for name in cameras},
    }


def take(ordered: Photography, folder: Path, tell: Tell) -> None:
    """Take all pictures and write them into the folder of a flight.

    Parameters
    ----------
    ordered : Photography
        The pictures to take.
    folder : Path
        Folder of the flight.
    tell : callable
        Called with the name of a picture, its number of finished parts, and of all parts.
    """
    grounds = {at.block: Tiles(ground=_ground(ordered, at)) for at in ordered.stations}
    stop = Event()

    def take_one(path: str, at: Station, camera: str) -> None:
        def pass_on(done: int, total: int) -> None:
            if stop.is_set():
                raise _StoppedError
            tell(Path(path).stem, done, total)

        pixels = camera_image(
            at,
            camera,
            grounds[at.block],
            reduce=ordered.reduce,
            seed=ordered.seed,
            tell=pass_on,
        )
        (folder / path).parent.mkdir(exist_ok=True)
        tifffile.imwrite(folder / path, pixels, photometric="rgb", metadata=None, software="")

    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(_THREADS) as pool:
        jobs = [pool.submit(take_one, *one) for one in ordered.orders()]
        try:
            for job in jobs:
                job.result()
        except BaseException:  # also after an interruption the other pictures are not finished
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise


def _ground(ordered: Photography, at: Station) -> Ground:
    if ordered.photo is not None:
        return ordered.photo
    return landscape(at, seed=ordered.seed)


def landscape(at: Station, *, seed: int = 1) -> Landscape:
    """Return the procedural landscape of a block, with its surveyed points painted on it.

    Parameters
    ----------
    at : Station
        Any exposure of the block.
    seed : int
        Another seed gives different noise, fields and houses.
    """
    middle = at.plan.blocks[at.block].centre_m
    return Landscape(country=Country(seed=seed, middle=middle), marks=at.marks_g[:, :2])
