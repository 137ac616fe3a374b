"""An explorer of the two methods: the reader sets the held lever arm of the two-step method.

The single step estimates the lever arm, so it does not depend on the held one. The two-step
method puts the difference into the interior orientation and the boresight. On the ground the two
parts cancel from the heights of the block, and from no other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from acx4book.typesetting.moving import (
    Column,
    Explorer,
    Linear,
    Mark,
    Panel,
    Plane,
    Slider,
    along,
    bars,
)
from acx4book.typesetting.style import round_length
from acx4lib import design
from acx4lib.attempts import Failed, attempt
from acx4lib.block import Block
from acx4lib.calibration.determination import ABSORBING
from acx4lib.calibration.mounting import Mounting, two_step_gnss
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import Measurement, directions, project
from acx4lib.geometry.frames import Pose, opk_from_rotation
from acx4lib.geometry.intersection import intersect
from acx4lib.georeferencing.budget import MappingFlight, looks_down, spacing

STEP_M = 0.1
"""Change of the held lever arm for numeric derivatives, m."""

BEYOND_M = 0.5
"""How far the sliders go beyond the declared and the estimated lever arm."""

AXES = {"x": "blue", "y": "orange", "z": "teal"}
"""Axes of the body, forward, left and up, and their colours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Held:
    """Estimates of the two-step method for any held lever arm, linear in it, from four of them.

    Attributes
    ----------
    single : Camera
        As the single step estimates it.
    cameras : tuple of Camera
        Of the two-step method: with the declared lever arm, and with `STEP_M` more along x, y, z.
    heights_m : tuple of float
        Of the block's strips above ground, each once.
    """

    single: Camera
    cameras: tuple[Camera, ...]
    heights_m: tuple[float, ...]

    @property
    def declared_m(self) -> Array:
        """The lever arm of the declaration, shape (3,)."""
        return self.cameras[0].T_b_c.r

    def response(self, values: Sequence[Array]) -> Linear:
        """Return values that depend linearly on the held lever arm.

        Parameters
        ----------
        values : sequence of ndarray
            Of the four cameras.
        """
        matrix = np.column_stack([(v - values[0]) / STEP_M for v in values[1:]])
        return Linear(matrix=matrix, constant=values[0] - matrix @ self.declared_m)

    @property
    def interior_um(self) -> Linear:
        """Two-step less single step of x_p, y_p and f, µm."""
        return self.response([1000 * (_interior(c) - _interior(self.single)) for c in self.cameras])

    @property
    def boresight(self) -> Linear:
        """Two-step less single step about x, y and z of the body, 0.001°."""
        single = self.single.T_b_c.R
        turns = [np.degrees(opk_from_rotation(c.T_b_c.R @ single.T)) for c in self.cameras]
        return self.response([1000 * turn for turn in turns])

    def ground_cm(self, height_m: float) -> Linear:
        """Error of a ground point along x, y and z of a level body at a height over it, cm."""
        return self.response(
            [100 * off_ground(camera, self.single, height_m) for camera in self.cameras]
        )


def _interior(camera: Camera) -> Array:
    """Return x_p, y_p and f, mm."""
    xp, yp, f = (getattr(camera.interior, name) for name in (*ABSORBING[1:], ABSORBING[0]))
    return np.array([xp, yp, f])


def off_ground(camera: Camera, true: Camera, height_m: float) -> Array:
    """Return a ground point as a camera intersects it; the true camera gives the origin.

    The point lies between two images of a level strip with 60 % of overlap, and is intersected
    from both.

    Parameters
    ----------
    camera, true : Camera
        The first with other parameters than the second.
    height_m : float
        Of the body above ground.

    Returns
    -------
    ndarray, shape (3,)
        Forward, left and up, m.
    """
    flown = MappingFlight(
        height_m=height_m, sigma_position_m=(1, 1, 1), sigma_attitude=(1, 1, 1), sigma_px=1
    )
    half = spacing(true, flown)[0] / 2
    T_m_b = Pose(
        R=np.tile(np.eye(3), (2, 1, 1)), r=np.array([[-half, 0, height_m], [half, 0, height_m]])
    )
    T_m_c = T_m_b @ camera.T_b_c
    measurement = Measurement(
        cameras=(camera,),
        camera_idx=np.zeros(2, dtype=np.intp),
        T_m_c=T_m_c,
        colrow=project(true, T_m_b @ true.T_b_c, np.zeros((2, 3))),
    )
    return intersect(T_m_c.r, directions(measurement), np.zeros(2, dtype=np.intp), 1)[0]


