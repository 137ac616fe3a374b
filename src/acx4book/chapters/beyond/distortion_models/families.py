"""Families of distortion parameters: corrections of image coordinates, linear in coefficients.

Every term is a vector field without unit over the image, of about one at its border. Coefficients
have the unit mm, and a corrected point is the measured point less the sum of coefficients times
terms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, xy_from_colrow

RADIAL = ("k1", "k2", "k3")
CENTRAL = ("f", "xp", "yp")
BROWN = (*CENTRAL, *RADIAL, "p1", "p2")


@dataclass(frozen=True, kw_only=True)
class Model:
    """A distortion model.

    Attributes
    ----------
    name : str
    free : tuple of str
        Interior parameters to estimate; those that are not are zero, if they are distortion.
    terms : callable, optional
        From points (n, 2), in half of the image's sides, to fields (n, 2, k), both without unit.
    """

    name: str
    free: tuple[str, ...]
    terms: Callable[[Array], Array] | None = None

    @property
    def n_terms(self) -> int:
        """Number of coefficients besides the interior parameters."""
        return 0 if self.terms is None else self.terms(np.zeros((1, 2))).shape[2]

    @property
    def n_distortion(self) -> int:
        """Number of all parameters of distortion."""
        return self.n_terms + len(set(self.free) - set(CENTRAL))


def ebner(uv: Array) -> Array:
    """Return Ebner's twelve terms at points (n, 2), shape (n, 2, 12).

    Parameters
    ----------
    uv : ndarray, shape (n, 2)
        From the middle of the image, in units of the base b of the 3 x 3 points.

    Notes
    -----
    After Ebner [1]_, with k = x² - 2/3 and m = y² - 2/3; term by term those of the model of this
    name in MicMac, times b. On the points x, y = -1, 0, 1 the terms are orthogonal to each other,
    and to what the orientation of a vertical image changes.

    References
    ----------
    .. [1] H. Ebner, "Self calibrating block adjustment", Bildmessung und Luftbildwesen 44, 1976.
    """
    x, y = uv.T
    k, m, zero = x**2 - 2 / 3, y**2 - 2 / 3, np.zeros(len(uv))
    dx = [x, y, -2 * k, x * y, m, zero, x * m, zero, y * k, zero, k * m, zero]
    dy = [-y, x, x * y, -2 * m, zero, k, zero, y * k, zero, x * m, zero, k * m]
    return np.stack([np.stack(dx, axis=-1), np.stack(dy, axis=-1)], axis=1)


WAVES = ((1, 0), (0, 1), (1, 1), (1, -1))
"""Whole waves along both sides of the image: a Fourier series of the first order."""


def fourier(uv: Array) -> Array:
    """Return sixteen terms of a Fourier series at points (n, 2), shape (n, 2, 16).

    Parameters
    ----------
    uv : ndarray, shape (n, 2)
        From the middle of the image, in half of its sides.

    Notes
    -----
    After Tang, Fritsch and Cramer [1]_: cos and sin of m u + n v, in x and in y, where u and v
    go from -pi to pi over the image. The constant term is left to the principal point.

    References
    ----------
    .. [1] R. Tang, D. Fritsch and M. Cramer, "New rigorous and flexible Fourier self-calibration
       models for airborne camera calibration", ISPRS Journal 71, 2012.
    """
    phase = np.pi * uv @ np.array(WAVES).T
    waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    return np.stack(
        [np.hstack([waves, np.zeros_like(waves)]), np.hstack([np.zeros_like(waves), waves])], axis=1
    )


MODELS = (
    Model(name="Brown", free=BROWN),
    Model(name="Brown, b1", free=(*BROWN, "b1")),
    Model(name="Ebner", free=CENTRAL, terms=ebner),
    Model(name="Fourier", free=CENTRAL, terms=fourier),
    Model(name="radial + Ebner", free=(*CENTRAL, *RADIAL), terms=ebner),
    Model(name="radial + Fourier", free=(*CENTRAL, *RADIAL), terms=fourier),
)
"""Those of the chapter, the paper's first; all estimate focal length and principal point."""


def by_coefficient(model: Model, camera: Camera, colrow: Array) -> Array:
    """Return what coefficients of one mm shift points (n, 2), px, shape (n, 2, k).

    Ebner's points x, y = -1, 0, 1 are a square: b is half of the longer side. Elsewhere every side
    is its own unit.
    """
    half_mm = camera.pixel_mm / 2 * np.array([camera.width_px, camera.height_px])
    if model.terms is None:
        return np.zeros((len(colrow), 2, 0))
    unit = half_mm.max() if model.terms is ebner else half_mm
    mm = model.terms(xy_from_colrow(camera, colrow) / unit)
    return mm / np.array([camera.pixel_mm, -camera.pixel_mm])[:, None]
