"""The plan of a flight: blocks, strips, exposures, control points."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from acx4sim.earth import Array
from acx4sim.optics import Camera

BLOCKS = ("heads", "calibration", "validation")


@dataclass(frozen=True, kw_only=True)
class GrossErrors:
    """Gross errors among the observations of one block.

    Attributes
    ----------
    block : str
        The block whose observations get the errors.
    image_points : float
        Share of the measured image points, 0 to 1.
    image_px : tuple of float
        Smallest and largest error of an image point; its logarithm has a uniform distribution,
        and so has its direction.
    control_m : float
        Error of one coordinate of one control point that is in four images or more.
    gnss_m : float
        Length of the error of one exposure's position.
    heading_deg : float
        Error of another exposure's heading.
    """

    block: str = "calibration"
    image_points: float = 0.02
    image_px: tuple[float, float] = (5.0, 200.0)
    control_m: float = 1.0
    gnss_m: float = 3.0
    heading_deg: float = 0.3

    def __post_init__(self) -> None:
        if not 0 <= self.image_points <= 1:
            msg = f"image_points must be a share from 0 to 1, got {self.image_points}"
            raise ValueError(msg)
        if not 0 < self.image_px[0] <= self.image_px[1] < np.inf:
            msg = f"image_px must be two positive bounds, the lower first, got {self.image_px}"
            raise ValueError(msg)
        for name in ("control_m", "gnss_m", "heading_deg"):
            if not np.isfinite(getattr(self, name)):
                msg = f"{name} must be a finite number, got {getattr(self, name)}"
                raise ValueError(msg)


@dataclass(frozen=True, kw_only=True)
class SlowErrors:
    """The part of the trajectory's errors that changes slowly; the rest is white noise.

    The standard deviation at a single exposure does not change. The slow part is a first-order
    Gauss-Markov process in every block.

    Attributes
    ----------
    gnss, attitude : float
        Share of the standard deviation, 0 to 1: with 0.8, the white noise has 0.6 of it.
    gnss_constant_s, attitude_constant_s : float
        Time constants: after this time the correlation is 1/e.
    """

    gnss: float = 0.95
    attitude: float = 0.95
    gnss_constant_s: float = 600.0
    attitude_constant_s: float = 600.0

    def __post_init__(self) -> None:
        for name in ("gnss", "attitude"):
            if not 0 <= getattr(self, name) <= 1:
                msg = f"{name} must be a share from 0 to 1, got {getattr(self, name)}"
                raise ValueError(msg)
        for name in ("gnss_constant_s", "attitude_constant_s"):
            if not getattr(self, name) > 0:
                msg = f"{name} must be positive, got {getattr(self, name)}"
                raise ValueError(msg)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a simulated flight.

    Attributes
    ----------
    image_noise, control_noise, gnss_noise, attitude_noise : float
        Factors on the noise: 1 is the design's, 0 gives exact data, -1 the same noise with the
        other sign. The flight's files have the changed sigma, or the design's where a factor is 0.
    tie_points : mapping of str to int
        By block, number of tie points with at least three rays in every camera; other blocks
        have the design's number.
    gnss_shift_m : tuple of float
        Constant error of the trajectory, east, north, height.
    gnss_drift_m_per_min : tuple of float
        Error that grows from zero at the first exposure of every block.
    gnss_strip_drift_m_per_min : tuple of float
        Standard deviations of an error that grows along every strip, at a different rate in each;
        it is zero in the middle of the strip.
    gnss_delay_s, attitude_delay_s : float
        Delay of the position and of the attitude in a row of the trajectory after its exposure.
    compass_deg : tuple of float
        Coefficients B and C of a compass: it shows more than the true heading by B times the sine
        and C times the cosine of what it shows.
    slow_errors : SlowErrors, optional
        Correlation of the trajectory's errors in time; none by default.
    refraction : str
        ``none``, or ``standard`` for rays bent by the standard atmosphere.
    gross_errors : GrossErrors, optional
        Mistakes among the observations; none by default.
    blocks : tuple of str, optional
        Blocks to simulate; all of the design by default.
    """

    image_noise: float = 1.0
    control_noise: float = 1.0
    gnss_noise: float = 1.0
    attitude_noise: float = 1.0
    tie_points: Mapping[str, int] = field(default_factory=dict)
    gnss_shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gnss_drift_m_per_min: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gnss_strip_drift_m_per_min: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gnss_delay_s: float = 0.0
    attitude_delay_s: float = 0.0
    compass_deg: tuple[float, float] = (0.0, 0.0)
    slow_errors: SlowErrors | None = None
    refraction: str = "none"
    gross_errors: GrossErrors | None = None
    blocks: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("image_noise", "control_noise", "gnss_noise", "attitude_noise"):
            _check_number(name, getattr(self, name))
        for name in ("gnss_delay_s", "attitude_delay_s"):
            _check_number(name, getattr(self, name))
        if self.refraction not in ("none", "standard"):
            msg = f"refraction is 'none' or 'standard', got {self.refraction!r}"
            raise ValueError(msg)
        for name in ("gnss_shift_m", "gnss_drift_m_per_min", "gnss_strip_drift_m_per_min"):
            _check_numbers(name, getattr(self, name), 3)
        _check_numbers("compass_deg", self.compass_deg, 2)
        for block, n_points in self.tie_points.items():
            if block not in BLOCKS or not isinstance(n_points, int) or n_points < 0:
                msg = f"tie_points: block {block!r} with {n_points} points; known are {BLOCKS}"
                raise ValueError(msg)