def held(
    block: Block,
    two: Mounting,
    single: Mounting,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
) -> Held | None:
    """Run the two-step method with three other lever arms; None where one of them fails.

    None also where heights over ground are not known.

    Parameters
    ----------
    block : Block
        Of one camera.
    two, single : Mounting
        Outcomes of `two_step_gnss` and `single_step`.
    free, fix, refraction
        As in `two_step_gnss`.
    """
    declared = two.calibration.cameras[0].T_b_c.r
    attempts = [
        attempt(
            two_step_gnss,
            design.with_lever_arm(block, declared + step),
            free=free,
            fix=fix,
            refraction=refraction,
            after=single,
        )
        for step in STEP_M * np.eye(3)
    ]
    outcomes = [outcome for outcome in attempts if not isinstance(outcome, Failed)]
    heights = [level.height_m for level in design.levels(single.bundle.network.block)]
    if len(outcomes) < len(attempts) or not np.all(np.isfinite(heights)):
        return None
    return Held(
        single=single.calibration.cameras[0],
        cameras=tuple(outcome.calibration.cameras[0] for outcome in (two, *outcomes)),
        heights_m=tuple(heights),
    )


def view(
    block: Block,
    two: Mounting,
    single: Mounting,
    *,
    free: Sequence[str],
    fix: Sequence[str] = (),
    refraction: str = "none",
) -> Explorer | None:
    """Return the explorer; None for several cameras, an oblique camera, or without outcomes.

    Parameters
    ----------
    block, two, single, free, fix, refraction
        As of `held`.
    """
    if len(block.cameras) > 1 or not looks_down(single.calibration.cameras[0]):
        return None
    outcome = held(block, two, single, free=free, fix=fix, refraction=refraction)
    return None if outcome is None else _explorer(outcome)


def _explorer(outcome: Held) -> Explorer:
    """Return the explorer."""
    estimated, declared = outcome.single.T_b_c.r, outcome.declared_m
    sliders = [
        Slider(
            name=f"held lever arm {axis}",
            unit="m",
            low=float(np.floor(10 * (min(ends) - BEYOND_M)) / 10),
            high=float(np.ceil(10 * (max(ends) + BEYOND_M)) / 10),
            step=0.01,
        )
        for axis, *ends in zip(AXES, estimated, declared, strict=True)
    ]
    as_estimated = [float(v) for v in np.round(estimated, 2)]
    shifted = {
        f"only {axis} wrong": [round(v + 0.3 * (i == k), 2) for i, v in enumerate(as_estimated)]
        for k, axis in enumerate(AXES)
    }
    low, high = min(outcome.heights_m), max(outcome.heights_m)
    heights = {f"{h:.0f} m": h for h in (*sorted({low, high}), 2 * high)}
    grows = Linear(matrix=100 * np.eye(3), constant=-100 * estimated)
    rows = {
        "lever arm (cm)": grows,
        "xₚ, yₚ, f (µm)": outcome.interior_um,
        "boresight (0.001°)": outcome.boresight,
        **{f"ground, {name} (cm)": outcome.ground_cm(h) for name, h in heights.items()},
    }
    presets = {
        "as declared": [float(v) for v in np.round(declared, 2)],
        "as the single step finds it": as_estimated,
        **shifted,
    }
    return Explorer(
        name="explorer-held-lever-arm",
        caption=(
            "The two-step method with the held lever arm, less the single step. Left: the interior "
            "orientation. Right: the error of a ground point, intersected from two images of a "
            "level strip, over the flying height; dashed lines are the heights of this block. The "
            "table has the numbers along the axes of the body, x forward, y to the left, z up, and "
            "those of the boresight about these axes."
        ),
        sliders=sliders,
        presets=presets,
        panels=[_interior_panel(outcome, sliders), _ground_panel(outcome, [*presets.values()])],
        columns=[Column(title=name, digits=1) for name in "xyz"],
        rows={name: _each(response) for name, response in rows.items()},
    )


