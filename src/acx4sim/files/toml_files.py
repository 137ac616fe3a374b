"""flight.toml and the truth of a simulated flight."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from acx4sim.earth import Array
from acx4sim.files.csv_files import grid_attitude_deg
from acx4sim.fly import Track
from acx4sim.plan import Options, Plan, stated

MADE_BY = "acx4 simulate"
"""The maker of a truth; the command looks for it before it replaces one."""

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


def flight_toml(plan: Plan, options: Options) -> str:
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


def truth(
    plan: Plan,
    seed: int,
    options: Options,
    tracks: Mapping[str, Track],
    points: Mapping[str, Array],
) -> dict[str, Any]:
    """Return the true values, for JSON.

    Parameters
    ----------
    plan, seed, options : Plan, int, Options
        Plan, seed and options of the flight.
    tracks : mapping of str to Track
        True body frames by block.
    points : mapping of str to ndarray, shape (3,)
        True control points and natural targets.
    """
    result: dict[str, Any] = {
        "made_by": MADE_BY,
        "name": plan.name,
        "seed": seed,
        "options": asdict(replace(options, tie_points=dict(options.tie_points))),
        "note": _note(plan),
        "cameras": {name: _camera_truth(plan, name) for name in _real_cameras(plan)},
    }
    if plan.heads:
        result["heads_in_synthetic_frame"] = {
            name: dict(zip(("omega_deg", "phi_deg", "kappa_deg"), angles, strict=True))
            for name, angles in plan.head_angles_deg.items()
        }
        mount = plan.approximate[plan.synthetic]
        result["rendered_boresight"] = {
            f"boresight_{angle}_deg": mount.get(f"mount_{angle}_deg", 0.0)
            for angle in ("omega", "phi", "kappa")
        }
        result["rendered_f_mm"] = plan.cameras[plan.heads[0]].f_mm
    result["exposures"] = {name: _exposure_truth(plan, track) for name, track in tracks.items()}
    result["control_points"] = {name: _plain(x, 6) for name, x in points.items()}
    return result


def _note(plan: Plan) -> str:
    if not plan.heads:
        return NOTE
    return " ".join(
        [NOTE, _CARRIED_NOTE if plan.measured_in_heads else _IDEAL_NOTE, _SYNTHETIC_NOTE]
    )


def _real_cameras(plan: Plan) -> list[str]:
    """Return the cameras with true parameters: not the one that is made of the heads."""
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
    opk_deg = grid_attitude_deg(plan, track)
    return {
        name: _plain(x_g, 6) + _plain(opk, 10)
        for name, x_g, opk in zip(track.exposure, track.x_g, opk_deg, strict=True)
    }
