"""The calibrated parameters: image and lens, their tables and figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from acx4book.report.markdown import Text, heading, listed, parameter_title, show, table
from acx4book.report.material import Material
from acx4book.typesetting import maps, style
from acx4book.typesetting.myst import (
    LABELS,
    group_label,
    lacking,
    p_value,
    value_and_sigma,
    with_unit,
)
from acx4book.typesetting.plain_text import Markup, shown
from acx4files.results import folder
from acx4files.results.read_back import read_calibration
from acx4lib.calibration.estimates import METHODS, GroupTest, group_tests, undistorted
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, Interior, xy_from_colrow
from acx4lib.geometry.parameters import BORESIGHT_ANGLES, MOUNT, REPORTED
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation

# --- estimates beside what was declared, and how they hang together


STRONG = 0.9
"""Correlation above which two parameters can hardly be separated."""

SIGNIFICANCE = 0.05
"""Error probability of every test of the report, two-sided; divided among combined tests."""

FROM_DECLARED = ("f", *MOUNT)
"""Parameters compared with their declared values, since zero has no meaning for them.

Without sigma these are approximations, and a difference from them is no mistake; with sigma the
verdict tests them.
"""


@dataclass(frozen=True, kw_only=True)
class _Estimate:
    """One estimated parameter, its test, and its largest correlation: `rho`, with `strongest`."""

    camera: str
    parameter: str
    unit: str
    value: float
    sigma: float
    sigma_before: float
    reference: float
    t: float
    critical: float
    strongest: str
    rho: float

    @property
    def significant(self) -> bool | None:
        """Whether the estimate differs significantly from zero; None with a declared value."""
        declared = any(REPORTED[key][0] == self.parameter for key in FROM_DECLARED)
        return None if declared else abs(self.t) > self.critical


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two parameters, ``camera/parameter``, and their correlation."""

    one: str
    other: str
    rho: float


def _estimates(material: Material, stage_method: str) -> list[_Estimate]:
    """Return a method's parameters with their tests."""
    rows = folder.rows(material.found, "parameters", stage_method)
    related = correlations(material, stage_method)
    critical = statistics.t_ppf(1 - SIGNIFICANCE / 2, _redundancy(material, stage_method))
    return [
        _estimate(material, row, related=related, critical=critical) for _, row in rows.iterrows()
    ]


def _estimate(
    material: Material, row: pd.Series, *, related: pd.DataFrame, critical: float
) -> _Estimate:
    camera, name = str(row["camera"]), str(row["parameter"])
    value, sigma = float(row["value"]), float(row["sigma"])
    reference = _reference(material, camera, name)
    difference = value - reference
    if name in BORESIGHT_ANGLES:
        difference = (difference + 180.0) % 360.0 - 180.0
    strongest, rho = _strongest(related, f"{camera}/{name}" if camera else name)
    return _Estimate(
        camera=camera,
        parameter=name,
        unit=str(row["unit"]),
        value=value,
        sigma=sigma,
        sigma_before=float(row["sigma_before"]),
        reference=reference,
        t=difference / sigma if sigma > 0 else np.nan,
        critical=critical,
        strongest=strongest,
        rho=rho,
    )


def _reference(material: Material, camera: str, name: str) -> float:
    """Return the value against which a parameter is tested."""
    key = next((key for key, (reported, _) in REPORTED.items() if reported == name), "")
    return _declared(material, camera, key) if key in FROM_DECLARED else 0.0


def _declared(material: Material, name: str, key: str) -> float:
    camera = material.flight.cameras[name]
    if key in INTERIOR:
        return float(camera.interior.to_array()[INTERIOR.index(key)])
    mounting = np.concatenate([camera.T_b_c.r, np.degrees(camera.T_b_c.opk)])
    return float(mounting[MOUNT.index(key)]) + 0.0  # avoids minus zero


def _redundancy(material: Material, stage_method: str) -> int:
    """Return the smallest redundancy of a method's adjustments, but at least one."""
    redundancies = [
        int(str(material.found.summary[name]["redundancy"]))
        for name in material.adjustments
        if f"{name}/".startswith(f"{stage_method}/")
    ]
    return max(1, min(redundancies, default=1))


