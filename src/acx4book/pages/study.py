"""Parts of pages on the study.

Simulated flight, accuracy, comparison of methods, geometry, and independent chapters.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import pandas as pd
import yaml

from acx4book.chapters import synthetic_cost
from acx4book.notebooks import execute, runner
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.pages.benchmarks import sigma
from acx4book.paper import printed
from acx4book.paper.scorecard import TWO_STEP
from acx4book.reference import data as reference
from acx4book.typesetting.myst import (
    LABELS,
    TITLES,
    UNITS,
    inside,
    myst_table,
    say,
    sections,
    with_unit,
)
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4files.results import folder, whole_files
from acx4files.results.provenance import KEPT as FLIGHT
from acx4lib.block import Block
from acx4lib.calibration.estimates import LIMIT_BORESIGHT_DEG, LIMIT_INTERIOR, LIMIT_LEVER_M, needed
from acx4lib.expected import Array
from acx4lib.geometry.parameters import BORESIGHT_ANGLES, REPORTED
from acx4lib.georeferencing import accuracy
from acx4sim.designs import acx4_plan

TEXTS = sections(Path(__file__).with_suffix(".md"))
"""Sentences with places for numbers."""


def _say(name: str, /, **values: Any) -> str:
    return say(TEXTS[name], **values).text


# --- What was chosen for the simulated flight, since the paper does not tell it


Row = tuple[str, str, str]
"""A choice, its value here, and the paper's statement or the effect."""


def _for_printed_numbers(flight: Flight, truth: Mapping[str, Any]) -> list[Row]:
    """Return the choices made to reproduce printed numbers."""
    best, worst = (printed.statement(f"gnss_{end}_m") for end in ("best", "worst"))
    rows: list[Row] = []
    if flight.calibration is not None:
        gnss = np.median(flight.calibration.trajectory.sigma_position, axis=0)
        rows += [
            (
                "tie points of the calibration block",
                f"{_n_ties(flight.calibration)}",
                "Not stated. With the next row: the standard deviations of the paper's Table 3.",
            ),
            (
                "noise of GNSS positions, plan and height",
                f"{100 * gnss[0]:g} and {100 * gnss[2]:g} cm",
                f"{best:.2f} to {worst:.2f} m, with which f and the lever arm's height could not "
                "be as precise as the paper's Table 3 has them.",
            ),
        ]
    if flight.validation is not None:
        rows += [
            (
                "places of the natural targets",
                _layout(acx4_plan().blocks["validation"].targets),
                "Shown in a small figure only. They lie where strips overlap, which gives about as "
                "many pairs as the paper's Table 4 has, and none that fails: 100 and 0 %.",
            )
        ]
    return [
        *rows,
        (
            "focal length of the first head",
            f"{truth['cameras']['CAM1']['f_mm']:.4f} mm",
            Markup("Held at another value in print. Chosen so that the paper's $f$ comes out."),
        ),
    ]


def _guessed(flight: Flight, truth: Mapping[str, Any]) -> list[Row]:
    """Return the choices not given in the paper and not tuned."""
    plan = acx4_plan()
    levers = np.array(
        [[truth["cameras"][h][f"lever_{axis}_m"] for axis in "xyz"] for h in printed.HEADS]
    )
    low, high = plan.blocks["validation"].target_px
    heads, calibration = plan.blocks["heads"], plan.blocks["calibration"]
    quality = printed.statement("synthetic_quality_px")
    return [
        (
            "noise of image points",
            f"{plan.noise.image_px:g} px",
            f"Not stated of measurements; the synthetic image's residuals are {quality:g} px.",
        ),
        (
            "noise of natural targets",
            f"{low:g} to {high:g} px",
            "Not stated. Natural targets are measured less well than signals.",
        ),
        (
            "tie points of every head",
            f"{heads.tie_points}",
            "Not stated. Standard deviations of the paper's Table 1 depend on it.",
        ),
        (
            "ground that has tie points, heads and calibration",
            f"{_area(heads.tie_area_m)} and {_area(calibration.tie_area_m)} km",
            "Not stated. It decides how many tie points the corners of the images have.",
        ),
        (
            "control field",
            _layout(plan.control),
            f"{printed.statement('field_points'):.0f} targets in a layout that is shown in a small "
            "figure only.",
        ),
        (
            "side overlap of the validation block",
            f"{100 * _side_overlap():.0f} %",
            "Not stated. It decides in how many images a target is.",
        ),
        (
            "places of the heads",
            f"a square of {np.ptp(levers, axis=0).max():.2f} m",
            Markup("The paper's $X_c$ and $Y_c$ would put them a metre apart, and were not given."),
        ),
        (
            "axes of the lever arm",
            "forward, left, up",
            "Not stated, nor whether the boresight is camera to body.",
        ),
        (
            "site, relief, refraction, seed",
            f"{plan.crs} near Curitiba, hills, {flight.refraction}, {truth['seed']}",
            "Not stated.",
        ),
    ]


