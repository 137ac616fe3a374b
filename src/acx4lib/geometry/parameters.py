"""Names of the estimated parameters, and of the grid's axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Mask

MOUNT = ("lever_x", "lever_y", "lever_z", "boresight_x", "boresight_y", "boresight_z")
"""The six parameters of a mounting, in the order of `collinearity.mounted_jacobian`."""

LEVER_ARM, BORESIGHT = MOUNT[:3], MOUNT[3:]

POSE = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")

GNSS = ("shift", "drift", "delay")
"""Systematic errors of positions: a shift of the whole block, a drift along each strip, a delay."""

ATTITUDE = ("deviation",)
"""Systematic errors of attitudes: a deviation of the headings that depends on the heading."""

TRAJECTORY = (*GNSS, *ATTITUDE)
"""All systematic errors of a trajectory that can be estimated."""

AXES = ("east", "north", "height")
"""Axes of the grid, along which errors of GNSS positions are counted."""

REPORTED = {
    "f": ("f_mm", "mm"),
    "xp": ("xp_mm", "mm"),
    "yp": ("yp_mm", "mm"),
    "k1": ("k1", "mm^-2"),
    "k2": ("k2", "mm^-4"),
    "k3": ("k3", "mm^-6"),
    "p1": ("p1", "mm^-1"),
    "p2": ("p2", "mm^-1"),
    "b1": ("b1", "1"),
    "b2": ("b2", "1"),
    "lever_x": ("lever_x_m", "m"),
    "lever_y": ("lever_y_m", "m"),
    "lever_z": ("lever_z_m", "m"),
    "boresight_x": ("boresight_omega_deg", "deg"),
    "boresight_y": ("boresight_phi_deg", "deg"),
    "boresight_z": ("boresight_kappa_deg", "deg"),
}
"""The library's name of every parameter, and its name and unit in results."""

BORESIGHT_ANGLES = tuple(REPORTED[name][0] for name in BORESIGHT)
"""Names of the boresight angles in results."""

SHOWN = {
    **{key: (key, unit) for key, (_, unit) in REPORTED.items()},
    **{
        key: (f"{part} {axis}", unit)
        for part, keys, axes, unit in (
            ("lever", LEVER_ARM, "xyz", "m"),
            ("boresight", BORESIGHT, "ωφκ", "°"),
        )
        for key, axis in zip(keys, axes, strict=True)
    },
    "k1": ("k1", "mm⁻²"),
    "k2": ("k2", "mm⁻⁴"),
    "k3": ("k3", "mm⁻⁶"),
    "p1": ("p1", "mm⁻¹"),
    "p2": ("p2", "mm⁻¹"),
}
"""The library's name of every parameter, and its name and unit in tables that values show."""

RELATIVE = (("Xc", "mm"), ("Yc", "mm"), ("Zc", "mm"), ("ω", "°"), ("φ", "°"), ("κ", "°"))
"""Names and units of a head's relative orientation, likewise."""


# --- Prior knowledge of a camera


@dataclass(frozen=True, kw_only=True)
class Prior:
    """Prior knowledge of a camera: of its mounting, in the order of `MOUNT`, and of f, xp, yp.

    Attributes
    ----------
    declared : tuple of bool
        Which values are declared; the others are zero for want of better ones.
    sigma : tuple of float
        Standard deviations of the declared values: the lever arm along the body's axes, m, the
        boresight about them, radians. Infinite where a value is an approximation only.
    interior : tuple of float
        Standard deviations of f, xp and yp, mm, from a laboratory; infinite likewise.

    Raises
    ------
    ValueError
        Where there are not six and three of them, or a sigma is not positive.
    """

    declared: tuple[bool, ...] = (False,) * len(MOUNT)
    sigma: tuple[float, ...] = (np.inf,) * len(MOUNT)
    interior: tuple[float, ...] = (np.inf,) * 3

    def __post_init__(self) -> None:
        if len(self.declared) != len(MOUNT) or len(self.sigma) != len(MOUNT):
            msg = f"declared and sigma: expected {len(MOUNT)} values each"
            raise ValueError(msg)
        if len(self.interior) != 3:
            raise ValueError(f"interior: expected 3 values, got {len(self.interior)}")
        for name in ("sigma", "interior"):
            if not all(sigma > 0 for sigma in getattr(self, name)):
                msg = f"{name}: expected positive numbers, got {getattr(self, name)}"
                raise ValueError(msg)

    @property
    def lever_sigma(self) -> Array:
        """Standard deviations of the lever arm along the body's axes, m."""
        return np.array(self.sigma[:3])

    @property
    def boresight_sigma(self) -> Array:
        """Standard deviations of the boresight about the body's axes, radians."""
        return np.array(self.sigma[3:])

    @property
    def lever_declared(self) -> Mask:
        """Which components of the lever arm are declared."""
        return np.array(self.declared[:3])

    @property
    def boresight_declared(self) -> Mask:
        """Which angles of the boresight are declared."""
        return np.array(self.declared[3:])
