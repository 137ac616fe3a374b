"""The synthetic images of a flight: from the files of its heads to a file for each exposure.

Existing images that were made from the same input are not made again. If an image cannot be made,
the others still are.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from acx4files.flight.reader import Flight
from acx4files.images.head_images import HeadFiles, fingerprint, head_files, read_heads
from acx4files.images.tiff import TILE, read_about, write, write_preview
from acx4files.results import folder as results
from acx4files.results import provenance, whole_files
from acx4files.results.read_back import read_relative_orientation
from acx4files.results.whole_files import file_stem
from acx4lib.calibration.heads import RelativeOrientation, can_be_calibrated
from acx4lib.errors import AdjustmentError, FlightError, OutputError
from acx4lib.expected import Raster
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.rendering import FEATHER_PX, render_into, render_plan, stack
from acx4lib.synthetic_image.response import (
    Response,
    ResponseFit,
    Samples,
    fit_response,
    overlap_samples,
)

FRAME = (
    "An ideal central perspective without distortion. Image coordinates are mm from the middle of "
    "the image, x right, y up: x = (col - (width_px - 1) / 2) pixel_mm, y = ((height_px - 1) / 2 - "
    "row) pixel_mm, and (0, 0) is the centre of the top-left pixel. The perspective centre is at "
    "(0, 0, f_mm), the principal point at (0, 0)."
)
HEADS_FRAME = (
    "A head stands at (Xc, Yc, Zc) over the image, whose plane is Z = 0; omega, phi, kappa turn "
    "the axes from the image to the head, R3(kappa) R2(phi) R1(omega). Grey values were divided "
    "by exp(g + a q + b q^2), q the squared distance from the middle of the head's image over "
    "that of its corner; response has g, a, b of every band."
)

ORIENTED = ("synthetic/refined", "heads/relative_orientation")
"""Results with the orientation of the heads; the first one that exists is used."""

IMAGES = "images.csv"
"""Table of the images, in the format of a flight's block."""

_HEADER = ["image", "camera", "exposure", "file"]

EXPOSURES = 3
"""Number of exposures, spread over the flight, from which the response is estimated."""

SEED = 4
"""Seed of the positions where grey values are compared."""

STRIPES_AT_HAND = 8
"""Number of stripes after which the memory of mapped pixels is given back."""

Blend = Literal["feather", "seam", "stack"]

TellRows = Callable[[str, int, int], None]
"""It is called with the exposure, the number of finished rows and the number of all rows."""


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
    blend: Blend = "feather",
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
    blend : {"feather", "seam", "stack"}
        Whether heads are blended along the lines of equal distance from their borders, or cut, or
        are bands of the image, one head after the other. Grey values of heads that are blended or
        cut are equalised by one response for the flight.
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
    names = [head.name for head in rig.orientation.heads]
    files, incomplete = head_files(flight, names, ("heads", *flight.transferred))
    chosen = _chosen(exposures, files, incomplete)
    sources = [] if blend == "stack" else spread(list(files.values()))
    problems, notes = [], [f"heads as {results_path} has them, {rig.source}"]
    if exposures is None and incomplete:
        notes.append(f"left out, without the files of all heads: {', '.join(incomplete)}")
    with whole_files.claim(folder, signs=[IMAGES]):
        complete = [files[name] for name in chosen if name in files]
        about = {one.exposure: _about(rig, one, blend, sources) for one in complete}
        kept = [name for name in about if _is_made(folder, name, about[name])]
        _list(rig, folder, kept)
        waiting = [one for one in complete if one.exposure not in kept]
        for one in waiting:
            tell(one.exposure, 0, rig.synthetic.height_px)
        fit, used = flight_response(sources if waiting else [], rig.orientation, rig.synthetic)
        if fit is not None:
            notes.append(_disagreement(fit, used))
        rendered = []
        for one in waiting:
            try:
                response = None if fit is None else fit.response
                _render(rig, one, blend, response, folder, about[one.exposure], tell)
                _list(rig, folder, [one.exposure])
                rendered.append(one.exposure)
            except FlightError as error:
                problems += [f"{one.exposure}: {problem}" for problem in error.problems]
            except (OutputError, OSError) as error:
                problems.append(f"{one.exposure}: {error}")
            if one.exposure not in rendered:
                tell(one.exposure, 0, 0)
    problems += [f"{name}: {incomplete[name]}" for name in chosen if name in incomplete]
    return Rendered(
        rendered=tuple(rendered), kept=tuple(kept), problems=tuple(problems), notes=tuple(notes)
    )


