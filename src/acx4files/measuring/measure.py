"""Match the pictures of a whole flight, and write the measured flight."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath

import cv2
import numpy as np

from acx4files.flight.block_from_tables import BLOCKS, BlockTables, read_block, without_points
from acx4files.flight.reader import Flight, checked, read, table_files
from acx4files.flight.toml_file import read_toml
from acx4files.measuring import views
from acx4files.measuring.levels import Matched, MeasureOptions, beyond_search, match_block
from acx4files.measuring.orientation import GAP_DEG, R_NED_M, Coarse, oriented_by_features
from acx4files.measuring.oriented import firm, refined
from acx4files.measuring.pairs import FOLDER, Matching
from acx4files.measuring.targets import Measured, Surveyed, find_surveyed
from acx4files.measuring.views import (
    Surface,
    View,
    declared_views,
    pixels_of_view,
    seen_at,
    size_on_file,
)
from acx4files.results import whole_files
from acx4files.results.whole_files import file_stem
from acx4lib import expected, shown
from acx4lib.block import Block, select_images
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import rph_from_rotation

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The measurements of a block.

    Attributes
    ----------
    block : str
    matched : Matched
        Tie points.
    surveyed : Surveyed
        Control and check points.
    options : MeasureOptions
    coarse : tuple of str
        Sentences on the trajectory, where the pictures were oriented by features.
    """

    block: str
    matched: Matched
    surveyed: Surveyed
    options: MeasureOptions
    coarse: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """Messages for the user on tie points and surveyed points."""
        return (
            *self.coarse,
            *_on_ties(self.block, self.matched, self.options.reduce),
            *_on_surveyed(self.block, self.surveyed),
        )


def measure_flight(
    path: str | Path,
    folder: str | Path,
    *,
    options: MeasureOptions = MeasureOptions(),  # noqa: B008 frozen
    executor: Executor | None = None,
    tell: Tell = lambda *_: None,
) -> list[Outcome]:
    """Measure the pictures of a flight, and write the measured flight.

    Parameters
    ----------
    path : str or Path
        A flight; `image_points.csv` and `control_points.csv` may be missing or empty.
    folder : str or Path
        New or empty, or that of a call that was interrupted.
    options : MeasureOptions
    executor : Executor, optional
        Where pairs of pictures are matched; by default here.
    tell : callable
        Called with the name of a level, its finished pairs, and all.

    Raises
    ------
    FlightError
        Where the flight cannot be read or measured.
    AdjustmentError
        Where the points of a block cannot be adjusted.
    OutputError
        Where the folder must not be used.
    """
    unmeasured = read_unmeasured(path)
    with whole_files.claim(folder, signs=[FOLDER]):
        (Path(folder) / FOLDER).mkdir(exist_ok=True)  # by which the folder is known
        matching = Matching(folder=Path(folder) / FOLDER, executor=executor)
        _copied(unmeasured, Path(folder))
        out: list[Outcome] = []
        for name in unmeasured.flight.blocks:
            rows = _given(unmeasured.tables[name], unmeasured.flight.apriori.image_point_px)
            if any(unmeasured.flight.image_files[name]):
                alike = _measured_before(unmeasured, name, out) if not rows else None
                outcome = alike or _measured(unmeasured, name, rows, options, matching, tell)
                rows = [*rows, *outcome.surveyed.rows]
                names = {row.point for row in rows} | {
                    *unmeasured.tables[name].control.text["point"]
                }
                rows += _tie_rows(outcome.matched, names)
                out.append(outcome)
            _write_points(Path(folder), name, rows)
        _put(Path(folder) / SETTINGS, _content(unmeasured.flight.path / SETTINGS))
        matching.forget()
    read(folder)
    return out


def _measured_before(
    unmeasured: Unmeasured, name: str, before: Sequence[Outcome]
) -> Outcome | None:
    """Return the outcome of an earlier block with the same pictures, trajectory and control."""
    tables, flight = unmeasured.tables[name], unmeasured.flight
    for outcome in before:
        other = unmeasured.tables[outcome.block]
        files = [
            [path and path.name for path in flight.image_files[k]] for k in (name, outcome.block)
        ]
        same = (
            tables.images.text == other.images.text,
            tables.trajectory.text == other.trajectory.text,
            tables.control.text == other.control.text,
            files[0] == files[1],
            not len(other.image_points),
        )
        if all(same):
            return replace(outcome, block=name)
    return None


