"""Heads of a small rig and of the simulated flight."""

from dataclasses import replace

import numpy as np

import acx4sim
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from support import blocks
from support.flights import simulated as flights

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
