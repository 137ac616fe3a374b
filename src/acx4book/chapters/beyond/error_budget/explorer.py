"""An explorer: what every source makes of a ground point, for any height and any trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acx4book.chapters.beyond.error_budget.tables import COORDINATES, plan_and_height
from acx4book.typesetting.moving import shown as html
from acx4book.typesetting.moving.explorer import Column, Explorer, Mark, Panel, Roots, Slider
from acx4book.typesetting.moving.plane import Plane
from acx4book.typesetting.moving.shown import Shown
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.mapping_flight import MappingFlight, over_ground

SLIDERS = (
    Slider(name="flying height", unit="m", low=500.0, high=3000.0, step=100.0),
    Slider(name="image point", unit="px", low=0.0, high=3.0, step=0.1),
    Slider(name="GNSS", unit="cm", low=0.0, high=30.0, step=1.0),
    Slider(name="roll and pitch", unit="°", low=0.0, high=0.02, step=0.0005),
    Slider(name="heading", unit="°", low=0.0, high=0.04, step=0.001),
)
"""For an aerial camera and its trajectory; those of other flights have other ends."""

SCALES = sorted(
    (d * 10.0**k for d in (1, 2, 5) for k in range(-6, 7)), key=lambda s: abs(np.log(s))
)
"""Factors of the ends of a slider, the nearest to one first."""

ENDS = tuple(d * 10.0**k for k in range(-6, 7) for d in (1.5, 3.0, 6.0))
"""Where axes may end: thirds of them are short numbers."""

ROWS = {
    "calibration": (0, budget.CALIBRATION),
    "image points": (1, ("image points",)),
    "GNSS": (2, ("GNSS",)),
    "roll and pitch": (3, ("roll", "pitch")),
    "heading": (4, ("heading",)),
}
"""What is shown: the slider on which it depends, and its sources; the first depends on none."""


def unit_flight(height_m: float) -> MappingFlight:
    """Return a mapping flight whose standard deviations are one unit of each slider."""
    degree = float(np.radians(1.0))
    return MappingFlight(
        height_m=height_m,
        sigma_position_m=(0.01, 0.01, 0.01),
        sigma_attitude=(degree, degree, degree),
        sigma_px=1.0,
    )


def sliders(values: Sequence[float]) -> list[Slider]:
    """Return the sliders between whose ends values lie: those of `SLIDERS`, or scaled."""
    return [_around(slider, value) for slider, value in zip(SLIDERS, values, strict=True)]


def _around(slider: Slider, value: float) -> Slider:
    least = max(slider.low, slider.step)
    scale = next((s for s in SCALES if s * least <= value <= s * slider.high), 1.0)
    low, high, step = (scale * end for end in (slider.low, slider.high, slider.step))
    return replace(slider, low=low, high=high, step=step)


def effects(calibration: Calibration, height: Slider) -> Array:
    """Return what one unit of each slider makes of a ground point, at every stop of the height.

    Parameters
    ----------
    calibration : Calibration
        Of one camera.
    height : Slider

    Returns
    -------
    ndarray, shape (n_stops, 2, n_rows)
        In plan and in height, cm.
    """
    found = []
    for height_m in height.stops:
        mean = plan_and_height(over_ground(calibration, unit_flight(height_m)).mean)
        own = [[budget.SOURCES.index(name) for name in sources] for _, sources in ROWS.values()]
        found.append([[part[columns].sum() for columns in own] for part in mean])
    return 100 * np.sqrt(np.maximum(np.array(found), 0.0))


def shown(calibration: Calibration, flown: MappingFlight) -> Shown:
    """Return the explorer as the page shows it."""
    return html.explorer(explorer(calibration, flown))


def explorer(calibration: Calibration, flown: MappingFlight) -> Explorer:
    """Return the explorer for a calibration and a flight.

    Parameters
    ----------
    calibration : Calibration
        Of one camera.
    flown : MappingFlight
        Where the sliders begin.
    """
    tilt, _, heading = np.degrees(flown.sigma_attitude)
    values = (flown.height_m, flown.sigma_px, 100 * flown.sigma_position_m[0], tilt, heading)
    own = sliders([float(value) for value in values])
    size = effects(calibration, own[0])
    table = np.zeros((*size.shape[:2], len(ROWS) + 1, len(own)))
    for k, (slider, _) in enumerate(ROWS.values()):
        table[:, :, k, slider] = size[:, :, k]
        table[:, :, -1, slider] = size[:, :, k]  # all together
    names = [*ROWS, "all together"]
    start = [round(float(value), slider.digits) for slider, value in zip(own, values, strict=True)]
    presets = {
        "this flight": start,
        "poor positions": [*start[:2], own[2].high, *start[3:]],
        "better targets": [start[0], round(start[1] / 3, own[1].digits), *start[2:]],
        "twice as high": [min(2 * start[0], own[0].high), *start[1:]],
    }
    rows = {
        name: [Roots(sliders=own, table=table[:, k, [i]]) for k in range(2)]
        for i, name in enumerate(names)
    }
    largest = np.max(
        [[part.at(at)[0] for part in rows[names[-1]]] for at in presets.values()], axis=0
    )
    ends = [next(end for end in ENDS if end >= one) for one in largest]
    return Explorer(
        name="explorer-error-budget",
        caption=(
            "Standard deviation of a ground point by its sources, for a mapping flight with 60 and "
            "30\N{NO-BREAK SPACE}% of overlap and the calibration of this flight, without an error "
            "of the survey. The last bar is the root of the sum of the squares of the others."
        ),
        sliders=own,
        presets=presets,
        panels=[
            _panel(name, names, Roots(sliders=own, table=_bars(table[:, k])), ends[k])
            for k, name in enumerate(COORDINATES)
        ],
        columns=[Column(title=f"{name} (cm)", digits=1) for name in COORDINATES],
        rows=rows,
    )


def _bars(table: Array) -> Array:
    """Return a table of lengths with a row of zeros, the other coordinate, below each."""
    both = np.zeros((len(table), 2 * table.shape[1], table.shape[2]))
    both[:, ::2] = table
    return both


def _panel(title: str, names: list[str], lengths: Roots, end: float) -> Panel:
    n = len(names)
    plane = Plane(
        x=(0.0, end), y=(-0.7, n - 0.3), size=(360.0, 230.0), margin=(104.0, 14.0, 8.0, 40.0)
    )
    at = np.column_stack([np.zeros(n), np.arange(n)[::-1]])
    ticks = "".join(
        plane.line([(tick, plane.y[0]), (tick, plane.y[1])], dash="2 3")
        + plane.text((tick, plane.y[0]), f"{tick:g}", shift=(0, 16))
        for tick in np.linspace(0, end, 4)
    )
    labels = "".join(
        plane.text(place, name, anchor="end", shift=(-6, 4))
        for place, name in zip(at, names, strict=True)
    )
    return Panel(
        title=title,
        alt=f"Bars for the sources of the error in {title}, and for all of them together.",
        size=plane.size,
        fixed=ticks + labels + plane.text((end / 2, plane.y[0]), "σ (cm)", shift=(0, 32)),
        marks=[
            Mark(
                kind="bars",
                colour="blue",
                at=plane.at(at),
                scale=plane.scale,
                response=lengths,
            )
        ],
    )
