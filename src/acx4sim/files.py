"""A simulated flight as a folder.

Flown, measured, and written whole or not at all, with its truth beside it.
"""

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from acx4sim.earth import Array, Grid, opk_from_attitude, rph_from_attitude
from acx4sim.fly import Track, Visibility, fly, ground_points, measure, record, stream
from acx4sim.pictures import Photography, Tell, order, take, told
from acx4sim.plan import BlockPlan, GrossErrors, Options, Plan, stated

# --- A flight from its plan: it is flown, points are projected and measured, tables are made


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedFlight:
    """A simulated flight: its tables, its truth and its pictures.

    Attributes
    ----------
    name : str
        Name of the design.
    toml : str
        Text of flight.toml.
    tables : mapping of str to DataFrame
        The flight's tables by their path inside the flight's folder.
    truth : dict
        True values, for JSON.
    plan : Plan
        The plan that was flown.
    seed : int
        Seed of its random numbers.
    photography : Photography, optional
        Pictures to take.
    """

    name: str
    toml: str
    tables: Mapping[str, pd.DataFrame]
    truth: dict[str, Any]
    plan: Plan
    seed: int
    photography: Photography | None = None


def simulate_plan(plan: Plan, seed: int, options: Options) -> SimulatedFlight:
    """Simulate a planned flight.

    Raises
    ------
    ValueError
        For a negative seed, a block that is not in the plan, or more
        tie points than a block sees.
    """
    if seed < 0:
        msg = f"seed must be zero or positive, got {seed}"
        raise ValueError(msg)
    plan = _as_asked(plan, options)
    files: dict[str, pd.DataFrame] = {}
    tracks: dict[str, Track] = {}
    recorded: dict[str, Track] = {}
    points: dict[str, Array] = {}
    for name, block in plan.blocks.items():
        tracks[name] = fly(plan, block, stream(seed, plan.draws, name, "fly"))
        path, names, x_g = _surveyed(plan, name)
        points.update(zip(names, x_g, strict=True))
        if path not in files:
            rng = stream(seed, plan.draws, path)
            has_targets = len(plan.blocks[name].targets) > 0
            sigma_m = block.target_m if has_targets else plan.noise.control_m
            files[path] = _control_points(sigma_m, names, x_g, options, rng)
        recorded[name] = record(
            tracks[name],
            plan.noise,
            options,
            white=stream(seed, plan.draws, name, "trajectory"),
            slow=stream(seed, plan.draws, name, "slow errors"),
        )
        files.update(_block_tables(plan, name, tracks[name], seed, options))
        files[f"{name}/trajectory.csv"] = _trajectory(plan, recorded[name])
    truth = _truth(plan, seed, options, tracks, points)
    if options.gross_errors is not None:
        spoiled = _spoil(plan, files, recorded, options.gross_errors, seed)
        files, truth["gross_errors"] = dict(spoiled.tables), spoiled.mistakes
    return SimulatedFlight(
        name=plan.name,
        toml=_flight_toml(plan, options),
        tables=files,
        truth=truth,
        plan=plan,
        seed=seed,
    )


def photograph(
    flight: SimulatedFlight,
    exposures: Sequence[str],
    *,
    reduce: int = 1,
    photo: str | Path | None = None,
) -> SimulatedFlight:
    """Order pictures of some exposures; they are taken when the flight is written.

    Parameters
    ----------
    flight : SimulatedFlight
        The flight.
    exposures : sequence of str
        Their names, of any block.
    reduce : int
        The pictures have 1/reduce of the size, and cover the middle of the sensors.
    photo : str or Path, optional
        File with a picture of the ground, with pixels of 12.5 cm, mirrored beyond its edges; by
        default the ground is the procedural landscape.

    Returns
    -------
    SimulatedFlight
        Its images.csv has the names of the files; its truth has the responses of the cameras.

    Raises
    ------
    ValueError
        For an unknown exposure, for no names, or where `reduce` leaves
        no pixel.
    OSError
        Where the photo does not exist or cannot be read.
    """
    ordered = order(flight.plan, flight.seed, exposures, reduce, photo)
    return replace(
        flight,
        tables=_with_files(flight.tables, ordered),
        truth={**flight.truth, "pictures": told(ordered)},
        photography=ordered,
    )


