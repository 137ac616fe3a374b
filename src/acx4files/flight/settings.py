"""The keys of flight.toml: their allowed values, and the checks of a file.

`FLIGHT` declares them, for the check of a file and for the table of the book's page.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pyproj.exceptions import ProjError

from acx4files.flight.problems import POSITIVE, RANGES, Problem, Range, did_you_mean, quoted
from acx4files.flight.table_files import named_file
from acx4files.flight.toml_file import (
    Keys,
    Table,
    Tables,
    Toml,
    Value,
    choice,
    choices,
    date,
    defaults,
    fits,
    is_number,
    is_text,
    known_names,
    no_problems,
    number,
    numbers,
    text,
)
from acx4lib.block import SMALLEST_ANGLE
from acx4lib.errors import UNSEEN
from acx4lib.geometry.camera import INTERIOR, Camera, Interior, distortion
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import (
    LARGEST_UNDULATION_M,
    LOCAL,
    GridSystem,
    grid_system,
    is_code_or_wkt,
)
from acx4lib.geometry.parameters import ATTITUDE, GNSS, Prior
from acx4lib.model import Model

FORMAT = 6
"""The latest format of flight.toml; all earlier formats are understood as well."""


def flight_table(toml: Toml) -> Table:
    """Return `FLIGHT` for a document: on no map, heights may be left out."""
    if toml.values.get("crs") != LOCAL:
        return FLIGHT
    return replace(FLIGHT, required=[key for key in FLIGHT.required if key != "heights"])


def _crs_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield the problem of the text of a CRS; WKT may have several lines."""
    value = toml.get(*keys)
    if not is_text(value):
        yield toml.problem(keys, quoted(value), "must be text, such as EPSG:32633")
    elif unseen := UNSEEN.search(re.sub(r"[\n\r\t]", " ", value)):
        fault = f"holds the character U+{ord(unseen[0]):04X}"
        yield toml.problem(keys, fault, "must be text without control characters")


def _height_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    value = number(_UNDULATION) if is_number(toml.get(*keys)) else text(_HEIGHTS)
    yield from value.problems(toml, keys)


