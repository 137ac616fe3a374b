"""One synthetic image: from the files of its heads to its own file."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acx4files.images.head_images import HeadFiles, HeadImages, read_heads
from acx4files.images.image_files import fingerprint
from acx4files.images.tiff import COMPRESSIONS, TILE, Format, write, write_preview
from acx4lib import expected
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError, FlightError, OutputError
from acx4lib.expected import Raster
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.rendering import (
    FEATHER_PX,
    Interpolation,
    RenderPlan,
    render_into,
    render_plan,
    render_rows,
)
from acx4lib.synthetic_image.response import (
    Response,
    ResponseFit,
    Samples,
    estimate_response,
    fit_response,
    overlap_samples,
)
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.search import check_overlaps, find_ties

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
    "that of its corner, not beyond the limits in response_reach; response has g, a, b of every "
    "band."
)

STACK = "stack"
"""The blend of heads whose fields coincide and whose bands differ: none; each has its own bands."""

CHOICES: Mapping[str, tuple[str, ...]] = {
    "blend": ("feather", "seam", STACK),
    "interpolation": ("bilinear", "cubic"),
    "equalise": ("flight", "image", "none"),
    "refine": ("flight", "image"),
    "compression": COMPRESSIONS,
}
"""Allowed values of `RenderOptions`."""


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """Options for the rendering of synthetic images.

    Attributes
    ----------
    blend : {"feather", "seam", "stack"}
        Whether heads are blended along the lines of equal distance from their borders, or cut, or
        are bands of the image, one head after the other.
    feather_px : float
        Width of the blending, px of a head at full size.
    interpolation : {"bilinear", "cubic"}
    equalise : {"flight", "image", "none"}
        Whether responses of the heads are estimated once, for every image, or not at all; a stack
        has none.
    refine : {"flight", "image"}
        Orientation of the heads: from the results, or refined by the tie points of each image.
    compression : str
        One of `tiff.COMPRESSIONS`.
    """

    blend: str = "feather"
    feather_px: float = FEATHER_PX
    interpolation: Interpolation = "bilinear"
    equalise: str = "flight"
    refine: str = "flight"
    compression: str = "none"

    def __post_init__(self) -> None:
        for name, known in CHOICES.items():
            if getattr(self, name) not in known:
                msg = f"{name} {getattr(self, name)!r}: must be one of {', '.join(known)}"
                raise ValueError(msg)
        expected.positive("feather_px", self.feather_px, zero=True)
        if self.blend == STACK and self.equalise != "none":
            msg = f"equalise {self.equalise!r}: bands of a stack are not equalised; must be none"
            raise ValueError(msg)


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderJob:
    """Input, options and output files of one synthetic image.

    Attributes
    ----------
    exposure : str
    files : tuple of Path
        Image files of the heads.
    orientation : RelativeOrientation
        At full size.
    synthetic : Camera
        At full size.
    options : RenderOptions
    response : Response or None
        Response of the flight; None where there is none, or none is wanted.
    path, preview : Path
        Files to write.
    about : dict
        Further entries for the description in the image.
    checked : bool
        Whether its pictures are known to belong together.
    threads : int or None
        Number of threads; None for all.
    """

    exposure: str
    files: tuple[Path, ...]
    orientation: RelativeOrientation
    synthetic: Camera
    options: RenderOptions
    response: Response | None
    path: Path
    preview: Path
    about: Mapping[str, Any]
    checked: bool = False
    threads: int | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome for one synthetic image.

    Attributes
    ----------
    exposure : str
    problems : tuple of str
        Reasons why it was not made; empty if it was.
    notes : tuple of str
        Remarks for the user.
    """

    exposure: str
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def render_exposure(job: RenderJob, tell: TellRows) -> Outcome:
    """Render one exposure and its preview to their files.

    Returns
    -------
    Outcome
        With the problems of files, pixels or disk; if there are any, nothing is written.
    """
    try:
        heads = read_heads(job.files, job.orientation.heads)
        return _render(_reduced(job, heads.reduction), heads, tell)
    except FlightError as error:
        return Outcome(exposure=job.exposure, problems=error.problems)
    except OutputError as error:
        return Outcome(exposure=job.exposure, problems=(str(error),))
    except OSError as error:
        reason = error.strerror or str(error)
        problem = f"{job.path}: cannot be written ({reason})"
        return Outcome(exposure=job.exposure, problems=(problem,))


def _reduced(job: RenderJob, k: int) -> RenderJob:
    """Return a job with cameras at 1/k of the size, the size of its images."""
    return replace(
        job,
        orientation=reduced_heads(job.orientation, k),
        synthetic=reduced_camera(job.synthetic, k),
        options=replace(job.options, feather_px=job.options.feather_px / k),
    )


