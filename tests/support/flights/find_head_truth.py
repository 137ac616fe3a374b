"""Find the true interior orientations of the simulated heads (run by hand).

Table 1 prints what a self-calibration with f held at 74 mm gives. Starting from the constants
in `acx4sim.optics.head_truth`, this script changes the truth until exact data of seed 1,
adjusted in that way, give Table 1's x_p, y_p, k1, p1, p2 and Zc, and prints the new constants:

    python tests/support/flights/find_head_truth.py
"""

import sys
import tempfile
from pathlib import Path
from types import MappingProxyType

import numpy as np

import acx4sim
from acx4book.paper import printed
from acx4lib import flight
from acx4lib.calibration.heads import calibrate_heads, relative_orientation
from acx4sim.optics import head_truth

HEADS = ("CAM1", "CAM2", "CAM3", "CAM4")
KEYS = ("xp", "yp", "k1", "p1", "p2")
EXACT = acx4sim.Options(
    image_noise=0.0, control_noise=0.0, gnss_noise=0.0, attitude_noise=0.0, blocks=("heads",)
)


def estimates(truth: dict[str, tuple[float, ...]]) -> dict[str, np.ndarray]:
    """Return xp, yp, k1, p1, p2 and Zc of every head from exact data."""
    head_truth.HEAD_TRUTH = MappingProxyType(
        {name: (truth[name], head_truth.HEAD_TRUTH[name][1]) for name in HEADS}
    )
    with tempfile.TemporaryDirectory() as folder:
        acx4sim.write(acx4sim.acx4(seed=1, options=EXACT), Path(folder) / "flight")
        read = flight.read(Path(folder) / "flight")
    heads = calibrate_heads(read.heads, HEADS, free=KEYS)
    oriented = relative_orientation(heads.bundles, read.cameras[read.synthetic.camera])
    return {
        name: np.array([getattr(camera.interior, key) for key in KEYS] + [oriented.xyz_mm[k, 2]])
        for k, (name, camera) in enumerate(zip(HEADS, oriented.heads, strict=True))
    }


def table_1() -> dict[str, np.ndarray]:
    """Return the same quantities as the paper prints them."""
    names = ("xp_mm", "yp_mm", "k1", "p1", "p2", "Zc_mm")
    return {head: np.array([printed.value(1, name, head) for name in names]) for head in HEADS}


def main() -> None:
    """Iterate and print."""
    target = table_1()
    truth = {name: np.array(head_truth.HEAD_TRUTH[name][0]) for name in HEADS}
    for _ in range(12):
        found = estimates({name: tuple(values) for name, values in truth.items()})
        largest = 0.0
        for name in HEADS:
            change = target[name] - found[name]
            truth[name][1:] += change[:5]
            truth[name][0] *= 1 - change[5] / 74.0 * (name != "CAM1")
            largest = max(largest, np.abs(change / [1, 1, 1e-6, 1e-6, 1e-6, 1]).max())
        sys.stdout.write(f"largest change {largest:.1e}\n")
        if largest < 2e-6:  # files hold pixels to 0.0001
            break
    for name in HEADS:
        constants = tuple(float(f"{value:.10g}") for value in truth[name])
        sys.stdout.write(f"{name} {constants}\n")


if __name__ == "__main__":
    main()
