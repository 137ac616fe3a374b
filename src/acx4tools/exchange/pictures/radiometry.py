"""What the metadata say of grey values: dark level and vignetting. Nothing is applied to pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array
from acx4tools.exchange.brought import number_of
from acx4tools.exchange.pictures.tags import Tags

CENTRE, POLYNOMIAL = "Camera:VignettingCenter", "Camera:VignettingPolynomial"
DARK, COVERED = "BlackLevel", "MicaSense:DarkRowValue"


@dataclass(frozen=True, kw_only=True)
class Vignetting:
    """The factory's vignetting of a head: grey values are divided by it.

    Attributes
    ----------
    centre_px : tuple of float
        col, row.
    coefficients : tuple of float
        Of r, r^2, …; the constant is one.
    """

    centre_px: tuple[float, float]
    coefficients: tuple[float, ...]

    def at(self, colrow: Array) -> Array:
        """Return the vignetting at pixels (..., 2): one in the middle, less outside."""
        r = np.hypot(*np.moveaxis(np.asarray(colrow, float) - self.centre_px, -1, 0))
        return np.asarray(np.polyval([*self.coefficients[::-1], 1.0], r))


def vignetting(tags: Tags) -> Vignetting | None:
    """Return the vignetting by XMP, as MicaSense's own software reads it; None without it.

    Raises
    ------
    FlightError
        Where the numbers are none.
    """
    centre, coefficients = tags.numbers(CENTRE, 2), tags.numbers(POLYNOMIAL)
    if not (centre and coefficients):
        return None
    return Vignetting(centre_px=(centre[0], centre[1]), coefficients=coefficients)


def dark_level(tags: Tags) -> float | None:
    """Return the grey value of darkness by the TIFF's `DARK`; None without it."""
    value = tags.exif.get(DARK)
    if value is None:
        return None
    found = np.atleast_1d(np.asarray(value, float))
    return float(found.mean()) if found.size and np.all(np.isfinite(found)) else None


def sentences(pictures: Sequence[Tags]) -> list[str]:
    """Return what is known of the grey values of heads, one picture each."""
    said = []
    dark = [level for level in map(dark_level, pictures) if level is not None]
    falls = [(tags, one) for tags in pictures if (one := vignetting(tags)) is not None]
    if dark:
        said.append(f"dark level {min(dark):g} to {max(dark):g}, not subtracted")
    if falls:
        corner = [
            float(one.at(np.array([[0, 0], [t.width_px, 0], [0, t.height_px]])).min())
            for t, one in falls
        ]
        said.append(
            f"vignetting of {number_of(len(falls), 'heads')}, corners with {min(corner):.2f} to "
            f"{max(corner):.2f} of the middle, not applied"
        )
    return said
