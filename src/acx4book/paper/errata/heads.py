"""Checks of the paper's first step: the four heads and Table 1."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acx4book.paper import printed as paper
from acx4book.typesetting.plain_text import shown
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import correct, distort, distortion
from acx4lib.geometry.frames import rotation_from_opk

SIGNS = {"xp_mm": "x_p", "yp_mm": "y_p", "omega_deg": "ω", "phi_deg": "φ", "kappa_deg": "κ"}
"""The paper's signs of parameters, by their names in results."""


def _ground_pixels_m(f: float) -> tuple[float, float]:
    """Compute the ground pixels of block 1, high and low, for a focal length in mm."""
    high, low = paper.statement("block_1_high_m"), paper.statement("block_1_low_m")
    pixel = paper.pixel_mm("CAM1")
    return pixel * high / f, pixel * low / f


def focal_lengths_of_heads() -> Array:
    """Compute the heads' focal lengths that Table 3's f and Table 1's Z_c mean, shape (4,), mm.

    The heads were held at one focal length F, and the frame of the synthetic image has camera 1
    at Z_c = F. A head that is longer than F by a factor comes to lie lower by it, and a frame
    with a camera 1 that is longer has a longer f: f_1 = f, f_k = f F / Z_c.
    """
    fixed = paper.statement("head_f_fixed_mm")
    z = np.array([paper.value(1, "Zc_mm", head) for head in paper.HEADS])
    f: Array = paper.value(3, "f_mm", "single_step") * fixed / z
    return f


def focal_length() -> tuple[str, str, str]:
    """Item 7: two nominal focal lengths."""
    nominal, fixed = paper.statement("head_f_nominal_mm"), paper.statement("head_f_fixed_mm")
    given = np.array([paper.statement(f"block_1_{level}_gsd_m") for level in ("high", "low")])
    texts, missed = [], []
    for f in (nominal, fixed):
        high, low = _ground_pixels_m(f)
        texts.append(f"{100 * high:.1f} and {100 * low:.1f} cm for {f:.0f} mm")
        missed.append(100 * np.abs(np.array([high, low]) - given).max())
    seen = focal_lengths_of_heads()
    return (
        f"lenses of {nominal:.0f} mm nominal (3.1), {fixed:.0f} mm fixed as the nominal value"
        f" (2.1, 4.1); ground pixels of block 1: {100 * given[0]:.0f} and"
        f" {100 * given[1]:.0f} cm (3.2)",
        "ground pixels of the heads: "
        + "; ".join(texts)
        + f". f = {paper.value(3, 'f_mm', 'single_step'):.2f} mm of the synthetic image and Z_c"
        " mean heads of " + ", ".join(f"{f:.2f}" for f in seen) + " mm",
        f"Two nominal values contradict each other. The ground pixels are nearer to {nominal:.0f}"
        f" mm, which misses them by at most {missed[0]:.1f} cm, {fixed:.0f} mm by"
        f" {missed[1]:.1f} cm; but they and the flying heights are rounded. Table 3 speaks for a"
        " longer lens than either: what is wrong with the fixed value comes back in f of the"
        " synthetic image.",
    )


def border_distortion_px() -> Array:
    """Compute k1 r^3 at the corner of each head, shape (4,), px."""
    k1 = np.array([paper.value(1, "k1", head) for head in paper.HEADS])
    px: Array = k1 * np.hypot(*paper.corners("CAM1")[0]) ** 3 / paper.pixel_mm("CAM1")
    return px


def total_distortion_px() -> Array:
    """Compute each head's distortion at its worst corner with all of Table 1, shape (4,), px."""
    dxy = [distortion(paper.interior(1, head), paper.corners(head)) for head in paper.HEADS]
    px: Array = np.linalg.norm(dxy, axis=-1).max(axis=1) / paper.pixel_mm("CAM1")
    return px


def border_distortion() -> tuple[str, str, str]:
    """Item 10: the distortion at the border of the heads."""
    radial, total = border_distortion_px(), total_distortion_px()
    return (
        f"at most about {paper.statement('head_border_distortion_px'):.0f} px at the border of"
        " each image",
        "k1 r³ at the corner: "
        + ", ".join(f"{value:.1f}" for value in radial)
        + " px; with decentring, at the worst corner: "
        + ", ".join(f"{value:.1f}" for value in total)
        + " px",
        "Consistent; it confirms the negative exponents of Table 1.",
    )


def missing_digit() -> tuple[str, str, str]:
    """Item 8: a principal point without its first digit."""
    cam3, cam4 = (paper.value(1, "xp_mm", head) for head in ("CAM3", "CAM4"))
    pixel = paper.pixel_mm("CAM3")
    return (
        f"x_p of CAM3 is {paper.printed(1, 'xp_mm', 'CAM3')} mm",
        f"{cam3:.4f} mm are {cam3 / pixel:.0f} px; CAM4 has {cam4:.4f} mm, {cam4 / pixel:.0f} px",
        "A leading 0 is missing and the size is plausible; whether a minus sign is missing too"
        " cannot be told from the text.",
    )


