"""Ways to spoil a flight, each drawn from a random generator."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

from support.fuzz import nasty
from support.fuzz.flights.hostile_sizes import large
from support.fuzz.flights.pixels import geoid, pictures
from support.fuzz.flights.special_files import special
from support.fuzz.flights.spoilt_tables import (
    cells,
    column_of_cells,
    columns,
    fewer,
    names,
    noise,
    rows,
    sigmas,
    text_file,
    units,
)
from support.fuzz.inside import data_of, write

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
