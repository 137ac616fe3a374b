"""Chapter 1, the heads: interior and relative orientation (section 4.1, Table 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from acx4book.paper import printed
from acx4book.typesetting import matrix, style
from acx4book.typesetting.matrix import Residuals, field_figure
from acx4book.typesetting.myst import LABELS, p_value
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4lib.attempts import Failed
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.determination import EXTERIOR, Correlations
from acx4lib.calibration.heads import (
    Heads,
    RelativeOrientation,
    above_gnss,
    corner_radius,
    radial_profile,
)
from acx4lib.calibration.held import Held
from acx4lib.expected import Array
from acx4lib.geometry.frames import log
from acx4lib.geometry.parameters import REPORTED, SHOWN

# --- Figures of the heads: residuals, distortion, correlations, a wrong focal length (4.1)


NO_HEADS = "No head could be adjusted."


# --- residuals -------------------------------------------------------------------------------


def mean_residuals(fits: Mapping[str, Bundle]) -> Figure:
    """Draw the mean residual vectors of the cells of every head's image.

    Returns
    -------
    Figure
        Vectors longer than three of their standard deviations stand out in colour: such are
        distortion that the model does not have.
    """
    if not fits:
        return style.nothing(NO_HEADS)
    return field_figure(
        {
            name: Residuals(
                camera=fit.network.block.cameras[0],
                colrow=fit.network.image_points.colrow,
                v=fit.solution.group("image_point").v,
                sigma_px=fit.network.image_points.sigma_px,
            )
            for name, fit in fits.items()
        }
    )


# --- distortion ------------------------------------------------------------------------------


def radial_distortion(
    fits: Mapping[str, Bundle],
    *,
    printed_px: Mapping[str, float] | None = None,
    claim_px: float | None = None,
) -> Figure:
    """Draw the radial distortion of every head, with one standard deviation, up to its corner.

    Parameters
    ----------
    fits : mapping of str to Bundle
    printed_px : mapping of str to float, optional
        The paper's at the corner, by head.
    claim_px : float, optional
        The paper's text on the distortion at the border.
    """
    if not fits:
        return style.nothing(NO_HEADS)
    printed_px = printed_px or {}
    with style.applied():
        fig, (wide, near) = style.subplots(1, 2, figsize=(style.WIDTH, 3.3), width_ratios=[1.5, 1])
        lowest, highest, corner = np.inf, -np.inf, 0.0
        for i, (name, fit) in enumerate(fits.items()):
            r, px, sigma = radial_profile(fit)
            for ax in (wide, near):
                ax.plot(r, px, color=style.colour(i), label=style.plain(name))
                ax.fill_between(r, px - sigma, px + sigma, color=style.colour(i), alpha=0.25, lw=0)
            ends = [px[-1], printed_px.get(name, px[-1])]
            if name in printed_px:
                near.plot(
                    r[-1], ends[1], "D", ms=4.5, mfc=style.PAPER, mec=style.colour(i), mew=1.3
                )
            lowest, highest = min(lowest, 0.93 * min(ends)), max(highest, 1.05 * max(ends))
            corner = max(corner, r[-1])
        highest = max(highest, 1.04 * (claim_px or 0.0))
        near.set(xlim=(0.955 * corner, 1.008 * corner), ylim=(lowest, highest))
        wide.yaxis.set_major_locator(MaxNLocator(7, integer=True))
        wide.set(xlim=(0, 1.02 * corner))
        style.heading(wide, "radial distortion", "from the principal point to the corner")
        style.heading(near, "at the corner", r"bands: $\pm 1\sigma$")
        handles = wide.get_legend_handles_labels()[0]
        handles += _claims((wide, near), claim_px, some=bool(printed_px))
        for ax in (wide, near):
            ax.set(xlabel="radius (mm)", ylabel="distortion (px)")
        style.legend_below(fig, handles)
    return fig


def _claims(axes: Sequence[Axes], claim_px: float | None, *, some: bool) -> list[Line2D]:
    """Draw the paper's statement and return the legend's handles of the paper's numbers."""
    handles = []
    if some:
        label = "the paper's Table 1"
        handles.append(
            Line2D([], [], ls="", marker="D", mfc=style.PAPER, mec=style.SOFT, label=label)
        )
    if claim_px is not None:
        for ax in axes:
            ax.axhline(claim_px, color=style.PRINTED, ls=(0, (4, 2)), lw=1)
        label = f"its text: about {claim_px:g} px"
        handles.append(Line2D([], [], color=style.PRINTED, ls=(0, (4, 2)), lw=1, label=label))
    return handles