def _measured(
    unmeasured: Unmeasured,
    name: str,
    given: Sequence[Measured],
    options: MeasureOptions,
    matching: Matching,
    tell: Tell,
) -> Outcome:
    """Measure one block."""
    flight = unmeasured.flight
    files = flight.image_files[name]
    block = select_images(flight.block(name), np.array([path is not None for path in files]))
    views = views_of(flight, block, [path for path in files if path is not None])
    control = unmeasured.tables[name].control
    surface = _ground(unmeasured, block, options)
    matched, coarse = _matched(block, views, surface, options, matching, tell)
    if len(control):
        matched = _placed(coarse.block if coarse else block, matched)
    messages = (*coarse.said, *_told(block, matched.views)) if coarse else ()
    x_m = block.frame.from_grid(control.stack("east_m", "north_m", "height_m"))
    surveyed = find_surveyed(matched.views, matched.surface, control.text["point"], x_m, given)
    return Outcome(
        block=name,
        matched=matched,
        surveyed=surveyed,
        options=options,
        coarse=messages,
    )


def _placed(block: Block, matched: Matched) -> Matched:
    """Return a matched block, moved to fit its trajectory."""
    try:
        oriented = refined(firm(block), matched.views, matched.rays)
    except AdjustmentError:
        return matched
    return replace(matched, views=oriented.views, surface=oriented.surface)


def _told(block: Block, views: Sequence[View]) -> Iterator[str]:
    """Yield a sentence on the attitudes of every strip, or of every course where none is named."""
    image_idx = [block.images.names.index(view.name) for view in views]
    exposure, first = np.unique(block.images.exposure_idx[image_idx], return_index=True)
    R_c_b = np.swapaxes(mountings(block.cameras).R, 1, 2)[block.images.camera_idx[image_idx]]
    R_m_b = (np.array([view.T_m_c.R[0] for view in views]) @ R_c_b)[first]
    by_pictures = np.degrees(rph_from_rotation(R_NED_M @ R_m_b))
    by_trajectory = np.degrees(rph_from_rotation(R_NED_M @ block.trajectory.T_m_b.R[exposure]))
    off = (by_trajectory - by_pictures + 180) % 360 - 180
    strips = np.array(block.images.strips)[image_idx][first]
    named = bool(np.all(strips != ""))
    group = np.unique(strips, return_inverse=True)[1] if named else _courses(by_pictures[:, 2])
    for k in range(int(group.max()) + 1):
        rows = group == k
        heading = _mean_deg(by_pictures[rows, 2])
        name = f"strip {strips[rows][0]}, heading" if named else "heading"
        yield (
            f"{block.name}: {name} {heading:.0f}°, {shown.count(int(rows.sum()), 'exposure')}: "
            "the trajectory's roll, pitch, heading are off by "
            f"{_numbers(off[rows].mean(axis=0))}°, "
            f"each by {_numbers(np.sqrt(np.mean(np.square(off[rows]), axis=0)), '')}° rms"
        )


def _courses(heading_deg: Array) -> Index:
    """Return the number of the course of every exposure; courses are apart by `GAP_DEG`."""
    order = np.argsort(heading_deg % 360)
    sorted_deg = (heading_deg % 360)[order]
    step = np.diff(sorted_deg, prepend=sorted_deg[-1] - 360) > GAP_DEG
    number = np.cumsum(step) % max(int(step.sum()), 1)
    out = np.zeros(len(order), dtype=np.intp)
    out[order] = number
    return out


def _mean_deg(angles: Array) -> float:
    turn = np.exp(1j * np.radians(angles)).mean()
    return float(np.degrees(np.angle(turn)) % 360)


def _numbers(values: Array, sign: str = "+") -> str:
    return ", ".join(f"{value:{sign}.1f}" for value in values.tolist())


