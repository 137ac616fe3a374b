"""Solutions of the exercises: each found in two ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4book.chapters.beyond.error_budget.examined import BARE, HEIGHT_M, PAPERS, Examined
from acx4book.notebooks.solution import Solution
from acx4book.paper import printed
from acx4lib.calibration.estimates import given
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.georeferencing import budget, direct
from acx4lib.georeferencing.mapping_flight import MappingFlight, fly, over_ground, spacing


def _part(variance: Array, source: str) -> Array:
    part: Array = variance[..., budget.SOURCES.index(source)]
    return part


def _bare(found: Examined) -> Camera:
    """Return the camera without mounting and distortion: the normal case."""
    camera = found.calibrations[PAPERS].cameras[0]
    return Camera(
        name=camera.name,
        width_px=camera.width_px,
        height_px=camera.height_px,
        pixel_mm=camera.pixel_mm,
        interior=Interior(f=camera.interior.f),
    )


def _between(camera: Camera, flight: MappingFlight) -> Array:
    """Return the variance of the point below the middle of a base, shape (3, n_sources)."""
    block = fly(camera, flight)
    at = np.array([[spacing(camera, flight)[0] / 2, 0.0, 0.0]])
    g = direct.georeference(block, given([camera]))
    return budget.predict(block, g, at, sigma_px=flight.sigma_px).variance[0]


def roll_of_half_a_pixel(found: Examined) -> Solution:
    """Return the standard deviation of roll that harms as half a pixel does, degrees."""
    camera = _bare(found)
    angle = 0.5 * camera.pixel_mm / camera.interior.f
    flight = replace(found.mapping(), sigma_px=0.5, sigma_attitude=(angle, 0.0, 0.0))
    variance = _between(camera, flight)[1]
    same = float(np.sqrt(_part(variance, "roll") / _part(variance, "image points")))
    degrees = float(np.degrees(angle))
    paper = printed.statement("roll_pitch_deg")
    return Solution(
        text=(
            f"Half a pixel $p$ is {0.5 * camera.pixel_mm * 1000:.1f} µm in the image, and seen "
            f"from the projection centre $0.5\\,p / f$ = {degrees:.4f}°, at any flying height. "
            f"The paper's {paper:g}° harm as much as {0.5 * paper / degrees:.1f} px."
        ),
        value=degrees,
        again=degrees * same,
    )


def more_overlap(found: Examined) -> Solution:
    """Return σ of a height from image points at 75 % of overlap over that at 60 %."""
    camera, flight = _bare(found), found.mapping()
    sigma = []
    for forward in (0.6, 0.75):
        height = _between(camera, replace(flight, forward=forward))[2]
        sigma.append(float(np.sqrt(_part(height, "image points"))))
    # sigma_Z = (H / f) s H / sqrt(sum of x^2), x the images' distances from their middle
    few, many = (np.array(x) for x in ([-0.2, 0.2], [-0.375, -0.125, 0.125, 0.375]))
    ratio = sigma[1] / sigma[0]
    return Solution(
        text=(
            "Let $s$ be the standard deviation of an image point and $x$ the distance of an image "
            "from the middle of all: $\\sigma_Z = (H / f)\\,s\\,H / \\sqrt{\\sum x^2}$. With 60 % "
            "of overlap the point is in two images, 0.2 $L$ to both sides, where $L$ is the length "
            "of a footprint; with 75 % it is in four, at 0.125 $L$ and 0.375 $L$. "
            f"σ of its height falls to {ratio:.2f} of what it was: neighbours are nearer to each "
            "other, but the outer rays are further apart."
        ),
        value=ratio,
        again=float(np.sqrt(np.sum(few**2) / np.sum(many**2))),
    )


def harmless_height(found: Examined) -> Solution:
    """Return the flying height at which the two-step calibration harms heights least, m."""
    calibration = found.calibrations[BARE]
    f, z = calibration.layout.interior[0, 0], calibration.layout.mount[0, 2]
    focal = calibration.cameras[0].interior.f
    least = float(focal * calibration.cov[f, z] / calibration.cov[f, f])
    heights = np.arange(800.0, 1401.0, 25.0)
    parts = [
        over_ground(calibration, found.mapping(h), n=4).mean[2, -len(budget.CALIBRATION) :].sum()
        for h in heights
    ]
    return Solution(
        text=(
            "$\\mathrm{d}Z = -(H / f)\\,\\mathrm{d}f + \\mathrm{d}z$ has the variance "
            "$(H / f)^2 \\sigma_f^2 - 2\\,(H / f)\\,\\sigma_{fz} + \\sigma_z^2$. Its derivative is "
            f"zero at $H = f \\sigma_{{fz}} / \\sigma_f^2$ = {least:.0f} m. That lies between the "
            "heights of the calibration, 1000 and 1500 m: there the focal length and the lever "
            "arm were determined together."
        ),
        value=least,
        again=float(heights[int(np.argmin(parts))]),
    )


def a_fifth_better(found: Examined) -> Solution:
    """Return by what factor image points must improve to lower the RMS in height by a fifth."""
    calibration, flight = found.calibrations[PAPERS], found.mapping(HEIGHT_M)
    before = over_ground(calibration, flight)
    height = before.mean[2]
    share = float(_part(height, "image points") / height.sum())
    pitch = float(_part(height, "pitch") / height.sum())
    factor = float(np.sqrt(1 - 0.36 / share))
    after = over_ground(calibration, replace(flight, sigma_px=factor * flight.sigma_px))
    return Solution(
        text=(
            f"An RMS of 0.8 leaves 64 % of the variance, so that 36 % has to go. Only the image "
            f"points have as much ({100 * share:.0f} %); pitch, the second, has "
            f"{100 * pitch:.0f} %. Their σ must fall to {factor:.2f} of what it is, from "
            f"{flight.sigma_px:.2f} to {factor * flight.sigma_px:.2f} px: signalised targets."
        ),
        value=0.8,
        again=float(after.rms[2] / before.rms[2]),
    )