# --- correlations ----------------------------------------------------------------------------


def correlations(found: Mapping[str, Correlations], *, claim: float | None = None) -> Figure:
    """Draw how the interior orientation of the heads correlates with the exterior.

    Parameters
    ----------
    found : mapping of str to Correlations
        By head.
    claim : float, optional
        Bound that the paper gives.

    Returns
    -------
    Figure
        Left the largest of all heads and images by pairs of parameters, right how many of all
        correlations stay below a value.
    """
    if not found:
        return style.nothing(NO_HEADS)
    if not any(c.values.size for c in found.values()):  # noqa: PD011 no frame's
        return style.nothing("No parameter is estimated in oriented images.")
    with style.applied():
        fig, (pairs, shares) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.2), width_ratios=[1.15, 1]
        )
        _draw_pairs(
            pairs,
            next(iter(found.values())).interior,
            np.max([c.largest for c in found.values()], 0),
        )
        for i, (name, c) in enumerate(found.items()):
            values = np.sort(np.abs(c.values), axis=None)
            share = np.arange(1, len(values) + 1) / len(values)
            shares.plot(values, 100 * share, color=style.colour(i), label=style.plain(name))
        shares.set(xlim=(0, 1), ylim=(0, 100), xlabel="absolute correlation (1)")
        shares.set_ylabel("share of all below (%)")
        handles = shares.get_legend_handles_labels()[0]
        if claim is not None:
            line = shares.axvline(claim, color=style.PRINTED, ls=(0, (4, 2)), lw=1)
            line.set_label(f"the paper: all below {claim:g}")
            handles.append(line)
        style.heading(pairs, "largest correlations", "of all heads and images")
        style.heading(shares, "all correlations", "interior with exterior orientation")
        style.legend_below(fig, handles)
    return fig


def _draw_pairs(ax: Axes, interior: Sequence[str], largest: Array) -> None:
    matrix.signed_cells(ax, largest)
    ax.set_aspect("auto")
    ax.set_xticks(np.arange(len(EXTERIOR)) + 0.5, [SYMBOLS[name] for name in EXTERIOR], size=9)
    ax.set_yticks(np.arange(len(interior)) + 0.5, [SYMBOLS[name] for name in interior], size=9)
    ax.set(xlabel="exterior orientation", ylabel="interior orientation")
    for i, j in np.ndindex(*largest.shape):
        matrix.write(ax, i, j, float(largest[i, j]), f"{largest[i, j]:.2f}")


# --- a wrong focal length --------------------------------------------------------------------


def held_focal_lengths(held: Mapping[float, Heads]) -> Figure:
    """Draw what the calibration of the heads shows when their focal lengths are held wrong.

    Parameters
    ----------
    held : mapping of float to Heads
        By the change of all focal lengths, mm; at least two.

    Returns
    -------
    Figure
        Above, quantities that could reveal a wrong focal length; below, parameters that absorb it.
    """
    tried, change = list(held.values()), np.array(list(held))
    names = [name for name in tried[0].bundles if all(name in h.bundles for h in tried)]
    if not names:
        return style.nothing(NO_HEADS)
    start = int(np.argmin(np.abs(change)))
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 4.6), sharex=True)
        for i, name in enumerate(names):
            curves = _reactions([h.bundles[name] for h in tried], start)
            first, *others = zip(axes.flat, curves, strict=True)
            _parabola(*first, change, colour=style.colour(i), label=style.plain(name))
            for ax, values in others:
                ax.plot(change, values, "o-", color=style.colour(i))
        labels = (
            "change of $v^TPv$ (1)",
            "rms at control points (mm)",
            "camera above GNSS (m)",
            "change of $x_p$ (mm)",
            "change of $y_p$ (mm)",
            "turned by (deg)",
        )
        ticks = [f"{c:+g}".replace("-", "\N{MINUS SIGN}") if c else "0" for c in change]
        for ax, label in zip(axes.flat, labels, strict=True):
            ax.set_ylabel(label)
            ax.set_xticks(change, ticks)
        axes[0, 1].set_ylim(0, 1600 * max(map(_control_rms, tried)))
        axes[0, 2].axhline(0.0, color=style.BRICK, lw=0.9, zorder=1)
        for ax in axes[1]:
            ax.set_xlabel("change of the held $f$ (mm)")
        style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0])
    return fig


