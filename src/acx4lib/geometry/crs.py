"""Checks of CRS texts, and transformers of geoid grids, for `geodesy`."""

from __future__ import annotations

import re
from pathlib import Path

import pyproj
from pyproj.exceptions import CRSError

# --- Which texts are accepted as a CRS: none that makes PROJ open a file
#
# A PROJ string may name grids, initialisation files and whole pipelines, and WKT may carry such
# strings. A flight is data; it must not choose which files of the machine are opened.


LONGEST = 20_000
"""Largest number of characters of a CRS as WKT; those of EPSG have at most 3 000."""

DEEPEST = 30
"""Largest number of nested brackets in WKT."""

_CODE = re.compile(r"\s*(?:[A-Z]\w*:[\w.]+(?:\+(?:[A-Z]\w*:)?[\w.]+)*|\d+)\s*", re.ASCII | re.I)
_URN = re.compile(r"\s*urn:ogc:def:crs:\w+:[\w.]*:[\w.]+\s*", re.ASCII | re.I)
_WKT = re.compile(r"\s*[A-Z_]+\s*[\[(]", re.ASCII | re.I)
_PROJ = re.compile(r"\s*\+?[A-Z]\w*(?:=\S*)?(?:\s+\+?[A-Z]\w*(?:=\S*)?)*\s*", re.ASCII | re.I)

# The parts of WKT that name a file, directly or inside a PROJ string.
_FILES_IN_WKT = re.compile(
    r"PARAMETERFILE|PROJ4_GRIDS|PROJ-based|grids\s*=|(?:init|file|catalog|model)\s*=|=\s*pipeline|"
    r"://|@",
    re.ASCII | re.I,
)

# These parameters of PROJ are numbers, or names that PROJ itself knows.
_HARMLESS = re.compile(
    r"proj|type|no_defs|wktext|over|south|north|approx|algo|zone|v?units|v?to_meter|ellps|datum|"
    r"towgs84|pm|axis|R(_A|_V|_a|_g|_h|_C|_lat_a|_lat_g)?|a|b|es?|r?f|lat_[0-3b]|lat_ts|lon_[0-3]|"
    r"lonc|[xyhk]_0|[khWMmnq]|alpha|gamma|azi|tilt|hyperbolic|no_uoff|no_off|no_rot|no_cut|sweep|"
    r"rot|lotsa|orient|mode"
)
_VALUE = re.compile(r"[\w.,+'-]*", re.ASCII)

_NO_GRID = re.compile(r"\+?nadgrids=@null(?![\w.,/])", re.ASCII)
"""Web Mercator is written with this entry; it means no grid, so no file is opened."""


def crs_fault(text: str) -> str:
    """Return why a text is refused as a CRS; empty if it is accepted.

    Parameters
    ----------
    text : str
        An authority code (``EPSG:31982``), WKT, or a PROJ string without files.
    """
    text = _NO_GRID.sub("", text)
    if len(text) > LONGEST:
        return f"has {len(text)} characters, of at most {LONGEST}"
    if _CODE.fullmatch(text) or _URN.fullmatch(text):
        return "" if not text.strip().lower().startswith("file:") else "is a file"
    if _WKT.match(text):
        return _wkt_fault(text)
    if "=" in text and _PROJ.fullmatch(text):
        return _proj_fault(text)
    return "is neither an authority code, nor WKT, nor a PROJ string without files"


def is_code_or_wkt(text: str) -> bool:
    """Tell whether a text may be a vertical CRS; any other can only be the name of a file."""
    return bool(_CODE.fullmatch(text) or _URN.fullmatch(text) or _WKT.match(text))


def _wkt_fault(text: str) -> str:
    match = _FILES_IN_WKT.search(text)
    if match:
        return f"names a file ({match[0].strip()})"
    depth = deepest = 0
    for bracket in re.findall(r"[\[\](){}]", text):
        depth += 1 if bracket in "[({" else -1
        deepest = max(depth, deepest)
    return f"has more than {DEEPEST} brackets inside each other" if deepest > DEEPEST else ""


def _proj_fault(text: str) -> str:
    for word in text.split():
        key, _, value = word.removeprefix("+").partition("=")
        if not _HARMLESS.fullmatch(key):
            return f"has +{key}, which may name a file or is no part of a projection"
        if not _VALUE.fullmatch(value) or (key, value) == ("proj", "pipeline"):
            return f"has +{key}={value}, which may name a file"
    return ""


# --- Transformers of PROJ from heights above a geoid to ellipsoidal heights


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
