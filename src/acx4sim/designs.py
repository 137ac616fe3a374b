"""The flights that can be simulated."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from acx4sim import optics
from acx4sim.earth import chained_deg
from acx4sim.files import SimulatedFlight, simulate_plan, write
from acx4sim.optics import Camera
from acx4sim.plan import BlockPlan, Noise, Options, Plan, Strip, layout

_FIELD = (671_000.0, 7_189_500.0)  # near Curitiba, Brazil
_FIELD_AZIMUTH = 28.0
_VILLAGE = (385_000.0, 5_518_000.0)  # in Bohemia

# Table 3 of the paper, single-step method, printed lever arm read as forward, left, up.
SYNTHETIC = Camera(
    width_px=12000,
    height_px=16200,
    pixel_um=5.6,
    f_mm=74.4404,
    xp_mm=0.0569,
    yp_mm=0.0063,
    k1=2.42e-7,
    k2=-9.30e-11,
    k3=2.06e-14,
    p1=1.70e-6,
    p2=2.03e-7,
    boresight_deg=(0.49665, -1.59457, 0.07984),
    lever_m=(0.223, -0.399, -0.201),
)

ORDINARY = Camera(
    width_px=11608,
    height_px=8708,
    pixel_um=4.6,
    f_mm=50.1273,
    xp_mm=0.0314,
    yp_mm=-0.0472,
    k1=6.1e-6,
    k2=-2.4e-9,
    k3=3.0e-13,
    p1=2.1e-6,
    p2=-3.4e-6,
    boresight_deg=(0.2134, -0.3172, 90.1420),
    lever_m=(-0.124, 0.086, -0.342),
)


def _heads_block() -> BlockPlan:
    """Plan block 1: overlaps are 80 and 50 % in every head, whose image is about 44 x 59 mm."""
    low = Strip(n=7, height_m=1600.0, base_m=190.0)
    return BlockPlan(
        letter="H",
        cameras=tuple(optics.HEADS),
        centre_m=_FIELD,
        azimuth_deg=_FIELD_AZIMUTH,
        strips=(
            Strip(n=10, height_m=2600.0, base_m=309.0),
            replace(low, left_m=638.0),
            low,
            replace(low, left_m=-638.0),
        ),
        start_s=221_400.0,
        tie_points=500,
        tie_area_m=(2600.0, 1900.0),
    )


def _calibration_block() -> BlockPlan:
    """Plan block 2: images of 67.2 x 90.72 mm (forward x across), overlaps 80 and 50 %."""
    low = Strip(n=10, height_m=1000.0, base_m=181.0)
    high = Strip(n=11, height_m=1500.0, base_m=271.0)
    return BlockPlan(
        letter="C",
        cameras=("SYN",),
        centre_m=_FIELD,
        azimuth_deg=_FIELD_AZIMUTH,
        strips=(
            replace(low, left_m=609.0),
            replace(low, turn_deg=180.0),
            replace(low, left_m=-609.0),
            replace(high, turn_deg=180.0),
            high,
        ),
        start_s=224_700.0,
        tie_points=700,
        tie_area_m=(2100.0, 1250.0),
    )


def _validation_block() -> BlockPlan:
    """Plan block 3: 20 strips of 13 or 14 images, overlaps 60 and 30 %, on another day.

    Its targets lie where strips overlap; this gives about as many pairs as in the paper, 262.
    """
    return BlockPlan(
        letter="V",
        cameras=("SYN",),
        centre_m=(682_000.0, 7_174_000.0),
        azimuth_deg=118.0,
        strips=tuple(
            Strip(
                n=14 if i % 5 in (0, 2) else 13,
                height_m=1300.0,
                base_m=469.0,
                turn_deg=180.0 * (i % 2),
                left_m=1109.0 * (9.5 - i),
            )
            for i in range(20)
        ),
        start_s=307_800.0,
        tie_points=0,
        tie_area_m=(3600.0, 11_200.0),
        targets=layout(4, 9, (2200.0, 8 * 1109.0), 330.0),
    )


def acx4_plan() -> Plan:
    """Plan the paper's flight: the heads measure in every block."""
    plan = _four_heads(
        "acx4", "Trimble ACx4 near Curitiba, simulated", mount_deg=SYNTHETIC.boresight_deg
    )
    in_heads = {
        name: replace(block, cameras=plan.heads, frame=plan.synthetic)
        for name, block in plan.blocks.items()
        if block.cameras == (plan.synthetic,)
    }
    return replace(plan, blocks={**plan.blocks, **in_heads})


def acx4_ideal_plan() -> Plan:
    """Plan the paper's flight with an ideal camera, which no heads make, in blocks 2 and 3."""
    omega, phi, kappa = (round(angle, 1) for angle in SYNTHETIC.boresight_deg)
    return _four_heads(
        "acx4-ideal",
        "Trimble ACx4 near Curitiba, simulated with an ideal synthetic camera",
        mount_deg=(omega, phi, kappa),
    )


def _four_heads(name: str, title: str, *, mount_deg: tuple[float, float, float]) -> Plan:
    """Plan the flight of the four heads; the synthetic frame is turned by `mount_deg`."""
    heads = {name: _mounted(name, mount_deg) for name in optics.HEADS}
    return Plan(
        name=name,
        draws="acx4",
        title=title,
        crs="EPSG:31982",
        ground_m=900.0,
        cameras={**heads, "SYN": SYNTHETIC},
        approximate={
            **{
                name: {"focal_mm": 74.0, **_mount(camera.boresight_deg, decimals=1)}
                for name, camera in heads.items()
            },
            "SYN": {"focal_mm": 74.0, **_mount(mount_deg)},
        },
        noise=Noise(
            image_px=0.5,
            gnss_horizontal_m=0.02,
            gnss_vertical_m=0.015,
            roll_pitch_deg=0.005,
            heading_deg=0.008,
        ),
        angles="grid",
        control=layout(8, 7, (1620.0, 1080.0), 50.0),
        blocks={
            "heads": _heads_block(),
            "calibration": _calibration_block(),
            "validation": _validation_block(),
        },
        synthetic="SYN",
        heads=tuple(optics.HEADS),
        head_angles_deg={name: head.boresight_deg for name, head in optics.HEADS.items()},
    )


