"""The image and its distortion: axes, principal point and corners; the distortion by radius."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from acx4book.report.material import Material
from acx4book.report.parameters.lens import (
    Balanced,
    Lens,
    balanced,
    decentring,
    lenses,
    radial,
    radial_sigma,
)
from acx4book.report.shown import Text, show, table
from acx4book.report.words import listed
from acx4book.typesetting import sketch, style
from acx4book.typesetting.labels import value_and_sigma
from acx4lib.geometry.camera import Camera, xy_from_colrow

UM = 1000.0
"""Micrometres in a millimetre."""

SMALLEST_LEVEL = 0.2
"""Cosine of the slope of the body's x axis against the image below which it is not drawn."""


def section(material: Material) -> Text:
    """Return the section on the distortion and the corners of the images."""
    found = shown_lenses(material)
    told = "the estimated coefficients, eqs (7) to (11); σ from their covariance matrix"
    return show(
        table(balanced_table(found), BALANCED, name="tab-report-balanced", obtained=FROM_RADIAL),
        table(distortion_table(material), DISTORTION, name="tab-report-distortion", obtained=told),
        table(corner_table(material), CORNERS, name="tab-report-corners", obtained=FORMAT),
    )


BALANCED = "Calibrated and balanced focal lengths"
FROM_RADIAL = "the radial coefficients and the focal length, up to the farthest corner of the image"
DISTORTION = "Lens distortion by the distance from the principal point"
CORNERS = "Corners of the images: centres of the corner pixels"
FORMAT = "the numbers of pixels and their size, as flight.toml states them"


def balanced_table(found: Sequence[Lens]) -> pd.DataFrame:
    """Return the calibrated and the balanced focal length of every lens."""
    rows = [
        {
            "Camera": lens.camera.name,
            "Focal length (mm)": _length(lens.interior.f, np.sqrt(lens.cov[0, 0])),
            "Balanced (mm)": _length(balance.f, balance.sigma),
            "Radial, balanced (µm)": f"within ±{UM * balance.largest:.1f}",
            "Farthest corner (mm)": f"{lens.radius:.2f}",
        }
        for lens, balance in ((lens, balanced(lens)) for lens in found)
    ]
    return pd.DataFrame(rows)


def _length(value: float, sigma: float) -> str:
    return value_and_sigma(value, sigma) if sigma > 0 else f"{value:g} held"


def shown_lenses(material: Material) -> list[Lens]:
    """Return the lenses of the calibration, and those of the heads that were calibrated alone."""
    methods = [material.calibration] if material.calibration else []
    if any(name.startswith("heads/bundle") for name in material.adjustments):
        methods.append("heads/bundle")
    return [lens for method in methods for lens in lenses(material, method)]


def profile(lens: Lens) -> pd.DataFrame:
    """Return the distortion at round distances from the principal point, and at the last one.

    Returns
    -------
    DataFrame
        radius_mm, angle_deg, radial_um and its sigma_um, balanced_um (radial, with respect to the
        balanced focal length), decentring_um.
    """
    step = style.round_length(lens.radius / 4)
    at = np.append(np.arange(step, lens.radius - step / 4, step), lens.radius)
    return profile_at(lens, balanced(lens), at)


def profile_at(lens: Lens, balance: Balanced, radius: np.ndarray) -> pd.DataFrame:
    """Return the distortion at distances from the principal point, mm, as `profile` does."""
    d, scale = radial(lens.interior, radius), balance.f / lens.interior.f
    return pd.DataFrame(
        {
            "radius_mm": radius,
            "angle_deg": np.degrees(np.arctan((radius - d) / lens.interior.f)),
            "radial_um": UM * d,
            "sigma_um": UM * radial_sigma(lens, radius),
            "balanced_um": UM * scale * (d - balance.slope * radius),
            "decentring_um": UM * decentring(lens.interior, radius),
        }
    )


def distortion_table(material: Material) -> pd.DataFrame:
    """Return the distortion of every lens at round distances from the principal point."""
    found = shown_lenses(material)
    rows = [
        {
            **({"Camera": lens.camera.name} if len(found) > 1 else {}),
            "Distance (mm)": f"{row['radius_mm']:.4g}",
            "Field angle (°)": f"{row['angle_deg']:.1f}",
            "Radial (µm)": value_and_sigma(row["radial_um"], row["sigma_um"]),
            "Radial, balanced (µm)": f"{row['balanced_um']:+.1f}",
            "Decentring (µm)": f"{row['decentring_um']:.1f}",
        }
        for lens in found
        for row in profile(lens).to_dict("records")
    ]
    return pd.DataFrame(rows)


def corners(camera: Camera) -> np.ndarray:
    """Return the pixel coordinates of the centres of the four corner pixels, shape (4, 2)."""
    col, row = camera.width_px - 1, camera.height_px - 1
    return np.array([[0, 0], [col, 0], [col, row], [0, row]], dtype=float)


