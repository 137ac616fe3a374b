"""The lever arm that the two-step interior orientation took up, beside the estimated one."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.mounting.sentences import listed
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.calibration.absorption import Absorption, absorption, effective_heights
from acx4lib.calibration.mounting import Mountings
from acx4lib.expected import Array
from acx4lib.flight.design import flying_heights
from acx4lib.geometry.frames import transform
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.statistical import distributions

NOTHING = (
    "The two methods cannot be compared here: one gave no result, holds $f$, $x_p$ or $y_p$, or "
    "has unknown errors of GNSS positions that the other does not have."
)
PAIRS = (("xp", 0), ("yp", 1), ("f", 2))
"""Which parameter takes up the component of the lever arm along which axis of the camera."""

COLUMNS = (
    *("camera", "parameter", "shift_mm", "expected_mm", "height_m", "at_mean_height_m"),
    *("lever_seen_m", "lever_estimated_m", "sigma_estimated_m", "sigma_difference_m"),
)


def lever_arm_seen(mountings: Mountings) -> pd.DataFrame:
    """Compare what the two-step interior orientation took up with the lever arm it could not see.

    Parameters
    ----------
    mountings : Mountings

    Returns
    -------
    DataFrame
        Per camera and axis of the camera: shift of two_step_gnss against single_step, and what
        the estimated lever arm makes of it by least squares (mm); the effective height; the
        lever arm that the shift means at the mean flying height, and by least squares; the one
        that the single step estimates, its sigma, and the sigma of the difference of the last
        two (m). No rows where the methods cannot be compared.
    """
    found = absorption(mountings)
    if found is None:
        return pd.DataFrame(columns=list(COLUMNS))
    single, gnss = mountings["single_step"], mountings["two_step_gnss"]
    mean_height = float(flying_heights(single.bundle.network.block).mean())
    heights = effective_heights(gnss.calibration, found.by_lever)
    expected = found.by_lever @ found.lever_m
    rows: list[tuple[object, ...]] = []
    for k, camera in enumerate(single.calibration.cameras):
        own = slice(3 * k, 3 * k + 3)
        R_c_b = camera.T_b_c.R.T
        held = gnss.calibration.cameras[k].T_b_c.r
        seen, estimated = (
            transform(R_c_b, lever[own] + held) for lever in (found.lever_seen_m, found.lever_m)
        )
        sigma_estimated = sigmas(propagate(R_c_b, _cov_lever(mountings, k)))
        sigma_difference = sigmas(propagate(R_c_b, found.cov_lever_m[own, own]))
        for (key, axis), row in zip(PAIRS, (1, 2, 0), strict=True):
            shift = found.shift_mm[own][row]
            at_mean = -shift * mean_height / camera.interior.f + (R_c_b @ held)[axis]
            rows.append(
                (
                    *(camera.name, key, shift, expected[own][row], heights[k, axis], at_mean),
                    *(seen[axis], estimated[axis], sigma_estimated[axis], sigma_difference[axis]),
                )
            )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _cov_lever(mountings: Mountings, k: int) -> Array:
    """Return the a posteriori covariance of a camera's lever arm; zero where it is held."""
    calibration = mountings["single_step"].calibration
    columns = calibration.layout.mount[k, :3]
    if np.any(columns < 0):
        return np.zeros((3, 3))
    return calibration.sigma0_sq * calibration.cov[np.ix_(columns, columns)]


def table(seen: pd.DataFrame) -> pd.DataFrame:
    """Return the comparison as a table for readers.

    Parameters
    ----------
    seen : DataFrame
        As `lever_arm_seen` returns it.
    """
    several = len(set(seen["camera"])) > 1
    names = [LABELS[f"{key}_mm"] for key in seen["parameter"]]
    cameras = {"Camera": seen["camera"]} if several else {}
    off_mm = 1e3 * (seen["lever_seen_m"] - seen["lever_estimated_m"])
    return pd.DataFrame(
        {
            **cameras,
            "Parameter": names,
            "Difference (mm)": seen["shift_mm"],
            "Expected (mm)": seen["expected_mm"],
            "Effective height (m)": seen["height_m"],
            "At the mean height (m)": seen["at_mean_height_m"],
            "Lever arm seen (m)": seen["lever_seen_m"],
            "Estimated (m)": seen["lever_estimated_m"],
            "Seen less estimated (mm)": [
                Markup(f"{off:+.1f} ± {1e3 * sigma:.1f}")
                for off, sigma in zip(off_mm, seen["sigma_difference_m"], strict=True)
            ],
        }
    )


FORMATS = {
    "Difference (mm)": "+.4f",
    "Expected (mm)": "+.4f",
    "Effective height (m)": ".0f",
    "At the mean height (m)": "+.3f",
    "Lever arm seen (m)": "+.4f",
    "Estimated (m)": "+.4f",
}


def sentence(mountings: Mountings, seen: pd.DataFrame) -> str:
    """Say by how much the lever arm that was taken up misses the estimated one.

    Parameters
    ----------
    mountings : Mountings
    seen : DataFrame
        As `lever_arm_seen` returns it for them.
    """
    found = absorption(mountings)
    if found is None:
        return NOTHING
    off = seen["lever_seen_m"] - seen["lever_estimated_m"]
    at_mean = seen["at_mean_height_m"] - seen["lever_estimated_m"]
    said = (
        f"The lever arm that the interior orientation took up misses the estimated one by "
        f"{listed(1e3 * off, '+.1f')} mm along $x$, $y$, $z$ (with the mean flying height, by "
        f"{listed(1e3 * at_mean, '+.0f')} mm)."
    )
    chi_square, n = _chi_square(found), len(off)
    if not np.isfinite(chi_square):
        return said
    p = distributions.chi2_sf(chi_square, n)
    return (
        f"{said} Both methods share their measurements, so the standard deviations of this "
        f"difference are only {listed(1e3 * seen['sigma_difference_m'], '.1f')} mm, where the "
        f"single step's lever arm alone has {listed(1e3 * seen['sigma_estimated_m'], '.0f')} mm. "
        f"All components together have $\\chi^2 = {chi_square:.1f}$ with {n} degrees of freedom "
        f"(*p* = {p:.2f})."
    )


def _chi_square(found: Absorption) -> float:
    """Return the chi-square of the difference; NaN where the attitudes add nothing to compare."""
    off, cov = found.lever_seen_m - found.lever_m, found.cov_lever_m
    if np.linalg.eigvalsh(cov).min() <= 1e-12:
        return float("nan")
    return float(off @ np.linalg.solve(cov, off))
