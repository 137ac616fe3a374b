"""Hypothesis strategies: angles, cameras, poses and points."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk


def numbers(largest, *, smallest=None):
    """Finite numbers without subnormals, symmetric unless `smallest` is given."""
    smallest = -largest if smallest is None else smallest
    return st.floats(smallest, largest, allow_subnormal=False)


def vectors(largest, n=3):
    """Vectors of n numbers."""
    return st.lists(numbers(largest), min_size=n, max_size=n).map(np.array)


def directions():
    """Unit vectors in the upper half space."""
    return (
        vectors(1.0)
        .map(lambda v: v + np.array([0.0, 0.0, 2.0]))
        .map(lambda v: v / np.linalg.norm(v))
    )


def opk(largest_phi_deg=80.0):
    """Omega, phi, kappa in radians; phi keeps away from a quarter turn."""
    return st.tuples(numbers(179.0), numbers(largest_phi_deg), numbers(179.0)).map(np.radians)


def interiors():
    """Interior orientations of wide-angle cameras, for image points within 45 mm of the middle.

    Radial distortion stays below 1 mm there and grows slower than the radius; all that
    `visible_points` draws is imaged there.
    """
    return st.builds(
        Interior,
        f=numbers(60.0, smallest=20.0),
        xp=numbers(0.5),
        yp=numbers(0.5),
        k1=numbers(4e-6),
        k2=numbers(1e-9),
        k3=numbers(5e-13),
        p1=numbers(1e-5),
        p2=numbers(1e-5),
        b1=numbers(1e-3),
        b2=numbers(1e-3),
    )


def image_points(n=5):
    """Measured points within 45 mm of the middle, shape (n, 2), mm."""
    return st.lists(vectors(31.0, 2), min_size=n, max_size=n).map(np.array)


def poses():
    """One pose of any attitude within some kilometres, leading axis one."""
    return st.builds(
        lambda angles, r: Pose(R=rotation_from_opk(angles)[None], r=r[None]),
        opk(),
        vectors(5000.0),
    )


def visible_points(n=5):
    """Points in front of a camera, camera axes, shape (n, 3), m: within 35 degrees of nadir."""
    one = st.tuples(numbers(0.5), numbers(0.5), numbers(3000.0, smallest=300.0))
    return st.lists(one, min_size=n, max_size=n).map(
        lambda rows: np.array([[u * z, v * z, -z] for u, v, z in rows])
    )