def _strongest(related: pd.DataFrame, label: str) -> tuple[str, float]:
    """Return the parameter most correlated with a given one, and the correlation."""
    if label not in related.index or len(related) < 2:
        return "", np.nan
    names = list(related.index)
    i = names.index(label)
    rho = related.to_numpy()[i].copy()
    rho[i] = 0.0
    k = int(np.argmax(np.abs(rho)))
    return str(names[k]), float(rho[k])


def correlations(material: Material, stage_method: str) -> pd.DataFrame:
    """Return the correlations of a method's parameters, named ``camera/parameter``."""
    cov = folder.covariance(material.found, stage_method)
    values = correlation(cov.to_numpy()) if len(cov) else np.zeros((0, 0))
    return pd.DataFrame(values, index=cov.index, columns=cov.index)


def strong_pairs(material: Material, stage_method: str) -> list[Pair]:
    """Return the pairs of parameters that correlate by more than `STRONG`, the largest first."""
    related = correlations(material, stage_method)
    values, names = related.to_numpy(), [str(name) for name in related.index]
    pairs = [
        Pair(one=names[i], other=names[j], rho=float(values[i, j]))
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True)
        if abs(values[i, j]) > STRONG
    ]
    return sorted(pairs, key=lambda pair: -abs(pair.rho))


def pair_texts(pairs: Sequence[Pair]) -> list[Markup]:
    """Return texts on pairs of parameters, with the cameras' names if there are several."""
    cameras = {name.rpartition("/")[0] for pair in pairs for name in (pair.one, pair.other)}
    return [_pair_text(pair, with_camera=len(cameras) > 1) for pair in pairs]


def _pair_text(pair: Pair, *, with_camera: bool) -> Markup:
    one, other = (shown(parameter_title(name)) for name in (pair.one, pair.other))
    first, last = (name.rpartition("/")[0] for name in (pair.one, pair.other))
    if with_camera and last:
        other = Markup(f"{other} of {shown(last)}")
    if with_camera and first and first != last:
        one = Markup(f"{one} of {shown(first)}")
    return Markup(f"{one} and {other} ({pair.rho:+.2f})")


def correlation_picture(material: Material) -> pd.DataFrame:
    """Return the correlations of the calibration, for `matrix.correlation_matrix`."""
    if not material.calibration:
        return pd.DataFrame()
    related = correlations(material, material.calibration)
    names = [str(name) for name in related.index]
    parts = [name.rpartition("/") for name in names]  # a parameter has no slash, a strip may have
    if len({camera for camera, _, _ in parts}) == 1 and all(name in LABELS for *_, name in parts):
        names = [name for *_, name in parts]
    return pd.DataFrame(related.to_numpy(), index=names, columns=names)


# --- sections


# --- The image and its distortion: axes, principal point and corners; the distortion by radius


UM = 1000.0
"""Micrometres in a millimetre."""

SMALLEST_LEVEL = 0.2
"""Smallest cosine between image plane and body's x axis for drawing the axis."""


def image_section(material: Material) -> Text:
    """Return the section on the distortion and the corners of the images."""
    shown_lenses = _shown_lenses(material)
    obtained = "the estimated coefficients, eqs (7) to (11); σ from their covariance matrix"
    return show(
        table(
            _balanced_table(shown_lenses),
            BALANCED,
            name="tab-report-balanced",
            obtained=FROM_RADIAL,
        ),
        table(
            _distortion_table(material), DISTORTION, name="tab-report-distortion", obtained=obtained
        ),
        table(_corner_table(material), CORNERS, name="tab-report-corners", obtained=FORMAT),
    )


def _corner_table(material: Material) -> pd.DataFrame:
    """Return pixel and image coordinates of the corners of every camera."""
    cameras = [lens.camera for lens in _shown_lenses(material)]
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


BALANCED = "Calibrated and balanced focal lengths"
FROM_RADIAL = "the radial coefficients and the focal length, up to the farthest corner of the image"
DISTORTION = "Lens distortion by the distance from the principal point"
CORNERS = "Corners of the images: centres of the corner pixels"
FORMAT = "the numbers of pixels and their size, as flight.toml states them"


