"""The synthetic images of a whole flight, as files.

Existing images that were made from the same input are not made again. If an image cannot be made,
the others still are.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import pandas as pd

from acx4files.flight.reader import Flight
from acx4files.images.exposure import (
    FlightResponse,
    Outcome,
    RenderJob,
    RenderOptions,
    TellRows,
    estimate_flight_response,
    render_exposure,
    spread,
)
from acx4files.images.head_images import HeadFiles, flight_files
from acx4files.images.image_files import fingerprint
from acx4files.images.tiff import read_about
from acx4files.results import folder as results
from acx4files.results import provenance, whole_files
from acx4files.results.read_back import read_relative_orientation
from acx4files.results.whole_files import file_stem
from acx4lib.calibration.heads import RelativeOrientation, not_calibrated
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.geometry.camera import Camera

ORIENTED = ("synthetic/refined", "heads/relative_orientation")
"""Results with the orientation of the heads; the first one that exists is used."""

IMAGES = "images.csv"
"""Table of the images, in the format of a flight's block."""

_HEADER = ("image", "camera", "exposure", "file")


@dataclass(frozen=True, kw_only=True, eq=False)
class SyntheticRig:
    """The orientation from which the images of a flight are rendered.

    Attributes
    ----------
    flight : Flight
    orientation : RelativeOrientation
    synthetic : Camera
    source : str
        Entry of `ORIENTED` with the orientation.
    tables : str
        Checksum of the flight's tables from which the orientation was computed.
    """

    flight: Flight
    orientation: RelativeOrientation
    synthetic: Camera
    source: str
    tables: str


@dataclass(frozen=True, kw_only=True)
class Rendered:
    """The outcome for a flight's synthetic images.

    Attributes
    ----------
    rendered, kept : tuple of str
        Exposures rendered now, and those whose images existed, made from the same input.
    problems : tuple of str
        Reasons for missing images, one line each, which begins with the exposure.
    notes : tuple of str
        Input of the images, and remarks for the user.
    """

    rendered: tuple[str, ...]
    kept: tuple[str, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]


def render_flight(
    flight: Flight,
    results_path: str | Path,
    folder: str | Path,
    *,
    exposures: Sequence[str] | None = None,
    options: RenderOptions = RenderOptions(),  # noqa: B008 frozen
    threads: int | None = None,
    tell: TellRows = lambda *_: None,
) -> Rendered:
    """Render the synthetic images of a flight.

    Parameters
    ----------
    flight : Flight
    results_path : str or Path
        Results folder with the orientation of the heads.
    folder : str or Path
        A new or empty folder, or that of an earlier call. A TIFF and a preview for each exposure
        are written to it, and `IMAGES`.
    exposures : sequence of str, optional
        By default all exposures with the files of all heads, in every block that is measured in
        heads; ``block/name`` where two of them have an exposure of this name.
    options : RenderOptions
    threads : int, optional
        By default one for each processor of this computer.
    tell : callable
        Called with exposure, rows finished and all rows; all rows are 0 if the exposure failed.

    Raises
    ------
    FlightError
        Where nothing can be rendered, or the results were changed after their run.
    OutputError
        Where the folder must not be used for the images, or another process is writing there.
    AdjustmentError
        Where the heads could not be oriented.
    """
    rig, folder = read_rig(flight, Path(results_path)), Path(folder)
    files = flight_files(flight, [head.name for head in rig.orientation.heads])
    chosen = files.chosen(exposures)
    sources = spread(list(files.complete.values())) if options.equalise == "flight" else []
    with whole_files.claim(folder, signs=[IMAGES]):
        complete = [files.complete[name] for name in chosen if name in files.complete]
        jobs = _jobs(rig, complete, folder, options, sources, threads)
        kept = [job for job in jobs if _is_made(job)]
        _list(rig, kept)
        waiting = [job for job in jobs if job not in kept]
        response = (
            estimate_flight_response(sources, rig.orientation, rig.synthetic) if waiting else None
        )
        for job in waiting:
            tell(job.exposure, 0, job.synthetic.height_px)
        outcomes = {}
        for job in waiting:
            equalised = job
            if response is not None:
                equalised = replace(job, response=response.fit.response)
            outcomes[job.exposure] = outcome = render_exposure(equalised, tell)
            if outcome.problems:
                tell(job.exposure, 0, 0)
            else:
                _list(rig, [job])
    for name in chosen:
        if name in files.incomplete:
            outcomes[name] = Outcome(exposure=name, problems=(files.incomplete[name],))
    left_out = {} if exposures is not None else files.incomplete
    return Rendered(
        rendered=tuple(name for name, outcome in outcomes.items() if not outcome.problems),
        kept=tuple(job.exposure for job in kept),
        problems=tuple(f"{n}: {p}" for n in chosen if n in outcomes for p in outcomes[n].problems),
        notes=tuple(_notes(results_path, rig, left_out, response, outcomes.values())),
    )


# --- orientation and response ----------------------------------------------------------------


