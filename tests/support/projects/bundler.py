"""Bundler's bundle.out, written by its manual's layout."""

import numpy as np

from acx4lib.geometry import frames

SIZE = (640, 480)
LENS = (700.0, -0.05, 0.01)
POINTS = np.array([[0.0, 0, -10], [2, 1, -11], [-2, 1.5, -9]])
ROTATIONS = [frames.exp(np.array([0.01 * k, 0.02, -0.03])) for k in range(2)]
SHIFTS = np.array([[0.0, 0, 0], [0.5, -0.1, 0.2]])


def seen(k):
    """Return pixels from the middle, y up, by the formulas of the manual."""
    P = POINTS @ ROTATIONS[k].T + SHIFTS[k]
    p = -P[:, :2] / P[:, 2:]
    r2 = np.sum(p**2, axis=1, keepdims=True)
    f, k1, k2 = LENS
    return f * (1 + k1 * r2 + k2 * r2**2) * p


def text(lenses=(LENS, LENS, (0, 0, 0))):
    lines = ["# Bundle file v0.3", f"{len(lenses)} {len(POINTS)}"]
    for k, lens in enumerate(lenses):
        R = ROTATIONS[k] if lens[0] else np.zeros((3, 3))
        t = SHIFTS[k] if lens[0] else np.zeros(3)
        lines += [" ".join(map(repr, map(float, row))) for row in (lens, *R, t)]
    for n, point in enumerate(POINTS):
        views = [f"{k} {n} {x!r} {y!r}" for k, (x, y) in ((k, seen(k)[n].tolist()) for k in (0, 1))]
        position = " ".join(map(repr, point.tolist()))
        lines += [position, "1 2 3", f"2 {' '.join(views)}"]
    return "\n".join(lines) + "\n"