def _n_ties(block: Block) -> int:
    return int(np.sum(block.rays > 0)) - len(block.control) - len(block.check)


def _side_overlap() -> float:
    """Return the side overlap of the validation block, a fraction of the image."""
    first, second = acx4_plan().blocks["validation"].strips[:2]
    f, width = printed.value(3, "f_mm", "single_step"), printed.value(2, "height_mm", "SYN")
    return 1 - abs(first.left_m - second.left_m) * f / (width * first.height_m)


def _layout(places: Array) -> str:
    """Return number and extent of points on the ground."""
    extent = 1e-3 * np.ptp(places, axis=0)
    return f"{len(places)} over {extent[0]:.1f} × {extent[1]:.1f} km"


def _area(half_m: tuple[float, float]) -> str:
    return f"{2e-3 * half_m[0]:.1f} × {2e-3 * half_m[1]:.1f}"


# --- How accurate direct georeferencing is over many simulated flights, for the front page


SCALES = (2000, 5000)
"""Denominators of the map scales claimed in the paper."""

SPREAD = (0.05, 0.95)
"""Quantiles that enclose nine of ten flights."""

METHODS = ("single_step", "two_step")

Flights = pd.DataFrame
"""A row a flight: RMS over the check points in plan and height (m), and whether class A of PEC-PCD
is reached in plan_SCALE and height_SCALE."""


def page(benchmarks: Path) -> str:
    """Return the accuracy over flights as MyST text.

    Parameters
    ----------
    benchmarks : Path
        Folder with the results of ``make chain`` and ``make coverage``.
    """
    by_way = {"four heads, single-step": _of_chain(synthetic_cost.read(benchmarks))}
    by_way |= {f"ideal camera, {inside(TITLES[m])}": of_ideal(benchmarks, m) for m in METHODS}
    table = pd.DataFrame([_row(title, flights) for title, flights in by_way.items()])
    caption = "RMS at the check points of many simulated flights, and how many reach class A"
    return f"{_say('accuracy')}\n\n{myst_table(table, caption, name='tab-front-accuracy')}\n"


def many(benchmarks: Path) -> str:
    """Return the RMS of many flights in a sentence: medians, and where nine of ten lie.

    Parameters
    ----------
    benchmarks : Path
        As `page` takes it.
    """
    ways = {
        "with images made of four heads": _of_chain(synthetic_cost.read(benchmarks)),
        "with one ideal camera": of_ideal(benchmarks, "single_step"),
    }
    at = [SPREAD[0], 0.5, SPREAD[1]]
    values = {
        title: {part: flights[part].quantile(at).to_list() for part in ("plan", "height")}
        for title, flights in ways.items()
    }
    return _say("many", ways=values)


def spread(benchmarks: Path) -> str:
    """Return the RMS over check points of many flights of an ideal camera, for a table."""
    flights = of_ideal(benchmarks, "single_step")
    at = [SPREAD[0], 0.5, SPREAD[1]]
    return _say("spread", plan=flights["plan"].quantile(at), height=flights["height"].quantile(at))


def _of_chain(chain: synthetic_cost.Study) -> Flights:
    """Return the accuracy of flights with synthetic images from four heads."""
    rms = synthetic_cost.rms_by_flight(chain, synthetic_cost.SYNTHETIC)
    classes = chain.classes[chain.classes["way"] == synthetic_cost.SYNTHETIC].set_index("seed")
    parts = [f"{part}_{scale}" for part in ("plan", "height") for scale in SCALES]
    return rms.join(classes[parts] == "A")


