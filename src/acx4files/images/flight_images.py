"""The synthetic images of a whole flight, as files.

Existing images that were made from the same input are not made again. If an image cannot be made,
the others still are.
"""

from __future__ import annotations

import csv
import hashlib
import importlib.metadata
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass, replace
from pathlib import Path

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
from acx4files.results import own_folder, provenance, whole_files
from acx4files.results.read_back import read_relative_orientation
from acx4files.results.whole_files import file_stem
from acx4lib.calibration.heads import RelativeOrientation, not_calibrated
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.geometry.camera import Camera
from acx4lib.least_squares.processors import as_finished

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


def render_flight(  # noqa: PLR0913 what, how and where
    flight: Flight,
    results_path: str | Path,
    folder: str | Path,
    *,
    exposures: Sequence[str] | None = None,
    options: RenderOptions = RenderOptions(),  # noqa: B008 frozen
    executor: Executor | None = None,
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
    executor : Executor, optional
        Processes, or a Dask cluster that sees the same files; by default one after the other.
    threads : int, optional
        Of one image; by default one for each processor of this computer.
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
    complete, incomplete = files.complete, files.incomplete
    chosen = files.chosen(exposures)
    sources = spread(list(complete.values())) if options.equalise == "flight" else []
    with own_folder.claim(folder, signs=[IMAGES], away_from=[flight.path]):
        jobs = _jobs(rig, [complete[n] for n in chosen if n in complete], folder, options, sources)
        kept = {job.exposure for job in jobs if _is_made(job)}
        remaining = [job for job in jobs if job.exposure not in kept]
        response = (
            estimate_flight_response(sources, rig.orientation, rig.synthetic) if remaining else None
        )
        remaining = [replace(_with_response(job, response), threads=threads) for job in remaining]
        outcomes = [*_missing(chosen, incomplete), *_rendered(remaining, rig, executor, tell)]
        if kept:
            _list(folder, rig, [job for job in jobs if job.exposure in kept])
    outcomes.sort(key=lambda o: chosen.index(o.exposure))
    left_out = incomplete if exposures is None else {}
    failed = {outcome.exposure for outcome in outcomes if outcome.problems}
    return Rendered(
        rendered=tuple(job.exposure for job in remaining if job.exposure not in failed),
        kept=tuple(job.exposure for job in jobs if job.exposure in kept),
        problems=tuple(f"{o.exposure}: {p}" for o in outcomes for p in o.problems),
        notes=tuple(_notes(results_path, rig, left_out, response, outcomes)),
    )


def _rendered(
    jobs: Sequence[RenderJob], rig: SyntheticRig, executor: Executor | None, tell: TellRows
) -> list[Outcome]:
    """Render images, and add each to the folder's table as soon as it is complete."""
    outcomes = []
    for job in jobs:
        tell(job.exposure, 0, job.synthetic.height_px)
    for job, outcome in _outcomes(jobs, executor, tell):
        outcomes.append(outcome)
        if outcome.problems:
            tell(job.exposure, 0, 0)
        else:
            _list(job.path.parent, rig, [job])
    return outcomes


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


def _with_response(job: RenderJob, response: FlightResponse | None) -> RenderJob:
    if response is None:
        return job
    checked = job.exposure in response.exposures
    return replace(job, response=response.fit.response, checked=checked)


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


def _missing(chosen: Iterable[str], incomplete: Mapping[str, str]) -> list[Outcome]:
    return [Outcome(exposure=n, problems=(incomplete[n],)) for n in chosen if n in incomplete]


def _jobs(
    rig: SyntheticRig,
    exposures: Sequence[HeadFiles],
    folder: Path,
    options: RenderOptions,
    sources: Sequence[HeadFiles],
) -> list[RenderJob]:
    """Return the jobs of all images."""
    about = {
        "flight": rig.flight.name,
        "orientation": rig.source,
        "tables": rig.tables,
        "response_from": [files.exposure for files in sources],
        "software": f"acx4lib {_version()}",
    }
    depends = [about, asdict(options), *_numbers(rig), *(_files(files) for files in sources)]
    return [
        RenderJob(
            exposure=files.exposure,
            files=files.paths,
            orientation=rig.orientation,
            synthetic=rig.synthetic,
            options=options,
            response=None,
            path=folder / f"{file_stem(files.exposure)}.tif",
            preview=folder / f"{file_stem(files.exposure)}_preview.jpg",
            about={**about, "input": _checksum([*depends, _files(files)])},
        )
        for files in exposures
    ]


def _version() -> str:
    try:
        return importlib.metadata.version("acx4lib")
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _numbers(rig: SyntheticRig) -> list[object]:
    """Return all numbers of cameras and orientation on which an image depends."""
    cameras = [
        [c.name, c.width_px, c.height_px, c.pixel_mm, asdict(c.interior)]
        for c in (rig.synthetic, *rig.orientation.heads)
    ]
    return [cameras, rig.orientation.xyz_mm.tolist(), rig.orientation.opk.tolist()]


def _files(files: HeadFiles) -> list[str]:
    return [files.exposure, *(fingerprint(path) for path in files.paths)]


def _checksum(depends: Sequence[object]) -> str:
    return hashlib.sha256(json.dumps(depends).encode()).hexdigest()


def _is_made(job: RenderJob) -> bool:
    exists = job.path.is_file() and job.preview.is_file()
    return exists and read_about(job.path).get("input") == job.about["input"]


# --- notes and table -------------------------------------------------------------------------


def _notes(
    results_path: str | Path,
    rig: SyntheticRig,
    left_out: Mapping[str, str],
    response: FlightResponse | None,
    outcomes: Sequence[Outcome],
) -> Iterator[str]:
    """Yield the notes on all images, then each note on single exposures, with their names."""
    yield f"heads as {results_path} has them, {rig.source}"
    yield from _other_constant(rig)
    if left_out:
        yield f"left out, without the files of all heads: {', '.join(left_out)}"
    if response is not None:
        yield str(response)
    for note in dict.fromkeys(note for outcome in outcomes for note in outcome.notes):
        names = [outcome.exposure for outcome in outcomes if note in outcome.notes]
        yield f"{', '.join(names)}: {note}"


def _list(folder: Path, rig: SyntheticRig, jobs: Sequence[RenderJob]) -> None:
    """Add images to the folder's table, sorted by their names."""
    path = folder / IMAGES
    rows = {}
    if path.is_file():
        lines = path.read_text("utf-8-sig").splitlines()
        rows = {row["exposure"]: row for row in csv.DictReader(lines) if row.get("exposure")}
    for job in jobs:
        values = (job.exposure, rig.synthetic.name, job.exposure, job.path.name)
        rows[job.exposure] = dict(zip(_HEADER, values, strict=True))
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, _HEADER, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows[name] for name in sorted(rows) if (folder / rows[name]["file"]).is_file())
    whole_files.write(path, table.getvalue())