def _chosen(
    names: Sequence[str] | None, complete: Mapping[str, HeadFiles], incomplete: Mapping[str, str]
) -> list[str]:
    """Return the names of the chosen exposures; by default of all complete ones.

    Raises
    ------
    FlightError
        Where there is none, or no exposure of such a name.
    """
    if names is None:
        if not complete:
            raise FlightError(list(incomplete.values()))
        return list(complete)
    unknown = [name for name in names if name not in {**complete, **incomplete}]
    if unknown:
        says = f"no files of this exposure; complete are {', '.join(complete)[:300] or 'none'}"
        raise FlightError([f"exposure {name}: {says}" for name in unknown])
    return list(dict.fromkeys(names))


# --- orientation -----------------------------------------------------------------------------


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
    return SyntheticRig(
        flight=flight,
        orientation=orientation,
        synthetic=flight.cameras[flight.synthetic.camera],
        source=source,
        tables=provenance.read(results_path).digest,
    )


def _read_orientation(flight: Flight, results_path: Path) -> tuple[str, RelativeOrientation]:
    heads = flight.blocks.get("heads")
    is_measured = heads is None or can_be_calibrated(heads)
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


# --- one response of the heads, so that neighbouring images agree ----------------------------


def spread(files: Sequence[HeadFiles]) -> list[HeadFiles]:
    """Return up to `EXPOSURES` of a flight's exposures, evenly spread from first to last."""
    indices = np.linspace(0, len(files) - 1, min(len(files), EXPOSURES)).round().astype(int)
    return [files[i] for i in indices]


def flight_response(
    files: Sequence[HeadFiles], orientation: RelativeOrientation, synthetic: Camera
) -> tuple[ResponseFit | None, list[str]]:
    """Estimate one response from several exposures.

    Parameters
    ----------
    files : sequence of HeadFiles
        Exposures with bad files, or with another number of bands than the first good one, are
        not used.
    orientation : RelativeOrientation
        At full size.
    synthetic : Camera

    Returns
    -------
    fit : ResponseFit or None
        None where no exposure is good, or no two heads overlap.
    exposures : list of str
        Those with good files.
    """
    rng = np.random.default_rng(SEED)
    samples: list[Samples] = []
    used: list[str] = []
    n_bands = 0
    for exposure in files:
        try:
            heads = read_heads(exposure.paths, orientation.heads)
        except FlightError:
            continue  # the problem is reported when this exposure is rendered
        n_bands = n_bands or heads.images[0].shape[2]
        if heads.images[0].shape[2] != n_bands:
            continue
        reduced = reduced_heads(orientation, heads.reduction)
        camera = reduced_camera(synthetic, heads.reduction)
        if here := overlap_samples(heads.images, reduced, camera, rng=rng):
            samples += here
            used.append(exposure.exposure)
        heads.forget()
    if not samples:
        return None, []
    return fit_response(samples, n_heads=len(orientation.heads), n_bands=n_bands), used


def _disagreement(fit: ResponseFit, exposures: Sequence[str]) -> str:
    """Return a sentence on differences of heads before and after."""
    before, after = (
        100 * np.nanmax([0.0, *(v for o in fit.overlaps for v in getattr(o, name))])
        for name in ("before", "after")
    )  # NaN for an overlap that is completely dark or saturated
    return (
        f"response of the heads from {', '.join(exposures)}: overlaps disagree by at most "
        f"{before:.1f} % before and {after:.1f} % after"
    )


# --- one image -------------------------------------------------------------------------------