def read_rig(flight: Flight, results_path: Path) -> SyntheticRig:
    """Read the orientation of the heads from the results, refined if available.

    Raises
    ------
    FlightError
        Where the flight has no synthetic camera, or the results have no orientation of heads.
    AdjustmentError
        Where the heads could not be oriented.
    """
    toml = flight.path / "flight.toml"
    if flight.synthetic is None:
        raise FlightError([f"{toml}: has no table [synthetic]; there is nothing to render"])
    source, orientation = _read_orientation(flight, results_path)
    names = [head.name for head in orientation.heads]
    missing = [name for name in flight.synthetic.heads if name not in names]
    if missing:
        problem = (
            f"{results_path}: has no orientation of {', '.join(missing)}; run stage heads again"
        )
        raise FlightError([problem])
    return SyntheticRig(
        flight=flight,
        orientation=orientation,
        synthetic=flight.cameras[flight.synthetic.camera],
        source=source,
        tables=provenance.read(results_path).digest,
    )


def _read_orientation(flight: Flight, results_path: Path) -> tuple[str, RelativeOrientation]:
    heads = flight.blocks.get("heads")
    is_measured = heads is None or not not_calibrated(heads)
    before = ["heads"] if is_measured else ["synthetic"]  # heads as declared have no stage heads
    run_results = provenance.results_before(results_path, before, flight)
    if is_measured and results.has(run_results, "synthetic"):
        run_results = provenance.results_before(results_path, ["heads", "synthetic"], flight)
    reasons: list[str] = []
    for source in ORIENTED:
        reasons = results.messages(run_results.summary.get(source, {}), "left_out")
        if results.has(run_results, source) and not reasons:
            return source, read_relative_orientation(run_results, source, flight.cameras)
    if reasons:
        raise AdjustmentError("; ".join(reasons))
    raise FlightError([f"{results_path}: has no orientation of the heads; run stage heads first"])


def _other_constant(rig: SyntheticRig) -> Iterator[str]:
    """Yield a note if the camera constant is not that of the flight."""
    first = rig.orientation.heads[0]
    declared = rig.synthetic.interior.f
    if abs(first.interior.f - declared) > 1e-6 * declared:
        yield (
            f"the camera constant is {first.interior.f:.6g} mm, that of {first.name}, in which the "
            f"heads' places are counted; flight.toml has {declared:.6g} for {rig.synthetic.name}"
        )


# --- which images ----------------------------------------------------------------------------


def _jobs(
    rig: SyntheticRig,
    exposures: Sequence[HeadFiles],
    folder: Path,
    options: RenderOptions,
    sources: Sequence[HeadFiles],
    threads: int | None,
) -> list[RenderJob]:
    """Return the jobs of all images, each with a checksum of all that its image depends on."""
    orientation = rig.orientation
    about = {
        "flight": rig.flight.name,
        "orientation": rig.source,
        "tables": rig.tables,
        "response_from": [files.exposure for files in sources],
        "software": f"acx4lib {importlib.metadata.version('acx4lib')}",
    }
    cameras = [
        [c.name, c.width_px, c.height_px, c.pixel_mm, asdict(c.interior)]
        for c in (rig.synthetic, *orientation.heads)
    ]
    depends: list[object] = [about, asdict(options), cameras]
    depends += [orientation.xyz_mm.tolist(), orientation.opk.tolist()]
    depends += [[files.exposure, *map(fingerprint, files.paths)] for files in sources]

    def job(files: HeadFiles) -> RenderJob:
        own = [*depends, [files.exposure, *map(fingerprint, files.paths)]]
        return RenderJob(
            exposure=files.exposure,
            files=files.paths,
            orientation=orientation,
            synthetic=rig.synthetic,
            options=options,
            path=folder / f"{file_stem(files.exposure)}.tif",
            preview=folder / f"{file_stem(files.exposure)}_preview.jpg",
            about={**about, "input": hashlib.sha256(json.dumps(own).encode()).hexdigest()},
            threads=threads,
        )

    return [job(files) for files in exposures]


def _is_made(job: RenderJob) -> bool:
    exists = job.path.is_file() and job.preview.is_file()
    return exists and read_about(job.path).get("input") == job.about["input"]


# --- notes and table -------------------------------------------------------------------------


def _notes(
    results_path: str | Path,
    rig: SyntheticRig,
    left_out: Mapping[str, str],
    response: FlightResponse | None,
    outcomes: Iterable[Outcome],
) -> Iterator[str]:
    """Yield the notes on all images, then each note on single exposures, with their names."""
    yield f"heads as {results_path} has them, {rig.source}"
    yield from _other_constant(rig)
    if left_out:
        yield f"left out, without the files of all heads: {', '.join(left_out)}"
    if response is not None:
        yield str(response)
    noted: dict[str, list[str]] = {}
    for outcome in outcomes:
        for note in outcome.notes:
            noted.setdefault(note, []).append(outcome.exposure)
    yield from (f"{', '.join(names)}: {note}" for note, names in noted.items())


def _list(rig: SyntheticRig, jobs: Sequence[RenderJob]) -> None:
    """Add images to their folder's table, sorted by their names."""
    if not jobs:
        return
    folder = jobs[0].path.parent
    path = folder / IMAGES
    known = pd.read_csv(path, dtype=str, keep_default_na=False) if path.is_file() else None
    new = [(job.exposure, rig.synthetic.name, job.exposure, job.path.name) for job in jobs]
    table = pd.concat([known, pd.DataFrame(new, columns=list(_HEADER))])[list(_HEADER)]
    table = table.drop_duplicates("exposure", keep="last").sort_values("exposure")
    table = table[[(folder / name).is_file() for name in table["file"]]]
    whole_files.write(path, table.to_csv(index=False, lineterminator="\n"))