def of_ideal(benchmarks: Path, method: str) -> Flights:
    """Return the accuracy of flights with images from one ideal camera."""
    _, (points,) = sigma.read_stored(benchmarks, "coverage", "points", make="coverage")
    rows = []
    for _, group in points[points["method"] == method].groupby("seed"):
        statistics = accuracy.from_differences(
            group[["d_east_m", "d_north_m", "d_height_m"]].to_numpy()
        )
        row: dict[str, float | bool] = {"plan": float(np.hypot(*statistics.rms[:2]))}
        row["height"] = statistics.rms[2]
        for scale in SCALES:
            reached = accuracy.pec_pcd(statistics, scale)
            row |= {f"{kind}_{scale}": reached[kind] == "A" for kind in ("plan", "height")}
        rows.append(row)
    return pd.DataFrame(rows)


def _row(title: str, flights: Flights) -> dict[str, str]:
    row = {"Images and method": title, "Flights": f"{len(flights)}"}
    for part in ("plan", "height"):
        low, high = flights[part].quantile(list(SPREAD))
        row[f"RMS, {part} (m)"] = f"{flights[part].median():.2f} ({low:.2f} to {high:.2f})"
    for scale in SCALES:
        shares = (100 * flights[f"{part}_{scale}"].mean() for part in ("plan", "height"))
        plan, height = (f"{share:.0f}" for share in shares)
        row[f"Class A at 1:{scale}, plan and height (%)"] = f"{plan}, {height}"
    return row


# --- Whether the single step beats the two-step method: one verdict, for the page of questions


COMPARED = ("f_mm", "lever_z_m", "boresight_omega_deg")
"""Parameters with compared standard deviations."""


def methods_page(found: folder.Results, camera: str, benchmarks: Path) -> str:
    """Return the verdict on the two methods as MyST text; empty if one is missing.

    Parameters
    ----------
    found : Results
        With the stages mounting and validation.
    camera : str
    benchmarks : Path
        Folder with the results of ``make coverage``.
    """
    names = ("two_step", "single_step")
    if not {f"{stage}/{m}" for stage in ("mounting", "validation") for m in names} <= {
        *found.summary
    }:
        return ""
    two, single = (folder.parameters(found, f"mounting/{m}", camera) for m in names)
    ratios = {name: two["sigma"][name] / single["sigma"][name] for name in COMPARED}
    rms = [_rms(found.summary[f"validation/{m}"]) for m in names]
    flights = {m: of_ideal(benchmarks, m) for m in names}
    values: dict[str, Any] = dict(zip(names, rms, strict=True))
    values |= {"n": len(flights["single_step"]), "gnss_ratio": None}
    parts = ["plan", "height"]
    values |= {"median": {m: of[parts].median().to_list() for m, of in flights.items()}}
    below = int((flights["single_step"]["height"] < rms[1][1]).sum())
    values |= {"draw": Markup(_say("draw", below=below, n=values["n"]))}
    if f"mounting/{TWO_STEP}" in found.summary:
        gnss = folder.parameters(found, f"mounting/{TWO_STEP}", camera)["sigma"]
        values |= {"gnss_ratio": gnss["f_mm"] / single["sigma"]["f_mm"]}
    values |= {"f": LABELS["f_mm"], "f_ratio": ratios["f_mm"]}
    values |= {"lever": LABELS["lever_z_m"], "lever_ratio": ratios["lever_z_m"]}
    values |= {
        key: by_name["boresight_omega_deg"]
        for key, by_name in (("omega", LABELS), ("omega_ratio", ratios))
    }
    heading = "## Does the single step beat the two-step method?"
    return f"{heading}\n\n{_say('methods', **values)}\n\n{_slow_errors(benchmarks)}"


def _rms(entry: dict[str, Any]) -> tuple[float, float]:
    """Return the RMS over the check points in plan and in height, m."""
    east, north, height = entry["points"]["rms"]
    return float(np.hypot(east, north)), float(height)


