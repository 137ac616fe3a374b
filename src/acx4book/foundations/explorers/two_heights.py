"""What a second flying height determines: standard deviations at every ratio of two heights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4book.foundations.designs import covariance, lines, planned
from acx4book.typesetting.moving.explorer import Column, Explorer, Mark, Panel, Slider, Stops
from acx4book.typesetting.moving.plane import Plane
from acx4lib.expected import Array

LOWER_M = 500.0
"""Height over ground of the lower lines."""

RATIO = Slider(name="second height over first", unit="", low=1.0, high=3.0, step=0.05)

SHOWN = {
    "f, mm": ("f, µm", 1000.0),
    "lever z, m": ("lever arm z, cm", 100.0),
    "lever x, m": ("lever arm x, cm", 100.0),
    "xp, mm": ("xₚ, µm", 1000.0),
    "φ, °": ("φ, 0.001°", 1000.0),
}
"""Unknowns of `designs.SHOWN`: as they are shown, with the factor to the unit there."""

SMALLEST = 0.005
"""Where the axis of the bars begins, a share of the σ at equal heights."""


def covariances(ratios: Sequence[float] | Array) -> Array:
    """Return covariances of the unknowns in the units of `SHOWN`, shape (n_ratios, 5, 5).

    Two opposite lines at each of two heights; f, the principal point, the whole mounting and a
    shift of GNSS are unknown.
    """
    names, scale = [*SHOWN], np.array([factor for _, factor in SHOWN.values()])
    found = []
    for ratio in ratios:
        flown = lines(90, 270, height_m=LOWER_M) + lines(90, 270, height_m=LOWER_M * ratio)
        cov = covariance(planned(flown), free=["f", "xp", "yp"], gnss=["shift"])
        found.append(cov.loc[names, names].to_numpy())
    return np.array(found) * np.outer(scale, scale)


def explorer() -> Explorer:
    """Return the explorer."""
    cov = covariances(RATIO.stops)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    share = sigma / sigma[0]
    rows = {
        f"σ of {name}": [Stops(sliders=[RATIO], table=column[:, [k]]) for column in (sigma, share)]
        for k, (name, _) in enumerate(SHOWN.values())
    }
    correlation = cov[:, [0], 1] / (sigma[:, [0]] * sigma[:, [1]])
    rows["correlation of f and z"] = [Stops(sliders=[RATIO], table=correlation)]
    return Explorer(
        name="explorer-two-heights",
        caption=(
            f"Opposite lines at {LOWER_M:.0f} m and at a second height. Left, the standard ellipse "
            "of the errors of f and of the lever arm's z: with equal heights it is a long line "
            "that leaves the drawing, since the two can be exchanged for each other. Right, each "
            "standard deviation as a share of what it is with equal heights; the axis is "
            "logarithmic."
        ),
        sliders=[RATIO],
        presets={f"{ratio:.1f}": [ratio] for ratio in (1.5, 1.0, 1.1, 2.0, 3.0)},
        panels=[_ellipse(cov[:, :2, :2]), _bars(share)],
        columns=[
            Column(title="value", digits=2),
            Column(title="share of σ at equal heights", digits=3),
        ],
        rows=rows,
    )


def ellipses(cov: Array, n: int = 36) -> Array:
    """Return points on the standard ellipses of covariances, shape (len(cov), n + 1, 2).

    Parameters
    ----------
    cov : ndarray, shape (n_ratios, 2, 2)
    n : int
        Number of points; the last is the first again.
    """
    angle = np.linspace(0, 2 * np.pi, n + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    values, axes = np.linalg.eigh(cov)
    points: Array = np.einsum("rij,rj,nj->rni", axes, np.sqrt(values), circle)
    return points


def _ellipse(cov: Array) -> Panel:
    size, limit = (360.0, 300.0), 40.0
    plane = Plane(x=(-limit, limit), y=(-limit, limit), size=size, margin=(44.0, 12.0, 26.0, 40.0))
    points = ellipses(cov)
    table = points.reshape(len(cov), -1)
    at = np.tile(plane.at(np.zeros((1, 2))), (points.shape[1], 1))
    ticks = [-40, -20, 0, 20, 40]
    return Panel(
        title="errors of f and z together",
        alt="A narrow ellipse that rises to the right, in a plane of errors of f and of z.",
        size=size,
        fixed=plane.axes(ticks, ticks, labels=("error of f, µm", "error of lever arm z, cm"))
        + plane.line([(-limit, 0), (limit, 0)], dash="2 3")
        + plane.line([(0, -limit), (0, limit)], dash="2 3"),
        marks=[
            Mark(
                kind="curve",
                colour="blue",
                at=at,
                scale=plane.scale,
                response=Stops(sliders=[RATIO], table=table),
            )
        ],
    )


def _bars(share: Array) -> Panel:
    size, n = (360.0, 300.0), share.shape[1]
    decades = (0.01, 0.1, 1.0)
    plane = Plane(
        x=(np.log10(SMALLEST), 0.0), y=(-0.7, n - 0.1), size=size, margin=(104.0, 14.0, 26.0, 40.0)
    )
    lengths = np.log10(np.maximum(share, SMALLEST)) - plane.x[0]
    rows = np.column_stack([np.full(n, plane.x[0]), np.arange(n)[::-1]])
    table = np.stack([lengths, np.zeros_like(lengths)], axis=2).reshape(len(share), -1)
    names = "".join(
        plane.text(at, name.partition(",")[0], anchor="end", shift=(-6, 4))
        for at, (name, _) in zip(rows, SHOWN.values(), strict=True)
    )
    ticks = "".join(
        plane.line([(np.log10(d), plane.y[0]), (np.log10(d), plane.y[1])], dash="2 3")
        + plane.text((np.log10(d), plane.y[0]), f"{d:g}", shift=(0, 16))
        for d in decades
    )
    return Panel(
        title="standard deviations",
        alt="Five bars on a logarithmic axis: f and z are the shortest, φ reaches nearly to one.",
        size=size,
        fixed=ticks
        + names
        + plane.text((plane.x[0] / 2, plane.y[0]), "share of σ at equal heights", shift=(0, 32)),
        marks=[
            Mark(
                kind="bars",
                colour="teal",
                at=plane.at(rows),
                scale=plane.scale,
                response=Stops(sliders=[RATIO], table=table),
            )
        ],
    )
