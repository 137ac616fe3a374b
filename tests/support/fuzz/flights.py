"""Cases of flights: `acx4 check` reads them, and of the good ones some are adjusted."""

from __future__ import annotations

import contextlib
import random
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import tifffile

import acx4sim
from acx4files import flight
from acx4files.images.image_files import image_from_file
from acx4files.stages import heads
from acx4lib.calibration import mounting
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.georeferencing import validation
from acx4sim.files import truth_path
from support.commands import complaint, said
from support.flights import in_heads
from support.flights.written import write_flight
from support.fuzz import nasty
from support.fuzz.flight_files import (
    cells,
    column_of_cells,
    columns,
    data_of,
    fewer,
    geoid,
    large,
    names,
    noise,
    pictures,
    rows,
    sigmas,
    special,
    text_file,
    units,
    write,
)

COMPUTED = 8
"""Of the accepted flights one of so many is adjusted."""


def warm(good: Path, work: Path) -> None:
    """Read all good ones, so that all is imported and compiled before memory is measured."""
    for path in _folders(good):
        run(path, 0)


def prepare(good: Path, work: Path, seed: int, case: int) -> tuple[Path, str]:
    """Write a mutated flight; the same seed and case give the same one."""
    rng = random.Random(f"{seed} {case}")
    folder = work / "flight"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(rng.choice(_folders(good)), folder)
    return folder, spoil(folder, rng)


def run(folder: Path, case: int) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    status, out, err = said("check", folder)
    wrong = complaint(status, out, err)
    if wrong or status:
        return "refused" if status else "accepted", wrong
    read = flight.read(folder)
    look_at_pictures(read)
    return (compute(read) if case % COMPUTED == 0 else "accepted"), ""


def _folders(good: Path) -> list[Path]:
    return sorted(path for path in good.iterdir() if path.is_dir())


def look_at_pictures(read: flight.Flight) -> None:
    """Read the pictures; what is wrong with one is a sentence that names it."""
    for block in read.blocks.values():
        for image, path in enumerate(read.image_files[block.name]):
            if path is None:
                continue
            try:
                image_from_file(path, block.cameras[block.images.camera_idx[image]]).image.max()
            except FlightError as error:
                (line,) = error.problems
                assert line.startswith(f"{path}: "), line


def compute(read: flight.Flight) -> str:
    """Adjust a flight as the stages do, and return how that ended."""
    with contextlib.suppress(AdjustmentError):
        if read.heads is not None:
            heads.calibrate(read)
    if read.calibration is None:
        return "computed"
    try:
        found = mounting.calibrate(
            read.calibration,
            free=read.estimate_mounting,
            fix=read.fix,
            refraction=read.refraction,
            gnss=read.gnss,
        )
        if read.validation is not None:
            for name, method in found.methods.items():
                validation.validate(
                    read.validation, method.calibration, method=name, refraction=read.refraction
                )
    except AdjustmentError:
        return "not determined"
    return "computed"


# --- the flights that are mutated: small, good, of both forms of trajectory, some with pictures ---


KEPT = 5
"""Of the simulated flight's tie points one of so many is kept, for speed."""

REDUCED = 50


def write_good(folder: Path) -> list[Path]:
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


# --- ways to spoil a flight, each drawn from a random generator --------------------------------


Mutation = Callable[[Path, random.Random], None]

ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "latin-1", "cp1252", "utf-8-sig", "utf-7", "cp037")


# --- bytes and encodings -----------------------------------------------------------------------


def bytes_(folder: Path, rng: random.Random) -> None:
    """Change, insert, remove, repeat or exchange bytes anywhere."""
    path = text_file(folder, rng)
    data = bytearray(data_of(path))
    for _ in range(rng.choice((1, 1, 2, 5, 50))):
        a = rng.randint(0, len(data))
        b = min(len(data), a + rng.choice((1, 1, 2, 8, 100, 5000)))
        junk = rng.choice(
            (rng.randbytes(rng.randint(1, 8)), data[a:b] * 2, b"", b"\n", b'"', b"\0")
        )
        data[a:b] = junk
    write(path, bytes(data))


def cut(folder: Path, rng: random.Random) -> None:
    path = text_file(folder, rng)
    data = data_of(path)
    write(path, data[: rng.randint(0, len(data))] if rng.random() < 0.8 else b"")


def encoding(folder: Path, rng: random.Random) -> None:
    path = text_file(folder, rng)
    text = data_of(path).decode("utf-8", errors="replace")
    text = text.replace("a", rng.choice(("ä", "a", "日")), 1)
    ends = rng.choice(("\n", "\r\n", "\r", "\n\r", "\x85", "\u2028", "\x0b", "\x0c", "\r\r\n"))
    write(path, text.replace("\n", ends).encode(rng.choice(ENCODINGS), errors="replace"))


