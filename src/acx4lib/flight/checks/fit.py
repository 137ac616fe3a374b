"""Whether control points project near their measurements, and the likely mistake if not.

With the approximate mounting and the trajectory, a control point must project near its
measurements. If it does not, the usual mistakes are undone one by one. If everything fits
after one of them, this mistake is named.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import BlockTables, assemble, measured_control
from acx4lib.flight.checks.mistakes import Mistake, mistakes, mounting_mistakes
from acx4lib.flight.problems import SHOWN, Problem
from acx4lib.flight.setup import Setup
from acx4lib.flight.text.document import Toml
from acx4lib.flight.text.table import Table
from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4lib.geometry.collinearity import pinhole, to_camera

ENOUGH = 3
"""Number of control measurements that is enough to judge a single camera."""


ENOUGH_TO_EXPLAIN = 5000
"""Number of rows of a table above which mistakes are tried on a part of the measurements."""

MOST = 0.75
"""Quantile of the distances that must be within the limit after a mistake is undone."""

ALIKE = 0.9
"""Ratio to the best misfit so far below which a later mistake is clearly the better explanation."""

FAR = 50_000.0
"""Distance of a block from its control points, m, that only another CRS explains."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Misfit:
    """Distances of control points from their measurements.

    Attributes
    ----------
    distance_px : ndarray, shape (n,)
        Infinite for a point behind the camera.
    allowed_px : ndarray, shape (n,)
        A quarter of the image diagonal.
    camera_idx, point_idx : ndarray, shape (n,)
    """

    distance_px: Array
    allowed_px: Array
    camera_idx: Index
    point_idx: Index

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.distance_px)

    def __getitem__(self, keep: Mask) -> Misfit:
        """Select measurements."""
        return Misfit(
            distance_px=self.distance_px[keep],
            allowed_px=self.allowed_px[keep],
            camera_idx=self.camera_idx[keep],
            point_idx=self.point_idx[keep],
        )

    def ratio(self, quantile: float) -> float:
        """Return a quantile of the ratios of distance to allowed distance."""
        return float(np.quantile(self.distance_px / self.allowed_px, quantile, method="higher"))


def misfit(block: Block) -> Misfit:
    """Return the distances of projected surveyed points from their measurements, not adjusted.

    Parameters
    ----------
    block : Block
    """
    x_m = np.full((len(block.points), 3), np.nan)
    is_surveyed = np.zeros(len(block.points), dtype=bool)
    for surveyed in (block.control, block.check):
        x_m[surveyed.point_idx] = surveyed.x_m
        is_surveyed[surveyed.point_idx] = True
    points = block.image_points[is_surveyed[block.image_points.point_idx]]
    camera_idx = block.images.camera_idx[points.image_idx]
    distance = np.full(len(points), np.inf)
    allowed = np.full(len(points), np.inf)
    for i, camera in enumerate(block.cameras):
        mine = camera_idx == i
        T_m_c = block.T_m_b_images[points.image_idx[mine]] @ camera.T_b_c
        x_c = to_camera(T_m_c, x_m[points.point_idx[mine]])
        ideal = correct(camera.interior, xy_from_colrow(camera, points.colrow[mine]))
        away = pinhole(camera.interior.f, x_c) - ideal
        distance[mine] = np.hypot(*away.T) / camera.pixel_mm
        allowed[mine] = camera.diagonal_px / 4
    distance[np.isnan(distance)] = np.inf
    return Misfit(
        distance_px=distance,
        allowed_px=allowed,
        camera_idx=camera_idx,
        point_idx=points.point_idx,
    )


def fit_problems(tables: BlockTables, setup: Setup, toml: Toml) -> Iterator[Problem]:
    """Yield a problem where the median distance exceeds a quarter of the image diagonal.

    Half of the strips may be wrong and the median good (headings of 0 and 180 degrees in
    radians). So a problem is also reported where a usual mistake explains the worse half.

    Parameters
    ----------
    tables : BlockTables
        Tables without any other problem.
    setup : Setup
    toml : Toml
        It has the lines of the mounting angles.
    """
    tables = _control_only(tables)
    if not len(tables.image_points):
        return
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        block = assemble(tables, setup)
        found = misfit(block)
    by_camera = {c.name: found[found.camera_idx == i] for i, c in enumerate(block.cameras)}
    judged = {name: mine for name, mine in by_camera.items() if len(mine) >= ENOUGH}
    wrong = {name: mine for name, mine in judged.items() if mine.ratio(0.5) > 1}
    if wrong and len(wrong) < len(judged):
        for name, mine in islice(wrong.items(), SHOWN):
            yield _one_camera(tables, setup, toml, (name, mine))
        if len(wrong) > SHOWN:
            says = f"control points do not fit images of {len(wrong) - SHOWN} more cameras"
            yield toml.problem(("cameras",), says, "must lie near their measurements")
    elif found.ratio(MOST) > 1:
        problem, explained = _whole_block(tables, setup, toml, found)
        if explained or found.ratio(0.5) > 1:
            yield problem


