"""Rotations, the paper's eq. (6), and poses.

``R_a_b`` takes the components of a vector from frame b to frame a, ``r_a_b`` is the origin of
b in a, and a `Pose` ``T_a_b`` holds both, so that inner letters touch: ``T_m_c = T_m_b @ T_b_c``.
All functions work over leading axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib import expected, shown
from acx4lib.expected import Array, Index, Mask


def skew(a: Array) -> Array:
    """Return the cross-product matrices of vectors: ``skew(a) @ b = a x b``.

    Parameters
    ----------
    a : ndarray, shape (..., 3)

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    a = expected.numbers("a", a, (..., 3))
    out = np.zeros((*a.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return out


def turn(axis: int, angle: Array | float) -> Array:
    """Return elementary rotations that turn *vectors* about a coordinate axis.

    Rx, Ry, Rz for axis 0, 1, 2; the R1, R2, R3 of photogrammetry, which turn the axes, are
    their transposes.

    Parameters
    ----------
    axis : {0, 1, 2}
    angle : float or ndarray, shape (...)
        Radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    expected.one_of("axis", axis, (0, 1, 2))
    angle = np.asarray(angle, dtype=float)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((*angle.shape, 3, 3))
    out[..., axis, axis] = 1.0
    out[..., j, j] = out[..., k, k] = np.cos(angle)
    out[..., k, j] = np.sin(angle)
    out[..., j, k] = -np.sin(angle)
    return out


def rotation_from_opk(opk: Array) -> Array:
    """Return R = M(omega, phi, kappa)^T, M the paper's eq. (6).

    M takes object to image, so R takes camera (or body) axes to the axes in which the angles
    are counted: ``R_m_c = rotation_from_opk(opk)``.

    Parameters
    ----------
    opk : ndarray, shape (..., 3)
        omega, phi, kappa in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Notes
    -----
    M = R3(kappa) R2(phi) R1(omega), hence M^T = Rx(omega) Ry(phi) Rz(kappa).
    """
    opk = expected.numbers("opk", opk, (..., 3))
    return turn(0, opk[..., 0]) @ turn(1, opk[..., 1]) @ turn(2, opk[..., 2])


def opk_from_rotation(R: Array) -> Array:
    """Return omega, phi, kappa of R = M^T; phi lies within a quarter turn.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)

    Returns
    -------
    ndarray, shape (..., 3)
        Radians. At phi = +-90 degrees omega and kappa are not separable.
    """
    R = expected.numbers("R", R, (..., 3, 3))
    expected.rotations("R", R.reshape(-1, 3, 3))
    omega = np.arctan2(-R[..., 1, 2], R[..., 2, 2])
    # atan2 instead of asin keeps full precision near a quarter turn
    phi = np.arctan2(R[..., 0, 2], np.hypot(R[..., 1, 2], R[..., 2, 2]))
    kappa = np.arctan2(-R[..., 0, 1], R[..., 0, 0])
    return np.stack([omega, phi, kappa], axis=-1)


def opk_jacobian(opk: Array) -> Array:
    """Return d(opk) / d(delta) for R <- R exp(delta), delta in the axes of the turned frame.

    Parameters
    ----------
    opk : ndarray, shape (..., 3)
        Radians, phi not at a quarter turn.

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    opk = expected.numbers("opk", opk, (..., 3))
    phi, kappa = opk[..., 1], opk[..., 2]
    out = np.zeros((*opk.shape, 3))
    out[..., 0, 0] = np.cos(kappa) / np.cos(phi)
    out[..., 0, 1] = -np.sin(kappa) / np.cos(phi)
    out[..., 1, 0] = np.sin(kappa)
    out[..., 1, 1] = np.cos(kappa)
    out[..., 2, 0] = -np.tan(phi) * np.cos(kappa)
    out[..., 2, 1] = np.tan(phi) * np.sin(kappa)
    out[..., 2, 2] = 1.0
    return out


def rotation_from_rph(rph: Array) -> Array:
    """Return R_ned_frd = Rz(heading) Ry(pitch) Rx(roll).

    Parameters
    ----------
    rph : ndarray, shape (..., 3)
        roll, pitch, heading in radians, heading clockwise from true north.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Forward-right-down to north-east-down.
    """
    rph = expected.numbers("rph", rph, (..., 3))
    return turn(2, rph[..., 2]) @ turn(1, rph[..., 1]) @ turn(0, rph[..., 0])


def rph_from_rotation(R: Array) -> Array:
    """Return roll, pitch, heading of R = Rz(heading) Ry(pitch) Rx(roll).

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Forward-right-down to north-east-down.

    Returns
    -------
    ndarray, shape (..., 3)
        Radians, within a half turn. At a pitch of +-90 degrees roll and heading are not separable.
    """
    R = expected.numbers("R", R, (..., 3, 3))
    roll = np.arctan2(R[..., 2, 1], R[..., 2, 2])
    pitch = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 2, 1], R[..., 2, 2]))
    heading = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return np.stack([roll, pitch, heading], axis=-1)


