"""What an independent trial found in the same pictures: SIFT, MAGSAC, three rotations a head.

Rotations about x, y and z from the reference head to the other, degrees; inliers; rms, px.
"""

from __future__ import annotations

from collections.abc import Mapping

from acx4book.reference.heads.solved import FIVE, TEN

TRIAL: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    TEN: {
        "1 Blue": (-0.106, -0.154, -0.131),
        "3 Red": (0.225, 0.169, -0.016),
        "4 NIR": (0.047, -0.472, -0.132),
        "5 Red edge": (-0.120, -0.127, 0.018),
        "6 Blue-444": (-0.197, -0.345, -0.064),
        "7 Green-531": (-0.456, 0.108, 0.150),
        "8 Red-650": (-0.034, 0.069, 0.004),
        "9 Red edge-705": (-0.032, -0.236, -0.228),
        "10 Red edge-740": (-0.137, -0.254, -0.264),
    },
    FIVE: {
        "1 Blue": (0.086, 0.154, 0.185),
        "3 Red": (0.026, 0.039, 0.074),
        "4 NIR": (-0.149, 0.134, 0.455),
        "5 Red edge": (-0.150, 0.110, -0.122),
    },
}
