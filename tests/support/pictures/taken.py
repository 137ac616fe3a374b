"""The printed heads and the synthetic camera, and small pictures of an exposure of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from scipy import ndimage

from acx4book.paper import printed
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy, xy_from_colrow
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk, turn
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads, synthetic_from_head


def printed_heads(names: Sequence[str] = printed.HEADS) -> RelativeOrientation:
    """Return heads of Table 1 as an orientation without errors."""
    width, height = (int(printed.statement(f"head_{side}_px")) for side in ("width", "height"))
    return RelativeOrientation(
        heads=tuple(
            Camera(
                name=name,
                width_px=width,
                height_px=height,
                pixel_mm=printed.pixel_mm(name),
                interior=printed.interior(1, name),
            )
            for name in names
        ),
        xyz_mm=np.stack([printed.centre_mm(name) for name in names]),
        opk=np.stack([printed.opk(name) for name in names]),
        cov_joint=np.zeros((16 * len(names), 16 * len(names))),
        n_exposures=1,
    )


def printed_synthetic() -> Camera:
    """Return the synthetic camera of Table 2, with the focal length of its heads."""
    return Camera(
        name="SYN",
        width_px=int(printed.value(2, "width_px", "SYN")),
        height_px=int(printed.value(2, "height_px", "SYN")),
        pixel_mm=printed.pixel_mm("SYN"),
        interior=Interior(f=printed.statement("head_f_fixed_mm")),
    )


# --- small pictures of an exposure whose geometry is known: a far-away plane with texture ------


def heads(k: int) -> RelativeOrientation:
    """Table 1 as printed, images reduced."""
    return reduced_heads(printed_heads(), k)


def synthetic(k: int) -> Camera:
    """Table 2, reduced."""
    return reduced_camera(printed_synthetic(), k)


def turned_heads(orientation, degrees, rng):
    """All heads but the first with errors of their three rotations."""
    opk = orientation.opk.copy()
    for k in range(1, len(opk)):
        R = rotation_from_opk(opk[k])
        for axis in range(3):
            R = R @ turn(axis, np.radians(degrees * rng.standard_normal()))
        opk[k] = opk_from_rotation(R)
    return replace(orientation, opk=opk)


def texture(n, rng, *, finest=0.3, contrast=1500.0, level=12000.0):
    """Fractal noise that continues over its borders; finest: cycles a pixel that remain."""
    r = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None])
    r[0, 0] = 1.0
    spectrum = np.fft.rfft2(rng.standard_normal((n, n))) * r**-1.2 * np.exp(-((r / finest) ** 4))
    values = np.fft.irfft2(spectrum, s=(n, n))
    return level + contrast * (values - values.mean()) / values.std()


def compressed(image, quality):
    """An 8-bit picture after a JPEG file, without its reduction of colours."""
    full = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    _, stream = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality, *full])
    return cv2.imdecode(stream, cv2.IMREAD_UNCHANGED).reshape(image.shape)


def pictures(orientation, camera, ground, rng, *, noise=0.5, bands=3, dtype=np.uint16):
    """What heads see of a plane: a gain and a vignetting of their own, noise, whole numbers."""
    filtered = ndimage.spline_filter(ground, mode="grid-wrap")
    out = []
    for k, head in enumerate(orientation.heads):
        colrow = np.stack(np.meshgrid(np.arange(head.width_px), np.arange(head.height_px)), -1)
        xy = synthetic_from_head(orientation, k, colrow.reshape(-1, 2).astype(float))
        col, row = colrow_from_xy(camera, xy).T
        seen = ndimage.map_coordinates(filtered, [row, col], mode="grid-wrap", prefilter=False)
        q = np.sum(xy_from_colrow(head, colrow.astype(float)) ** 2, axis=-1)
        seen = seen.reshape(colrow.shape[:2]) * (1 + 0.03 * k) * (1 - 0.2 * q / q.max())
        seen = np.repeat(seen[..., None], bands, axis=2)
        seen += noise * np.sqrt(np.maximum(seen, 1)) * rng.standard_normal(seen.shape)
        out.append(np.clip(np.rint(seen), 0, np.iinfo(dtype).max).astype(dtype))
    return out
