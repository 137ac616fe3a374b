"""Many mutated flights, and how `acx4 check` answered them: read, or refused by lines with a place.

`python -m support.fuzz.run --cases N --seed SEED`.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import struct
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd

import acx4sim
from acx4sim.files import truth_path
from support.commands import complaint, said
from support.flights import in_heads
from support.flights.written import write_flight

CELLS = (
    *("nan", "inf", "-inf", "1e308", "1e400", "1e-400", "0", "-0.0", "0x10", "1_000", "1,5", "1."),
    *("--1", "1e", "٣", "9" * 6000, "-1", "1e9", "91", "361", "true", "#N/A", "1 000", "½", "1d5"),
    *("", " ", "\t", "=1+1", "@SUM(A1)", "+", "a;=1", "x" * 201, "a\nb", "a\rb", "a\x1b[31mb"),
    *("a\u2028b", "a\u202eb", "\ufeff", "a\x00b", "e\u0301", "日本語", "<b>", "a,b", 'a"b', '"'),
    *("'", "\\", "../x", "..", "/etc/passwd", "NULL", "None", "E0", "G1", "CAM", "E0_CAM", "check"),
)
VALUES = (
    *("[" * 2000, "{a=" * 100, "[[]]", "{}", "[1, 'a', [2]]", "1979-05-27", "07:32", "0o7", "inf"),
    *("-nan", "+1", "1__0", "''", "'''a\nb'''", '"\\u202e"', '"\\ud800"', '"\\q"', "true", "x", ""),
    *("0x" + "f" * 9000, "9" * 5000, '"EPSG:4326"', '"EPSG:2263"', '"local"', '"+proj=utm"'),
    *('"PROJCS["', '"EPSG:31982+5773"', '"EPSG:5773"', '"../geoid.gtx"', '"geoid.gtx"', '"lever"'),
    *('["k1", "k1"]', '["delay"]', '["drift"]', '["lever_arm", "boresight"]', '"heads"', "1e9"),
)
FACTORS = (1000.0, 0.001, 0.3048, 57.29577951308232, 0.017453292519943295, -1.0, 1e10, 0.0, 1.0001)


# --- the flights that are mutated: small, good, of both forms of trajectory ---------------------


def write_good(folder: Path) -> list[Path]:
    """Write the flights, and return their folders."""
    flat = write_flight(folder / "flat", blocks=("heads", "calibration", "validation"))
    above = write_flight(folder / "geoid", form="geographic")
    header = struct.pack(">4d2i", -27.0, -51.0, 1.0, 1.0, 4, 4)
    (above / "geoid.gtx").write_bytes(header + np.full(16, 3.0, dtype=">f4").tobytes())
    path = above / "flight.toml"
    path.write_text(path.read_text().replace('"ellipsoidal"', '"geoid.gtx"'))
    simulated = folder / "simulated"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1, options=acx4sim.Options()), simulated)
    truth_path(simulated).unlink()
    points = pd.read_csv(simulated / "calibration/image_points.csv")
    control = set(pd.read_csv(simulated / "control_points.csv")["point"])
    kept = control | set(sorted({*points["point"]} - control)[::5])  # for speed
    points[points["point"].isin(kept)].to_csv(
        simulated / "calibration/image_points.csv", index=False
    )
    return [flat, above, simulated, in_heads.write(folder / "in_heads")]


# --- ways to spoil a file of text ---------------------------------------------------------------


def _bytes(data: bytes, rng: random.Random) -> bytes:
    """Change, insert, remove or repeat bytes, or cut the end off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 50))):
        a = rng.randint(0, len(out))
        b = min(len(out), a + rng.choice((1, 2, 8, 100, 5000)))
        junk = (rng.randbytes(rng.randint(1, 8)), out[a:b] * 2, b"", b"\n", b'"', b"\0")
        out[a:b] = rng.choice(junk)
    return bytes(out) if rng.random() < 0.7 else data[: rng.randint(0, len(data))]


def _encoding(data: bytes, rng: random.Random) -> bytes:
    text = data.decode("utf-8").replace("a", rng.choice("äa日"), 1)
    ends = rng.choice(("\n", "\r\n", "\r", "\n\r", "\x85", "\u2028", "\x0b", "\r\r\n"))
    coding = rng.choice(("utf-16", "utf-16-le", "utf-32", "latin-1", "utf-8-sig", "utf-7", "cp037"))
    return text.replace("\n", ends).encode(coding, errors="replace")


def _cells(rows: list[list[str]], rng: random.Random) -> None:
    for _ in range(rng.choice((1, 1, 3, 30))):
        row, cell = rng.choice(rows), rng.choice(CELLS)
        row[rng.randrange(len(row))] = rng.choice((cell, '"' + cell.replace('"', '""') + '"'))


def _rows(rows: list[list[str]], rng: random.Random) -> None:
    header, *below = rows
    i, j = sorted((rng.randint(0, len(below)), rng.randint(0, len(below))))
    ways = (
        lambda: below[:i] + below[j:],
        lambda: below + below[i:j],
        lambda: below[::-1],
        lambda: below[:i] + [[""]] * rng.choice((1, 1000)) + below[i:],
        lambda: below + [[""] * len(header)] * 3,
        lambda: [*below[:i], header, *below[i:]],
        lambda: [row[: rng.randint(0, len(row))] for row in below],
        lambda: [[*row, "x"] for row in below],
        lambda: below[:1],
        list,
    )
    rows[1:] = rng.choice(ways)()


