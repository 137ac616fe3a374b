"""Synthetic images made one after the other, or by the workers of an executor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import replace

from acx4lib.least_squares.processors import as_finished
from acx4lib.production.exposure import Outcome, RenderJob, render_exposure
from acx4lib.production.stripes import TellRows


def made(
    jobs: Sequence[RenderJob], executor: Executor | None, tell: TellRows
) -> Iterator[tuple[RenderJob, Outcome]]:
    """Yield every image with its outcome, as they are finished.

    Parameters
    ----------
    jobs : sequence of RenderJob
    executor : Executor or None
        Its workers must be able to read the files; without one, images are made here.
    tell : callable
        Called with exposure, rows finished and all rows; of an executor, for whole images.
    """
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
    """Return what a call returned; where it was lost with its worker, the image has a problem."""
    try:
        return call.result()
    except FileNotFoundError as error:
        problem = error.strerror or str(error)
        return Outcome(exposure=job.exposure, problems=(problem,))
    except Exception as error:  # the other images go on
        reason = " ".join(str(error).split()) or type(error).__name__
        problem = f"{reason}; short of memory? use fewer workers"
        return Outcome(exposure=job.exposure, problems=(problem,))