def _matched(
    block: Block,
    views: Sequence[View],
    surface: Surface | None,
    options: MeasureOptions,
    matching: Matching,
    tell: Tell,
) -> tuple[Matched, Coarse | None]:
    """Match a block from its trajectory's orientations; where they are too coarse, by features."""
    run = partial(match_block, options=options, matching=matching, tell=tell)
    beyond = beyond_search(block, views, surface, options.reduce) if surface else ""
    first: FlightError | AdjustmentError | None = None
    if surface and not beyond:
        try:
            return run(block, views, surface), None
        except (FlightError, AdjustmentError) as error:
            first = error
    count = partial(tell, f"{block.name} features")
    try:
        coarse = oriented_by_features(block, views, executor=matching.executor, tell=count)
    except (FlightError, AdjustmentError) as error:
        raise _joined(first, beyond if surface else _NO_HEIGHT, error) from None
    return run(coarse.block, coarse.views, coarse.surface, skip=1), coarse


def _joined(
    first: FlightError | AdjustmentError | None, beyond: str, last: FlightError | AdjustmentError
) -> FlightError | AdjustmentError:
    """Return the error of a block that can be matched neither by its trajectory nor by features."""
    if isinstance(first, AdjustmentError):
        return first
    return FlightError(
        [*(first.problems if first else []), *([beyond] if beyond else []), str(last)]
    )


_NO_HEIGHT = "no control points tell the height of the ground; it may be given by --ground HEIGHT"


def views_of(flight: Flight, block: Block, files: Sequence[Path]) -> list[View]:
    """Return the pictures of a block with their approximate orientations, at their files' size.

    Parameters
    ----------
    flight : Flight
    block : Block
        With one image for each file.
    files : sequence of Path
    """
    inside = flight.pictures.resolve()
    shown = [flight.pictures / path.relative_to(inside) for path in files]
    views = declared_views(block, shown)
    return [seen_at(view, size_on_file(view.path, view.declared)) for view in views]


def _ground(unmeasured: Unmeasured, block: Block, options: MeasureOptions) -> Surface | None:
    """Return a first, level ground: as given, or the mean of the surveyed points, if any."""
    control = unmeasured.tables[block.name].control
    if options.ground_m is not None:
        below = block.frame.to_grid(np.mean(block.trajectory.T_m_b.r, axis=0)[None])
        below[0, 2] = options.ground_m
        return views.level(float(block.frame.from_grid(below)[0, 2]))
    if not len(control):
        return None
    x_m = block.frame.from_grid(control.stack("east_m", "north_m", "height_m"))
    return views.level(float(np.median(x_m[:, 2])))


def _tie_rows(matched: Matched, taken: set[str]) -> Iterator[Measured]:
    """Yield the measurements of tie points, under names that nothing else has."""
    rays = matched.rays
    names = (name for k in range(1, 10**9) if (name := f"T{k:05d}") not in taken)
    name_of = {point: next(names) for point in dict.fromkeys(rays.point.tolist())}
    for point, v, colrow, sigma in zip(
        rays.point.tolist(), rays.view.tolist(), rays.colrow, rays.sigma_px, strict=True
    ):
        view = matched.views[v]
        col, row = view.full(colrow[None])[0]
        yield Measured(
            image=view.name,
            point=name_of[point],
            col_px=float(col),
            row_px=float(row),
            sigma_px=float(sigma) * view.shrink,
        )


def _on_ties(name: str, matched: Matched, reduce: int) -> Iterator[str]:
    """Yield sentences on the tie points of a block."""
    count = np.unique(matched.rays.point, return_counts=True)[1]
    n, rays = len(count), len(matched.rays)
    yield (
        f"{name}: {n} tie points with {rays} measurements in {len(matched.views)} pictures, "
        f"{rays / max(n, 1):.1f} rays a point; {matched.n_rejected} measurements rejected"
    )
    if matched.reduced > reduce:
        yield f"{name}: measured at 1/{matched.reduced} of their size; larger they hold no more"
    each = np.bincount(matched.rays.view, minlength=len(matched.views))
    few = [view.name for view, k in zip(matched.views, each, strict=True) if k < 12]
    if few:
        yield f"{name}: fewer than 12 points in {', '.join(few[:5])}{' …' if len(few) > 5 else ''}"