def stated(factor: float) -> float:
    """Return the factor on the standard deviations that a flight's files state."""
    return abs(factor) or 1.0


def _check_number(name: str, factor: float) -> None:
    """Raise a ValueError where a factor on noise, or a delay, is not finite."""
    if not np.isfinite(factor):
        msg = f"{name} must be finite, got {factor}"
        raise ValueError(msg)


def _check_numbers(name: str, values: object, n: int) -> None:
    """Raise a ValueError where values are not n finite numbers."""
    if np.shape(values) != (n,) or not np.all(np.isfinite(values)):  # type: ignore[call-overload]
        msg = f"{name} must be {['two', 'three'][n - 2]} numbers, got {values!r}"
        raise ValueError(msg)


@dataclass(frozen=True, kw_only=True)
class Strip:
    """One strip; positions are forward and left of the block's centre, along its azimuth.

    Attributes
    ----------
    n : int
        Number of exposures.
    height_m : float
        Flying height above mean ground.
    base_m : float
        Distance between exposures.
    turn_deg : float
        Direction of flight relative to the block's azimuth, clockwise.
    forward_m, left_m : float
        Position of the strip's middle.
    speed_m_s : float
        Over ground.
    name : str
        In images.csv; its number in the block by default.
    """

    n: int
    height_m: float
    base_m: float
    turn_deg: float = 0.0
    forward_m: float = 0.0
    left_m: float = 0.0
    speed_m_s: float = 70.0
    name: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockPlan:
    """One block of a flight.

    Attributes
    ----------
    letter : str
        First letter of the names of its exposures.
    cameras : tuple of str
        Cameras that expose together.
    frame : str
        Camera whose image must show a point at an exposure; then all cameras of the block that see
        the point measure it. Empty where every camera measures what it sees.
    centre_m : tuple of float
        East and north of the middle.
    azimuth_deg : float
        Grid azimuth of the block.
    strips : tuple of Strip
        In the order of flight.
    start_s : float
        Time of the first exposure, seconds of the week.
    tie_points : int
        Tie points with at least three rays in every camera, or in the frame.
    tie_area_m : tuple of float
        Half of the length and width of the area with tie points.
    targets : ndarray, shape (n, 2)
        The block's own natural targets, forward and left; none in a block that shares the
        flight's control points.
    target_m : tuple of float
        Standard deviations of their survey, east, north, height.
    target_px : tuple of float
        Smallest and largest standard deviation of measuring one of them.
    tie_places : ndarray, shape (n, 2), optional
        Positions of tie points, forward and left, instead of random ones; every image that shows
        such a point measures it.
    motion : ndarray, shape (n, 7), optional
        How every exposure leaves its place and the level, instead of by chance: forward, left, up,
        roll, pitch, yaw in their standard deviations, and the crab of its strip, -1 to 1.
    """

    letter: str
    cameras: tuple[str, ...]
    centre_m: tuple[float, float]
    azimuth_deg: float
    strips: tuple[Strip, ...]
    start_s: float
    tie_points: int
    tie_area_m: tuple[float, float]
    targets: Array = field(default_factory=lambda: np.empty((0, 2)))
    target_m: tuple[float, float, float] = (0.01, 0.01, 0.02)
    target_px: tuple[float, float] = (1.0, 2.0)
    tie_places: Array | None = None
    motion: Array | None = None
    frame: str = ""


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of a design: px, m, deg."""

    image_px: float
    gnss_horizontal_m: float
    gnss_vertical_m: float
    roll_pitch_deg: float
    heading_deg: float
    control_m: tuple[float, float, float] = (0.01, 0.01, 0.02)


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """A whole flight.

    Attributes
    ----------
    name, title : str
        Its names in the simulator and in flight.toml.
    draws : str
        Name of its random numbers: plans that share it share trajectories, targets and errors.
    crs : str
        CRS of the grid.
    ground_m : float
        Mean ellipsoidal height of the ground.
    relief : float
        Factor on the heights of the hills.
    cameras : dict of str to Camera
        With their true parameters.
    approximate : dict of str to dict
        Their approximate values in flight.toml.
    synthetic, heads : str and tuple of str
        The synthetic camera and its heads, empty for an ordinary camera.
    head_angles_deg : dict of str to tuple
        Omega, phi, kappa of the heads in the synthetic frame.
    refraction : str
        As in `Options`.
    noise : Noise
        Standard deviations.
    angles : str
        Form of the trajectory: `grid` (omega, phi, kappa) or `geodetic` (roll, pitch, heading).
    control : ndarray, shape (n, 2)
        Signalised points, forward and left of the calibration block's centre.
    blocks : dict of str to BlockPlan
        Blocks by the names of their folders.
    """

    name: str
    draws: str
    title: str
    crs: str
    ground_m: float
    cameras: Mapping[str, Camera]
    approximate: Mapping[str, Mapping[str, float]]
    noise: Noise
    angles: str
    control: Array
    blocks: Mapping[str, BlockPlan]
    synthetic: str = ""
    heads: tuple[str, ...] = ()
    head_angles_deg: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    refraction: str = "none"
    relief: float = 1.0

    @property
    def measured_in_heads(self) -> bool:
        """Whether the heads measure the points to be transferred into the synthetic image."""
        return any(block.frame for block in self.blocks.values())


def layout(n_forward: int, n_left: int, half_m: tuple[float, float], play_m: float) -> Array:
    """Return points in rows, each moved by up to `play_m`; they are the same in every run.

    Returns
    -------
    places : ndarray, shape (n_forward * n_left, 2)
        Forward and left, m.
    """
    forward, left = np.meshgrid(
        np.linspace(-half_m[0], half_m[0], n_forward), np.linspace(-half_m[1], half_m[1], n_left)
    )
    count = np.arange(forward.size)[:, None]
    play = (count * [0.7548776662, 0.5698402910]) % 1 * 2 - 1
    return np.column_stack([forward.ravel(), left.ravel()]) + play_m * play


def grid_from_field(block: BlockPlan, places: Array) -> Array:
    """Compute east and north of positions given forward and left of a block's centre."""
    azimuth = np.radians(block.azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    left = np.array([-forward[1], forward[0]])
    en: Array = np.asarray(block.centre_m) + places[:, :1] * forward + places[:, 1:] * left
    return en