def _with_files(
    tables: Mapping[str, pd.DataFrame], ordered: Photography
) -> dict[str, pd.DataFrame]:
    tables = dict(tables)
    for block in {station.block for station in ordered.stations}:
        files = {
            Path(path).stem: path.removeprefix(f"{block}/")
            for path, station, _ in ordered.orders()
            if station.block == block
        }
        images = tables[f"{block}/images.csv"]
        tables[f"{block}/images.csv"] = images.assign(file=images["image"].map(files).fillna(""))
    return tables


def _as_asked(plan: Plan, options: Options) -> Plan:
    """Return the plan with the blocks, the tie points and the refraction of the options."""
    wanted = tuple(plan.blocks) if options.blocks is None else options.blocks
    unknown = sorted({*wanted, *options.tie_points} - set(plan.blocks))
    if unknown or not wanted:
        msg = f"blocks {unknown or 'none'} asked for; {plan.name} has {list(plan.blocks)}"
        raise ValueError(msg)
    return replace(
        plan,
        refraction=options.refraction,
        blocks={
            name: replace(block, tie_points=options.tie_points.get(name, block.tie_points))
            for name, block in plan.blocks.items()
            if name in wanted
        },
    )


def _surveyed(plan: Plan, name: str) -> tuple[str, list[str], Array]:
    """Return file, names and true coordinates of the surveyed points of a block."""
    block = plan.blocks[name]
    if len(block.targets):
        names = [f"N{i:02d}" for i in range(1, len(block.targets) + 1)]
        return f"{name}/control_points.csv", names, ground_points(plan, block, block.targets)
    names = [f"P{i:02d}" for i in range(1, len(plan.control) + 1)]
    return "control_points.csv", names, ground_points(plan, block, plan.control)


def _block_tables(
    plan: Plan, name: str, track: Track, seed: int, options: Options
) -> dict[str, pd.DataFrame]:
    """Tabulate images and measurements of a block."""
    block = plan.blocks[name]
    _, names, x_g = _surveyed(plan, name)
    sight = measure(plan, block, track, x_g, stream(seed, plan.draws, name, "tie points"))
    rng = stream(seed, plan.draws, name, "image points")
    n_ties = sight.seen.shape[2] - len(names)
    points = _pointing(plan, block, names, n_ties, options, rng)
    images = _images(block, track)
    measured = _image_points(images["image"], points, sight, rng)
    return {f"{name}/images.csv": images, f"{name}/image_points.csv": measured}