def _each(response: Linear) -> list[Linear]:
    """Return the three numbers of a response as three responses."""
    constant = np.broadcast_to(response.constant, 3)
    return [Linear(matrix=response.matrix[[k]], constant=constant[[k]]) for k in range(3)]


def _end(responses: Sequence[Linear], settings: Iterable[Sequence[float]]) -> float:
    """Return the next round number above all responses at some settings of the sliders."""
    reached = [np.abs(response.at(values)).max() for values in settings for response in responses]
    largest = max(1e-3, *map(float, reached))
    power = 10.0 ** np.floor(np.log10(largest))
    return float(power * next(step for step in (1, 2, 5, 10) if step * power >= largest))


def _interior_panel(outcome: Held, sliders: Sequence[Slider]) -> Panel:
    change = outcome.interior_um
    end = _end([change], product(*((slider.low, slider.high) for slider in sliders)))
    lengths = replace(
        change, matrix=along(change.matrix, 0), constant=along(np.asarray(change.constant), 0)
    )
    return bars(
        ["xₚ", "yₚ", "f"],
        lengths,
        title="interior orientation",
        alt="Three bars from a line in the middle: principal point and focal length.",
        ends=(-end, end),
        label="two-step less single step, µm",
    )


def _ground_panel(outcome: Held, settings: Sequence[Sequence[float]]) -> Panel:
    lowest, highest = 0.5 * min(outcome.heights_m), 2 * max(outcome.heights_m)
    ends = [outcome.ground_cm(h) for h in (lowest, highest)]
    end = _end(ends, settings)
    plane = Plane(
        x=(0.0, highest), y=(-end, end), size=(360.0, 230.0), margin=(52.0, 14.0, 26.0, 40.0)
    )
    ends_of_line = plane.at(np.array([[lowest, 0.0], [highest, 0.0]]))
    marks = [
        Mark(
            kind="curve",
            colour=colour,
            at=ends_of_line,
            scale=plane.scale,
            response=Linear(
                matrix=_upwards([response.matrix[[k]] for response in ends]),
                constant=_upwards([np.asarray(response.constant)[[k]] for response in ends]),
            ),
        )
        for k, colour in enumerate(AXES.values())
    ]
    step = round_length(highest / 4)
    fixed = plane.axes(
        [*np.arange(0.0, highest, step)],
        [-end, -end / 2, 0.0, end / 2, end],
        labels=("flying height over ground, m", "error on the ground, cm"),
    ) + plane.line([(0, 0), (highest, 0)])
    fixed += "".join(plane.line([(h, -end), (h, end)], dash="2 3") for h in outcome.heights_m)
    above = end - 16 / plane.scale[1]  # 16 px over the drawing, beside the name of the axis
    for k, (axis, colour) in enumerate(AXES.items()):
        start = highest * (0.7 + 0.11 * k)
        fixed += plane.line([(start, above), (start + 0.04 * highest, above)], colour, 1.6)
        fixed += plane.text((start + 0.06 * highest, above), axis, shift=(0, 4))
    return Panel(
        title="the ground point",
        alt="Three straight lines over the flying height, which cross near the block's heights.",
        size=plane.size,
        fixed=fixed,
        marks=marks,
    )


def _upwards(ends: Sequence[Array]) -> Array:
    """Return rows for x, zero, and y of both ends of a line."""
    return np.concatenate([np.concatenate([np.zeros_like(end), end]) for end in ends])