def _render(job: RenderJob, heads: HeadImages, tell: TellRows) -> Outcome:
    """Check, refine, equalise and write an image; cameras and images have the same size."""
    if not job.checked:
        wrong = check_overlaps(heads.images, job.orientation, job.synthetic)
        if wrong:
            return Outcome(exposure=job.exposure, problems=tuple(wrong))
    _need_room(job, heads)
    job, notes = _refined(job, heads)
    job = replace(job, response=_response(job, heads))
    feather = job.options.feather_px if job.options.blend == "feather" else 0.0
    plan = render_plan(
        job.orientation,
        job.synthetic,
        response=job.response,
        feather_px=feather,
        interpolation=job.options.interpolation,
    )
    write(
        job.path,
        _stripes(job, plan, heads, tell),
        _format(job, heads),
        _about(job, notes),
        threads=job.threads,
    )
    heads.forget()
    write_preview(job.preview, job.path)
    return Outcome(exposure=job.exposure, notes=(*notes, *_size_note(job, heads)))


def _size_note(job: RenderJob, heads: HeadImages) -> Iterator[str]:
    if heads.reduction > 1:
        size = f"{job.synthetic.width_px} x {job.synthetic.height_px} px"
        yield f"head images at 1/{heads.reduction} of the size, so the synthetic image has {size}"


def _refined(job: RenderJob, heads: HeadImages) -> tuple[RenderJob, tuple[str, ...]]:
    """Return the job, its heads refined by this image's tie points if this is requested."""
    if job.options.refine == "flight":
        return job, ()
    ties = find_ties(heads.images, job.orientation, job.synthetic)
    notes = tuple(ties.sentences)
    try:
        refined = refine_by_rotations(job.orientation, ties.ties)
    except AdjustmentError as error:
        return job, (*notes, f"not refined by its own tie points: {error}")
    notes = (*notes, refined.sentence) if refined.sentence else notes
    if refined.unreached:
        notes = (*notes, f"without tie points, as they were: {', '.join(refined.unreached)}")
    return replace(job, orientation=refined.orientation), notes


def _response(job: RenderJob, heads: HeadImages) -> Response | None:
    """Return the flight's response if it has the same bands, otherwise this image's own."""
    if job.options.equalise == "none":
        return None
    bands = heads.images[0].shape[2]
    if job.response is not None and job.response.coefficients.shape[1] == bands:
        return job.response
    rng = np.random.default_rng(SEED)
    return estimate_response(heads.images, job.orientation, job.synthetic, rng=rng).response


def _stripes(
    job: RenderJob, plan: RenderPlan, heads: HeadImages, tell: TellRows
) -> Iterator[Raster]:
    fill = stacked if job.options.blend == STACK else blended
    form = _format(job, heads)
    return stripes(
        fill(plan, heads.images, job.threads),
        (form.height, form.width, form.bands),
        heads.images[0].dtype,
        partial(tell, job.exposure),
    )


def _format(job: RenderJob, heads: HeadImages) -> Format:
    stack = job.options.blend == STACK
    return Format(
        height=job.synthetic.height_px,
        width=job.synthetic.width_px,
        bands=heads.images[0].shape[2] * (len(heads.images) if stack else 1),
        stack=stack,
        dtype=heads.images[0].dtype.name,
        pixel_mm=job.synthetic.pixel_mm,
        compression=job.options.compression,
    )


def _need_room(job: RenderJob, heads: HeadImages) -> None:
    """Raise where the disk has no room for the result, before hours of work."""
    form = _format(job, heads)
    needs = 5 / 3 * form.height * form.width * form.bands * heads.images[0].dtype.itemsize
    free = shutil.disk_usage(job.path.parent).free
    if form.compression == "none" and free < needs:
        problem = (
            f"{job.path}: needs {needs / 1e9:.2g} GB while it is made, {free / 1e9:.2g} are free"
        )
        raise FlightError([problem])


def _about(job: RenderJob, notes: Sequence[str]) -> dict[str, Any]:
    """Return the description in the image."""
    camera = job.synthetic
    return {
        "exposure": job.exposure,
        "frame": FRAME,
        "f_mm": job.orientation.heads[0].interior.f,  # Xc, Yc, Zc refer to it
        "xp_mm": 0.0,
        "yp_mm": 0.0,
        "pixel_mm": camera.pixel_mm,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "camera": camera.name,
        "mount_opk_deg": np.degrees(camera.T_b_c.opk).tolist(),
        "options": asdict(job.options),
        "heads_frame": HEADS_FRAME,
        "heads": [_about_head(job, k) for k in range(len(job.files))],
        "notes": list(notes),
        **job.about,
    }


def _about_head(job: RenderJob, k: int) -> dict[str, Any]:
    camera, path = job.orientation.heads[k], job.files[k]
    response = None if job.response is None else job.response.coefficients[k].tolist()
    valid_range = None if job.response is None else _valid_range(job.response, k)
    return {
        "camera": camera.name,
        "file": path.name,
        "bytes": path.stat().st_size,
        "fingerprint": fingerprint(path),
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "pixel_mm": camera.pixel_mm,
        "interior": asdict(camera.interior),
        "Xc_Yc_Zc_mm": job.orientation.xyz_mm[k].tolist(),
        "omega_phi_kappa_deg": np.degrees(job.orientation.opk[k]).tolist(),
        "response": response,
        "response_reach": valid_range,
    }


