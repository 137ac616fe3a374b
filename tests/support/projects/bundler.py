"""Bundler's bundle.out by its manual's layout, VisualSFM's .nvm by that of its documentation."""

import cv2
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


# --- VisualSFM's .nvm


NVM_SIZE, NVM_F, NVM_R = (640, 480), 700.0, 0.05
NVM_POINTS = np.array([[0.0, 0, 10], [2, 1, 11], [-2, 1.5, 9]])
NVM_TURNS = np.radians([[1.0, 2.0, -3.0], [0.5, -1.0, 40.0]])
NVM_CENTRES = np.array([[0.0, 0, 0], [0.5, -0.1, 0.2]])


def nvm_seen(k):
    """Return pixels from the middle, y down: m (1 + r |m|²) is ideal, in units of f."""
    x_c = (NVM_POINTS - NVM_CENTRES[k]) @ cv2.Rodrigues(NVM_TURNS[k])[0].T
    ideal = x_c[:, :2] / x_c[:, 2:]
    m = ideal.copy()
    for _ in range(50):
        m = ideal / (1 + NVM_R * np.sum(m**2, axis=1, keepdims=True))
    return NVM_F * m


def nvm_quaternion(turn):
    """Return w, x, y, z of a rotation vector."""
    angle = np.linalg.norm(turn)
    return [np.cos(angle / 2), *(np.sin(angle / 2) / angle * turn)]


def nvm_text(second_lens=(NVM_F, NVM_R), head="NVM_V3"):
    """Return two cameras, three points that both see, and an empty model at the end."""
    lines = [head, "", "2"]
    for k, (f, r) in enumerate(((NVM_F, NVM_R), second_lens)):
        numbers = [f, *nvm_quaternion(NVM_TURNS[k]), *NVM_CENTRES[k], r, 0]
        lines.append(" ".join([f"img\\{'ab'[k]}.jpg", *(repr(float(one)) for one in numbers)]))
    lines += ["", str(len(NVM_POINTS))]
    for n, point in enumerate(NVM_POINTS.tolist()):
        views = [f"{k} {n} {x!r} {y!r}" for k in (0, 1) for x, y in [nvm_seen(k)[n].tolist()]]
        lines.append(" ".join([*map(repr, point), "1 2 3 2", *views]))
    return "\n".join([*lines, "", "0", "", "#the last part", "0", ""])
