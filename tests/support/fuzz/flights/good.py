"""The flights that are mutated: small, good, of both forms of trajectory, some with pictures."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pandas as pd
import tifffile

import acx4sim
from acx4sim.files import truth_path
from support.flights import in_heads
from support.flights.written import write_flight

KEPT = 5
"""Of the simulated flight's tie points one of so many is kept, for speed."""

REDUCED = 50


def write_all(folder: Path) -> list[Path]:
    """Write the flights, and return their folders."""
    pictured = write_flight(folder / "pictured", blocks=("heads", "calibration", "validation"))
    _add_pictures(pictured)
    above_geoid = write_flight(folder / "geoid", form="geographic")
    _add_geoid(above_geoid)
    simulated = folder / "simulated"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1, options=acx4sim.Options()), simulated)
    truth_path(simulated).unlink()
    _thin(simulated)
    return [pictured, above_geoid, simulated, in_heads.write(folder / "in_heads")]


def _add_pictures(folder: Path) -> None:
    """Give two exposures pictures at a part of the size, each stored in another way."""
    table = pd.read_csv(folder / "heads/images.csv")
    table["file"] = ""
    rng = np.random.default_rng(1)
    stored = ({}, {"compression": "deflate"}, {"tile": (32, 32)}, {"bigtiff": True})
    (folder / "heads/images").mkdir()
    named = table[table["exposure"].isin(["E0", "E1"])].index
    for i, how in zip(named, stored, strict=True):
        pixels = rng.integers(0, 60_000, (3000 // REDUCED, 4000 // REDUCED, 3), dtype=np.uint16)
        name = f"images/{table.loc[i, 'image']}.tif"
        tifffile.imwrite(folder / "heads" / name, pixels, photometric="rgb", **how)
        table.loc[i, "file"] = name
    table.to_csv(folder / "heads/images.csv", index=False)


def _add_geoid(folder: Path) -> None:
    """Let heights count from a geoid that is flat here, so that all else still fits."""
    header = struct.pack(">4d2i", -27.0, -51.0, 1.0, 1.0, 4, 4)
    (folder / "geoid.gtx").write_bytes(header + np.full(16, 3.0, dtype=">f4").tobytes())
    path = folder / "flight.toml"
    path.write_text(path.read_text().replace('"ellipsoidal"', '"geoid.gtx"'))


def _thin(folder: Path) -> None:
    control = set(pd.read_csv(folder / "control_points.csv")["point"])
    path = folder / "calibration/image_points.csv"
    table = pd.read_csv(path)
    ties = sorted(set(table["point"]) - control)
    table[table["point"].isin(control | set(ties[::KEPT]))].to_csv(path, index=False)
