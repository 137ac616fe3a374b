"""The library, checked with measurements and results of other people.

Every comparison is a table: what others printed, what we compute from their measurements, and
the difference. If the measurements are missing, `computed_or_stored` returns the stored tables,
which ``python -m acx4book.reference`` computes.
"""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from acx4book.reference import data, heads, ign, noaa, stored
from acx4book.reference import nist as reference_nist
from acx4book.reference.dbat import comparison, statements
from acx4book.reference.heads import FIVE, TEN
from acx4book.reference.stored import Comparison
from acx4book.typesetting import myst
from acx4book.typesetting.plain_text import Markup
from acx4lib.geometry.parameters import AXES

COMPARISONS: dict[str, tuple[str, Callable[[], pd.DataFrame]]] = {
    "camcal": ("dbat-camcal", lambda: statements.results(comparison.camcal())),
    "sxb": ("dbat-sxb", lambda: statements.results(comparison.sxb())),
    "nist": ("nist-strd", reference_nist.results),
    "noaa": ("noaa-dss-dg", noaa.results),
    "ign": ("ign-uce-m3", ign.results),
    "ign_forgotten_steps": ("ign-uce-m3", ign.forgotten_steps),
    "ten_pairs": (TEN, lambda: heads.pairs(TEN)),
    "ten_rotations": (TEN, lambda: heads.rotations(TEN)),
    "ten_readings": (TEN, lambda: heads.relatives(TEN)),
    "ten_parallax": (TEN, lambda: heads.parallax(TEN)),
    "ten_vignetting": (TEN, lambda: heads.vignetting(TEN)),
    "five_pairs": (FIVE, lambda: heads.pairs(FIVE)),
    "five_rotations": (FIVE, lambda: heads.rotations(FIVE)),
}
"""For every comparison, the set of files that it needs and the function that computes it."""

LABELS = {
    "lon_deg": "longitude (°)",
    "lat_deg": "latitude (°)",
    "distance_m": "distance (m)",
    "ground_pixel_m": "ground pixel (m)",
    "ground_pixels": "distance (ground pixels)",
    "residual_px": "residual (px)",
    "misfit_px": "misfit (px)",
    "std_height_m": "height, std. dev. (m)",
    **{f"d_{axis}_m": f"{axis} (m)" for axis in AXES},
    **{f"sigma_{axis}_m": f"{axis}, σ (m)" for axis in AXES},
    **{f"mean_{axis}_m": f"{axis}, mean (m)" for axis in AXES},
    "largest": "largest difference",
}
"""Headings of columns in the book."""

_FORMATS = {
    "lon_deg": ".6f",
    "lat_deg": ".6f",
    "distance_m": ".4f",
    "rays": ".2g",
    "ground_pixel_m": ".3f",
    "ground_pixels": ".2f",
    "residual_px": ".2f",
    "misfit_px": ".2f",
    "std_height_m": ".3f",
    **{f"d_{axis}_m": "+.4f" for axis in AXES},
    **{f"sigma_{axis}_m": ".4f" for axis in AXES},
    **{f"mean_{axis}_m": "+.3f" for axis in AXES},
    "largest": ".2f",
}


def myst_table(table: pd.DataFrame, caption: str, *, name: str) -> str:
    """Return a table of this package as MyST, with the book's headings and formats."""
    formats = {LABELS.get(c, c): f for c, f in _FORMATS.items() if c in table.columns}
    shown = myst.marked(table.rename(columns=LABELS))
    return myst.myst_table(shown, Markup(caption), name=name, formats=formats)


def compute(name: str) -> pd.DataFrame:
    """Return one of `COMPARISONS`, computed from its measurements.

    Parameters
    ----------
    name : str

    Raises
    ------
    ReferenceDataError
        Where a file is missing, or is not the indexed one.
    """
    return COMPARISONS[name][1]()


def computed_or_stored(name: str, *, folder: str = "") -> Comparison:
    """Return one of `COMPARISONS`; the stored one if its measurements are missing.

    Parameters
    ----------
    name : str
    folder : str
        Folder of the measurements; if empty, the usual one.
    """
    with data.at(folder):
        return stored.computed_or_stored(name, COMPARISONS)


def store() -> None:
    """Compute all comparisons and store them in the repository."""
    stored.store(COMPARISONS)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return numbers of agreeing values and the largest differences for a report."""
    return comparison.summary(table)


def nist_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the digits that agree for every data set of NIST."""
    return reference_nist.summary(table)


def ign_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the surveyed points and the tie points' statistics of IGN's images."""
    return ign.summary(table)


def answer(
    camcal: Comparison, sxb: Comparison, nist: Comparison, noaa: Comparison, ign: Comparison
) -> str:
    """Return sentences on how far the numbers of others are met.

    Parameters
    ----------
    camcal, sxb, nist, noaa, ign : Comparison
        As `computed_or_stored` returns them under these names.
    """
    agrees = pd.concat([camcal.table["agrees"], sxb.table["agrees"]])
    converged = nist.table["outcome"] == reference_nist.CONVERGED
    runs = nist.table.assign(good=converged).groupby(["dataset", "start"])["good"].first()
    height = ign.table.loc[ign.table["kind"] == "tie point", "d_height_m"]
    return (
        f"Yes. {int(agrees.sum())} of {len(agrees)} values and statements in the reports of DBAT "
        "are met to one unit of the last printed digit. "
        f"{int(runs.sum())} of {len(runs)} of NIST's regressions converge, all to at least "
        f"{nist.table.loc[converged, 'digits'].min():.1f} certified digits; one that does not is "
        "reported as not determined. OSSIM's ground points are met to "
        f"{1e3 * noaa.table['distance_m'].max():.0f} mm, and the agency's {len(height)} tie points "
        f"to {1e3 * height.mean():+.0f} mm in height on average, with a standard deviation of "
        f"{height.std():.2f} m."
    )