def correlations(largest: Mapping[str, float] | None) -> tuple[str, str, str]:
    """Item 11: correlations of interior with exterior orientation.

    Parameters
    ----------
    largest : mapping or None
        Largest absolute correlations of a run by the names of their pairs; None if not computed.
    """
    claim = paper.statement("max_correlation")
    printed = f"correlations between IOP and EOP below {100 * claim:.0f} %"
    if not largest:
        return printed, "not computed: needs the results of a run", "Open without a run."
    pairs = sorted(largest.items(), key=lambda pair: -abs(pair[1]))[:4]
    holds = abs(pairs[0][1]) < claim
    verdict = (
        "Holds in our run."
        if holds
        else "Cannot be the maximum for such a block; a mean or a median over all pairs may be"
        " meant, or exterior orientation that was constrained in a way the text does not tell."
    )
    return (
        printed,
        "largest: " + ", ".join(f"{v:.2f} ({_signs(name)})" for name, v in pairs),
        verdict,
    )


def _signs(pair: str) -> str:
    """Return the names of two parameters of a head as the paper writes them."""
    for name, sign in SIGNS.items():
        pair = pair.replace(name, sign)
    return shown(pair)


def _mean_phi_deg() -> float:
    """Compute the mean phi of the four heads: the tilt of their common plane, degrees."""
    return float(np.mean([paper.value(1, "phi_deg", head) for head in paper.HEADS]))


def reference_camera() -> tuple[str, str, str]:
    """Item 16: the reference camera is not aligned with itself."""
    phi = [paper.value(1, "phi_deg", head) for head in paper.HEADS]
    omega = paper.value(1, "omega_deg", "CAM1")
    boresight = paper.value(3, "boresight_phi_deg", "single_step")
    return (
        f"CAM1 is the reference camera, with ω = {omega:.2f}°, φ = {phi[0]:.2f}°",
        "φ of the four: "
        + ", ".join(f"{value:.1f}" for value in phi)
        + f"°, in the mean {_mean_phi_deg():.2f}°; boresight φ of the synthetic image"
        f" {boresight:.2f}°; sum {_mean_phi_deg() + boresight:.2f}°",
        "The angles are relative to the plane of the synthetic image, and CAM1 gives the scale"
        " only. That plane is tilted against the mean of the heads by about the boresight: the"
        " heads are nearly level with the IMU, the synthetic image is not.",
    )


def footprint(head: str) -> Array:
    """Project the corners of a head to the synthetic image plane with all of Table 1.

    Parameters
    ----------
    head : str
        One of `printed.HEADS`.

    Returns
    -------
    ndarray, shape (4, 2)
        mm. The angles of Table 1 are those of eq. (6) from the synthetic axes to the head's.
    """
    interior = paper.interior(1, head)
    ideal = correct(interior, paper.corners(head))
    rays = np.column_stack([ideal, np.full(4, -interior.f)]) @ rotation_from_opk(paper.opk(head)).T
    r_s_h = paper.centre_mm(head)
    xy: Array = r_s_h[:2] - rays[:, :2] * (r_s_h[2] / rays[:, 2])[:, None]
    return xy


def sees(head: str, xy: Array, R_s_h: Array) -> Mask:
    """Tell which points of the synthetic image lie on the sensor of a head with given axes.

    Parameters
    ----------
    head : str
    xy : ndarray, shape (n, 2)
        Synthetic image coordinates, mm.
    R_s_h : ndarray, shape (3, 3)

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    interior = paper.interior(1, head)
    x_h = (np.column_stack([xy, np.zeros(len(xy))]) - paper.centre_mm(head)) @ R_s_h
    ideal = -interior.f * x_h[:, :2] / x_h[:, 2:]
    half = paper.corners(head)[0]
    near = np.all(np.abs(ideal) < 1.1 * half, axis=1) & (x_h[:, 2] < 0)
    measured = distort(interior, np.where(near[:, None], ideal, 0.0))
    on_sensor: Mask = near & np.all(np.abs(measured) <= half, axis=1)
    return on_sensor


def uncovered() -> tuple[float, float]:
    """Compute the share of the synthetic image that no head sees.

    Returns
    -------
    as_read, transposed : float
        With the angles of Table 1 from the synthetic axes to the head's, and in the other
        direction.
    """
    half = paper.corners("SYN")[0]
    x, y = (np.linspace(-side, side, 121) for side in half)
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rotations = [(head, rotation_from_opk(paper.opk(head))) for head in paper.HEADS]
    as_read = np.any([sees(head, xy, R) for head, R in rotations], axis=0)
    transposed = np.any([sees(head, xy, R.T) for head, R in rotations], axis=0)
    return float(1 - as_read.mean()), float(1 - transposed.mean())


def coverage() -> tuple[str, str, str]:
    """Item 17: do the heads cover the synthetic image, and why is its pixel smaller."""
    feet = np.concatenate([footprint(head) for head in paper.HEADS])
    low, high = feet.min(axis=0), feet.max(axis=0)
    as_read, transposed = uncovered()
    width, height = 2 * paper.corners("SYN")[0]
    um, syn_um = paper.statement("head_pixel_um"), paper.value(2, "pixel_um", "SYN")
    return (
        f"synthetic image of {width:.2f} × {height:.2f} mm with {syn_um:g} µm pixels, heads with"
        f" {um:g} µm pixels",
        f"the heads reach x {low[0]:.1f} to {high[0]:.1f} mm, y {low[1]:.1f} to {high[1]:.1f} mm;"
        f" uncovered {100 * as_read:.0f} %, with transposed rotations {100 * transposed:.0f} %",
        "Consistent, and it tells which way Table 1's angles turn. Why the synthetic pixel is"
        " smaller than the heads' (slight oversampling) is not said.",
    )
