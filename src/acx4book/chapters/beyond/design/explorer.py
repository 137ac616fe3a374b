"""The design of a flight to move: two heights, the angle between strips, control points."""

from __future__ import annotations

import numpy as np

from acx4book.typesetting.moving.explorer import Column, Explorer, Mark, Panel, Slider, Stops
from acx4book.typesetting.moving.plane import Plane
from acx4lib.expected import Array
from acx4lib.planning import ground
from acx4lib.planning.choosing.target import BLOCK
from acx4lib.planning.design import sigmas
from acx4lib.planning.plan import Plan, Strip, image_length_m, strip_of

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

LEAST, MOST = 0.3, 300.0
"""Ends of the bars' axis."""

N_IMAGES = 5
"""Of every strip."""

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
    found = sigma(plan)
    rows = {
        f"σ of {name}": [Stops(sliders=SLIDERS, table=found[..., [k]])]
        for k, (name, _) in enumerate(SHOWN.values())
    }
    return Explorer(
        name="explorer-design",
        caption=(
            f"Two strips at {LOW_M:.0f} m and two at a second height, five images each, by the "
            "paper's camera; unknown are its interior orientation, the mounting, and a shift of "
            "GNSS. Left, the lower strip of the first course, blue, and the upper one of the "
            "second, orange, each with the footprint of its middle image; squares are control "
            "points. Right, standard deviations on a logarithmic axis."
        ),
        sliders=SLIDERS,
        presets={
            "two heights, opposite": [1.5, 180.0, 5.0],
            "one height": [1.0, 180.0, 5.0],
            "one direction": [1.5, 0.0, 5.0],
            "crossing": [1.5, 90.0, 5.0],
            "two control points": [1.5, 180.0, 2.0],
        },
        panels=[_map(plan), _bars(found)],
        columns=[Column(title="value", digits=2)],
        rows=rows,
    )


def sigma(plan: Plan) -> Array:
    """Return σ in the units of `SHOWN`, shape (n_ratios, n_turns, n_controls, n_shown).

    Two strips at the lower height and two at the upper one; the second of each is turned.
    """
    found = [
        [[_shown(plan, ratio, turn, int(n)) for n in CONTROL.stops] for turn in TURN.stops]
        for ratio in RATIO.stops
    ]
    return np.array(found)


def _shown(plan: Plan, ratio: float, turn_deg: float, control: int) -> Array:
    heights = (LOW_M, LOW_M * ratio)
    strips = [_strip(plan, height, turn) for height in heights for turn in (0.0, turn_deg)]
    found = sigmas(plan.with_strips(strips).with_control(control, AREA_M))
    return np.array([factor * found[name] for name, (_, factor) in SHOWN.items()])


def _strip(plan: Plan, height_m: float, turn_deg: float) -> Strip:
    camera = plan.cameras(BLOCK)[0]
    return strip_of(camera, height_m, COURSE_DEG + turn_deg, images=N_IMAGES)


def _map(plan: Plan) -> Panel:
    size, reach = (340.0, 300.0), 1.7
    plane = Plane(x=(-reach, reach), y=(-reach * 0.88, reach * 0.88), size=size)
    low = _curve(plane, "blue", _outline(plan, LOW_M, 0.0)[None, None, None])
    turned = [[_outline(plan, LOW_M * r, turn) for turn in TURN.stops] for r in RATIO.stops]
    high = _curve(plane, "orange", np.array(turned)[:, :, None])
    points = plan.with_control(int(CONTROL.high), AREA_M).control
    at = ground.places(points)[:, ::-1] * [-1, 1] / 1000.0
    squares = [_square(plane, place, k) for k, place in enumerate(at)]
    return Panel(
        title="the flight in plan",
        alt="A blue strip upwards and an orange one downwards with their footprints, and squares.",
        size=size,
        fixed=plane.text((0.0, -reach * 0.84), "3.4 km across, first course up"),
        marks=[high, low, *squares],
    )


def _outline(plan: Plan, height_m: float, turn_deg: float) -> Array:
    """Return a strip with an arrow's head, then its middle footprint; right and up, km."""
    one, camera = _strip(plan, height_m, turn_deg), plan.cameras(BLOCK)[0]
    half = 0.5 * one.base_m * (N_IMAGES - 1)
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
    at = np.tile(plane.at(np.zeros((1, 2))), (places.shape[3], 1))
    table = places.reshape(*places.shape[:3], -1)
    response = Stops(sliders=SLIDERS, table=table)
    return Mark(kind="curve", colour=colour, at=at, scale=plane.scale, response=response)


def _square(plane: Plane, place: Array, k: int) -> Mark:
    """Return a control point that is out of the drawing where it is not surveyed."""
    corners = 0.045 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
    there = [place if k < n else np.array([99.0, 99.0]) for n in CONTROL.stops]
    return _curve(plane, "ink", np.array([one + corners for one in there])[None, None])


def _bars(found: Array) -> Panel:
    size, n = (360.0, 300.0), len(SHOWN)
    ends = np.log10([LEAST, MOST])
    plane = Plane(x=tuple(ends), y=(-0.7, n - 0.1), size=size, margin=(104.0, 14.0, 26.0, 40.0))
    lengths = np.log10(np.clip(found, LEAST, MOST)) - ends[0]
    rows = np.column_stack([np.full(n, ends[0]), np.arange(n)[::-1]])
    table = np.stack([lengths, np.zeros_like(lengths)], axis=-1).reshape(*found.shape[:3], -1)
    names = "".join(
        plane.text(at, name, anchor="end", shift=(-6, 4))
        for at, (name, _) in zip(rows, SHOWN.values(), strict=True)
    )
    ticks = "".join(
        plane.line([(np.log10(d), plane.y[0]), (np.log10(d), plane.y[1])], dash="2 3")
        + plane.text((np.log10(d), plane.y[0]), f"{d:g}", shift=(0, 16))
        for d in (1.0, 10.0, 100.0)
    )
    middle = (float(ends.mean()), plane.y[0])
    return Panel(
        title="standard deviations",
        alt="Six bars on a logarithmic axis, all of them short: from one to about six units.",
        size=size,
        fixed=ticks + names + plane.text(middle, "σ in the unit beside its name", shift=(0, 32)),
        marks=[
            Mark(
                kind="bars",
                colour="teal",
                at=plane.at(rows),
                scale=plane.scale,
                response=Stops(sliders=SLIDERS, table=table),
            )
        ],
    )
