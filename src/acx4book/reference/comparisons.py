"""Stored comparisons, used if the measurements are missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from pandas.api.types import is_numeric_dtype

from acx4book.reference import data, dbat_files, dbat_statements, heads, ign, noaa
from acx4book.reference import nist as reference_nist
from acx4book.reference.heads import FIVE, TEN
from acx4book.typesetting import myst, style
from acx4book.typesetting.plain_text import Markup
from acx4files.results import whole_files
from acx4files.results.whole_files import working_copy
from acx4lib.geometry.parameters import AXES

PACKAGES = ("acx4lib", "numpy", "scipy", "pyproj")

FOLDER = data.FOLDER / "results"


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A comparison and its origin.

    Attributes
    ----------
    table : DataFrame
    origin : str
        A sentence: computed now, or date and software of the stored comparison.
    """

    table: pd.DataFrame
    origin: str


# --- The library, checked with measurements and results of other people
#
# Every comparison is a table: what others printed, what we compute from their measurements, and
# the difference. If the measurements are missing, `computed_or_stored` returns the stored tables,
# which ``python -m acx4book.reference`` computes.


COMPARISONS: dict[str, tuple[str, Callable[[], pd.DataFrame]]] = {
    "camcal": ("dbat-camcal", lambda: dbat_statements.results(dbat_files.camcal())),
    "sxb": ("dbat-sxb", lambda: dbat_statements.results(dbat_files.sxb())),
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


def computed_or_stored(name: str, *, folder: str = "") -> Comparison:
    """Return one of `COMPARISONS`; the stored one if its measurements are missing.

    Parameters
    ----------
    name : str
    folder : str
        Folder of the measurements; if empty, the usual one.

    Raises
    ------
    ReferenceDataError
        Where a file is not the indexed one.
    """
    files, compute = COMPARISONS[name]
    with data.at(folder):
        if data.is_here(files):
            origin = "Computed from the measurements for this page."
            return Comparison(table=compute(), origin=origin)
        known = pd.read_csv(FOLDER / "computed.csv", dtype=str).set_index("name").loc[name]
        versions = ", ".join(f"{package} {known[package]}" for package in PACKAGES)
        return Comparison(
            table=_read(FOLDER / f"{name}.csv"),
            origin=(
                f"The measurements are not on this machine ({data.HINT}); these are the results "
                f"computed on {known['date']} with {versions}."
            ),
        )


def _read(path: Path) -> pd.DataFrame:
    """Read a stored table; texts remain texts, also empty ones."""
    table = pd.read_csv(
        path, keep_default_na=False, na_values=[""], dtype={"printed": str, "point": str}
    )
    texts = table.columns[[not is_numeric_dtype(kind) for kind in table.dtypes]]
    table[texts] = table[texts].fillna("")
    return table


def store() -> None:
    """Compute all comparisons and store them with the date and the software versions.

    Raises
    ------
    ReferenceDataError
        Where a file is missing, or there is no working copy to store them in.
    """
    if working_copy() is None:
        msg = f"{FOLDER}: is part of the installed library; results are stored in a working copy"
        raise data.ReferenceDataError(msg)
    FOLDER.mkdir(exist_ok=True)
    today = datetime.now(UTC).date().isoformat()
    versions = {package: version(package) for package in PACKAGES}
    for name, (_, compute) in COMPARISONS.items():
        _write(compute(), name)
    made = [{"name": name, "date": today, **versions} for name in COMPARISONS]
    _write(pd.DataFrame(made), "computed")


def _write(table: pd.DataFrame, name: str) -> None:
    path = FOLDER / f"{name}.csv"
    text = table.to_csv(index=False, float_format="%.12g", lineterminator="\n")
    whole_files.write(path, text)


def answer(
    camcal: Comparison, sxb: Comparison, nist: Comparison, noaa: Comparison, ign: Comparison
) -> str:
    """Return sentences on the agreement with the numbers of others.

    Parameters
    ----------
    camcal, sxb, nist, noaa, ign : Comparison
        As `computed_or_stored` returns them under these names.
    """
    agrees = pd.concat([camcal.table["agrees"], sxb.table["agrees"]])
    converged = nist.table["outcome"] == reference_nist.CONVERGED
    by_normals = nist.table["quantity"].str.endswith(reference_nist.BY_NORMALS)
    n_sets = nist.table["dataset"].nunique()
    runs = nist.table.assign(good=converged).groupby(["dataset", "start"])["good"].first()
    height = ign.table.loc[ign.table["kind"] == "tie point", "d_height_m"]
    return (
        f"Yes. {int(agrees.sum())} of {len(agrees)} values and statements in the reports of DBAT "
        "are met to one unit of the last printed digit. "
        f"Of NIST's {n_sets + len(reference_nist.NOT_RUN)} nonlinear regressions {n_sets} were "
        f"run, from two starts each. {int(runs.sum())} of {len(runs)} converge, all to at least "
        f"{nist.table.loc[converged & ~by_normals, 'digits'].min():.1f} certified digits; one that "
        "does not is reported as not determined. OSSIM's ground points are met to "
        f"{1e3 * noaa.table['distance_m'].max():.0f} mm, and the agency's {len(height)} tie points "
        f"to {1e3 * height.mean():+.0f} mm in height on average, with a standard deviation of "
        f"{height.std():.2f} m."
    )


# --- Figures of the comparisons


LEFT_OUT = ("statement",)
"""Kinds without numbers."""


def last_digits(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the differences of all printed numbers in units of their last digit.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        Comparisons by the titles of the reports.

    Returns
    -------
    Figure
        One dot per number; numbers in the band round to the printed digits.
    """
    kinds = list(dict.fromkeys(kind for table in tables.values() for kind in table["kind"]))
    kinds = [kind for kind in kinds if kind not in LEFT_OUT]
    with style.applied():
        fig, axes = style.subplots(
            1, len(tables), figsize=(style.WIDTH, 3.4), sharey=True, squeeze=False
        )
        for i, (ax, (title, table)) in enumerate(zip(axes.flat, tables.items(), strict=True)):
            ax.axvspan(-0.5, 0.5, color=style.colour(i), alpha=0.10, lw=0)
            for row, kind in enumerate(kinds):
                units = table.loc[table["kind"] == kind, "units"].to_numpy(dtype=float)
                # spread in a fixed pattern, so that equal values do not hide each other
                spread = 0.6 * ((np.arange(len(units)) * 0.618) % 1 - 0.5)
                ax.plot(units, row + spread, ".", ms=3, alpha=0.6, color=style.colour(i))
            numbers = int((~table["kind"].isin(LEFT_OUT)).sum())
            ax.set_title(f"{title}: {numbers} numbers")
            ax.set(xlim=(-1.05, 1.05), xlabel="difference (units of the last printed digit)")
            ax.set_yticks(range(len(kinds)), kinds)
        axes.flat[0].invert_yaxis()
    return fig


def forgotten_steps(table: pd.DataFrame) -> Figure:
    """Draw the errors in the image and in height that each forgotten step causes.

    Parameters
    ----------
    table : DataFrame
        As `forgotten_steps` returns it.

    Returns
    -------
    Figure
        Bars on logarithmic axes; dotted lines show the complete chain.
    """
    columns = (
        ("misfit_px", "RMS residual of IGN's coordinates (px)", style.BLUE),
        ("mean_height_m", "mean difference in height (m)", style.ORANGE),
    )
    rows = np.arange(len(table))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9), sharey=True)
        for ax, (column, label, fill) in zip(axes, columns, strict=True):
            size = table[column].abs().to_numpy(dtype=float)
            ax.barh(rows, size, color=[style.SOFT, *[fill] * (len(rows) - 1)], height=0.6)
            ax.axvline(size[0], color=style.INK, ls=":", lw=1)
            ax.set(xscale="log", xlabel=label)
            ax.grid(visible=False, axis="y")
        axes[0].set_yticks(rows, table["reading"])
        axes[0].invert_yaxis()
    return fig