# --- flight.toml -------------------------------------------------------------------------------


def toml(folder: Path, rng: random.Random) -> None:
    """Change values, keys and lines."""
    path = folder / "flight.toml"
    lines = data_of(path).decode("utf-8", errors="replace").split("\n")
    for _ in range(rng.choice((1, 1, 2, 6))):
        k = rng.randrange(len(lines))
        key, _, value = lines[k].partition("=")
        text = nasty.cell(rng).replace("\\", "\\\\").replace('"', '\\"')
        lines[k] = rng.choice(
            (
                f"{key}= {rng.choice(nasty.TOML)}",
                f"{key}= {rng.choice(nasty.NUMBERS)}",
                f'{key}= "{text}"',
                f"{key}= [{value}, {value}]",
                f"{key[:-2]}x ={value}",
                f"{lines[k]}\n{lines[k]}",
                "",
                rng.choice(nasty.TOML),
                nasty.any_text(rng),
                f"{lines[k]}{nasty.any_text(rng)}",
                "  " + lines[k],
            )
        )
    if rng.random() < 0.1:
        rng.shuffle(lines)
    write(path, "\n".join(lines).encode("utf-8", errors="surrogatepass"))


def stages(folder: Path, rng: random.Random) -> None:
    """Add what is asked of the stages, right or wrong."""
    listed = ("f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2", "b1", "b2")
    options = {
        "estimate": (*listed, "f", "K1"),
        "fix": ("lever_arm", "boresight", "lever"),
        "gnss": ("shift", "drift", "x"),
        "weights": ("given", "estimated"),
    }
    lines = ["", f"[stages.{rng.choice(('mounting', 'heads', 'mountings'))}]"]
    for key, known in options.items():
        chosen = rng.sample(known, rng.randint(0, len(known)))
        value = repr(chosen) if rng.random() < 0.8 else rng.choice(nasty.TOML)
        lines += [f"{key} = {value}"] * (rng.random() < 0.5)
    lines += ["[apriori]", f"heading_deg = {rng.choice(nasty.NUMBERS)}"] * (rng.random() < 0.3)
    path = folder / "flight.toml"
    write(path, data_of(path) + "\n".join(lines).encode())


def systems(folder: Path, rng: random.Random) -> None:
    """Another CRS, other heights."""
    path = folder / "flight.toml"
    text = data_of(path).decode("utf-8", errors="replace")
    key, values = rng.choice((("crs", nasty.CRS), ("heights", nasty.HEIGHTS)))
    value = rng.choice(values)
    if rng.random() < 0.3:
        at = rng.randint(0, len(value))
        value = value[:at] + nasty.any_text(rng, 4) + value[at:]
    basic = re.sub(r'["\\\x00-\x1f\x7f]', lambda m: f"\\u{ord(m[0]):04x}", value)
    text = re.sub(rf"(?m)^{key} = .*$", lambda _: f'{key} = "{basic}"', text)
    write(path, text.encode("utf-8", errors="surrogatepass"))


def between_files(folder: Path, rng: random.Random) -> None:
    """Exchange two files, or put one of another flight's kind in a place."""
    a, b = text_file(folder, rng), text_file(folder, rng)
    if a != b:
        a_data, b_data = data_of(a), data_of(b)
        write(a, b_data)
        write(b, a_data if rng.random() < 0.5 else b_data)
    elif data_of(a):
        a.unlink()


MUTATIONS: dict[str, Mutation] = {
    "bytes": bytes_,
    "cut": cut,
    "encoding": encoding,
    "cells": cells,
    "column": column_of_cells,
    "rows": rows,
    "columns": columns,
    "units": units,
    "noise": noise,
    "fewer": fewer,
    "sigmas": sigmas,
    "names": names,
    "toml": toml,
    "stages": stages,
    "systems": systems,
    "files": between_files,
    "special": special,
    "pictures": pictures,
    "geoid": geoid,
    "large": large,
}
WEIGHTS = {"large": 0.25, "files": 0.5, "stages": 0.7, "toml": 2.0, "cells": 2.0, "bytes": 2.0}


def spoil(folder: Path, rng: random.Random) -> str:
    """Mutate a flight in place, once or more, and return in which ways."""
    weights = [WEIGHTS.get(kind, 1.0) for kind in MUTATIONS]
    kinds = rng.choices(list(MUTATIONS), weights, k=rng.choice((1, 1, 1, 2, 3)))
    for kind in kinds:
        MUTATIONS[kind](folder, rng)
    return "+".join(kinds)