def _slow_errors(benchmarks: Path) -> str:
    """State the effect of slowly changing trajectory errors on the boresight."""
    _, (errors,) = sigma.read_stored(benchmarks, "slow_errors", make="coverage")
    rows = errors[(errors["weights"] == "white") & errors["parameter"].isin(BORESIGHT_ANGLES)]
    ratio = ((rows["error"] / rows["sigma"]) ** 2).groupby(rows["parameter"]).mean() ** 0.5
    return _say("slow errors", n=rows["seed"].nunique(), ratio=ratio)


# --- What a simulated flight was given, as a page of the book


Truth = Mapping[str, Any]
"""The content of a flight's ``.truth.json``."""

MOUNT = tuple(f"lever_{axis}_m" for axis in "xyz")
BORESIGHT = tuple(f"boresight_{angle}_deg" for angle in ("omega", "phi", "kappa"))
SHOWN = ("f_mm", "xp_mm", "yp_mm", *MOUNT, *BORESIGHT)
DECIMALS = {"mm": 4, "m": 3, "deg": 6}


def simulation_page(flight: Flight, truth: Truth | None) -> str:
    """Return the true values and the noise of a flight as MyST text.

    Parameters
    ----------
    flight : Flight
    truth : mapping or None
        None for a flight that was not simulated.
    """
    if truth is None:
        return f"{_say('measured', name=flight.name)}\n"
    parts = [
        _say("simulated", name=flight.name, seed=truth["seed"]),
        myst_table(_cameras(truth), "True values of the cameras", name="tab-truth"),
        _of_the_paper(flight, truth) if printed.applies(flight) else "",
        myst_table(_noise(flight), "Noise of the measurements", name="tab-noise"),
        _chosen_page(flight, truth) if printed.applies(flight) else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _chosen_page(flight: Flight, truth: Mapping[str, Any]) -> str:
    """Return everything that was chosen as MyST text."""
    rows = [
        *(("chosen", *row) for row in _for_printed_numbers(flight, truth)),
        *(("a guess", *row) for row in _guessed(flight, truth)),
    ]
    columns = ["Kind", "What", "This book", "Paper, and what comes out by it"]
    table = pd.DataFrame(rows, columns=columns)
    return f"{_say('chosen')}\n\n{myst_table(table, 'What was chosen', name='tab-chosen')}"


def _cameras(truth: Truth) -> pd.DataFrame:
    """Return a row for each true parameter, a column for each camera."""
    cameras = truth["cameras"]
    rows = []
    for name in SHOWN:
        unit = name.rpartition("_")[2]
        true = [Markup(f"{values[name]:.{DECIMALS[unit]}f}") for values in cameras.values()]
        rows.append([with_unit(LABELS[name], unit), *true])
    return pd.DataFrame(rows, columns=["Parameter", *cameras])  # a camera has any name


def _of_the_paper(flight: Flight, truth: Truth) -> str:
    """State the origin of the synthetic camera, and the values taken from the paper."""
    levers = np.array([[truth["cameras"][h][name] for name in MOUNT] for h in printed.HEADS])
    angles = np.degrees(flight.cameras["SYN"].T_b_c.opk)
    mount = [printed.value(3, name, "single_step") for name in BORESIGHT]
    synthetic = truth["cameras"].get("SYN", {})
    from_paper = [
        name for name, x in synthetic.items() if x == printed.value(3, name, "single_step")
    ]
    return _say(
        "of the paper",
        given=len(from_paper) if synthetic else None,
        same=np.allclose(angles, mount, atol=1e-9),
        held=flight.cameras["CAM1"].interior.f,
        first=truth["cameras"]["CAM1"]["f_mm"],
        apart=np.ptp(levers, axis=0).max(),
    )


def _noise(flight: Flight) -> pd.DataFrame:
    """Return the standard deviations of the simulated noise, by block."""
    return pd.DataFrame([{"Block": name, **_sigmas(b)} for name, b in flight.blocks.items()])


def _sigmas(block: Block) -> dict[str, str]:
    surveyed = np.concatenate([block.control.sigma_m, block.check.sigma_m])
    trajectory = block.trajectory
    return {
        "Image points (px)": _range(block.image_points.sigma_px),
        "Survey: plan, height (m)": _plan_height(surveyed),
        "GNSS: plan, height (m)": _plan_height(trajectory.sigma_position),
        f"Roll and pitch, heading ({UNITS['deg']})": _plan_height(
            np.degrees(trajectory.sigma_attitude)
        ),
    }


def _range(values: Array) -> str:
    low, high = (f"{value:g}" for value in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def _plan_height(sigma: Array) -> str:
    """Return the median of the first two columns and of the third."""
    if not len(sigma):
        return ""
    plan, height = np.median(sigma[:, :2]), np.median(sigma[:, 2])
    return f"{plan:.3g}, {height:.3g}"


# --- Which flight determines which parameter


def geometry_page() -> str:
    """Return which geometry determines which parameter, as MyST text."""
    caption = "What a parameter needs, and the σ above which it counts as not determined"
    return myst_table(_geometry_table(), caption, name="tab-geometry") + "\n"


def _geometry_table() -> pd.DataFrame:
    """Tabulate limit and geometry for the parameters; equal neighbours share a row."""
    rows: list[dict[str, str]] = []
    for key, (name, _) in REPORTED.items():
        limit, geometry = _limit(key), needed(key)
        if rows and (rows[-1]["Largest σ"], rows[-1]["It needs"]) == (limit, geometry):
            rows[-1]["Parameter"] = Markup(f"{rows[-1]['Parameter']}, {LABELS[name]}")
        else:
            rows.append({"Parameter": LABELS[name], "Largest σ": limit, "It needs": geometry})
    return pd.DataFrame(rows)


def _limit(key: str) -> str:
    """Return the sigma above which a parameter is not determined; lens terms have no limit."""
    if key.startswith("lever"):
        return f"{LIMIT_LEVER_M:g} m"
    if key.startswith("boresight"):
        return f"{LIMIT_BORESIGHT_DEG:g}°"
    if key in ("f", "xp", "yp"):
        return Markup(f"{100 * LIMIT_INTERIOR:g} % of $f$")
    return "any"


# --- Chapters that depend on no flight: run again after a change of their inputs, and kept
#
# The book of the flight in the project has all of them. The book of another flight has the kept
# chapters that are up to date; it leaves out the others and the pages of the programming interface.


FOUNDATIONS = tuple(
    f"foundations/{path.stem}" for path in sorted((NOTEBOOKS_PATH / "foundations").glob("*.ipynb"))
)
"""The chapters of part I."""

CHAPTERS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(FOUNDATIONS, ("data/paper/*.csv",)),
    "05-reference-data": ("data/reference/**/*.csv", "measured"),
    "09-weights": ("data/paper/*.csv",),
    "10-synthetic-quality": ("data/paper/*.csv",),
    "11-ten-heads": ("data/reference/**/*.csv", "measured"),
    "07-exercises": (),
    "12-synthetic-cost": ("data/paper/*.csv", "data/benchmarks/closed_chain*"),
    "19-from-pictures": (
        "data/benchmarks/measured_flights*",
    ),  # takes half a minute, so it is not the last
    "13-four-real-heads": ("data/reference/four-heads/**/*",),
    "14-failure-clinic": (),
    "15-which-flight": (),
    "16-error-budget": ("data/paper/*.csv",),
}
"""The notebooks, and the files of the working copy that they read; *measured* are the measurements
of others, wherever they are."""

OF_IDEAL = ("09-weights", "16-error-budget")
"""Chapters for any flight; the book shows the flight of the ideal camera."""

KEPT = Path("build", "chapters")
"""Folder of the kept executed notebooks, below the current folder: the working copy."""


def run(ideal_path: Path) -> None:
    """Execute missing and outdated chapters.

    Parameters
    ----------
    ideal_path : Path
        Run of the flight for `OF_IDEAL`.

    Raises
    ------
    NotebookError
        If a notebook fails.
    """
    # absolute: papermill changes the working folder while it reads and writes, of all threads
    kept = {name: path.absolute() for name, path in _kept(ideal_path).items()}
    missing = {name: path for name, path in kept.items() if not path.is_file()}
    for path in missing.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    if missing:
        steps = {name: partial(_run, ideal_path, name, path) for name, path in missing.items()}
        runner.side_by_side(steps, {})


def bring(executed: Path, ideal_path: Path | None) -> list[str]:
    """Copy the chapters into the book, and return the names of chapters left out.

    Parameters
    ----------
    executed : Path
        Folder of the book's executed notebooks.
    ideal_path : Path or None
        Run of the flight for `OF_IDEAL`; missing and outdated chapters are then executed. Without
        it only kept chapters are used.

    Raises
    ------
    NotebookError
        If a notebook fails.
    """
    if ideal_path is not None:
        run(ideal_path)
    available = {name: path for name, path in _kept(ideal_path).items() if path.is_file()}
    for name, path in available.items():
        page = executed / f"{name}.ipynb"
        page.parent.mkdir(exist_ok=True)
        whole_files.copy(path, page)
    return [name for name in CHAPTERS if name not in available]


def _kept(ideal_path: Path | None) -> dict[str, Path]:
    """Return the path of each kept chapter; the name has a digest of what it depends on."""
    names = [name for name in CHAPTERS if ideal_path is not None or name not in OF_IDEAL]
    return {name: KEPT / f"{name}-{_digest(name, ideal_path)[:16]}.ipynb" for name in names}


def _run(ideal_path: Path, name: str, kept: Path) -> None:
    """Run a chapter and replace its kept copies."""
    source = NOTEBOOKS_PATH / f"{name}.ipynb"
    new = kept.with_name(f"new-{kept.name}")
    of_ideal = {"flight_path": str(ideal_path / FLIGHT), "results_path": str(ideal_path)}
    execute.execute(source, new, parameters=of_ideal if name in OF_IDEAL else {})
    for old in kept.parent.glob(f"{source.stem}-*.ipynb"):
        old.unlink()
    new.replace(kept)


def _digest(name: str, ideal_path: Path | None) -> str:
    files = [*_files(CHAPTERS[name])]
    if ideal_path is not None and name in OF_IDEAL:
        files += [ideal_path / "parameters.csv", *(ideal_path / FLIGHT).rglob("*.*")]
    return execute.digest(NOTEBOOKS_PATH / f"{name}.ipynb", Path("src"), files)


def _files(patterns: Iterable[str]) -> Iterator[Path]:
    """Yield the files that match patterns, and the list of library versions."""
    yield Path("environment.lock")
    for pattern in patterns:
        measured = pattern == "measured"
        paths = reference.folder().rglob("*") if measured else Path().glob(pattern)
        yield from filter(Path.is_file, paths)


# --- a book without some of them -------------------------------------------------------------


def leave_out(book: Path, pages: Collection[str]) -> None:
    """Write the book's table of contents without given pages, and the titles of these.

    The extension `left_out` of the book reads the list: links become titles or names.

    Parameters
    ----------
    book : Path
    pages : collection of str
        Pages as the table of contents names them, and folders of pages.
    """
    contents = yaml.safe_load((book / "_toc.yml").read_text("utf-8"))
    for part in contents.get("parts", [contents]):
        part["chapters"] = [*_without(pages, part["chapters"])]
    if "parts" in contents:  # an empty one is malformed
        contents["parts"] = [part for part in contents["parts"] if part["chapters"]]
    generated = book / "_generated"
    whole_files.write(generated / "_toc.yml", yaml.safe_dump(contents))
    titles = {page: _title(page) for page in pages}
    whole_files.write(generated / "left_out.json", json.dumps(titles, indent=1))


def _without(pages: Collection[str], entries: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the entries of a table of contents, and their sections, without given pages."""
    for entry in entries:
        folders = {parent.as_posix() for parent in PurePosixPath(entry["file"]).parents}
        if not {entry["file"], *folders} & set(pages):
            below = [*_without(pages, entry.get("sections", ()))]
            alone = {key: value for key, value in entry.items() if key != "sections"}
            yield {**alone, "sections": below} if below else alone


def _title(page: str) -> str:
    """Return the title of a chapter; empty for a folder."""
    notebook = NOTEBOOKS_PATH / f"{page.removeprefix('_executed/')}.ipynb"
    if not notebook.is_file():
        return ""
    first = json.loads(notebook.read_text("utf-8"))["cells"][0]["source"]
    return "".join(first).splitlines()[0].removeprefix("# ")