def _render(
    rig: SyntheticRig,
    files: HeadFiles,
    blend: Blend,
    response: Response | None,
    folder: Path,
    about: Mapping[str, Any],
    tell: TellRows,
) -> None:
    """Render one exposure and its preview to their files, at 1/K of the size if its heads are.

    Raises
    ------
    FlightError, OutputError, OSError
        With the problems of files or of the disk; then nothing is written.
    """
    heads = read_heads(files.paths, rig.orientation.heads)
    k, images, is_stack = heads.reduction, heads.images, blend == "stack"
    orientation, synthetic = reduced_heads(rig.orientation, k), reduced_camera(rig.synthetic, k)
    bands, dtype = images[0].shape[2], images[0].dtype
    if response is not None and response.coefficients.shape[1] != bands:
        usual = response.coefficients.shape[1]
        problem = f"has {bands} bands, pictures before it have {usual}; all must be alike"
        raise FlightError([f"{files.paths[0]}: {problem}"])
    feather_px = FEATHER_PX / k if blend == "feather" else 0.0
    plan = render_plan(orientation, synthetic, response=response, feather_px=feather_px)
    shape = plan.height_px, plan.width_px, bands * (len(images) if is_stack else 1)
    rooms = np.empty((2, TILE, *shape[1:]), dtype)

    def stripe(start: int) -> Raster:
        stop = min(start + TILE, shape[0])
        if is_stack:
            return stack(plan, images, start, stop)
        out = rooms[start // TILE % 2, : stop - start]
        render_into(out, plan, images, start)
        return out

    def stripes() -> Iterator[Raster]:
        """Yield stripes from the top; the next is rendered while one is written."""
        with ThreadPoolExecutor(1) as pool:
            ahead = pool.submit(stripe, 0)
            for stop in range(TILE, shape[0] + TILE, TILE):
                done = ahead.result()
                if stop < shape[0]:
                    ahead = pool.submit(stripe, stop)
                if stop % (STRIPES_AT_HAND * TILE) == 0:
                    heads.forget()
                tell(files.exposure, min(stop, shape[0]), shape[0])
                yield done

    path, preview = _places(folder, files.exposure)
    write(
        path,
        stripes(),
        shape,
        {**about, **_about_cameras(orientation, synthetic, files, response)},
        pixel_mm=synthetic.pixel_mm,
        dtype=dtype.name,
        colour=bands >= 3 and not is_stack,
    )
    write_preview(preview, path)


def _places(folder: Path, exposure: str) -> tuple[Path, Path]:
    """Return the paths of an exposure's image and of its preview."""
    return folder / f"{file_stem(exposure)}.tif", folder / f"{file_stem(exposure)}_preview.jpg"


def _about(
    rig: SyntheticRig, files: HeadFiles, blend: Blend, sources: Sequence[HeadFiles]
) -> dict[str, Any]:
    """Return the origin of an image, with a checksum of all that it depends on."""
    about = {
        "exposure": files.exposure,
        "flight": rig.flight.name,
        "orientation": rig.source,
        "tables": rig.tables,
        "blend": blend,
        "response_from": [source.exposure for source in sources],
        "software": f"acx4lib {importlib.metadata.version('acx4lib')}",
    }
    orientation = rig.orientation
    cameras = [
        [c.name, c.width_px, c.height_px, c.pixel_mm, asdict(c.interior)]
        for c in (rig.synthetic, *orientation.heads)
    ]
    poses = [orientation.xyz_mm.tolist(), orientation.opk.tolist()]
    prints = [[*map(fingerprint, source.paths)] for source in (*sources, files)]
    depends = json.dumps([about, cameras, poses, prints])
    return {**about, "input": hashlib.sha256(depends.encode()).hexdigest()}


def _about_cameras(
    orientation: RelativeOrientation,
    synthetic: Camera,
    files: HeadFiles,
    response: Response | None,
) -> dict[str, Any]:
    """Return the geometry of an image and of its heads, and their responses."""
    return {
        "frame": FRAME,
        "f_mm": orientation.heads[0].interior.f,  # Xc, Yc, Zc refer to it
        "xp_mm": 0.0,
        "yp_mm": 0.0,
        "pixel_mm": synthetic.pixel_mm,
        "width_px": synthetic.width_px,
        "height_px": synthetic.height_px,
        "camera": synthetic.name,
        "mount_opk_deg": np.degrees(synthetic.T_b_c.opk).tolist(),
        "heads_frame": HEADS_FRAME,
        "heads": [
            {
                "camera": camera.name,
                "file": path.name,
                "bytes": path.stat().st_size,
                "width_px": camera.width_px,
                "height_px": camera.height_px,
                "pixel_mm": camera.pixel_mm,
                "interior": asdict(camera.interior),
                "Xc_Yc_Zc_mm": orientation.xyz_mm[k].tolist(),
                "omega_phi_kappa_deg": np.degrees(orientation.opk[k]).tolist(),
                "response": None if response is None else response.coefficients[k].tolist(),
            }
            for k, (camera, path) in enumerate(zip(orientation.heads, files.paths, strict=True))
        ],
    }


def _is_made(folder: Path, exposure: str, about: Mapping[str, Any]) -> bool:
    path, preview = _places(folder, exposure)
    exists = path.is_file() and preview.is_file()
    return exists and read_about(path).get("input") == about["input"]


def _list(rig: SyntheticRig, folder: Path, exposures: Sequence[str]) -> None:
    """Add images to their folder's table, sorted by their names."""
    if not exposures:
        return
    path = folder / IMAGES
    known = pd.read_csv(path, dtype=str, keep_default_na=False) if path.is_file() else None
    new = [(name, rig.synthetic.name, name, _places(folder, name)[0].name) for name in exposures]
    table = pd.concat([known, pd.DataFrame(new, columns=_HEADER)])[_HEADER]
    table = table.drop_duplicates("exposure", keep="last").sort_values("exposure")
    table = table[[(folder / name).is_file() for name in table["file"]]]
    whole_files.write(path, table.to_csv(index=False, lineterminator="\n"))