def _parabola(ax: Axes, cost: Array, change: Array, *, colour: str, label: str) -> None:
    """Draw the change of v'Pv, which is of second degree in a parameter, through its values."""
    ax.plot(change, cost, "o", color=colour)
    fine = np.linspace(change.min(), change.max(), 61)
    curve = np.polynomial.Polynomial.fit(change, cost, min(2, len(change) - 1))
    ax.plot(fine, curve(fine), color=colour, label=label)


def _reactions(fits: Sequence[Bundle], start: int) -> list[Array]:
    """Return how one head reacts: v'Pv, control (mm), height, principal point, attitude (°)."""
    control = [fit.solution.group("control_point").v for fit in fits]
    xy = np.array([[fit.cameras[0].interior.xp, fit.cameras[0].interior.yp] for fit in fits])
    R_m_c = fits[start].T_m_c.R
    turned = [log(np.swapaxes(R_m_c, -1, -2) @ fit.T_m_c.R).mean(axis=0) for fit in fits]
    return [
        np.array([fit.solution.cost - fits[start].solution.cost for fit in fits]),
        np.array([1000 * np.sqrt(np.mean(v**2)) if len(v) else np.nan for v in control]),
        np.array([above_gnss(fit) for fit in fits]),
        *(xy - xy[start]).T,
        np.degrees(np.linalg.norm(turned, axis=1)),
    ]


# --- Tables of the heads: what they hold, and effects of a wrong focal length


INTERIOR = ("f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2", "b1", "b2")

SYMBOLS = {name: LABELS[name] for name in INTERIOR} | {
    "east_m": Markup("$X_0$"),
    "north_m": Markup("$Y_0$"),
    "height_m": Markup("$Z_0$"),
    "omega_deg": Markup(r"$\omega$"),
    "phi_deg": Markup(r"$\varphi$"),
    "kappa_deg": Markup(r"$\kappa$"),
}
"""The paper's symbols of interior and exterior orientation by their names in results."""


def printed_border_px(flight: Flight) -> dict[str, float]:
    """Return Table 1's radial distortion at the corner by head, px; empty for other cameras."""
    if not printed.applies(flight):
        return {}
    cameras = [flight.cameras[name] for name in printed.HEADS]
    return {
        camera.name: printed.value(1, "k1", camera.name)
        * corner_radius(camera) ** 3
        / camera.pixel_mm
        for camera in cameras
    }


def claim(flight: Flight, statement: str) -> float | None:
    """Return a number of the paper's text; None for other cameras than the paper's."""
    return printed.statement(statement) if printed.applies(flight) else None


# --- what is held ----------------------------------------------------------------------------


COSTS = Markup("costs in $v^TPv$")

WORDS = {name: SHOWN[key][0] for key, (name, _) in REPORTED.items()}
"""Names of parameters in tables, by those in results."""


def held_values(tested: Mapping[str, Held]) -> pd.DataFrame:
    """Return the focal lengths that heads hold, and whatever else the images reject.

    Parameters
    ----------
    tested : mapping of str to Held
        By head.

    Returns
    -------
    DataFrame
        By ``camera``, ``parameter``, ``unit``: the value held; ``value`` and ``sigma`` that it
        would have if it alone were free; by how much holding it raises v'Pv; p, or that the images
        cannot tell. Empty if no head holds any of them.
    """
    rows = {}
    for camera, test in tested.items():
        of_f = [name for name in test.names if name.endswith("/f_mm")]
        alone = test.table()
        for name, unit in alone.index:
            if name in (*of_f, *test.rejected):
                rows[camera, WORDS[name.partition("/")[2]], unit] = [*alone.loc[(name, unit)]]
    index = pd.MultiIndex.from_tuples(rows, names=["camera", "parameter", "unit"]) if rows else None
    columns = ["held", "value", "sigma", COSTS, "p"]
    table = pd.DataFrame([*rows.values()], index=index, columns=columns)
    table["p"] = ["cannot tell" if np.isnan(p) else p_value(p) for p in table["p"]]
    table.attrs["formats"] = {COSTS: ".1f"}
    return table