def _mounted(name: str, mount_deg: tuple[float, float, float]) -> Camera:
    """Return a head on the IMU."""
    head = optics.HEADS[name]
    return replace(head, boresight_deg=chained_deg(mount_deg, head.boresight_deg))


def _mount(angles_deg: tuple[float, float, float], decimals: int = 9) -> dict[str, float]:
    """Return a boresight as keys of flight.toml."""
    names = ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg")
    return {name: round(angle, decimals) for name, angle in zip(names, angles_deg, strict=True)}


def single_head_plan() -> Plan:
    """Plan a flight of one ordinary camera, with the long side of the image across the flight.

    The image is 40.06 mm forward and 53.40 mm across at f = 50.13 mm.
    """
    low = Strip(n=7, height_m=600.0, base_m=96.0)
    cross = Strip(n=8, height_m=1000.0, base_m=160.0)
    calibration = BlockPlan(
        letter="C",
        cameras=("CAM",),
        centre_m=_VILLAGE,
        azimuth_deg=341.0,
        strips=(
            replace(low, left_m=320.0),
            replace(low, turn_deg=180.0),
            replace(low, left_m=-320.0),
            replace(cross, turn_deg=90.0, forward_m=120.0),
            replace(cross, turn_deg=270.0, forward_m=-120.0),
        ),
        start_s=381_000.0,
        tie_points=400,
        tie_area_m=(850.0, 900.0),
    )
    validation = BlockPlan(
        letter="V",
        cameras=("CAM",),
        centre_m=(_VILLAGE[0] + 3000.0, _VILLAGE[1] - 2000.0),
        azimuth_deg=71.0,
        strips=tuple(
            Strip(
                n=12,
                height_m=800.0,
                base_m=256.0,
                turn_deg=180.0 * (i % 2),
                left_m=597.0 * (2 - i),
            )
            for i in range(5)
        ),
        start_s=384_600.0,
        tie_points=0,
        tie_area_m=(1700.0, 1600.0),
        targets=layout(6, 4, (1200.0, 1150.0), 90.0),
    )
    return Plan(
        name="single-head",
        draws="single-head",
        title="One camera turned by 90 degrees, simulated",
        crs="EPSG:32633",
        ground_m=430.0,
        cameras={"CAM": ORDINARY},
        approximate={"CAM": {"focal_mm": 50.0, "mount_kappa_deg": 90.0}},
        noise=Noise(
            image_px=0.4,
            gnss_horizontal_m=0.02,
            gnss_vertical_m=0.03,
            roll_pitch_deg=0.006,
            heading_deg=0.015,
        ),
        angles="geodetic",
        control=layout(5, 4, (520.0, 520.0), 40.0),
        blocks={"calibration": calibration, "validation": validation},
    )


# --- flown -----------------------------------------------------------------------------------


def acx4(*, seed: int = 1, options: Options = Options()) -> SimulatedFlight:  # noqa: B008 frozen
    """Simulate the paper's flight: four heads, a synthetic camera, three blocks.

    Parameters
    ----------
    seed : int
        The same seed gives the same bytes.
    options : Options
        Noise, tie points, GNSS errors, blocks.
    """
    return simulate_plan(acx4_plan(), seed, options)


def acx4_ideal(*, seed: int = 1, options: Options = Options()) -> SimulatedFlight:  # noqa: B008 frozen
    """Simulate the paper's flight with an ideal synthetic camera, which no heads make.

    Parameters
    ----------
    seed, options
        As in `acx4`, of which it has the trajectories, targets and errors.
    """
    return simulate_plan(acx4_ideal_plan(), seed, options)


def single_head(*, seed: int = 1, options: Options = Options()) -> SimulatedFlight:  # noqa: B008 frozen
    """Simulate a flight of one ordinary camera, turned by 90 degrees on its mount.

    Parameters
    ----------
    seed, options
        As in `acx4`.
    """
    return simulate_plan(single_head_plan(), seed, options)


PLANS: Mapping[str, Callable[[], Plan]] = MappingProxyType(
    {"acx4": acx4_plan, "acx4-ideal": acx4_ideal_plan, "single-head": single_head_plan}
)
DESIGNS: Mapping[str, Callable[..., SimulatedFlight]] = MappingProxyType(
    {"acx4": acx4, "acx4-ideal": acx4_ideal, "single-head": single_head}
)


def simulate(
    name: str,
    folder: str | Path,
    *,
    seed: int = 1,
    options: Options = Options(),  # noqa: B008 frozen
) -> Path:
    """Write a simulated flight, its truth beside it, and return its folder.

    Parameters
    ----------
    name : str
        One of `DESIGNS`.
    folder : str or Path
        New or empty.
    seed, options
        As in `acx4`.

    Raises
    ------
    ValueError
        For another name.
    FileExistsError
        Where a flight is there already.
    """
    if name not in DESIGNS:
        msg = f"name must be one of {', '.join(DESIGNS)}, got {name!r}"
        raise ValueError(msg)
    write(DESIGNS[name](seed=seed, options=options), folder)
    return Path(folder)
