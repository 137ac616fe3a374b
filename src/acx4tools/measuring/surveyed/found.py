"""The surveyed points of a block: those measured in one picture, and those that are signalised."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import inside
from acx4tools.measuring.flights import Measured
from acx4tools.measuring.pictures.ground import Surface
from acx4tools.measuring.pictures.views import View, pixels_of
from acx4tools.measuring.surveyed.natural import carried
from acx4tools.measuring.surveyed.targets import find_targets


@dataclass(frozen=True, kw_only=True, eq=False)
class Surveyed:
    """Surveyed points as they were found.

    Attributes
    ----------
    rows : tuple of Measured
        Measurements beside the given ones.
    not_found : dict of str to tuple of str
        For every point that some pictures should show and that was not found in them, these.
    """

    rows: tuple[Measured, ...]
    not_found: dict[str, tuple[str, ...]]


def find_surveyed(
    views: Sequence[View],
    surface: Surface,
    names: Sequence[str],
    x_m: Array,
    given: Sequence[Measured],
) -> Surveyed:
    """Look for surveyed points in all pictures of a block.

    Parameters
    ----------
    views : sequence of View
        With orientations on which the pictures agree.
    surface : Surface
    names : sequence of str
        Of the points.
    x_m : ndarray, shape (n, 3)
        Mapping frame, m.
    given : sequence of Measured
        What is measured already. Such a point is matched from there; the others are looked for as
        signalised ones.
    """
    there = {(row.image, row.point) for row in given}
    by_point: dict[str, list[Measured]] = {}
    for row in given:
        by_point.setdefault(row.point, []).append(row)
    signalised = [k for k, name in enumerate(names) if name not in by_point]
    rows = [
        _row(views[one.view], names[signalised[one.point]], np.array(one.colrow), one.sigma_px)
        for one in find_targets(views, x_m[signalised])
    ]
    for name in names:
        rows += _natural(views, surface, by_point.get(name, []))
    rows = [row for row in rows if (row.image, row.point) not in there]
    done = there | {(row.image, row.point) for row in rows}
    return Surveyed(rows=tuple(rows), not_found=dict(_missing(views, names, x_m, done)))


def _natural(
    views: Sequence[View], surface: Surface, given: Sequence[Measured]
) -> Iterator[Measured]:
    """Yield the measurements of a point in other pictures, matched from the surest given one."""
    of_name = {view.name: view for view in views}
    here = [row for row in given if row.image in of_name]
    if not here:
        return
    row = min(here, key=lambda one: one.sigma_px)
    view = of_name[row.image]
    others = [other for other in views if other is not view]
    colrow = view.own(np.array([[row.col_px, row.row_px]]))[0]
    for k, place, sigma in zip(*carried(view, others, surface, colrow), strict=True):
        own = others[k]
        given_px = row.sigma_px / own.shrink
        yield _row(own, row.point, place, float(np.hypot(sigma, given_px)))


def _row(view: View, point: str, colrow: Array, sigma_px: float) -> Measured:
    col, row = view.full(colrow[None])[0]
    return Measured(
        image=view.name,
        point=point,
        col_px=float(col),
        row_px=float(row),
        sigma_px=sigma_px * view.shrink,
    )


def _missing(
    views: Sequence[View], names: Sequence[str], x_m: Array, done: set[tuple[str, str]]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the points that pictures should show, with those in which they were not found."""
    shown: list[Mask] = [inside(view.camera, pixels_of(view, x_m)) for view in views]
    for k, name in enumerate(names):
        lacking = [
            view.name
            for view, here in zip(views, shown, strict=True)
            if here[k] and (view.name, name) not in done
        ]
        if lacking:
            yield name, tuple(lacking)
