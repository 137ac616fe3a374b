"""Chapter 15: which flight determines what, before it is flown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from acx4book.notebooks import simulated
from acx4book.planning import plan as plans
from acx4book.planning.design import sigmas
from acx4book.planning.flown import flying_time_s
from acx4book.planning.plan import Plan, Strip, image_length_m, strip_of
from acx4book.typesetting import style
from acx4book.typesetting.moving import Explorer, Mark, Panel, Plane, Slider, Stops
from acx4book.typesetting.myst import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4sim.designs import acx4_ideal_plan

# --- Figures of the chapter: curves of standard deviations, and flights in plan


PANELS = {
    "interior (µm)": (1000.0, {"f_mm": "f", "xp_mm": "$x_p$", "yp_mm": "$y_p$"}),
    "lever arm (cm)": (100.0, {"lever_z_m": "z", "lever_x_m": "x", "lever_y_m": "y"}),
    "boresight (0.001°)": (
        1000.0,
        {
            "boresight_kappa_deg": "κ",
            "boresight_omega_deg": "ω",
            "boresight_phi_deg": "φ",
        },
    ),
}
"""Panels with their unit: the factor to it, and curves by the parameter's name in results."""

LEAST_RANGE = 4.0
"""Smallest ratio of the ends of a logarithmic axis."""

COLOURS = (style.BLUE, style.ORANGE, style.TEAL)


def curves(table: pd.DataFrame, label: str, *, beside: pd.DataFrame | None = None) -> Figure:
    """Draw standard deviations along a change, on logarithmic axes.

    Parameters
    ----------
    table : DataFrame
        As `curves` makes it: a row for every parameter, a column for every change.
    label : str
        Title of the change.
    beside : DataFrame, optional
        Drawn dashed in the same colours.
    """
    with style.applied():
        fig, axes = style.subplots(1, len(PANELS), figsize=(style.WIDTH, 2.9), sharex=True)
        for ax, (title, (factor, names)) in zip(axes, PANELS.items(), strict=True):
            for (name, short), colour in zip(names.items(), COLOURS, strict=True):
                ax.plot(table.columns, factor * table.loc[name], "o-", color=colour, label=short)
                if beside is not None:
                    ax.plot(
                        beside.columns, factor * beside.loc[name], "o--", color=colour, mfc="none"
                    )
            ax.set(title=title, yscale="log", xlabel=label)
            ax.xaxis.set_major_locator(MaxNLocator(5, integer=table.columns.dtype.kind == "i"))
            _ticked(ax)
            ax.legend(loc="best")
        axes[0].set_ylabel("σ")
    return fig


def _ticked(ax: Axes) -> None:
    """Write plain numbers on a logarithmic axis of at least a factor of four.

    On a shorter axis a nearly constant line would look steep.
    """
    low, high = ax.get_ylim()
    wider = max(1.0, LEAST_RANGE * low / high) ** 0.5
    low, high = low / wider, high * wider
    digits = (1, 2, 5) if high / low > 10 else (1, 1.5, 2, 3, 5, 7)
    ticks = [d * 10.0**k for k in range(-3, 4) for d in digits if low <= d * 10.0**k <= high]
    ax.set_ylim(low, high)
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_yticks([], minor=True)


def maps(flights: Mapping[str, Plan]) -> Figure:
    """Draw flights in plan: strips, the footprints of their middle images, control points."""
    with style.applied():
        fig, axes = style.subplots(
            1, len(flights), figsize=(style.WIDTH, 2.7), sharex=True, sharey=True
        )
        for ax, (name, plan) in zip(axes, flights.items(), strict=True):
            style.bare(ax)
            ax.set(title=name, aspect="equal", xticks=[], yticks=[])
            _map(ax, plan)
        style.scale_bar(axes[0], per_axis_unit=1.0, unit="km", at=(0.04, 0.05))
    return fig


def _map(ax: Axes, plan: Plan) -> None:
    block = plan.blocks["calibration"]
    lowest = min(strip.flying_height_m for strip in block.strips.values())
    for strip in block.strips.values():
        high = strip.flying_height_m > 1.01 * lowest
        colour = style.ORANGE if high else style.BLUE
        ends, corners = _placed(plan, strip)
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", xy=tuple(ends[1]), xytext=tuple(ends[0]), arrowprops=arrow)
        ax.plot(*corners.T, color=colour, lw=0.6)
    control = plans.on_map(block.area, plans.places(block.points)) - _middle(plan)
    ax.plot(*control.T / 1000.0, "D", color=style.INK, mfc="none", ms=2)