# --- a wrong focal length --------------------------------------------------------------------


def held(
    tried: Mapping[str, Heads],
    orientations: Mapping[str, RelativeOrientation | Failed],
    before: Heads,
) -> pd.DataFrame:
    """Return fit, heights and orientation of heads whose focal lengths are held at other values.

    Parameters
    ----------
    tried : mapping of str to Heads
        By a title for the held focal lengths.
    orientations : mapping of str to RelativeOrientation or Failed
        Of each.
    before : Heads
        With the focal lengths as they were.

    Returns
    -------
    DataFrame
        A row for each that has a head: by how much v'Pv of all heads changed; the RMS of all
        components of the residuals at control points; how high the cameras stand above GNSS, and
        by how much they were lifted at most; by how much the principal points moved; and the
        relative orientation.
    """
    rows = {
        title: _reaction(heads, before) | _orientation(orientations[title])
        for title, heads in tried.items()
        if heads.bundles
    }
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index.name = "held f"
    formats = {COST: "+.1f", "RMS at control points (mm)": ".1f"}
    heights = ("Cameras above GNSS, lowest (m)", "highest (m)", "Lifted by up to (m)")
    table.attrs["formats"] = formats | dict.fromkeys(heights, ".1f") | {MOVED: ".3f", PLACE: ".3f"}
    return table


COST = Markup("Change of $v^TPv$")
MOVED = Markup("$x_p$, $y_p$ moved by up to (mm)")
PLACE = Markup("$X_c$, $Y_c$ up to (mm)")


def _reaction(heads: Heads, before: Heads) -> dict[str, object]:
    fits, sound = heads.bundles, before.bundles
    rise = {name: above_gnss(fit) for name, fit in fits.items()}
    xy = np.array(
        [[fit.cameras[0].interior.xp, fit.cameras[0].interior.yp] for fit in fits.values()]
    )
    xy_before = np.array(
        [[sound[name].cameras[0].interior.xp, sound[name].cameras[0].interior.yp] for name in fits]
    )
    return {
        COST: sum(fit.solution.cost - sound[name].solution.cost for name, fit in fits.items()),
        "RMS at control points (mm)": 1000 * _control_rms(heads),
        "Cameras above GNSS, lowest (m)": min(rise.values()),
        "highest (m)": max(rise.values()),
        "Lifted by up to (m)": max(abs(rise[name] - above_gnss(sound[name])) for name in fits),
        MOVED: np.abs(xy - xy_before).max(),
    }


def _control_rms(heads: Heads) -> float:
    """Return the RMS of all components of the control points' residuals, all heads, m."""
    v = [fit.solution.group("control_point").v.ravel() for fit in heads.bundles.values()]
    squares = np.concatenate(v) ** 2
    return float(np.sqrt(squares.mean())) if len(squares) else np.nan


def _orientation(heads: RelativeOrientation | Failed) -> dict[str, object]:
    if isinstance(heads, Failed):
        return {}
    xyz = heads.xyz_mm
    return {
        PLACE: np.abs(xyz[:, :2]).max(),
        Markup("$Z_c$ minus the first head's (mm)"): ", ".join(
            f"{z:.3f}" for z in xyz[1:, 2] - xyz[0, 2]
        ),
    }


def by_wrong_lengths(reactions: pd.DataFrame) -> dict[str, float]:
    """Return the largest changes where all focal lengths are held wrong, for a sentence.

    Parameters
    ----------
    reactions : DataFrame
        As `held` returns it, with a row ``unchanged``; the last row is passed over.

    Returns
    -------
    dict of str to float
        ``control_mm``, ``moved_mm``, ``lifted_m``; empty where no head can be adjusted with its
        focal length unchanged.
    """
    if "unchanged" not in reactions.index:
        return {}
    right, wrong = reactions.loc["unchanged"], reactions.iloc[:-1].drop(index="unchanged")
    controls = "RMS at control points (mm)"
    return {
        "control_mm": wrong[controls].max() - right[controls],
        "moved_mm": wrong[MOVED].max(),
        "lifted_m": wrong["Lifted by up to (m)"].max(),
    }