# --- Synthetic images made one after the other, or by the workers of an executor


def _outcomes(
    jobs: Sequence[RenderJob], executor: Executor | None, tell: TellRows
) -> Iterator[tuple[RenderJob, Outcome]]:
    """Yield each job with its outcome as soon as it is finished."""
    if executor is None:
        yield from ((job, render_exposure(job, tell)) for job in jobs)
        return
    for job, call in as_finished(executor, _made, [_absolute(job) for job in jobs]):
        tell(job.exposure, job.synthetic.height_px, job.synthetic.height_px)
        yield job, _outcome(job, call)


def _made(job: RenderJob) -> Outcome:
    return render_exposure(job, lambda *_: None)


def _absolute(job: RenderJob) -> RenderJob:
    """Return a job for a worker that may run in another folder."""
    files = tuple(path.absolute() for path in job.files)
    return replace(job, files=files, path=job.path.absolute(), preview=job.preview.absolute())


def _outcome(job: RenderJob, call: Future[Outcome]) -> Outcome:
    """Return the outcome of a call; an image lost with its worker has a problem."""
    try:
        return call.result()
    except FileNotFoundError as error:
        problem = error.strerror or str(error)
        return Outcome(exposure=job.exposure, problems=(problem,))
    except Exception as error:  # the other images go on
        reason = " ".join(str(error).split()) or type(error).__name__
        problem = f"{reason}; short of memory? use fewer workers"
        return Outcome(exposure=job.exposure, problems=(problem,))
