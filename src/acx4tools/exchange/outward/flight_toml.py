"""Cameras as flight.toml declares them, for the next flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acx4lib.calibration.estimates import parameters
from acx4lib.expected import Array
from acx4lib.flight.settings import SIGMAS, camera_toml
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4tools.exchange.outward.calibrated import Calibrated
from acx4tools.exchange.outward.taken import Taken

FILE = "cameras.toml"

ASSUMED = (
    "the tables take the place of those of the same names in flight.toml of a new flight",
    "lever_sigma_m and mount_sigma_deg are comments: without # they make the mounting an "
    "observation of the next calibration",
)
NOT_MOUNTED = (
    "the mounting is not estimated: mount angles have the heads' rotations relative to each other"
)
FRAME = (
    "{} is a synthetic camera, whose mount angles in flight.toml also define the frame of its "
    "images: where images are rendered anew, keep the old angles"
)


def take(calibrated: Calibrated) -> Taken:
    """Return the tables ``[cameras.NAME]`` with calibrated values, sigma as comments."""
    return Taken(
        files={FILE: "\n".join(_tables(calibrated))},
        assumed=(*ASSUMED, *_remarks(calibrated)),
        left_out=("correlations: they are in covariance.csv of the results",),
    )


def _remarks(calibrated: Calibrated) -> Iterator[str]:
    synthetic = calibrated.flight.synthetic
    if not calibrated.mounted:
        yield NOT_MOUNTED
    elif synthetic is not None and synthetic.camera in [c.name for c in calibrated.cameras]:
        yield FRAME.format(synthetic.camera)


def _tables(calibrated: Calibrated) -> Iterator[str]:
    listed = parameters(calibrated.calibration)
    for k, camera in enumerate(calibrated.cameras):
        yield camera_toml(camera).rstrip("\n")
        if calibrated.mounted:
            for key, sigma in zip(SIGMAS, _mount_sigmas(calibrated, k), strict=True):
                yield f"# {key} = {sigma.tolist()}"
        own = [p for p in listed if p.camera == camera.name]
        yield from (f"# sigma of {p.name}: {p.sigma:.3g} {p.unit}" for p in own)
        yield ""


def _mount_sigmas(calibrated: Calibrated, k: int) -> tuple[Array, Array]:
    """Return sigma along and about the body's axes, m and degrees; rounded to four digits."""
    calibration = calibrated.calibration
    columns = calibration.layout.mount[k]
    J = np.zeros((6, calibration.n_columns + 1))  # the last column is of what is held
    J[:3, columns[:3]] = np.eye(3)
    J[3:, columns[3:]] = np.degrees(calibration.cameras[k].T_b_c.R)
    sigma = sigmas(propagate(J[:, :-1], calibration.cov))
    rounded = np.array([float(f"{one:.4g}") for one in sigma])
    return rounded[:3], rounded[3:]