def _on_surveyed(name: str, surveyed: Surveyed) -> Iterator[str]:
    """Yield sentences on the surveyed points of a block."""
    points = {row.point for row in surveyed.rows}
    if points:
        n = len(surveyed.rows)
        yield f"{name}: {len(points)} surveyed points found, with {n} measurements"
    for point, images in surveyed.not_found.items():
        more = f" and {len(images) - 5} more" if len(images) > 5 else ""
        yield f"{name}: point {point} not found in {', '.join(images[:5])}{more}"


# --- Small pictures with the measured points on them, to be looked at


SIDE_PX = 1400
"""Longer side of the pictures, at most."""

COLOURS = ((2, (31, 138, 229)), (4, (120, 154, 29)), (10**9, (160, 88, 33)))
"""Largest number of rays, and the colour of such a point: blue, green, red."""

SURVEYED = (48, 70, 191)


def write_pictures(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Write a JPEG for every picture that was measured.

    Tie points are dots, orange with two rays, green with three or four, blue with more; surveyed
    points are squares.

    Parameters
    ----------
    outcomes : sequence of Outcome
    folder : Path
        Each block gets a folder in it.
    """
    for outcome in outcomes:
        (folder / outcome.block).mkdir(parents=True)
        rays = outcome.matched.rays
        count = np.bincount(rays.point)[rays.point] if len(rays) else np.zeros(0)
        for k, view in enumerate(outcome.matched.views):
            in_view = rays.view == k
            surveyed = [
                (row.col_px, row.row_px) for row in outcome.surveyed.rows if row.image == view.name
            ]
            drawn = _drawn(
                view, rays.colrow[in_view], count[in_view], np.array(surveyed).reshape(-1, 2)
            )
            _, coded = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 85])
            place = folder / outcome.block / f"{file_stem(view.name)}.jpg"
            whole_files.write(place, coded.tobytes())


def _drawn(view: View, ties: Array, count: Array, surveyed: Array) -> np.ndarray:
    """Return a picture with its points, (rows, cols, 3), 8 bit."""
    image = pixels_of_view(view)
    k = max(-(-max(image.shape[:2]) // SIDE_PX), 1)
    grey = image[::k, ::k].mean(axis=2, dtype=np.float32)
    low, high = np.percentile(grey, (1, 99))
    bright = np.clip((grey - low) / max(float(high - low), 1.0) * 255, 0, 255).astype(np.uint8)
    out = np.ascontiguousarray(np.repeat(bright[:, :, None], 3, axis=2))
    for place, n in zip(ties / k, count, strict=True):
        colour = next(colour for most, colour in COLOURS if n <= most)
        cv2.circle(out, _whole(place), 4, colour, -1, cv2.LINE_AA)
    for place in view.own(surveyed) / k:
        corner = np.array([7, 7])
        cv2.rectangle(out, _whole(place - corner), _whole(place + corner), SURVEYED, 2)
    return out


def _whole(place: Array) -> tuple[int, int]:
    col, row = np.rint(place).astype(int).tolist()
    return col, row


# --- A flight whose image points are not measured yet, read, and written with them


SETTINGS = "flight.toml"
"""The file that is written last: it makes the folder a flight, into which no command writes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Unmeasured:
    """A flight whose blocks may lack image points.

    Attributes
    ----------
    flight : Flight
        Its blocks have the measurements that are there.
    tables : dict of str to BlockTables
        Of every block.
    """

    flight: Flight
    tables: dict[str, BlockTables]


def read_unmeasured(path: str | Path) -> Unmeasured:
    """Return the flight in a folder, with the measurements that it already has.

    Parameters
    ----------
    path : str or Path
        Folder with a flight.toml. `image_points.csv` and `control_points.csv` may be missing.

    Raises
    ------
    FlightError
        With all problems, one line each; also where a block has neither pictures nor
        measurements, and where no block has pictures.
    """
    folder = expected.folder(path, "the folder of a flight, with a flight.toml")
    names = [name for name in BLOCKS if (folder / name).is_dir()]
    if not names:
        problem = (
            f"{folder}: no block to measure; a flight has {', '.join(f'{n}/' for n in BLOCKS)}"
        )
        raise FlightError([problem])
    toml = read_toml(folder / "flight.toml")
    tables = {name: without_points(read_block(folder, name, pictures=folder)) for name in names}
    flight = checked(toml, list(tables.values()))
    pictured = [name for name in names if any(flight.image_files[name])]
    empty = [
        f"{folder / name / 'images.csv'}: column file: names no picture; "
        "give it the file of every image, relative to the block's folder"
        for name, table in tables.items()
        if name not in pictured and not (pictured and len(table.image_points))
    ]
    if empty:
        raise FlightError(empty)
    return Unmeasured(flight=flight, tables=tables)


# --- the measured flight ---------------------------------------------------------------------


def _copied(unmeasured: Unmeasured, folder: Path) -> None:
    """Copy a flight's tables and pictures; image points and settings follow later.

    Pictures are linked where the file system can, so that they take no more space. Images without
    a picture and without measurements are left out.

    Parameters
    ----------
    unmeasured : Unmeasured
    folder : Path
        Of the measured flight.
    """
    flight = unmeasured.flight
    names = [name.as_posix() for name in table_files(flight)]
    pictures = dict(_pictures(flight))
    own_control = (f"{block}/control_points.csv" in names for block in flight.blocks)
    has_control = "control_points.csv" in names or all(own_control)
    missing = [] if has_control else ["control_points.csv"]
    made = {
        f"{block}/images.csv": _used_images(unmeasured, block, tables)
        for block, tables in unmeasured.tables.items()
    } | dict.fromkeys(missing, b"point,east_m,north_m,height_m\n")
    for name in names:
        if name != SETTINGS and name not in made:
            _put(folder / name, _content(flight.path / name))
    for name, content in made.items():
        _put(folder / name, content)
    for name, source in pictures.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists():
            whole_files.link(source, target)


def _used_images(unmeasured: Unmeasured, block: str, tables: BlockTables) -> bytes:
    """Return images.csv of a block with the images that have a picture or measurements."""
    files = unmeasured.flight.image_files[block]
    used = {*tables.image_points.text["image"]}
    used |= {n for n, path in zip(tables.images.text["image"], files, strict=True) if path}
    source = (unmeasured.flight.path / block / "images.csv").read_text("utf-8-sig")
    rows = list(csv.reader(io.StringIO(source, newline="")))
    column = [name.strip() for name in rows[0]].index("image")
    kept = [rows[0], *(row for row in rows[1:] if row and row[column].strip() in used)]
    return _csv(kept)


def _csv(rows: Sequence[Sequence[str]]) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _pictures(flight: Flight) -> Iterator[tuple[str, Path]]:
    """Yield the files of the flight's pictures, by their place below its folder."""
    for block, files in flight.image_files.items():
        names = _names_of(flight, block)
        for name, path in zip(names, files, strict=True):
            if path is not None and name:
                yield (PurePosixPath(block) / name).as_posix(), path


def _names_of(flight: Flight, block: str) -> Sequence[str]:
    """Return the cells of the column ``file`` of a block, empty where there is none."""
    inside = flight.pictures.resolve() / block
    return [
        "" if path is None else path.relative_to(inside).as_posix()
        for path in flight.image_files[block]
    ]


def _write_points(folder: Path, block: str, rows: Sequence[Measured]) -> None:
    """Write the image points of a block."""
    name = f"{block}/image_points.csv"
    header = ["image", "point", "col_px", "row_px", "sigma_px"]
    numbers = ([row.col_px, row.row_px, row.sigma_px] for row in rows)
    places = ([f"{number:.4f}" for number in three] for three in numbers)
    lines = ([row.image, row.point, *place] for row, place in zip(rows, places, strict=True))
    _put(folder / name, _csv([header, *lines]))


def _content(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read()


def _put(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    whole_files.write(path, content)


def _given(tables: BlockTables, sigma_px: float) -> list[Measured]:
    """Return the measurements that a block has already."""
    table = tables.image_points
    sigma = table.numbers.get("sigma_px", np.full(len(table), sigma_px))
    columns: Mapping[str, Sequence[str]] = table.text
    places = zip(table.numbers["col_px"], table.numbers["row_px"], sigma, strict=True)
    names = zip(columns["image"], columns["point"], strict=True)
    return [
        Measured(image=image, point=point, col_px=float(c), row_px=float(r), sigma_px=float(s))
        for (image, point), (c, r, s) in zip(names, places, strict=True)
    ]