def _middle(plan: Plan) -> Array:
    area = plan.blocks["calibration"].area
    return np.array([area.east_m, area.north_m])


def _placed(plan: Plan, strip: Strip) -> tuple[Array, Array]:
    """Return a strip's ends and its middle footprint in km from the field's middle.

    Strips are drawn a little to the right, so that opposite ones do not coincide.
    """
    camera, area = plan.cameras("calibration")[0], plan.blocks["calibration"].area
    course = np.radians(strip.course_deg)
    forward = np.array([np.sin(course), np.cos(course)])
    right = np.array([forward[1], -forward[0]])
    local = np.array([[strip.forward_m, strip.left_m]])
    middle = plans.on_map(area, local)[0] - _middle(plan)
    half = 0.5 * strip.base_m * (strip.n_exposures - 1)
    aside = 60.0 * right
    ends = middle + aside + np.outer([-half, half], forward)
    x = 0.5 * image_length_m(camera, strip.flying_height_m)
    y = 0.5 * image_length_m(camera, strip.flying_height_m, across=True)
    square = np.array([[x, y], [-x, y], [-x, -y], [x, -y], [x, y]])
    return ends / 1000.0, (middle + square @ np.array([forward, right])) / 1000.0


# --- The design of a flight to move: two heights, the angle between strips, control points


RATIO = Slider(name="second height over first", unit="", low=1.0, high=2.0, step=0.25)
TURN = Slider(name="second course against first", unit="°", low=0.0, high=180.0, step=45.0)
CONTROL = Slider(name="control points", unit="", low=2.0, high=8.0, step=3.0)
SLIDERS = (RATIO, TURN, CONTROL)

SHOWN = {
    "f_mm": ("f, µm", 1000.0),
    "lever_z_m": ("lever arm z, cm", 100.0),
    "lever_x_m": ("lever arm x, cm", 100.0),
    "lever_y_m": ("lever arm y, cm", 100.0),
    "boresight_phi_deg": ("φ, 0.001°", 1000.0),
    "boresight_kappa_deg": ("κ, 0.001°", 1000.0),
}
"""Parameters by their names in results: as they are shown, with the factor to the unit there."""

N_IMAGES = 5
"""Images of every strip."""

LOW_M, COURSE_DEG = 1000.0, 28.0
"""The lower height, and the first course: the paper's."""

AREA_M = (1300.0, 1000.0)
"""Length and width of the rectangle with control points."""


def explorer(plan: Plan) -> Explorer:
    """Return the explorer.

    Parameters
    ----------
    plan : Plan
        Whose camera is flown; its own strips are not.
    """
    sigma = _sigma(plan)
    rows = {
        f"σ of {name}": [Stops(sliders=SLIDERS, table=sigma[..., [k]])]
        for k, (name, _) in enumerate(SHOWN.values())
    }
    return Explorer(
        name="explorer-design",
        caption=(
            f"Two strips at {LOW_M:.0f} m and two at a second height, five images each, by the "
            "paper's camera; unknown are its interior orientation, the mounting, and a shift of "
            "GNSS. The lower strip of the first course is blue, and the upper one of the second "
            "orange, each with the footprint of its middle image; squares are control points. The "
            "table has standard deviations."
        ),
        sliders=SLIDERS,
        presets={
            "two heights, opposite": [1.5, 180.0, 5.0],
            "one height": [1.0, 180.0, 5.0],
            "one direction": [1.5, 0.0, 5.0],
            "crossing": [1.5, 90.0, 5.0],
            "two control points": [1.5, 180.0, 2.0],
        },
        panels=[_explorer_map(plan)],
        columns={"value": 2},
        rows=rows,
    )


def _sigma(plan: Plan) -> Array:
    """Return σ in the units of `SHOWN`, shape (n_ratios, n_turns, n_controls, n_shown)."""
    sigma = [
        [[_shown(plan, ratio, turn, int(n)) for n in CONTROL.stops] for turn in TURN.stops]
        for ratio in RATIO.stops
    ]
    return np.array(sigma)


def _shown(plan: Plan, ratio: float, turn_deg: float, control: int) -> Array:
    heights = (LOW_M, LOW_M * ratio)
    strips = [_strip(plan, height, turn) for height in heights for turn in (0.0, turn_deg)]
    sigma = sigmas(plan.with_strips(strips).with_control(control, AREA_M))
    return np.array([factor * sigma[name] for name, (_, factor) in SHOWN.items()])


def _strip(plan: Plan, height_m: float, turn_deg: float) -> Strip:
    camera = plan.cameras("calibration")[0]
    return strip_of(camera, height_m, COURSE_DEG + turn_deg, images=N_IMAGES)