def _control_only(tables: BlockTables) -> BlockTables:
    """Return the tables without tie points and without control points that are not measured."""
    surveyed = set(tables.control.text["point"])
    names = tables.image_points.text["point"]
    measured = np.array([name in surveyed for name in names], dtype=bool)
    return replace(
        tables,
        image_points=tables.image_points.select(measured),
        control=tables.control.select(measured_control(tables)),
        distances=None,
    )


def _thinned(tables: BlockTables) -> BlockTables:
    """Return some thousand measurements of a large block, and the rows that belong to them.

    About forty mistakes are tried; a part of the measurements shows them as well as all do.
    """
    if max(len(table) for table in tables.tables) <= ENOUGH_TO_EXPLAIN:
        return tables
    points = tables.image_points
    every = -(-len(points) // ENOUGH_TO_EXPLAIN)
    points = points.select(np.arange(len(points)) % every == 0)
    images = _named(tables.images, "image", points.text["image"])
    return replace(
        tables,
        image_points=points,
        images=images,
        trajectory=_named(tables.trajectory, "exposure", images.text["exposure"]),
        control=_named(tables.control, "point", points.text["point"]),
        distances=None,
    )


def _named(table: Table, column: str, names: Iterable[str]) -> Table:
    """Return the rows with one of these names."""
    wanted = set(names)
    return table.select(np.array([name in wanted for name in table.text[column]], dtype=bool))


def _whole_block(
    tables: BlockTables, setup: Setup, toml: Toml, found: Misfit
) -> tuple[Problem, bool]:
    """Return the problem of a block, and whether a usual mistake explains it."""
    problem = _problem(tables, found, "control points")
    best, says = _best(mistakes(_thinned(tables), setup))
    if best is None:
        return replace(problem, found=f"{problem.found}; {_where(tables, setup)}"), False
    problem = replace(problem, found=f"{problem.found}; {says}")
    if best.where == "mount":
        return _at_mount(problem, toml, min(tables.images.text["camera"])), True
    table: Table = getattr(tables, best.where)
    return replace(problem, file=table.file, column=best.column), True


def _one_camera(
    tables: BlockTables, setup: Setup, toml: Toml, which: tuple[str, Misfit]
) -> Problem:
    name, found = which
    camera = dict(zip(tables.images.text["image"], tables.images.text["camera"], strict=True))
    keep = np.array([camera[i] == name for i in tables.image_points.text["image"]], dtype=bool)
    alone = replace(
        tables,
        image_points=tables.image_points.select(keep),
        images=_named(tables.images, "camera", [name]),
    )
    _, says = _best(mounting_mistakes(_thinned(alone), setup, only=name))
    problem = _problem(tables, found, f"control points in images of {name}")
    return _at_mount(replace(problem, found=f"{problem.found}; {says}"), toml, name)


def _best(candidates: Iterator[Mistake]) -> tuple[Mistake | None, str]:
    """Return the mistake that explains nearly all misfits, if there is one, and a sentence."""
    best, least, left = None, 1.0 / ALIKE, ""
    for mistake in candidates:
        with np.errstate(all="ignore"):  # changed positions may not be on the earth
            after = misfit(assemble(mistake.tables, mistake.setup))
            ratio = after.ratio(MOST)
        if ratio < ALIKE * least:
            best, least, left = mistake, ratio, f"{np.median(after.distance_px):.0f} px"
    if best is None:
        return None, "no quarter turn or sign explains it"
    return best, f"it looks as if {best.says} (then {left})"


def _problem(tables: BlockTables, found: Misfit, who: str) -> Problem:
    median = float(np.median(found.distance_px))
    where = (
        f"{median:.0f} px from their measurements" if np.isfinite(median) else "behind the camera"
    )
    allowed = np.median(found.allowed_px)
    outside = int((found.distance_px > found.allowed_px).sum())
    return Problem(
        file=tables.control.file,
        line=1,
        column="east_m",
        found=f"{who} lie {where} (median; {outside} of {len(found)} too far) with the trajectory "
        f"of {tables.trajectory.file} and the points of {tables.control.file}",
        expected=f"must be below {allowed:.0f} px, a quarter of the image diagonal",
    )


def _at_mount(problem: Problem, toml: Toml, camera: str) -> Problem:
    """Return a problem with its place changed to the mounting angles in flight.toml."""
    return toml.problem(("cameras", camera, "mount_kappa_deg"), problem.found, problem.expected)


def _where(tables: BlockTables, setup: Setup) -> str:
    """Return a sentence on the distance between control and exposures, to find the mistake."""
    with np.errstate(all="ignore"):
        block = assemble(tables, setup)
    surveyed = np.concatenate([block.control.x_m, block.check.x_m])
    apart = surveyed.mean(axis=0) - block.trajectory.T_m_b.r.mean(axis=0)
    doubt = f" (is {setup.grid.crs} the right CRS?)" if np.hypot(*apart[:2]) > FAR else ""
    return (
        "no usual mistake explains it; the control points' middle lies "
        f"{apart[0]:.0f} m east, {apart[1]:.0f} m north and {apart[2]:.0f} m up of the exposures'"
        f"{doubt}"
    )