def _columns(rows: list[list[str]], rng: random.Random) -> None:
    """Remove, repeat, exchange or rename columns, or give one of them a single value."""
    i, j, how = rng.randrange(len(rows[0])), rng.randrange(len(rows[0])), rng.randrange(6)
    value, known = rng.choice(CELLS).replace("\n", ""), ("sigma_px", "role", "time_s", "file")
    for n, row in enumerate(rows):
        if len(row) != len(rows[0]) - (n > 0 and how == 0) + (n > 0 and how in (1, 5)):
            continue
        if how == 0:
            del row[i]
        elif how == 1:
            row.insert(j, row[i])
        elif how == 2 or (how == 3 and n == 0):
            row[i], row[j] = row[j], row[i]
        elif how == 4:
            row[i] = value if n else row[i]
        elif how == 5:
            row.append(value if n else rng.choice(known))


def _units(rows: list[list[str]], rng: random.Random) -> None:
    """Write columns in another unit, with another sign or origin, or with errors of any size."""
    numeric = [k for k, name in enumerate(rows[0]) if re.search(r"_(m|deg|px|s)$", name)]
    chosen = rng.sample(numeric, min(len(numeric), rng.choice((1, 2, 3, 9))))
    factor, offset = rng.choice(FACTORS), rng.choice((0.0, 0.0, 90.0, 180.0, 500_000.0))
    size = 10 ** rng.uniform(-6, 4) * (rng.random() < 0.3)
    for row in rows[1:]:
        for k in (k for k in chosen if k < len(row) and re.fullmatch(r"-?[\d.]+(e-?\d+)?", row[k])):
            row[k] = repr(float(row[k]) * factor + offset + rng.gauss(0, size))


def _settings(data: bytes, rng: random.Random) -> bytes:
    """Change, remove or repeat lines of flight.toml, or add keys."""
    lines = data.decode("utf-8").split("\n")
    i, value = rng.randrange(len(lines)), rng.choice(VALUES)
    key = lines[i].partition(" =")[0] or "crs"
    more = ("[stages.mounting]", "[apriori]", "[synthetic]", "[certificate]", "[session]", "[x]")
    keys = ("gnss", "fix", "estimate", "weights", "heading_deg", "gnss_correlation_s", "heads")
    lines[i : i + 1] = rng.choice(
        (
            [f"{key} = {value}"],
            [],
            [lines[i], lines[i]],
            [lines[i][: rng.randint(0, len(lines[i]))]],
            [value],
        )
    )
    if rng.random() < 0.4:
        lines += [rng.choice(more), f"{rng.choice(keys)} = {rng.choice(VALUES)}"]
    return "\n".join(lines).encode("utf-8", errors="surrogatepass")


def spoil(folder: Path, rng: random.Random) -> str:
    """Mutate a flight in place, once or more, and return in which ways."""
    kinds = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        tables = [*sorted(folder.glob("*.csv")), *sorted(folder.glob("*/*.csv"))]
        toml = folder / "flight.toml"
        way = rng.choice((_bytes, _encoding, _cells, _cells, _rows, _columns, _units, _settings))
        path = toml if way is _settings else rng.choice(tables)
        if way in (_bytes, _encoding) and rng.random() < 0.3:
            path = toml
        data = path.read_bytes()
        if way in (_cells, _rows, _columns, _units):
            rows = [line.split(",") for line in data.decode("utf-8", "replace").split("\n")]
            way(rows, rng)
            text = "\n".join(map(",".join, rows))
            path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
        else:
            try:
                path.write_bytes(way(data, rng))
            except UnicodeDecodeError:  # spoilt before
                continue
        if rng.random() < 0.03:
            data, other = path.read_bytes(), rng.choice(tables)
            path.unlink()
            other.write_bytes(data) if rng.random() < 0.5 else None
            kinds.append("files")
            break
        kinds.append(way.__name__)
    return "+".join(kinds)


def run(work: Path, *, cases: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Check mutated flights; return how many ended in which way, and what must not be.

    Parameters
    ----------
    work : Path
        An empty folder.
    cases, seed : int
        The same seed and case give the same flight.
    """
    good, outcomes, findings = write_good(work / "good"), Counter(), []
    for case in range(cases):
        rng = random.Random(f"{seed} {case}")
        shutil.rmtree(work / "flight", ignore_errors=True)
        folder = shutil.copytree(rng.choice(good), work / "flight")
        kinds = spoil(folder, rng)
        try:
            status, out, err = said("check", folder)
            wrong = complaint(status, out, err)
        except Exception:
            status, wrong = -1, traceback.format_exc()
        outcomes["refused" if status else "accepted"] += 1
        if wrong:
            findings.append(f"seed {seed}, case {case} ({kinds}): {wrong}")
    return outcomes, findings


def main() -> None:
    """Run, print and fail where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        outcomes, findings = run(Path(work).resolve(), cases=given.cases, seed=given.seed)
    print(*findings, dict(outcomes), sep="\n")  # noqa: T201 a command
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
