"""VisualSFM's .nvm, written by the layout of its documentation."""

import cv2
import numpy as np

SIZE, F, R = (640, 480), 700.0, 0.05
POINTS = np.array([[0.0, 0, 10], [2, 1, 11], [-2, 1.5, 9]])
TURNS = np.radians([[1.0, 2.0, -3.0], [0.5, -1.0, 40.0]])
CENTRES = np.array([[0.0, 0, 0], [0.5, -0.1, 0.2]])


def seen(k):
    """Return pixels from the middle, y down: m (1 + r |m|²) is ideal, in units of f."""
    x_c = (POINTS - CENTRES[k]) @ cv2.Rodrigues(TURNS[k])[0].T
    ideal = x_c[:, :2] / x_c[:, 2:]
    m = ideal.copy()
    for _ in range(50):
        m = ideal / (1 + R * np.sum(m**2, axis=1, keepdims=True))
    return F * m


def quaternion(turn):
    """Return w, x, y, z of a rotation vector."""
    angle = np.linalg.norm(turn)
    return [np.cos(angle / 2), *(np.sin(angle / 2) / angle * turn)]


def text(second_lens=(F, R), head="NVM_V3"):
    """Return two cameras, three points that both see, and an empty model at the end."""
    lines = [head, "", "2"]
    for k, (f, r) in enumerate(((F, R), second_lens)):
        numbers = [f, *quaternion(TURNS[k]), *CENTRES[k], r, 0]
        lines.append(" ".join([f"img\\{'ab'[k]}.jpg", *(repr(float(one)) for one in numbers)]))
    lines += ["", str(len(POINTS))]
    for n, point in enumerate(POINTS.tolist()):
        views = [f"{k} {n} {x!r} {y!r}" for k in (0, 1) for x, y in [seen(k)[n].tolist()]]
        lines.append(" ".join([*map(repr, point), "1 2 3 2", *views]))
    return "\n".join([*lines, "", "0", "", "#the last part", "0", ""])