def _pointing(
    plan: Plan,
    block: BlockPlan,
    surveyed: list[str],
    n_ties: int,
    options: Options,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Return the standard deviation of measuring each point."""
    sigma = np.full(len(surveyed) + n_ties, plan.noise.image_px)
    if len(block.targets):
        low, high = block.target_px
        sigma[: len(surveyed)] = np.clip(rng.uniform(low, high, len(surveyed)).round(1), low, high)
    points = pd.DataFrame(
        {
            "point": [*surveyed, *(f"T{i:05d}" for i in range(1, n_ties + 1))],
            "noise_px": options.image_noise * sigma,
        }
    )
    if len(block.targets):
        points["sigma_px"] = sigma * stated(options.image_noise)
    return points


# --- flight.toml and the truth of a simulated flight


MADE_BY = "acx4 simulate"
"""The maker named in a truth; the command checks it before it replaces a truth."""

NOTE = (
    "True values. Cameras: boresight is omega, phi, kappa of eq. (6), camera to body; the lever "
    "arm is forward, left, up. Exposures: east, north, height, omega, phi, kappa of the IMU's "
    "body frame against the grid. Control points: east, north, height. In block heads every "
    "head's exterior orientation follows from its own boresight and lever arm."
)
_SYNTHETIC_NOTE = (
    "The boresight of synthetic images that are made of the heads is the mount_* of their camera "
    "in flight.toml, and their focal length is, to first order, that of the first head. Xc, Yc of "
    "Table 1 are no lever arms and are not contained in the heads' positions."
)
_IDEAL_NOTE = (
    "Blocks calibration and validation are measured in an ideal synthetic image, which no heads "
    "make, with the parameters of camera SYN here, the paper's Table 3."
)
_CARRIED_NOTE = (
    "Blocks calibration and validation are measured in the heads. The synthetic camera that these "
    "make has no parameters of its own, and is no camera here."
)


def _flight_toml(plan: Plan, options: Options) -> str:
    """Return the text of flight.toml: sensors, approximate values, true standard deviations."""
    title = json.dumps(plan.title, ensure_ascii=False)  # a TOML string, too
    lines = [
        f"name = {title}",
        "simulated = true",
        f'crs = "{plan.crs}"',
        'heights = "ellipsoidal"',
    ]
    if plan.refraction != "none":
        lines.append(f'refraction = "{plan.refraction}"')
    for name, camera in plan.cameras.items():
        lines += ["", f"[cameras.{name}]"]
        sensor = {k: getattr(camera, k) for k in ("width_px", "height_px", "pixel_um")}
        lines += [f"{key} = {value}" for key, value in {**sensor, **plan.approximate[name]}.items()]
    if plan.heads:
        heads = ", ".join(f'"{name}"' for name in plan.heads)
        lines += ["", "[synthetic]", f'camera = "{plan.synthetic}"', f"heads = [{heads}]"]
    if plan.measured_in_heads:
        lines.append('measured_in = "heads"')
    lines += ["", "[apriori]"]
    lines += [f"{key} = {value:.6g}" for key, value in _apriori(plan, options).items()]
    if plan.heads:
        lines += ["", "[stages.heads]", 'estimate = ["xp_mm", "yp_mm", "k1", "p1", "p2"]']
    names = ("f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2")
    estimate = ", ".join(f'"{name}"' for name in names)
    lines += ["", "[stages.mounting]", f"estimate = [{estimate}]", "fix = []"]
    return "\n".join(lines) + "\n"


def _apriori(plan: Plan, options: Options) -> dict[str, float]:
    noise = plan.noise
    image, gnss = stated(options.image_noise), stated(options.gnss_noise)
    attitude = stated(options.attitude_noise)
    return {
        "image_point_px": image * noise.image_px,
        "gnss_horizontal_m": gnss * noise.gnss_horizontal_m,
        "gnss_vertical_m": gnss * noise.gnss_vertical_m,
        "roll_pitch_deg": attitude * noise.roll_pitch_deg,
        "heading_deg": attitude * noise.heading_deg,
    }


def _truth(
    plan: Plan,
    seed: int,
    options: Options,
    tracks: Mapping[str, Track],
    points: Mapping[str, Array],
) -> dict[str, Any]:
    """Return the true values, for JSON."""
    truth: dict[str, Any] = {
        "made_by": MADE_BY,
        "name": plan.name,
        "seed": seed,
        "options": asdict(replace(options, tie_points=dict(options.tie_points))),
        "note": _note(plan),
        "cameras": {name: _camera_truth(plan, name) for name in _real_cameras(plan)},
    }
    if plan.heads:
        truth["heads_in_synthetic_frame"] = {
            name: dict(zip(("omega_deg", "phi_deg", "kappa_deg"), angles, strict=True))
            for name, angles in plan.head_angles_deg.items()
        }
        mount = plan.approximate[plan.synthetic]
        truth["rendered_boresight"] = {
            f"boresight_{angle}_deg": mount.get(f"mount_{angle}_deg", 0.0)
            for angle in ("omega", "phi", "kappa")
        }
        truth["rendered_f_mm"] = plan.cameras[plan.heads[0]].f_mm
    truth["exposures"] = {name: _exposure_truth(plan, track) for name, track in tracks.items()}
    truth["control_points"] = {name: _plain(x, 6) for name, x in points.items()}
    return truth


def _note(plan: Plan) -> str:
    if not plan.heads:
        return NOTE
    return " ".join(
        [NOTE, _CARRIED_NOTE if plan.measured_in_heads else _IDEAL_NOTE, _SYNTHETIC_NOTE]
    )


def _real_cameras(plan: Plan) -> list[str]:
    """Return the names of the cameras with true parameters, without a camera made of heads."""
    made = plan.synthetic if plan.measured_in_heads else ""
    return [name for name in plan.cameras if name != made]


def _plain(values: Array, decimals: int) -> list[float]:
    return [round(float(value), decimals) for value in values]


def _camera_truth(plan: Plan, name: str) -> dict[str, float]:
    camera = plan.cameras[name]
    names = ("f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2")
    boresight = zip(("omega", "phi", "kappa"), camera.boresight_deg, strict=True)
    lever = zip("xyz", camera.lever_m, strict=True)
    return {
        **{key: getattr(camera, key) for key in names},
        **{f"boresight_{angle}_deg": value for angle, value in boresight},
        **{f"lever_{axis}_m": value for axis, value in lever},
    }


def _exposure_truth(plan: Plan, track: Track) -> dict[str, list[float]]:
    opk_deg = _grid_attitude_deg(plan, track)
    return {
        name: _plain(x_g, 6) + _plain(opk, 10)
        for name, x_g, opk in zip(track.exposure, track.x_g, opk_deg, strict=True)
    }


# --- A simulated flight on disk


TRUTH_MARK = f'"made_by": "{MADE_BY}"'.encode()
"""Text at the beginning of every truth."""


def truth_path(folder: str | Path) -> Path:
    """Return the path of a flight's truth: beside its folder, never inside."""
    folder = Path(folder)
    return folder.with_name(f"{folder.name}.truth.json")


def write(flight: SimulatedFlight, folder: str | Path, *, tell: Tell = lambda *_: None) -> None:
    """Write a flight folder with its pictures and, beside it, its truth.

    The folder appears complete or not at all.

    Parameters
    ----------
    flight : SimulatedFlight
        The flight.
    folder : str or Path
        Folder to write; it must not exist, or be empty.
    tell : callable
        Called with the name of a picture, its number of finished rows, and of all rows.

    Raises
    ------
    FileExistsError
        Where the folder or the truth exists already.
    """
    folder = Path(folder).resolve()
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        msg = f"{folder} exists already and is not an empty folder; choose another name"
        raise FileExistsError(msg)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".simulate-") as scratch:
        draft = Path(scratch) / "flight"
        write_files(flight, draft)
        if flight.photography is not None:
            take(flight.photography, draft, tell)
        truth_draft = Path(scratch) / "truth.json"
        _write_text(truth_draft, json.dumps(flight.truth, indent=1) + "\n")
        if folder.exists():
            folder.rmdir()
        truth_draft.replace(truth_path(folder))
        draft.replace(folder)