def exp(delta: Array) -> Array:
    """Return the rotations of rotation vectors (Rodrigues).

    Parameters
    ----------
    delta : ndarray, shape (..., 3)
        Axis times angle, radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    delta = expected.numbers("delta", delta, (..., 3))
    angle = np.linalg.norm(delta, axis=-1)[..., None, None]
    K = skew(delta)
    # np.sinc(x) = sin(pi x) / (pi x), without a special case at zero
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    rotation: Array = np.eye(3) + first * K + second * (K @ K)
    return rotation


def log(R: Array) -> Array:
    """Return the rotation vectors of rotations; inverse of `exp` below a half turn.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)

    Returns
    -------
    ndarray, shape (..., 3)
        Radians.
    """
    R = expected.numbers("R", R, (..., 3, 3))
    twice_sine = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]],
        axis=-1,
    )
    sine = 0.5 * np.linalg.norm(twice_sine, axis=-1)
    cosine = 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    return twice_sine / (2.0 * np.sinc(angle / np.pi))[..., None]


def log_jacobian(delta: Array) -> Array:
    """Return d log(R exp(eps)) / d eps at R = exp(delta), the inverse right Jacobian.

    Parameters
    ----------
    delta : ndarray, shape (..., 3)
        Radians, below a half turn.

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    delta = expected.numbers("delta", delta, (..., 3))
    angle = np.linalg.norm(delta, axis=-1)[..., None, None]
    half = np.maximum(angle, 1e-4) / 2  # at 1e-4 the series' next term is below rounding
    K = skew(delta)
    out: Array = np.eye(3) + 0.5 * K + (1 - half / np.tan(half)) / (2 * half) ** 2 * (K @ K)
    return out


def mean_rotation(R: Array, weights: Array | None = None) -> Array:
    """Return the mean of rotations near each other.

    Parameters
    ----------
    R : ndarray, shape (n, 3, 3)
    weights : ndarray, shape (3, n, 3), optional
        ``weights[:, i]`` is the weight matrix of rotation i, for the rotation vector from the
        mean; these matrices sum to the identity. By default all rotations have equal weight.

    Returns
    -------
    ndarray, shape (3, 3)
    """
    expected.shape("R", R, ("n", 3, 3))
    expected.rotations("R", R)
    mean = R[0]
    for _ in range(20):
        deltas = log(mean.T @ R)
        step = deltas.mean(axis=0) if weights is None else np.einsum("inj,nj->i", weights, deltas)
        mean = mean @ exp(step)
        if np.linalg.norm(step) < 1e-14:
            break
    return mean


@dataclass(frozen=True, kw_only=True, eq=False)
class Pose:
    """Position and attitude of a frame b in a frame a, one or many.

    Attributes
    ----------
    R : ndarray, shape (..., 3, 3)
        R_a_b.
    r : ndarray, shape (..., 3)
        Origin of b in a, m.

    Raises
    ------
    ValueError
        For other shapes. `Camera`, `Trajectory` and other values that hold poses check that R
        is a rotation.
    """

    R: Array
    r: Array

    def __post_init__(self) -> None:
        R, r = getattr(self.R, "shape", ()), getattr(self.r, "shape", ())
        if R[-2:] == (3, 3) and r[-1:] == (3,) and R[:-2] == r[:-1]:
            return  # the usual case, quickly: poses are made very often
        expected.shape("R", self.R, (..., 3, 3))
        expected.shape("r", self.r, (..., 3))
        if not _spread(R[:-2], r[:-1]):
            msg = f"R and r: expected as many of either, got {R[:-2]} and {r[:-1]}"
            raise ValueError(msg)

    def __repr__(self) -> str:
        """Describe a pose by its position, or several by their number, in one line."""
        if self.r.ndim > 1:
            return shown.line("Pose", f"{len(self)} of them")
        r, opk = (", ".join(f"{x:.3f}" for x in v) for v in (self.r, np.degrees(self.opk)))
        return shown.line("Pose", f"r ({r})", f"ω, φ, κ ({opk})°")

    def __matmul__(self, other: Pose) -> Pose:
        """Chain: ``T_a_c = T_a_b @ T_b_c``."""
        return Pose(R=self.R @ other.R, r=self.r + transform(self.R, other.r))

    def __getitem__(self, idx: int | slice | Index | Mask) -> Pose:
        """Select along the first axis."""
        if isinstance(idx, np.ndarray) and idx.dtype != bool:  # four times as quick
            return Pose(R=self.R.take(idx, axis=0), r=self.r.take(idx, axis=0))
        return Pose(R=self.R[idx], r=self.r[idx])

    def __len__(self) -> int:
        """Count the poses along the first axis."""
        return len(self.r)

    @property
    def inverse(self) -> Pose:
        """The inverse pose, T_b_a."""
        R_b_a = np.swapaxes(self.R, -1, -2)
        return Pose(R=R_b_a, r=-transform(R_b_a, self.r))

    @property
    def opk(self) -> Array:
        """omega, phi, kappa in radians, shape (..., 3)."""
        return opk_from_rotation(self.R)


def _spread(a: tuple[int, ...], b: tuple[int, ...]) -> bool:
    """Tell whether arrays of these shapes can be broadcast against each other."""
    pairs = zip(reversed(a), reversed(b), strict=False)
    return all(m == n or 1 in (m, n) for m, n in pairs)


def transform(R: Array, x: Array) -> Array:
    """Return R x for matrices and vectors over leading axes.

    Parameters
    ----------
    R : ndarray, shape (..., k, l)
    x : ndarray, shape (..., l)

    Returns
    -------
    ndarray, shape (..., k)
    """
    return np.einsum("...ij,...j->...i", R, x)
