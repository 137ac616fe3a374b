"""The content of flight.toml, as values of the library."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acx4lib.flight.block import SMALLEST_ANGLE
from acx4lib.flight.table_files import named_file
from acx4lib.flight.toml_file import Toml
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, grid_system
from acx4lib.geometry.parameters import Prior
from acx4lib.least_squares.gauss_markov import GaussMarkov

SIZE = ("width_px", "height_px", "pixel_um", "focal_mm")
LENS = ("xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2", "b1", "b2")
MOUNT = ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg")
SIGMAS = ("lever_sigma_m", "mount_sigma_deg")
"""Standard deviations of the declared mounting: a number, or a list of three."""
LEVER = ("lever_x_m", "lever_y_m", "lever_z_m")
ESTIMABLE = {"f_mm": "f", "xp_mm": "xp", "yp_mm": "yp", **{name: name for name in INTERIOR[3:]}}
"""Interior parameters that a stage may estimate, with the library's names for them."""
ESTIMATED = {
    "heads": ("xp_mm", "yp_mm", "k1", "p1", "p2"),
    "mounting": tuple(name for name in ESTIMABLE if name not in ("b1", "b2")),
}
"""Those that a stage estimates where flight.toml says nothing."""


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

    @property
    def slow_positions(self) -> GaussMarkov:
        """How the errors of GNSS positions are correlated."""
        share, constant = self.gnss_correlated_share, self.gnss_correlation_s
        return GaussMarkov(share=share, time_constant_s=constant)

    @property
    def slow_attitudes(self) -> GaussMarkov:
        """How the errors of attitudes are correlated."""
        share, constant = self.attitude_correlated_share, self.attitude_correlation_s
        return GaussMarkov(share=share, time_constant_s=constant)


UNOBSERVED = dict.fromkeys(
    ("gnss_horizontal_m", "gnss_vertical_m", "roll_pitch_deg", "heading_deg"), np.inf
)
"""Standard deviations of a flight on no map, unless it says others: no receiver is supposed."""


@dataclass(frozen=True, kw_only=True)
class Session:
    """When a flight was flown, and what may have changed its cameras.

    Attributes
    ----------
    date : datetime.date or None
    temperature_c : float
        Of the cameras, degrees Celsius; NaN where not known.
    """

    date: dt.date | None = None
    temperature_c: float = np.nan


@dataclass(frozen=True, kw_only=True)
class Device:
    """What identifies a camera on its certificate; empty where it is not stated."""

    maker: str = ""
    model: str = ""
    serial: str = ""
    lens: str = ""
    lens_serial: str = ""
    sensor: str = ""
    sensor_serial: str = ""


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """What a certificate of calibration states beside the results; nothing is computed from it.

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
    def measured_in_heads(self) -> bool:
        """Whether the blocks calibration and validation are measured in images of the heads."""
        return self.synthetic is not None and self.synthetic.measured_in == "heads"


def setup_of(toml: Toml) -> Setup:
    """Return the content of a flight.toml in which no problem was found."""
    synthetic = toml.table("synthetic")
    mounting = toml.table("stages", "mounting")
    estimated = {
        stage: tuple(ESTIMABLE[name] for name in toml.table("stages", stage).get("estimate", names))
        for stage, names in ESTIMATED.items()
    }
    grid, apriori = grid_of(toml), toml.table("apriori")
    unsaid = UNOBSERVED if grid.is_local else {}
    return Setup(
        name=toml.values["name"],
        grid=grid,
        refraction=toml.values.get("refraction", "none"),
        simulated=toml.values.get("simulated", False),
        cameras={name: camera_of(name, table) for name, table in toml.table("cameras").items()},
        synthetic=_synthetic_of(synthetic) if synthetic else None,
        apriori=Apriori(**unsaid | {key: float(value) for key, value in apriori.items()}),
        smallest_angle=_smallest_angle(toml),
        estimate_heads=estimated["heads"],
        estimate_mounting=estimated["mounting"],
        fix=tuple(mounting.get("fix", ())),
        gnss=(*mounting.get("gnss", ()), *mounting.get("attitude", ())),
        weights=mounting.get("weights", "given"),
        certificate=_certificate_of(toml.table("certificate")),
        session=_session_of(toml.table("session")),
    )


def _session_of(table: dict[str, Any]) -> Session:
    date, celsius = table.get("date"), float(table.get("temperature_c", np.nan))
    return Session(
        date=date.date() if isinstance(date, dt.datetime) else date, temperature_c=celsius
    )


def _certificate_of(table: dict[str, Any]) -> Certificate:
    cameras = {name: Device(**device) for name, device in table.get("cameras", {}).items()}
    lever = tuple(map(float, table.get("antenna_lever_m", ())))
    return Certificate(**{**table, "antenna_lever_m": lever, "cameras": cameras})


def _smallest_angle(toml: Toml) -> float:
    degrees = toml.table("adjustment").get("smallest_angle_deg")
    return SMALLEST_ANGLE if degrees is None else float(np.radians(float(degrees)))


def _synthetic_of(table: dict[str, Any]) -> Synthetic:
    measured_in = table.get("measured_in", "synthetic")
    return Synthetic(camera=table["camera"], heads=tuple(table["heads"]), measured_in=measured_in)


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


def camera_table(camera: Camera) -> dict[str, Any]:
    """Return the table of a camera in flight.toml, the inverse of `camera_of`.

    Its mounting counts as declared there, with the sigma that the camera's prior has of it.
    """
    sizes = (camera.width_px, camera.height_px, 1000.0 * camera.pixel_mm, camera.interior.f)
    lens = (getattr(camera.interior, key.removesuffix("_mm")) for key in LENS)
    mount, lever = np.degrees(camera.T_b_c.opk).tolist(), camera.T_b_c.r.tolist()
    table = dict(zip((*SIZE, *LENS, *MOUNT, *LEVER), (*sizes, *lens, *mount, *lever), strict=True))
    lever_sigma, mount_sigma = np.array(camera.prior.sigma).reshape(2, 3)
    for key, sigma in zip(SIGMAS, (lever_sigma, np.degrees(mount_sigma)), strict=True):
        if np.isfinite(sigma).all():
            table[key] = sigma.tolist()
    return table


def camera_toml(camera: Camera) -> str:
    """Return the lines of flight.toml that declare a camera."""
    name = json.dumps(camera.name, ensure_ascii=False)
    lines = (f"{key} = {value}" for key, value in camera_table(camera).items())
    return "\n".join([f"[cameras.{name}]", *lines, ""])


def _prior(table: dict[str, Any]) -> Prior:
    """Return what a camera's table says of its mounting: a value is declared if it is written."""
    declared = [key in table for key in (*LEVER, *MOUNT)]
    given = [np.broadcast_to(table.get(key, np.inf), 3).astype(float) for key in SIGMAS]
    sigma = np.where(declared, np.concatenate([given[0], np.radians(given[1])]), np.inf)
    return Prior(declared=tuple(declared), sigma=tuple(sigma.tolist()))


def grid_of(toml: Toml) -> GridSystem:
    """Return the CRS and the heights; a geoid grid has its full path."""
    return grid_system(toml.values["crs"], _heights(toml))


def _heights(toml: Toml) -> str | float:
    """Return the heights for the grid system: a file has its full path."""
    heights = toml.values.get("heights", "ellipsoidal")
    if not isinstance(heights, str):
        return float(heights)
    if heights == "ellipsoidal":
        return heights
    inside = toml.folder.resolve()
    path, _ = named_file(inside, inside, heights)
    return str(path) if path is not None else heights