def _valid_range(response: Response, k: int) -> list[float | None]:
    """Return the valid range of q of a head; None for infinity, which JSON lacks."""
    limits = [] if response.valid_range is None else response.valid_range[k].tolist()
    return [limit if np.isfinite(limit) else None for limit in limits]


# --- A synthetic image in stripes, from top to bottom: heads blended, or stacked as its bands


TellRows = Callable[[str, int, int], None]
"""It is called with the exposure, the number of finished rows and the number of all rows."""

Fill = Callable[[Raster, int], Any]
"""Fills an array with rows of the image from a given row on."""


def blended(plan: RenderPlan, images: Sequence[Raster], threads: int | None) -> Fill:
    """Return a function that fills stripes with the blended image of all heads."""
    return lambda out, start: render_into(out, plan, images, start, threads)


def stacked(plan: RenderPlan, images: Sequence[Raster], threads: int | None) -> Fill:
    """Return a function that fills stripes with the bands of all heads, head after head."""
    head_plans = [replace(plan, maps=(head,), feather_px=0.0) for head in plan.maps]

    def fill(out: Raster, start: int) -> None:
        stop = start + len(out)
        parts = (
            render_rows(head_plan, [image], start, stop, threads=threads)
            for head_plan, image in zip(head_plans, images, strict=True)
        )
        np.concatenate(list(parts), axis=2, out=out)

    return fill


def stripes(
    fill: Fill, shape: tuple[int, int, int], dtype: np.dtype, tell: Callable[[int, int], None]
) -> Iterator[Raster]:
    """Yield the image in stripes from the top; the next is rendered while one is written.

    A stripe is overwritten after the next one. Rendering runs in a thread of its own, which
    signals do not interrupt.

    Parameters
    ----------
    fill : callable
    shape : tuple of int
        Rows, columns and bands of the image.
    dtype : dtype
    tell : callable
        Called with the number of finished rows and of all.
    """
    rows = shape[0]
    rooms = np.empty((2, TILE, *shape[1:]), dtype)

    def stripe(start: int) -> Raster:
        out = rooms[start // TILE % 2, : rows - start]
        fill(out, start)
        return out

    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(stripe, 0)
        for start in range(TILE, rows + TILE, TILE):
            done = ahead.result()
            if start < rows:
                ahead = pool.submit(stripe, start)
            yield done
            tell(min(start, rows), rows)


# --- One response of a flight's heads from a few exposures, so that neighbouring images agree


EXPOSURES = 3
"""Number of exposures, spread over the flight, from which the response is estimated."""

SEED = 4
"""Seed of the positions where grey values are compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightResponse:
    """The response of a flight's heads, and the exposures from which it was estimated.

    Attributes
    ----------
    fit : ResponseFit
    exposures : tuple of str
        Exposures with good files.
    """

    fit: ResponseFit
    exposures: tuple[str, ...]

    def __str__(self) -> str:
        """Return a sentence on its exposures, and on differences of heads before and after."""
        before, after = (
            100 * np.nanmax([0.0, *(v for o in self.fit.overlaps for v in getattr(o, name))])
            for name in ("before", "after")
        )  # NaN for an overlap that is completely dark or saturated
        return (
            f"response of the heads from {', '.join(self.exposures)}: overlaps disagree by at most "
            f"{before:.1f} % before and {after:.1f} % after"
        )


def spread(files: Sequence[HeadFiles]) -> list[HeadFiles]:
    """Return up to `EXPOSURES` of a flight's exposures, evenly spread from first to last."""
    indices = np.linspace(0, len(files) - 1, min(len(files), EXPOSURES)).round().astype(int)
    return [files[i] for i in indices]


def estimate_flight_response(
    files: Sequence[HeadFiles], orientation: RelativeOrientation, synthetic: Camera
) -> FlightResponse | None:
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
    FlightResponse or None
        None where no exposure is good, or no two heads overlap.
    """
    rng = np.random.default_rng(SEED)
    samples: list[Samples] = []
    used: list[str] = []
    n_bands = 0
    for exposure in files:
        exposure_samples = _samples(exposure, orientation, synthetic, rng)
        bands = exposure_samples[0].log_ratio.shape[1] if exposure_samples else 0
        if exposure_samples and bands == (n_bands or bands):
            samples += exposure_samples
            used.append(exposure.exposure)
            n_bands = bands
    if not samples:
        return None
    fit = fit_response(samples, n_heads=len(orientation.heads), n_bands=n_bands)
    return FlightResponse(fit=fit, exposures=tuple(used))


def _samples(
    files: HeadFiles,
    orientation: RelativeOrientation,
    synthetic: Camera,
    rng: np.random.Generator,
) -> list[Samples]:
    """Return the samples of one exposure; empty where its files are not good."""
    try:
        heads = read_heads(files.paths, orientation.heads)
    except FlightError:
        return []  # the problem is reported when this exposure is rendered
    reduced = reduced_heads(orientation, heads.reduction)
    camera = reduced_camera(synthetic, heads.reduction)
    if check_overlaps(heads.images, reduced, camera):
        return []
    return overlap_samples(heads.images, reduced, camera, rng=rng)