def write_files(flight: SimulatedFlight, folder: Path) -> None:
    """Write the tables and flight.toml into a new folder: neither pictures nor truth."""
    folder.mkdir()
    _write_text(folder / "flight.toml", flight.toml)
    for name, table in flight.tables.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        _write_text(path, table.to_csv(index=False, lineterminator="\n"))


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


# --- The tables of a simulated flight


# A millionth of a pixel, a micrometre, and an angle that moves the ground by less than that.
DECIMALS = {"px": 6, "m": 6, "deg": 10, "s": 3}
_LAT_LON_DECIMALS = 12


def _rounded(table: pd.DataFrame) -> pd.DataFrame:
    """Round every column by the unit at the end of its name."""
    decimals = {
        name: DECIMALS[name.rsplit("_", 1)[-1]]
        for name in table.columns
        if name.rsplit("_", 1)[-1] in DECIMALS
    }
    decimals |= dict.fromkeys(decimals.keys() & {"lat_deg", "lon_deg"}, _LAT_LON_DECIMALS)
    return table.round(decimals)


def _images(block: BlockPlan, track: Track) -> pd.DataFrame:
    """Tabulate the images of a block, exposure by exposure."""
    many = len(block.cameras) > 1
    return pd.DataFrame(
        [
            (f"{exposure}_{camera}" if many else exposure, camera, exposure, strip)
            for exposure, strip in zip(track.exposure, track.strip, strict=True)
            for camera in block.cameras
        ],
        columns=["image", "camera", "exposure", "strip"],
    )