def corner_table(material: Material) -> pd.DataFrame:
    """Return pixel and image coordinates of the corners of every camera."""
    cameras = [lens.camera for lens in shown_lenses(material)]
    alike: dict[tuple[float, ...], list[Camera]] = {}
    for camera in cameras:
        size = (camera.width_px, camera.height_px, camera.pixel_mm)
        alike.setdefault(size, []).append(camera)
    rows = [
        {
            "Camera": listed([camera.name for camera in same]),
            "Corner": corner,
            "Column (px)": f"{col:g}",
            "Row (px)": f"{row:g}",
            "x (mm)": f"{x:+.4f}",
            "y (mm)": f"{y:+.4f}",
        }
        for same in alike.values()
        for corner, (col, row), (x, y) in zip(
            ("upper left", "upper right", "lower right", "lower left"),
            corners(same[0]),
            xy_from_colrow(same[0], corners(same[0])),
            strict=True,
        )
    ]
    return pd.DataFrame(rows)


def image_figure(material: Material) -> Figure:
    """Draw every image with its axes, and the radial distortion of all lenses."""
    found = shown_lenses(material)
    if not found:
        return style.nothing("No interior orientation was calibrated.")
    n = len(found)
    columns = min(n, 3)
    rows = -(-n // columns)
    with style.applied():
        beside = n == 1
        size = (style.WIDTH, 2.9) if beside else (style.WIDTH, 1.9 * rows + 2.4)
        fig = style.figure(figsize=size)
        parts = fig.add_gridspec(1, 2) if beside else fig.add_gridspec(rows + 1, columns)
        for i, lens in enumerate(found):
            _axes_of_image(fig.add_subplot(parts[divmod(i, columns)]), lens)
        _curves(fig.add_subplot(parts[0, 1] if beside else parts[rows, :]), found)
        if n > 1:
            style.legend_below(fig, fig.axes[-1].get_legend_handles_labels()[0])
    return fig


def _axes_of_image(ax: Axes, lens: Lens) -> None:
    """Draw the format of an image with its axes, pixel axes, principal point and direction."""
    camera = lens.camera
    width, height = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    style.bare(ax)
    ax.set(xticks=[], yticks=[], aspect="equal", title=style.plain(camera.name))
    ax.set(xlim=(-0.72 * width, 0.72 * width), ylim=(-0.66 * height, 0.66 * height))
    low, fill = (-width / 2, -height / 2), style.SHEET
    ax.add_patch(Rectangle(low, width, height, facecolor=fill, edgecolor=style.EDGE))
    zero, reach = np.zeros(2), 0.3 * min(width, height)
    for tip, name, shift in (((reach, 0), "x", (8, 0)), ((0, reach), "y", (0, 8))):
        sketch.arrow(ax, zero, np.array(tip), sketch.CAMERA)
        sketch.note(ax, np.array(tip), name, sketch.CAMERA, shift=shift)
    corner = np.array([-width / 2, height / 2])
    for tip, name, shift in (((reach, 0), "col", (0, 8)), ((0, -reach), "row", (-13, 0))):
        sketch.arrow(ax, corner, corner + np.array(tip), style.SOFT, width=1.2)
        sketch.note(ax, corner + np.array(tip), name, style.SOFT, shift=shift)
    forward = camera.T_b_c.R[0, :2]
    level = float(np.hypot(*forward))
    if level > SMALLEST_LEVEL:
        start = np.array([0.22 * width, -0.3 * height])
        tip = start + 0.5 * reach * forward / level
        sketch.arrow(ax, start, tip, sketch.BODY)
        behind = -forward / level
        sketch.note(ax, start, "body x", sketch.BODY, shift=(21 * behind[0], 8 * behind[1]))
    ax.plot(lens.interior.xp, lens.interior.yp, "+", color=style.INK, ms=9, mew=1.2, zorder=7)


def _curves(ax: Axes, found: Sequence[Lens]) -> None:
    """Draw the radial distortion with both focal lengths, and its standard deviation."""
    for i, lens in enumerate(found):
        at = np.linspace(0.0, lens.radius, 101)
        told = profile_at(lens, balanced(lens), at)
        colour = style.colour(i)
        band = 3 * told["sigma_um"]
        ax.fill_between(
            at, told["radial_um"] - band, told["radial_um"] + band, color=colour, alpha=0.18, lw=0
        )
        ax.plot(at, told["radial_um"], color=colour, label=style.plain(lens.camera.name))
        ax.plot(at, told["balanced_um"], "--", color=colour, lw=1.2)
    ax.axhline(0, color=style.INK, lw=0.7)
    ax.set_xlabel("distance from the principal point (mm)")
    ax.set_ylabel("radial distortion (µm)")
