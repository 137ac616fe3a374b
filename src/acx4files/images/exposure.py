"""One synthetic image: from the files of its heads to its own file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4files.images.head_images import HeadFiles, HeadImages, read_heads
from acx4files.images.image_files import fingerprint
from acx4files.images.tiff import COMPRESSIONS, TILE, write, write_preview
from acx4lib import expected
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError, OutputError
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
    "that of its corner, not beyond the limits in response_reach; response has g, a, b of every "
    "band."
)

STACK = "stack"
"""The blend of heads whose fields coincide and whose bands differ: none; each has its own bands."""

STRIPES_AT_HAND = 8
"""Number of stripes after which the memory of mapped pixels is given back."""

TellRows = Callable[[str, int, int], None]
"""It is called with the exposure, the number of finished rows and the number of all rows."""

Fill = Callable[[Raster, int], Any]
"""Fills an array with rows of the image from a given row on."""


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
    equalise : {"flight", "none"}
        Whether responses of the heads are estimated once for the flight; a stack has none.
    compression : str
        One of `tiff.COMPRESSIONS`.
    """

    blend: str = "feather"
    feather_px: float = FEATHER_PX
    interpolation: Interpolation = "bilinear"
    equalise: str = "flight"
    compression: str = "none"

    def __post_init__(self) -> None:
        expected.one_of("blend", self.blend, ("feather", "seam", STACK))
        expected.one_of("interpolation", self.interpolation, ("bilinear", "cubic"))
        equalise = ("none",) if self.blend == STACK else ("flight", "none")
        expected.one_of("equalise", self.equalise, equalise)
        expected.one_of("compression", self.compression, tuple(COMPRESSIONS))
        expected.positive("feather_px", self.feather_px, zero=True)


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
    path, preview : Path
        Files to write.
    about : dict
        Further entries for the description in the image.
    response : Response or None
        Response of the flight; None where there is none, or none is wanted.
    threads : int or None
        Number of threads; None for all.
    """

    exposure: str
    files: tuple[Path, ...]
    orientation: RelativeOrientation
    synthetic: Camera
    options: RenderOptions
    path: Path
    preview: Path
    about: Mapping[str, Any]
    response: Response | None = None
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
        problems = error.problems
    except OutputError as error:
        problems = (str(error),)
    except OSError as error:
        problems = (f"{job.path}: cannot be written ({error.strerror or error})",)
    return Outcome(exposure=job.exposure, problems=problems)


def _reduced(job: RenderJob, k: int) -> RenderJob:
    """Return a job with cameras at 1/k of the size, the size of its images."""
    return replace(
        job,
        orientation=reduced_heads(job.orientation, k),
        synthetic=reduced_camera(job.synthetic, k),
        options=replace(job.options, feather_px=job.options.feather_px / k),
    )


def _render(job: RenderJob, heads: HeadImages, tell: TellRows) -> Outcome:
    """Equalise and write an image; cameras and images have the same size."""
    bands, dtype = heads.images[0].shape[2], heads.images[0].dtype
    if job.response is not None and job.response.coefficients.shape[1] != bands:
        others = f"{job.response.coefficients.shape[1]}; all must be alike"
        raise FlightError([f"{job.files[0]}: has {bands} bands, pictures before it have {others}"])
    stack = job.options.blend == STACK
    plan = render_plan(
        job.orientation,
        job.synthetic,
        response=job.response,
        feather_px=job.options.feather_px if job.options.blend == "feather" else 0.0,
        interpolation=job.options.interpolation,
    )
    fill = (stacked if stack else blended)(plan, heads.images, job.threads)
    shape = plan.height_px, plan.width_px, bands * (len(heads.images) if stack else 1)

    def told(done: int, rows: int) -> None:
        tell(job.exposure, done, rows)
        if done % (STRIPES_AT_HAND * TILE) == 0 or done == rows:
            heads.forget()

    write(
        job.path,
        stripes(fill, shape, dtype, told),
        shape,
        _about(job),
        pixel_mm=job.synthetic.pixel_mm,
        dtype=dtype.name,
        colour=bands >= 3 and not stack,
        compression=job.options.compression,
        threads=job.threads,
    )
    write_preview(job.preview, job.path)
    size = f"{plan.width_px} x {plan.height_px} px"
    note = f"head images at 1/{heads.reduction} of the size, so the synthetic image has {size}"
    return Outcome(exposure=job.exposure, notes=(note,) if heads.reduction > 1 else ())


def _about(job: RenderJob) -> dict[str, Any]:
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


def blended(plan: RenderPlan, images: Sequence[Raster], threads: int | None = None) -> Fill:
    """Return a function that fills stripes with the blended image of all heads."""
    return lambda out, start: render_into(out, plan, images, start, threads)


def stacked(plan: RenderPlan, images: Sequence[Raster], threads: int | None = None) -> Fill:
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
            tell(min(start, rows), rows)
            yield done


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
        try:
            heads = read_heads(exposure.paths, orientation.heads)
        except FlightError:
            continue  # the problem is reported when this exposure is rendered
        n_bands = n_bands or heads.images[0].shape[2]
        reduced = reduced_heads(orientation, heads.reduction)
        camera = reduced_camera(synthetic, heads.reduction)
        if heads.images[0].shape[2] != n_bands:
            continue
        if here := overlap_samples(heads.images, reduced, camera, rng=rng):
            samples += here
            used.append(exposure.exposure)
    if not samples:
        return None
    fit = fit_response(samples, n_heads=len(orientation.heads), n_bands=n_bands)
    return FlightResponse(fit=fit, exposures=tuple(used))