def _grid_attitude_deg(plan: Plan, track: Track) -> Array:
    """Compute omega, phi, kappa of the body relative to the grid, degrees."""
    grid = Grid(crs=plan.crs)
    gamma = grid.convergence(grid.geodetic_from_grid(track.x_g))
    return np.degrees(opk_from_attitude(track.R_enu_b, gamma))


def _trajectory(plan: Plan, track: Track) -> pd.DataFrame:
    """Tabulate a trajectory in the form of the plan."""
    if plan.angles == "grid":
        names = "east_m north_m height_m omega_deg phi_deg kappa_deg"
        values = np.column_stack([track.x_g, _grid_attitude_deg(plan, track)])
    else:
        names = "lat_deg lon_deg height_m roll_deg pitch_deg heading_deg"
        llh = Grid(crs=plan.crs).geodetic_from_grid(track.x_g)
        rph = rph_from_attitude(track.R_enu_b)
        values = np.column_stack([np.degrees(llh[:, :2]), llh[:, 2], np.degrees(rph)])
    table = pd.DataFrame(values, columns=names.split())
    table.insert(0, "exposure", track.exposure)
    table["time_s"] = track.time_s
    return _rounded(table)


def _control_points(
    sigma_m: Sequence[float],
    names: list[str],
    x_g: Array,
    options: Options,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Tabulate surveyed points: true coordinates plus noise."""
    sigma = np.array(sigma_m)
    survey = x_g + options.control_noise * sigma * rng.standard_normal(x_g.shape)
    table = pd.DataFrame(survey, columns=["east_m", "north_m", "height_m"])
    table.insert(0, "point", names)
    for name, value in zip(("east", "north", "height"), sigma, strict=True):
        table[f"sigma_{name}_m"] = value * stated(options.control_noise)
    return _rounded(table)


def _image_points(
    image_names: pd.Series, points: pd.DataFrame, sight: Visibility, rng: np.random.Generator
) -> pd.DataFrame:
    """Tabulate measurements, image by image."""
    exposure_idx, camera_idx, point_idx = np.nonzero(sight.seen.transpose(1, 0, 2))
    exact = sight.colrow[camera_idx, exposure_idx, point_idx]
    point = points.iloc[point_idx].reset_index(drop=True)
    noise = point["noise_px"].to_numpy()[:, None] * rng.standard_normal(exact.shape)
    table = pd.DataFrame(exact + noise, columns=["col_px", "row_px"])
    table.insert(0, "image", image_names.to_numpy()[exposure_idx * len(sight.seen) + camera_idx])
    table.insert(1, "point", point["point"])
    if "sigma_px" in point:
        table["sigma_px"] = point["sigma_px"]
    return _rounded(table)


# --- Gross errors put into a simulated flight, to see whether they are found
#
# All other observations keep the values that they have without gross errors.


_COORDINATES = ("east_m", "north_m", "height_m")
_MIN_RAYS = 4  # images of the control point with the error: in fewer it may not be detectable


@dataclass(frozen=True, kw_only=True, eq=False)
class Spoiled:
    """Tables with gross errors, and a list of these errors.

    Attributes
    ----------
    tables : mapping of str to DataFrame
        All tables of the flight by path.
    mistakes : list of dict
        One for every gross error: `kind`, `image_or_exposure` and `point` as in rejected.csv,
        `block`, and the errors that were added, by column.
    """

    tables: Mapping[str, pd.DataFrame]
    mistakes: list[dict[str, Any]]


def _spoil(
    plan: Plan,
    files: Mapping[str, pd.DataFrame],
    recorded: Mapping[str, Track],
    errors: GrossErrors,
    seed: int,
) -> Spoiled:
    """Put gross errors into one block of a flight and into its control points."""
    block = errors.block
    if block not in recorded:
        msg = f"gross_errors: block {block!r} is not simulated; there are {list(recorded)}"
        raise ValueError(msg)
    rng = stream(seed, plan.draws, block, "gross errors")
    paths = [f"{block}/{name}.csv" for name in ("trajectory", "image_points")]
    control = f"{block}/control_points.csv"
    paths.append(control if control in files else "control_points.csv")
    track, in_track = _spoil_track(recorded[block], errors, rng)
    points, in_images = _spoil_images(plan, files, errors, rng)
    survey, in_survey = _spoil_control(files[paths[2]], files[paths[1]], errors, rng)
    spoiled = dict(zip(paths, (_trajectory(plan, track), points, survey), strict=True))
    mistakes = [{**mistake, "block": block} for mistake in in_track + in_images + in_survey]
    return Spoiled(tables={**files, **spoiled}, mistakes=mistakes)


def _spoil_track(
    track: Track, errors: GrossErrors, rng: np.random.Generator
) -> tuple[Track, list[dict[str, Any]]]:
    """Shift one exposure, and turn another about its vertical axis."""
    shifted, turned = rng.choice(len(track.exposure), 2, replace=False)
    direction = rng.standard_normal(3)
    x_g, turn_deg = track.x_g.copy(), np.zeros((len(track.exposure), 3))
    shift = errors.gnss_m * direction / np.linalg.norm(direction)
    x_g[shifted] += shift
    turn_deg[turned, 2] = errors.heading_deg * rng.choice([-1.0, 1.0])
    spoiled = replace(
        track, x_g=x_g, R_enu_b=track.R_enu_b * Rotation.from_rotvec(turn_deg, degrees=True)
    )
    return spoiled, [
        _mistake("gnss", track.exposure[shifted], "", _COORDINATES, shift),
        # The body's z axis points up; heading is clockwise.
        _mistake("attitude", track.exposure[turned], "", ("heading_deg",), -turn_deg[turned, 2:]),
    ]


def _spoil_images(
    plan: Plan, files: Mapping[str, pd.DataFrame], errors: GrossErrors, rng: np.random.Generator
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Move a share of the measurements in any direction, but not off the sensor."""
    table = files[f"{errors.block}/image_points.csv"].copy()
    rows = np.flatnonzero(rng.random(len(table)) < errors.image_points)
    least, greatest = np.log(errors.image_px)
    length = np.exp(rng.uniform(least, greatest, len(rows)))
    direction = rng.uniform(0, 2 * np.pi, len(rows))
    move = length[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    names = ["col_px", "row_px"]
    before = table.loc[rows, names].to_numpy()
    cameras = files[f"{errors.block}/images.csv"].set_index("image")["camera"]
    sensors = [plan.cameras[name] for name in cameras[table.loc[rows, "image"]]]
    last = np.array([[sensor.width_px, sensor.height_px] for sensor in sensors]).reshape(-1, 2) - 1
    after = before + move
    move = np.where((after < 0) | (after > last), -move, move)
    table.loc[rows, names] = before + move
    mistakes = [
        _mistake("image_point", image, point, names, added)
        for image, point, added in zip(
            table.loc[rows, "image"], table.loc[rows, "point"], move, strict=True
        )
    ]
    return _rounded(table), mistakes


def _spoil_control(
    survey: pd.DataFrame, points: pd.DataFrame, errors: GrossErrors, rng: np.random.Generator
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Add an error to one coordinate of one surveyed point."""
    rays = survey["point"].map(points["point"].value_counts()).fillna(0)
    candidates = np.flatnonzero(rays >= _MIN_RAYS)
    if not len(candidates):
        msg = f"gross_errors: no control point is in {_MIN_RAYS} images of {errors.block}"
        raise ValueError(msg)
    row, name = rng.choice(candidates), rng.choice(_COORDINATES)
    error = errors.control_m * rng.choice([-1.0, 1.0])
    table = survey.copy()
    table.loc[row, name] += error
    return _rounded(table), [
        _mistake("control_point", "", table.loc[row, "point"], (name,), np.array([error]))
    ]


def _mistake(
    kind: str, image_or_exposure: str, point: str, names: tuple[str, ...] | list[str], added: Array
) -> dict[str, Any]:
    values = {str(name): round(float(value), 6) for name, value in zip(names, added, strict=True)}
    return {"kind": kind, "image_or_exposure": image_or_exposure, "point": str(point), **values}