def _balanced_table(shown_lenses: Sequence[Lens]) -> pd.DataFrame:
    """Return the calibrated and the balanced focal length of every lens."""
    rows = [
        {
            "Camera": lens.camera.name,
            "Focal length (mm)": _length(lens.interior.f, np.sqrt(lens.cov[0, 0])),
            "Balanced (mm)": _length(balance.f, balance.sigma),
            "Radial, balanced (µm)": f"within ±{UM * balance.largest:.1f}",
            "Farthest corner (mm)": f"{lens.radius:.2f}",
        }
        for lens, balance in ((lens, balanced(lens)) for lens in shown_lenses)
    ]
    return pd.DataFrame(rows)


def _length(value: float, sigma: float) -> str:
    return value_and_sigma(value, sigma) if sigma > 0 else f"{value:g} held"


def _shown_lenses(material: Material) -> list[Lens]:
    """Return the lenses of the calibration and of the separately calibrated heads."""
    methods = [material.calibration] if material.calibration else []
    if any(name.startswith("heads/bundle") for name in material.adjustments):
        methods.append("heads/bundle")
    return [lens for method in methods for lens in lenses(material, method)]


def profile(lens: Lens) -> pd.DataFrame:
    """Return the distortion at round distances from the principal point, and at the largest.

    Returns
    -------
    DataFrame
        radius_mm, angle_deg, radial_um and its sigma_um, balanced_um (radial, with respect to the
        balanced focal length), decentring_um.
    """
    step = style.round_length(lens.radius / 4)
    radii = np.append(np.arange(step, lens.radius - step / 4, step), lens.radius)
    return _profile_at(lens, balanced(lens), radii)


def _profile_at(lens: Lens, balance: Balanced, radius: np.ndarray) -> pd.DataFrame:
    """Return the distortion at distances from the principal point, mm, as `profile` does."""
    d, scale = _radial(lens.interior, radius), balance.f / lens.interior.f
    return pd.DataFrame(
        {
            "radius_mm": radius,
            "angle_deg": np.degrees(np.arctan((radius - d) / lens.interior.f)),
            "radial_um": UM * d,
            "sigma_um": UM * _radial_sigma(lens, radius),
            "balanced_um": UM * scale * (d - balance.slope * radius),
            "decentring_um": UM * _decentring(lens.interior, radius),
        }
    )


def _radial(interior: Interior, radius: Array) -> Array:
    """Return the radial distortion, mm, at distances from the principal point, eqs (10)-(11)."""
    return _powers(radius) @ _coefficients(interior)


def _radial_sigma(lens: Lens, radius: Array) -> Array:
    """Return the standard deviation of the radial distortion, mm, shape (n,)."""
    J = _powers(radius)
    cov = lens.cov[np.ix_(RADIAL, RADIAL)]
    return np.sqrt(np.maximum(np.sum((J @ cov) * J, axis=1), 0.0))


def _decentring(interior: Interior, radius: Array) -> Array:
    """Return the tangential decentring distortion, mm; the radial one is 3 times as large."""
    return np.hypot(interior.p1, interior.p2) * radius**2


def _distortion_table(material: Material) -> pd.DataFrame:
    """Return the distortion of every lens at round distances from the principal point."""
    shown_lenses = _shown_lenses(material)
    rows = [
        {
            **({"Camera": lens.camera.name} if len(shown_lenses) > 1 else {}),
            "Distance (mm)": f"{row['radius_mm']:.4g}",
            "Field angle (°)": f"{row['angle_deg']:.1f}",
            "Radial (µm)": value_and_sigma(row["radial_um"], row["sigma_um"]),
            "Radial, balanced (µm)": f"{row['balanced_um']:+.1f}",
            "Decentring (µm)": f"{row['decentring_um']:.1f}",
        }
        for lens in shown_lenses
        for row in profile(lens).to_dict("records")
    ]
    return pd.DataFrame(rows)


def corners(camera: Camera) -> np.ndarray:
    """Return the pixel coordinates of the centres of the four corner pixels, shape (4, 2)."""
    col, row = camera.width_px - 1, camera.height_px - 1
    return np.array([[0, 0], [col, 0], [col, row], [0, row]], dtype=float)