def _halves(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield a share of correlated errors without its time constant, or the reverse."""
    table = toml.table(*keys)
    for quantity in ("gnss", "attitude"):
        both = (f"{quantity}_correlation_s", f"{quantity}_correlated_share")
        for key, other in (both, both[::-1]):
            if key in table and other not in table:
                yield toml.problem((*keys, key), "stands alone", f"needs {other} as well")


def _grid_problems(toml: Toml, _: Keys) -> Iterator[Problem]:
    crs, heights = toml.values.get("crs"), toml.values.get("heights")
    if not is_text(crs):
        return
    try:
        grid_system(str(crs))
    except ValueError as error:
        yield toml.problem(("crs",), str(error), f"must be a projected CRS in metres, or {LOCAL!r}")
        return
    if crs == LOCAL:
        yield from _local_problems(toml)
    elif is_text(heights) and heights != "ellipsoidal":
        expected = "must be 'ellipsoidal', a geoid grid in the flight, a vertical CRS, or a number"
        path, wrong = _grid_file(toml)
        hint = did_you_mean(heights, ["ellipsoidal"])
        if path is None and not hint and not is_code_or_wkt(str(heights)):
            yield toml.problem(("heights",), f"{quoted(heights)} {wrong}", expected)
            return
        try:
            _grid_of(toml)
        except ValueError as error:
            reason = " ".join(str(error.__cause__ or error).split())[:200]
            if path is not None and type(error.__cause__) is ProjError:
                reason = "PROJ cannot read it as a geoid grid"
            fault = f"{quoted(heights)} cannot be used{hint or f' ({reason})'}"
            yield toml.problem(("heights",), fault, expected)


def _local_problems(toml: Toml) -> Iterator[Problem]:
    """Yield a geoid or a refraction, which a frame on no map cannot have."""
    for key, only in (("heights", "ellipsoidal"), ("refraction", "none")):
        value = toml.values.get(key, only)
        if value != only:
            expected = f"must be {only!r} or left out, since crs is {LOCAL!r}"
            yield toml.problem((key,), quoted(value), expected)


def _whole_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    if not toml.get(*keys):
        yield toml.problem(keys, "no cameras", "must hold one table per camera")


def _sigma_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield a sigma of values that are not declared."""
    of = {**dict(zip(SIGMAS, (LEVER, MOUNT), strict=True)), **{k: (v,) for k, v in KNOWN.items()}}
    for key, values in of.items():
        if key in toml.table(*keys) and not any(name in toml.table(*keys) for name in values):
            cure = f"needs the values it is of: {', '.join(values)}"
            yield toml.problem((*keys, key), "sigma of nothing", cure)


def _lens_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    """Yield absurd distortion or principal points: other units or another lens model."""
    camera = camera_of("camera", toml.table(*keys))
    half = 0.5 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    corners = half * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    radius, dxy = float(np.hypot(*half)), distortion(camera.interior, corners)
    worst, inward = float(np.abs(dxy).max()), float(np.max(np.sum(dxy * corners, axis=1))) / radius
    # A third inwards would fold a lens of k1 alone; outwards a fisheye needs a quarter and more.
    if worst > 0.5 * radius or inward > 0.25 * radius:
        fault = f"distortion by k1 to p2 reaches {worst:.3g} mm at a corner"
        yield toml.problem(keys, fault, "must be small; k1 in mm^-2, k2 in mm^-4, k3 in mm^-6")
    for axis, key in enumerate(("xp_mm", "yp_mm")):
        value = toml.table(*keys).get(key, 0.0)
        if abs(value) > half[axis]:
            expected = "must lie on the sensor, in mm from its middle"
            yield toml.problem((*keys, key), f"{value!r} (pixels?)", expected)


def _synthetic_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield unknown or repeated names of the synthetic camera and its heads."""
    table, cameras = toml.table(*keys), toml.table("cameras")
    camera, heads, cure = table.get("camera"), table.get("heads"), "must be one of [cameras.…]"
    if "camera" in table:
        yield from known_names(toml, (*keys, "camera"), [camera], cameras, cure)
    if isinstance(heads, list) and heads:
        yield from known_names(toml, (*keys, "heads"), heads, cameras, cure, before=[camera])
    elif "heads" in table:
        yield toml.problem((*keys, "heads"), quoted(heads), "must be a list of cameras")


def _device_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield cameras of a certificate that the flight does not have."""
    cameras, stated = toml.table("cameras"), toml.table(*keys, "cameras")
    for name in stated.keys() - cameras.keys():
        fault = f"no camera of this name{did_you_mean(name, cameras)}"
        yield toml.problem((*keys, "cameras", name), fault, "must be one of [cameras.…]")


_METRES = f"an undulation in metres, at most {LARGEST_UNDULATION_M:g} either way"
_HEIGHTS = f"must be text, or {_METRES}"
_UNDULATION = Range(-LARGEST_UNDULATION_M, LARGEST_UNDULATION_M, f"must be {_METRES}")
_SHARES = dict.fromkeys(("gnss_correlated_share", "attitude_correlated_share"), Range(0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Apriori:
    """Standard deviations for observations without their own; the names have the units.

    The others say how the trajectory's errors are correlated in time: see `GaussMarkov`.
    """

    image_point_px: float = 0.5
    gnss_horizontal_m: float = 0.05
    gnss_vertical_m: float = 0.10
    roll_pitch_deg: float = 0.005
    heading_deg: float = 0.008
    gnss_correlation_s: float = 1.0
    gnss_correlated_share: float = 0.0
    attitude_correlation_s: float = 1.0
    attitude_correlated_share: float = 0.0


_APRIORI = dict.fromkeys(defaults(Apriori), POSITIVE) | _SHARES
_QUOTED = text("must be text in quotes")
_SIGMA = numbers(3, POSITIVE, "must be a number or a list of three", alone=True)
ESTIMABLE = {"f_mm": "f", "xp_mm": "xp", "yp_mm": "yp", **{name: name for name in INTERIOR[3:]}}
"""Interior parameters that a stage may estimate, with the library's names for them."""
_ESTIMATE = choices(tuple(ESTIMABLE))


# --- The content of flight.toml, as values of the library


SIZE = ("width_px", "height_px", "pixel_um", "focal_mm")
LENS = ("xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2", "b1", "b2")
MOUNT = ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg")
SIGMAS = ("lever_sigma_m", "mount_sigma_deg")
"""Standard deviations of the declared mounting: a number, or a list of three."""
LEVER = ("lever_x_m", "lever_y_m", "lever_z_m")
KNOWN = {"focal_sigma_mm": "focal_mm", "xp_sigma_mm": "xp_mm", "yp_sigma_mm": "yp_mm"}
"""Standard deviations of a laboratory, and the values that they are of."""


def camera_of(name: str, table: dict[str, Any]) -> Camera:
    """Return a camera from its table in flight.toml, with valid values."""
    opk = np.radians([float(table.get(key, 0.0)) for key in MOUNT])
    lever = np.array([float(table.get(key, 0.0)) for key in LEVER])
    lens = {key.removesuffix("_mm"): float(table.get(key, 0.0)) for key in LENS}
    return Camera(
        name=name,
        width_px=int(table["width_px"]),
        height_px=int(table["height_px"]),
        pixel_mm=float(table["pixel_um"]) / 1000.0,
        interior=Interior(f=float(table["focal_mm"]), **lens),
        T_b_c=Pose(R=rotation_from_opk(opk), r=lever),
        prior=_prior(table),
    )


def _prior(table: dict[str, Any]) -> Prior:
    """Return the prior of a camera; a value of its mounting in the table counts as declared."""
    declared = [key in table for key in (*LEVER, *MOUNT)]
    sigmas = [np.broadcast_to(table.get(key, np.inf), 3).astype(float) for key in SIGMAS]
    sigma = np.where(declared, np.concatenate([sigmas[0], np.radians(sigmas[1])]), np.inf)
    interior = tuple(float(table.get(key, np.inf)) for key in KNOWN)
    return Prior(declared=tuple(declared), sigma=tuple(sigma.tolist()), interior=interior)


CAMERA = Table(
    keys={
        **{key: number(RANGES[key]) for key in (*SIZE, *LENS, *MOUNT, *LEVER)},
        **dict.fromkeys(SIGMAS, _SIGMA),
        **dict.fromkeys(KNOWN, number(POSITIVE)),
    },
    required=SIZE,
    default=dict.fromkeys((*LENS, *MOUNT, *LEVER), 0.0),
    rules=[_sigma_problems],
    sound=[_lens_problems],
)
ESTIMATED = {
    "heads": ("xp_mm", "yp_mm", "k1", "p1", "p2"),
    "mounting": tuple(name for name in ESTIMABLE if name not in ("b1", "b2")),
}
"""Interior parameters that a stage estimates by default."""


@dataclass(frozen=True, kw_only=True)
class Synthetic:
    """The virtual camera of the synthetic images, and the heads that make them.

    Attributes
    ----------
    camera : str
    heads : tuple of str
    measured_in : str
        The images in which the blocks calibration and validation are measured: ``synthetic``, or
        ``heads``.
    """

    camera: str
    heads: tuple[str, ...]
    measured_in: str = "synthetic"


@dataclass(frozen=True, kw_only=True)
class Device:
    """Identification of a camera on its certificate; empty where not stated."""

    maker: str = ""
    model: str = ""
    serial: str = ""
    lens: str = ""
    lens_serial: str = ""
    sensor: str = ""
    sensor_serial: str = ""


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """Statements of a calibration certificate beside the results; nothing is computed from them.

    Attributes
    ----------
    number, operator, laboratory, imu, imu_serial, gnss_base, datum_epoch : str
        Empty where it is not stated.
    antenna_lever_m : tuple of float
        Of the GNSS antenna from the centre of the IMU, along the axes of the body; three or none.
    valid_until : datetime.date or None
    cameras : mapping of str to Device
        By the name of the camera.
    """

    number: str = ""
    operator: str = ""
    laboratory: str = ""
    imu: str = ""
    imu_serial: str = ""
    gnss_base: str = ""
    datum_epoch: str = ""
    antenna_lever_m: tuple[float, ...] = ()
    valid_until: dt.date | None = None
    cameras: Mapping[str, Device] = field(default_factory=dict)


def _grid_of(toml: Toml) -> GridSystem:
    """Return the CRS and the heights; a geoid grid has its full path."""
    heights = toml.values.get("heights", "ellipsoidal")
    if isinstance(heights, str) and heights != "ellipsoidal":
        heights = str(_grid_file(toml)[0] or heights)
    return grid_system(toml.values["crs"], heights if isinstance(heights, str) else float(heights))


def _grid_file(toml: Toml) -> tuple[Path | None, str]:
    """Return the file that `heights` names, or None and the fault of its name."""
    inside = toml.folder.resolve()
    return named_file(inside, inside, str(toml.values["heights"]))


FLIGHT = Table(
    keys={
        "name": text(),
        "crs": Value('code, WKT or PROJ string of a projected CRS, or `"local"`', _crs_problems),
        "heights": Value("text, or a number", _height_problems),
        "refraction": choice(("none", "standard")),
        "simulated": fits(
            "`true` or `false`; default `false`",
            "must be true or false",
            lambda value: isinstance(value, bool),
        ),
        "cameras": Tables(of=CAMERA, whole=_whole_problems),
        "synthetic": Table(
            keys={
                "camera": Value("name of a camera", no_problems),
                "heads": Value("list of names of cameras", no_problems),
                "measured_in": choice(("synthetic", "heads")),
            },
            required=("camera", "heads"),
            default=defaults(Synthetic),
            rules=[_synthetic_problems],
        ),
        "apriori": Table(
            keys={key: number(allowed) for key, allowed in _APRIORI.items()},
            default={k: v for k, v in defaults(Apriori).items() if "correlat" not in k},
            rules=[_halves],
        ),
        "adjustment": Table(
            keys={"smallest_angle_deg": number(Range(0.0, 90.0))},
            default={"smallest_angle_deg": float(np.degrees(SMALLEST_ANGLE))},
        ),
        "session": Table(
            keys={"date": date(timed=True), "temperature_c": number(Range(-100.0, 100.0))}
        ),
        "stages": Table(
            keys={
                "heads": Table(
                    keys={"estimate": _ESTIMATE}, default={"estimate": ESTIMATED["heads"]}
                ),
                "mounting": Table(
                    keys={
                        "estimate": _ESTIMATE,
                        "fix": choices(("lever_arm", "boresight")),
                        "gnss": choices(GNSS),
                        "attitude": choices(ATTITUDE),
                        "weights": choice(("given", "estimated")),
                    },
                    default={"estimate": ESTIMATED["mounting"], "weights": "given"},
                ),
            }
        ),
        "certificate": Table(
            keys={
                **dict.fromkeys(defaults(Certificate), _QUOTED),
                "antenna_lever_m": numbers(
                    3, RANGES[LEVER[0]], "must be a list of three numbers: x, y, z, in m"
                ),
                "valid_until": date(),
                "cameras": Tables(of=Table(keys=dict.fromkeys(defaults(Device), _QUOTED))),
            },
            rules=[_device_problems],
        ),
        "format": fits(
            f"whole number from 1 to {FORMAT}",
            f"must be a whole number up to {FORMAT}; a larger one is of a later acx4",
            lambda value: value in range(1, FORMAT + 1),
        ),
    },
    required=("name", "crs", "heights", "cameras"),
    default={"refraction": "none"},
    rules=[_grid_problems],
)
"""The keys of flight.toml and their defaults; any other key is refused."""

UNOBSERVED = dict.fromkeys(
    ("gnss_horizontal_m", "gnss_vertical_m", "roll_pitch_deg", "heading_deg"), np.inf
)
"""Default standard deviations of a flight on no map: no GNSS receiver is assumed."""


@dataclass(frozen=True, kw_only=True)
class Session:
    """Date of a flight, and temperature of its cameras.

    Attributes
    ----------
    date : datetime.date or None
    temperature_c : float
        Of the cameras, degrees Celsius; NaN where not known.
    """

    date: dt.date | None = None
    temperature_c: float = np.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """The content of flight.toml.

    Attributes
    ----------
    name : str
    grid : GridSystem
    refraction : str
        ``none`` or ``standard``.
    simulated : bool
        Whether its measurements were computed, not made.
    cameras : dict of str to Camera
    synthetic : Synthetic or None
    apriori : Apriori
    smallest_angle : float
        Of every block, radians.
    estimate_heads, estimate_mounting : tuple of str
        Interior parameters that the stages estimate, by the library's names.
    fix : tuple of str
        Parts that the mounting stage holds: ``lever_arm``, ``boresight``.
    gnss : tuple of str
        Errors of the trajectory that the mounting stage estimates, names of
        `parameters.TRAJECTORY`.
    weights : str
        Sigma that the mounting stage uses: ``given``, or ``estimated`` from the residuals.
    certificate : Certificate
    session : Session
    """

    name: str
    grid: GridSystem
    refraction: str
    simulated: bool
    cameras: dict[str, Camera]
    synthetic: Synthetic | None
    apriori: Apriori
    smallest_angle: float
    estimate_heads: tuple[str, ...]
    estimate_mounting: tuple[str, ...]
    fix: tuple[str, ...]
    gnss: tuple[str, ...]
    weights: str
    certificate: Certificate
    session: Session

    @property
    def model(self) -> Model:
        """The choices of stage mounting."""
        return Model(
            free=self.estimate_mounting, fix=self.fix, refraction=self.refraction, gnss=self.gnss
        )

    @property
    def heads_model(self) -> Model:
        """The choices of stage heads and of rigs; errors of positions are not estimated there."""
        of_attitudes = tuple(name for name in self.gnss if name in ATTITUDE)
        return replace(self.model, free=self.estimate_heads, gnss=of_attitudes)

    @property
    def measured_in_heads(self) -> bool:
        """Whether the blocks calibration and validation are measured in images of the heads."""
        return self.synthetic is not None and self.synthetic.measured_in == "heads"


def setup_of(toml: Toml) -> Setup:
    """Build the setup from a flight.toml without problems."""
    mounting, grid = toml.table("stages", "mounting"), _grid_of(toml)
    estimate = {
        stage: tuple(ESTIMABLE[name] for name in toml.table("stages", stage).get("estimate", names))
        for stage, names in ESTIMATED.items()
    }
    apriori = UNOBSERVED if grid.is_local else {}
    apriori = apriori | {key: float(value) for key, value in toml.table("apriori").items()}
    angle = toml.table("adjustment").get("smallest_angle_deg")
    synthetic, session = toml.table("synthetic"), toml.table("session")
    date, celsius = session.get("date"), session.get("temperature_c", np.nan)
    stated = toml.table("certificate")
    devices = {name: Device(**device) for name, device in stated.get("cameras", {}).items()}
    lever = tuple(map(float, stated.get("antenna_lever_m", ())))
    return Setup(
        name=toml.values["name"],
        grid=grid,
        refraction=toml.values.get("refraction", "none"),
        simulated=toml.values.get("simulated", False),
        cameras={name: camera_of(name, table) for name, table in toml.table("cameras").items()},
        synthetic=Synthetic(**synthetic | {"heads": (*synthetic["heads"],)}) if synthetic else None,
        apriori=Apriori(**apriori),
        smallest_angle=SMALLEST_ANGLE if angle is None else float(np.radians(float(angle))),
        estimate_heads=estimate["heads"],
        estimate_mounting=estimate["mounting"],
        fix=tuple(mounting.get("fix", ())),
        gnss=(*mounting.get("gnss", ()), *mounting.get("attitude", ())),
        weights=mounting.get("weights", "given"),
        certificate=Certificate(**{**stated, "antenna_lever_m": lever, "cameras": devices}),
        session=Session(
            date=date.date() if isinstance(date, dt.datetime) else date,
            temperature_c=float(celsius),
        ),
    )


def camera_table(camera: Camera) -> dict[str, Any]:
    """Return the table of a camera in flight.toml, the inverse of `camera_of`.

    Its mounting is declared there, with the sigma of the camera's prior.
    """
    sizes = (camera.width_px, camera.height_px, 1000.0 * camera.pixel_mm, camera.interior.f)
    lens = (getattr(camera.interior, key.removesuffix("_mm")) for key in LENS)
    mount, lever = np.degrees(camera.T_b_c.opk).tolist(), camera.T_b_c.r.tolist()
    table = dict(zip((*SIZE, *LENS, *MOUNT, *LEVER), (*sizes, *lens, *mount, *lever), strict=True))
    lever_sigma, mount_sigma = np.array(camera.prior.sigma).reshape(2, 3)
    for key, sigma in zip(SIGMAS, (lever_sigma, np.degrees(mount_sigma)), strict=True):
        if np.isfinite(sigma).all():
            table[key] = sigma.tolist()
    known = zip(KNOWN, camera.prior.interior, strict=True)
    return table | {key: sigma for key, sigma in known if np.isfinite(sigma)}


def camera_toml(camera: Camera) -> str:
    """Return the lines of flight.toml that declare a camera."""
    name = json.dumps(camera.name, ensure_ascii=False)
    lines = (f"{key} = {value}" for key, value in camera_table(camera).items())
    return "\n".join([f"[cameras.{name}]", *lines, ""])
