"""The library, checked against measurements and results that nobody here made.

Every comparison is a table: what others printed, what we compute from their measurements, and
the difference. Where the measurements are missing, `computed_or_stored` returns the last
computed tables, which `python -m acx4lib.checked` makes anew.
"""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from acx4lib import reference
from acx4lib.checked import comparison, dbat, dbat_blocks, ign, nist, noaa, stored
from acx4lib.checked.stored import Comparison

COMPARISONS: dict[str, tuple[str, Callable[[], pd.DataFrame]]] = {
    "camcal": ("dbat-camcal", lambda: dbat.results(dbat_blocks.camcal())),
    "sxb": ("dbat-sxb", lambda: dbat.results(dbat_blocks.sxb())),
    "nist": ("nist-strd", nist.results),
    "noaa": ("noaa-dss-dg", noaa.results),
    "ign": ("ign-uce-m3", ign.results),
    "ign_forgotten_steps": ("ign-uce-m3", ign.forgotten_steps),
}
"""The set of files that every comparison needs, and what computes it."""

FORMATS: dict[str, dict[str, str]] = {
    "report": {"largest difference": ".2f"},
    "noaa": {
        "lon_deg": ".6f",
        "lat_deg": ".6f",
        "d_east_m": "+.4f",
        "d_north_m": "+.4f",
        "distance_m": ".4f",
        "ground_pixel_m": ".3f",
    },
    "ign": {
        "rays": ".2g",
        "ground_pixels": ".2f",
        **{f"d_{axis}_m": "+.3f" for axis in ign.AXES},
        **{f"sigma_{axis}_m": ".3f" for axis in ign.AXES},
    },
    "ign_forgotten_steps": {
        "residual_px": ".2f",
        "misfit_px": ".2f",
        "std_height_m": ".3f",
        **{f"mean_{axis}_m": "+.3f" for axis in ign.AXES},
    },
}
"""How the numbers of the tables are printed, by column."""


def compute(name: str) -> pd.DataFrame:
    """Return one of `COMPARISONS`, computed from its measurements.

    Parameters
    ----------
    name : str

    Raises
    ------
    ReferenceDataError
        Where a file is missing, or is not the one that was indexed.
    """
    return COMPARISONS[name][1]()


def computed_or_stored(name: str, *, folder: str = "") -> Comparison:
    """Return one of `COMPARISONS`, as it was stored where its measurements are missing.

    Parameters
    ----------
    name : str
    folder : str
        Of the measurements; where they are looked for anyway if empty.
    """
    with reference.at(folder):
        return stored.computed_or_stored(name, COMPARISONS)


def store() -> None:
    """Compute all comparisons and store them in the repository."""
    stored.store(COMPARISONS)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the numbers of values that agree and the largest differences of a report."""
    return comparison.summary(table)


def nist_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the digits that agree for every data set of NIST."""
    return nist.summary(table)


def ign_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the surveyed points and the tie points' statistics of IGN's images."""
    return ign.summary(table)
