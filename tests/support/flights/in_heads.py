"""Flights of heads: with all blocks measured in them, with others than the paper's, small rigs."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd

import acx4sim
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4sim.designs import acx4_plan
from acx4sim.files import simulate_plan
from acx4sim.optics import Camera as Lens
from acx4sim.plan import Options
from support import blocks
from support.flights import simulated as flights
from support.flights import written
from support.flights.simulated import EXACT, HEADS, read_back

OTHER_NAMES = {"CAM2": "port", "CAM3": "starboard"}

LENS = ("xp", "yp", "k1", "k2", "k3", "p1", "p2")


def one_centre_plan():
    """Return a plan whose heads look from one place, and a distortion-free camera beside them.

    Its frame is the body's. What the heads see, transferred into the synthetic image, is what this
    camera sees: the simulator projects into it without any head.
    """
    plan = acx4_plan()
    lever = (0.223, -0.399, -0.201)
    heads = {
        name: replace(plan.cameras[name], boresight_deg=plan.head_angles_deg[name], lever_m=lever)
        for name in HEADS
    }
    ideal = Lens(
        width_px=12000, height_px=16200, pixel_um=5.6, f_mm=heads["CAM1"].f_mm, lever_m=lever
    )
    block = replace(plan.blocks["calibration"], cameras=(*HEADS, "SYN"), frame="")
    return replace(
        plan,
        cameras={**heads, "SYN": ideal},
        approximate={name: {"focal_mm": 74.0, **_mount(plan, name)} for name in (*HEADS, "SYN")},
        blocks={"calibration": block},
    )


def _mount(plan, name):
    angles = plan.head_angles_deg.get(name, (0.0, 0.0, 0.0))
    return dict(zip(("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"), angles, strict=True))


@cache
def one_centre():
    """Return the calibration block of that plan, exact and with all five cameras."""
    options = Options(tie_points={"calibration": 60}, **EXACT)
    return read_back(simulate_plan(one_centre_plan(), 1, options)).flight.calibration


def true_orientation():
    """Return the true orientation of these heads."""
    plan = one_centre_plan()
    heads = tuple(_camera(name, plan.cameras[name]) for name in HEADS)
    return RelativeOrientation(
        heads=heads,
        xyz_mm=np.tile([0.0, 0.0, heads[0].interior.f], (len(heads), 1)),
        opk=np.radians([plan.head_angles_deg[name] for name in HEADS]),
        cov_joint=np.zeros((16 * len(heads), 16 * len(heads))),
        n_exposures=1,
    )


def _camera(name, lens):
    interior = {key: getattr(lens, f"{key}_mm" if key in ("xp", "yp") else key) for key in LENS}
    return Camera(
        name=name,
        width_px=lens.width_px,
        height_px=lens.height_px,
        pixel_mm=1e-3 * lens.pixel_um,
        interior=Interior(f=lens.f_mm, **interior),
    )


def small():
    """Simulate the paper's flight, small, with its blocks 2 and 3 measured in the heads."""
    options = acx4sim.Options(tie_points={"heads": 60, "calibration": 60})
    return acx4sim.acx4(seed=1, options=options)


def write(folder, blocks=("heads", "calibration", "validation")):
    """Write a small flight of two heads without errors; every block is measured in them."""
    written.write_flight(folder, blocks=blocks, mounted=("LEFT", "RIGHT"))
    if "heads" in blocks:
        toml = folder / "flight.toml"
        key = 'measured_in = "heads"\n'
        toml.write_text(toml.read_text().replace("[synthetic]\n", f"[synthetic]\n{key}"))
    return folder


def write_other_heads(path):
    """Write a flight of two heads into a folder that is not there yet; return the folder."""
    options = acx4sim.Options(blocks=("heads",))
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=1, options=options), path)
    toml = (path / "flight.toml").read_text()
    toml = re.sub(r"\[cameras\.CAM[14]\]\n(.+\n)+\n", "", toml)
    for old, new in {**OTHER_NAMES, "SYN": "virtual"}.items():
        toml = toml.replace(f"cameras.{old}]", f"cameras.{new}]").replace(f'"{old}"', f'"{new}"')
    toml = toml.replace('"CAM1", ', "").replace(', "CAM4"', "")
    (path / "flight.toml").write_text(toml)
    images = pd.read_csv(path / "heads" / "images.csv", dtype=str)
    images = images[images["camera"].isin(OTHER_NAMES)]
    points = pd.read_csv(path / "heads" / "image_points.csv", dtype=str)
    points = points[points["image"].isin(images["image"])]
    images.assign(camera=images["camera"].map(OTHER_NAMES)).to_csv(
        path / "heads" / "images.csv", index=False
    )
    points.to_csv(path / "heads" / "image_points.csv", index=False)
    return path


# --- heads of a small rig and of the simulated flight ------------------------------------------


SEEDS = range(1, 11)
FREE = ("xp", "yp", "k1")
SYNTHETIC = replace(
    blocks.CAMERA,
    name="SYN",
    interior=Interior(f=50.0),
    T_b_c=Pose(R=rotation_from_opk(np.radians([0.5, -1.6, 2.0])), r=np.zeros(3)),
)
HEADS_DEG = ((-8.0, 4.0, 91.0), (7.5, -5.0, -92.0), (6.0, 7.0, 2.0))
LEVERS = ((0.10, -0.05, 0.02), (-0.20, 0.15, 0.08), (0.05, 0.25, -0.03))  # m, body axes


def heads(n=2):
    return tuple(
        replace(
            blocks.CAMERA,
            name=f"CAM{k + 1}",
            interior=Interior(f=50.0 + 0.1 * k, xp=0.05 * k, yp=-0.03, k1=2e-6),
            T_b_c=Pose(R=rotation_from_opk(np.radians(HEADS_DEG[k])), r=np.array(LEVERS[k])),
        )
        for k in range(n)
    )


def simulated(n=2, *, strips=blocks.BOTH_WAYS, ties=30, **options):
    return blocks.simulate(
        blocks.fly(strips),
        cameras=heads(n),
        control=blocks.crosses(),
        ties=blocks.terrain(ties),
        **options,
    )


def flown(seed):
    """The heads of a simulated flight with a third of its tie points."""
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 100})
    return flights.read_back(acx4sim.DESIGNS["acx4"](seed=seed, options=options))