def image_figure(material: Material) -> Figure:
    """Draw every image with its axes, and the radial distortion of all lenses."""
    shown_lenses = _shown_lenses(material)
    if not shown_lenses:
        return style.nothing("No interior orientation was calibrated.")
    n = len(shown_lenses)
    columns = min(n, 3)
    rows = -(-n // columns)
    with style.applied():
        beside = n == 1
        size = (style.WIDTH, 2.9) if beside else (style.WIDTH, 1.9 * rows + 2.4)
        fig = style.figure(figsize=size)
        parts = fig.add_gridspec(1, 2) if beside else fig.add_gridspec(rows + 1, columns)
        for i, lens in enumerate(shown_lenses):
            _axes_of_image(fig.add_subplot(parts[divmod(i, columns)]), lens)
        curves = fig.add_subplot(parts[0, 1] if beside else parts[rows, :])
        flight = material.flight
        _curves(curves, shown_lenses, flight.head_names if "heads" in flight.blocks else ())
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
        maps.arrow(ax, zero, np.array(tip), maps.CAMERA)
        maps.note(ax, np.array(tip), name, maps.CAMERA, shift=shift)
    corner = np.array([-width / 2, height / 2])
    for tip, name, shift in (((reach, 0), "col", (0, 8)), ((0, -reach), "row", (-13, 0))):
        maps.arrow(ax, corner, corner + np.array(tip), style.SOFT, width=1.2)
        maps.note(ax, corner + np.array(tip), name, style.SOFT, shift=shift)
    forward = camera.T_b_c.R[0, :2]
    level = float(np.hypot(*forward))
    if level > SMALLEST_LEVEL:
        start = np.array([0.22 * width, -0.3 * height])
        tip = start + 0.5 * reach * forward / level
        maps.arrow(ax, start, tip, maps.BODY)
        behind = -forward / level
        maps.note(ax, start, "body x", maps.BODY, shift=(21 * behind[0], 8 * behind[1]))
    ax.plot(lens.interior.xp, lens.interior.yp, "+", color=style.INK, ms=9, mew=1.2, zorder=7)


def _curves(ax: Axes, shown_lenses: Sequence[Lens], heads: Sequence[str]) -> None:
    """Draw the radial distortion with both focal lengths, and its standard deviation.

    A head has the colour that it has in all figures; a camera that is none is black beside heads.
    """
    of_heads = [lens for lens in shown_lenses if lens.camera.name in heads]
    for i, lens in enumerate(shown_lenses):
        radii = np.linspace(0.0, lens.radius, 101)
        curve = _profile_at(lens, balanced(lens), radii)
        k = heads.index(lens.camera.name) if lens in of_heads else i
        colour = style.INK if of_heads and lens not in of_heads else style.colour(k)
        band = 3 * curve["sigma_um"]
        ax.fill_between(
            radii,
            curve["radial_um"] - band,
            curve["radial_um"] + band,
            color=colour,
            alpha=0.18,
            lw=0,
        )
        ax.plot(radii, curve["radial_um"], color=colour, label=style.plain(lens.camera.name))
        ax.plot(radii, curve["balanced_um"], "--", color=colour, lw=1.2)
    ax.axhline(0, color=style.INK, lw=0.7)
    ax.set_xlabel("distance from the principal point (mm)")
    ax.set_ylabel("radial distortion (µm)")


# --- The calibrated lens: its distortion along a radius, and the focal length that balances it


F = INTERIOR.index("f")
RADIAL = tuple(INTERIOR.index(key) for key in ("k1", "k2", "k3"))
POWERS = np.array([3, 5, 7])
"""Powers of the radius that belong to k1, k2, k3: eqs (10)-(11) along a radius."""

HALVINGS = 60
"""Number of halvings of the slope's interval; enough for the last digit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lens:
    """A camera with the interior orientation of the results.

    Attributes
    ----------
    camera : Camera
    cov : ndarray, shape (9, 9)
        A posteriori covariance in the order and the units of `INTERIOR`; zero where held.
    """

    camera: Camera
    cov: Array

    @property
    def interior(self) -> Interior:
        """The interior orientation of the results."""
        return self.camera.interior

    @property
    def radius(self) -> float:
        """Distance of the farthest corner of the image from the principal point, mm."""
        pixels = np.array([self.camera.width_px, self.camera.height_px])
        half = 0.5 * self.camera.pixel_mm * pixels
        return float(np.hypot(*(half + np.abs([self.interior.xp, self.interior.yp]))))


@dataclass(frozen=True, kw_only=True)
class Balanced:
    """The focal length that balances the radial distortion.

    Attributes
    ----------
    f, sigma : float
        mm.
    slope : float
        1 - f / c, for the calibrated focal length f and the balanced one c.
    largest : float
        Largest distortion with respect to c, mm; its negative is the smallest.
    """

    f: float
    sigma: float
    slope: float
    largest: float


def lenses(material: Material, stage_method: str) -> list[Lens]:
    """Return the lenses of a method's cameras, as the results have them."""
    cov = folder.covariance(material.found, stage_method)
    return [
        _lens(material, stage_method, name, cov)
        for name in folder.cameras(material.found, stage_method)
    ]


def _lens(material: Material, stage_method: str, name: str, cov: object) -> Lens:
    rows = folder.parameters(material.found, stage_method, name)
    labels = [REPORTED[key][0] for key in INTERIOR]
    estimates = {
        key: float(rows["value"][label])
        for key, label in zip(INTERIOR, labels, strict=True)
        if label in rows.index
    }
    whole = cov.reindex(index=[f"{name}/{label}" for label in labels])  # type: ignore[attr-defined]
    camera = material.flight.cameras[name]
    return Lens(
        camera=camera.with_interior(replace(camera.interior, **estimates)),
        cov=whole.reindex(columns=whole.index).fillna(0.0).to_numpy(),
    )


def _powers(radius: Array) -> Array:
    return np.asarray(radius, dtype=float)[:, None] ** POWERS


def _coefficients(interior: Interior) -> Array:
    return np.array([interior.k1, interior.k2, interior.k3])


def balanced(lens: Lens) -> Balanced:
    """Return the focal length whose largest and smallest radial distortion have the same size.

    Notes
    -----
    A point at the ideal distance f tan(t), measured at r = f tan(t) + d(r), has the distortion
    r - c tan(t) = (c / f) (d(r) - s r) with respect to the focal length c, where s = 1 - f / c.
    The sum of the largest and the smallest value of d(r) - s r from the principal point to the
    farthest corner decreases with s, and is zero for the balanced c = f / (1 - s). Both extremes
    are stationary or at the corner, so that s depends on a coefficient of d by
    (r1^n + r2^n) / (r1 + r2), where r1 and r2 are the places of the extremes. For d = k1 r^3 alone
    s is 3/4 k1 R^2: the difference is a Chebyshev polynomial.
    """
    R, interior = lens.radius, lens.interior
    slope = _balanced_slope(_coefficients(interior) * R ** (POWERS - 1))
    c = interior.f / (1 - slope)
    radii, values = _extremes(_coefficients(interior) * R ** (POWERS - 1), slope)
    ends = R * np.array([radii[np.argmax(values)], radii[np.argmin(values)]])
    by_k = np.sum(ends[:, None] ** POWERS, axis=0) / max(float(ends.sum()), R * 1e-12)
    J = np.concatenate([[c / interior.f], c**2 / interior.f * by_k])
    cov = lens.cov[np.ix_((F, *RADIAL), (F, *RADIAL))]
    return Balanced(
        f=c,
        sigma=float(np.sqrt(max(J @ cov @ J, 0.0))),
        slope=slope,
        largest=float(c / interior.f * R * values.max()),
    )


def _balanced_slope(k: Array) -> float:
    """Return the slope that balances the distortion within the unit radius, by bisection."""
    low, high = -float(np.abs(k).sum()), float(np.abs(k).sum())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        _, values = _extremes(k, middle)
        if values.max() + values.min() > 0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _extremes(k: Array, slope: float) -> tuple[Array, Array]:
    """Return candidate radii for extremes of d(r) - s r, r from 0 to 1, and the values there."""
    squares = np.roots([*(POWERS * k)[::-1], -slope])
    real = squares[np.abs(squares.imag) < 1e-9].real
    inner = np.sqrt(real[(real > 0) & (real < 1)])
    radii = np.concatenate([[0.0, 1.0], inner])
    return radii, radii[:, None] ** POWERS @ k - slope * radii


# --- Tables of the calibrated parameters


def section(material: Material) -> Text:
    """Return the section on the estimates: tests, methods, correlations."""
    matrices = _correlation_tables(material)
    return show(
        table(_parameter_table(material), SINGLE, name="tab-report-parameters", obtained=ROWS),
        _heads_sentence(material),
        table(_joint_table(material), JOINT, name="tab-report-joint", obtained=FROM_COVARIANCE),
        table(_method_table(material), METHOD, name="tab-report-methods", obtained=ROWS),
        *(
            table(
                matrix, MATRIX + (f", {name}" if len(matrices) > 1 else ""),
                name=f"tab-report-correlations-{number}", obtained=FROM_COVARIANCE,
            )
            for number, (name, matrix) in enumerate(matrices.items(), 1)
        ),
        _correlation_sentence(material),
    )  # fmt: skip


def _parameter_table(material: Material) -> pd.DataFrame:
    """Return the parameters of the calibration with sigma, test and strongest correlation."""
    if not material.calibration:
        return pd.DataFrame()
    estimates = _estimates(material, material.calibration)
    several = len({p.camera for p in estimates}) > 1
    heads = any(p.sigma_before > 0 for p in estimates)
    rows = [
        {
            **({"Camera": p.camera} if several else {}),
            "Parameter": with_unit(parameter_title(p.parameter), p.unit),
            "Value and σ": value_and_sigma(p.value, p.sigma),
            **({"Of σ from the heads": f"{p.sigma_before:.2g}"} if heads else {}),
            "Against": f"{p.reference:g}",
            "t": p.t,
            "Significant": SIGNIFICANT[p.significant],
            "Strongest correlation": _strongest_text(p),
        }
        for p in estimates
    ]
    return pd.DataFrame(rows)


def _heads_sentence(material: Material) -> str:
    """Return sentences on the part of sigma that comes from the heads; empty without any."""
    estimates = _estimates(material, material.calibration) if material.calibration else []
    shares = {p.parameter: p.sigma_before / p.sigma for p in estimates if p.sigma_before > 0}
    if not shares:
        return ""
    largest = max(shares, key=lambda name: shares[name])
    said = (
        "The points were transferred into the synthetic image by calibrated heads. Errors of this "
        "calibration move all points of a head together, which the adjustment cannot see; their "
        f"part is in σ, as the root of a sum of squares. It is {min(shares.values()):.2g} to "
        f"{shares[largest]:.2g} times σ, most in {parameter_title(largest)}. Flights whose points "
        "the same heads transfer share this part."
    )
    if "f" in material.flight.estimate_heads:
        return said
    return (
        f"{said} The heads' focal lengths are held: what is wrong with them scatters with the path "
        "of the flight that calibrates the heads, and is in no σ."
    )


def _joint_table(material: Material) -> pd.DataFrame:
    """Return the tests of several parameters of the calibration at once."""
    tests = _joint_tests(material, material.calibration) if material.calibration else []
    several = len({test.camera for test in tests}) > 1
    rows = [
        {
            **({"Camera": test.camera} if several else {}),
            "Parameters": group_label(test.keys),
            "Largest single t": test.largest,
            "F": test.f_ratio,
            "Degrees of freedom": f"{len(test.keys)}; {test.redundancy:,}",
            "p": p_value(test.p),
        }
        for test in tests
    ]
    return pd.DataFrame(rows)


def _joint_tests(material: Material, stage_method: str) -> list[GroupTest]:
    """Return the tests of a method's parameters by groups, against zero."""
    names = folder.cameras(material.found, stage_method)
    cameras = [material.flight.cameras[name] for name in names]
    calibration = read_calibration(material.found, stage_method, cameras)
    tests = group_tests(
        calibration,
        [undistorted(camera) for camera in cameras],
        redundancy=_redundancy(material, stage_method),
    )
    return [test for test in tests if not set(test.keys) <= set(FROM_DECLARED)]


def _method_table(material: Material) -> pd.DataFrame:
    """Return the parameters of all methods of the mounting stage side by side."""
    names = [f"mounting/{m}" for m in METHODS if f"mounting/{m}" in material.adjustments]
    names.sort(key=lambda name: name != material.calibration)
    if len(names) < 2:
        return pd.DataFrame()
    table = _side_by_side(
        {heading(name): folder.rows(material.found, "parameters", name) for name in names}
    )
    for name in (f"mounting/{method}" for method in METHODS):
        if reasons := folder.messages(material.found.summary.get(name, {}), "left_out"):
            table[heading(name)] = lacking(reasons[0])
    return table


def _correlation_sentence(material: Material) -> str:
    """Return a sentence on pairs of strongly correlated parameters."""
    if not material.calibration:
        return ""
    pairs = strong_pairs(material, material.calibration)
    if not pairs:
        return f"No correlation exceeds {STRONG:g}."
    return f"Correlations above {STRONG:g}: " + ", ".join(pair_texts(pairs)) + "."


SINGLE = "The calibration: parameters, standard deviations and significance"
JOINT = "The same, several parameters tested together"
METHOD = "The same by all methods"
MATRIX = "Correlation matrix of the interior orientation parameters and the mounting"
ROWS = "parameters.csv: estimates and standard deviations, those times σ₀ of their adjustment"
FROM_COVARIANCE = "covariance.csv: the covariance matrix of the calibration"

SIGNIFICANT = {True: "yes", False: "no", None: "–"}
"""The dash marks parameters compared with a declared value: the verdict judges these."""


def _correlation_tables(material: Material) -> dict[str, pd.DataFrame]:
    """Return the full correlation matrix of every camera's parameters, by the camera's name."""
    if not material.calibration:
        return {}
    related = correlations(material, material.calibration)
    rows = folder.rows(material.found, "parameters", material.calibration)
    of_cameras = rows[rows["camera"] != ""].groupby("camera", sort=False)["parameter"]
    return {
        str(camera): _matrix(related, [f"{camera}/{name}" for name in names])
        for camera, names in of_cameras
    }


def _matrix(related: pd.DataFrame, labels: list[str]) -> pd.DataFrame:
    titles = [parameter_title(label) for label in labels]
    values = related.loc[labels, labels].to_numpy()
    rows = [
        [title, *(_correlation(rho, i == j) for j, rho in enumerate(row))]
        for i, (title, row) in enumerate(zip(titles, values, strict=True))
    ]
    return pd.DataFrame(rows, columns=["parameter", *titles])


def _correlation(rho: float, is_diagonal: bool) -> str:
    if is_diagonal:
        return "1"
    if abs(rho) < 0.005:
        return "0.00"
    return Markup(f"**{rho:+.2f}**") if abs(rho) > STRONG else f"{rho:+.2f}"


def _strongest_text(p: _Estimate) -> Markup:
    if not p.strongest:
        return Markup("–")
    return Markup(f"{p.rho:+.2f} with {shown(parameter_title(p.strongest))}")


def head_table(material: Material, stage_method: str) -> pd.DataFrame:
    """Return the parameters of every head, a column per head; empty without heads."""
    if not folder.has(material.found, stage_method):
        return pd.DataFrame()
    rows = folder.rows(material.found, "parameters", stage_method)
    heads = rows.groupby("camera", sort=False)
    return _side_by_side({str(name): of_head.assign(camera="") for name, of_head in heads})


def _side_by_side(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return parameters with sigma, a column per table; a parameter without a row is held."""
    several = len({name for rows in tables.values() for name in rows["camera"] if name}) > 1
    cells: dict[str, dict[str, str]] = {}
    for column, rows in tables.items():
        for _, row in rows.iterrows():
            label = with_unit(parameter_title(str(row["parameter"])), str(row["unit"]))
            if several and row["camera"]:
                label = Markup(f"{shown(row['camera'])} {label}")
            text = value_and_sigma(float(row["value"]), float(row["sigma"]))
            cells.setdefault(label, {})[column] = text
    lines = [
        [label, *(texts.get(column, "held") for column in tables)] for label, texts in cells.items()
    ]
    return pd.DataFrame(lines, columns=["Parameter", *tables])  # a camera may have this name too