def _explorer_map(plan: Plan) -> Panel:
    size, reach = (340.0, 300.0), 1.7
    plane = Plane(x=(-reach, reach), y=(-reach * 0.88, reach * 0.88), size=size)
    low = _curve(plane, "blue", _outline(plan, LOW_M, 0.0)[None, None, None])
    turned = [[_outline(plan, LOW_M * r, turn) for turn in TURN.stops] for r in RATIO.stops]
    high = _curve(plane, "orange", np.array(turned)[:, :, None])
    points = plan.with_control(int(CONTROL.high), AREA_M).control
    places = plans.places(points)[:, ::-1] * [-1, 1] / 1000.0
    squares = [_square(plane, place, k) for k, place in enumerate(places)]
    return Panel(
        title="the flight in plan",
        alt="A blue strip upwards and an orange one downwards with their footprints, and squares.",
        size=size,
        fixed=plane.text((0.0, -reach * 0.84), "3.4 km across, first course up"),
        marks=[high, low, *squares],
    )


def _outline(plan: Plan, height_m: float, turn_deg: float) -> Array:
    """Return a strip with an arrow's head, then its middle footprint; right and up, km."""
    strip, camera = _strip(plan, height_m, turn_deg), plan.cameras("calibration")[0]
    half = 0.5 * strip.base_m * (N_IMAGES - 1)
    x = 0.5 * image_length_m(camera, height_m)
    y = 0.5 * image_length_m(camera, height_m, across=True)
    aside, head = 60.0, 90.0
    path = [
        (aside, -half), (aside, half), (aside - head / 2, half - head), (aside, half),
        (aside + head / 2, half - head), (aside, half), (aside, x), (y, x), (y, -x), (-y, -x),
        (-y, x), (aside, x),
    ]  # fmt: skip
    turn = np.radians(turn_deg)
    R = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return np.array(path) @ R.T / 1000.0


def _curve(plane: Plane, colour: str, places: Array) -> Mark:
    """Return a line through places, shape (n_ratios, n_turns, n_controls, n, 2)."""
    table = places.reshape(*places.shape[:3], -1)
    return Mark("curve", colour, plane, Stops(sliders=SLIDERS, table=table))


def _square(plane: Plane, place: Array, k: int) -> Mark:
    """Return the mark of a control point; it lies outside the drawing where it is not surveyed."""
    corners = 0.045 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
    centres = [place if k < n else np.array([99.0, 99.0]) for n in CONTROL.stops]
    return _curve(plane, "ink", np.array([centre + corners for centre in centres])[None, None])


# --- Tables of planned flights


def flights(plans: Mapping[str, Plan], names: Sequence[str]) -> pd.DataFrame:
    """Return strips, images, minutes and standard deviations, a column for every flight.

    Parameters
    ----------
    plans : mapping of str to Plan
        By their names for readers.
    names : sequence of str
        Parameters whose standard deviations are shown, by their names in results.
    """
    return pd.DataFrame({name: _column(plan, names) for name, plan in plans.items()})


def _column(plan: Plan, names: Sequence[str]) -> pd.Series:
    strips = [*plan.blocks["calibration"].strips.values()]
    of_flight = {
        "strips": len(strips),
        "images": sum(strip.n_exposures for strip in strips),
        "minutes": flying_time_s(tuple(strips)) / 60,
    }
    return pd.concat([pd.Series(of_flight), sigmas(plan)[[*names]]])


def written(numbers: pd.DataFrame) -> pd.DataFrame:
    """Return the table of `flights` as text, with names and units for readers."""
    counted = ["strips", "images", "minutes"]
    text = numbers.map("{:#.2g}".format)
    text.loc[counted] = numbers.loc[counted].map("{:.0f}".format)
    units = {name: name.rpartition("_")[2].replace("deg", "°") for name in numbers.index[3:]}
    names = {name: Markup(f"σ of {LABELS[name]}, {unit}") for name, unit in units.items()}
    return text.rename(index=names).reset_index(names="")


# --- The plan of the paper's calibration flight


def papers(gnss: Sequence[str] = ()) -> Plan:
    """Return the plan of the paper's calibration block, with its synthetic camera.

    Parameters
    ----------
    gnss : sequence of str
        Errors of GNSS that are unknown as well, such as ``shift``.
    """
    values = simulated.values(acx4_ideal_plan())
    values["stages"]["mounting"]["gnss"] = [*gnss]
    return plans.from_values({k: v for k, v in values.items() if k not in ("heads", "validation")})
