"""Transformers of PROJ from heights above a geoid to ellipsoidal heights."""

from __future__ import annotations

import re
from pathlib import Path

import pyproj
from pyproj.exceptions import CRSError

from acx4lib.geometry.crs.text import crs_fault

UNQUOTABLE = re.compile('[",\x00-\x1f]')
"""Characters that the path of a file in a pipeline of PROJ cannot have."""


def geoid_of_file(path: str) -> pyproj.Transformer:
    """Return the transformer of a geoid grid file to ellipsoidal heights.

    Raises
    ------
    CRSError, ProjError
        Where PROJ cannot read the file.
    """
    if not Path(path).is_file():
        msg = "there is no such file"
        raise CRSError(msg)
    if UNQUOTABLE.search(path) or not path.isprintable():
        msg = "PROJ opens no file with a comma, a quote or what is no text in its path"
        raise CRSError(msg)
    return pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f'+step +proj=vgridshift +grids="{path}" +multiplier=1 '
        "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )


def geoid_of_crs(crs: pyproj.CRS, heights: str) -> pyproj.Transformer:
    """Return the transformer of a vertical CRS to ellipsoidal heights, never an approximate one.

    Parameters
    ----------
    crs : CRS
        Projected, or compound.
    heights : str
        The vertical CRS: a code or WKT.

    Raises
    ------
    CRSError, ProjError
        Where `heights` is no vertical CRS, or its grid is not installed.
    """
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    geographic = horizontal.geodetic_crs
    if geographic is None:
        msg = f"{crs.name} has no geodetic CRS"
        raise CRSError(msg)
    fault = crs_fault(heights)
    if fault:
        raise CRSError(f"it {fault}")
    vertical = pyproj.CRS.from_user_input(heights)
    if not vertical.is_vertical:
        msg = f"{vertical.name} is not a vertical CRS"
        raise CRSError(msg)
    name = f"{geographic.name} + {vertical.name}"
    compound = pyproj.crs.CompoundCRS(name, [geographic, vertical])
    return pyproj.Transformer.from_crs(
        compound, geographic.to_3d(), always_xy=True, allow_ballpark=False, only_best=True
    )
