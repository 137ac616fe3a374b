"""Ways to spoil the tables of a flight."""

from __future__ import annotations

import random
import re
from pathlib import Path

from support.fuzz import nasty
from support.fuzz.inside import data_of, is_here, write

FACTORS = (1000.0, 0.001, 0.3048, 57.29577951308232, 0.017453292519943295, -1.0, 1e10, 0.0, 1.0001)


def tables(folder: Path) -> list[Path]:
    found = [*sorted(folder.glob("*.csv")), *sorted(folder.glob("*/*.csv"))]
    return [path for path in found if is_here(path) and path.is_file()]


def table(folder: Path, rng: random.Random) -> Path:
    return rng.choice(tables(folder) or [folder / "control_points.csv"])


def text_file(folder: Path, rng: random.Random) -> Path:
    return rng.choice([folder / "flight.toml", *tables(folder)])


def rows_of(path: Path) -> list[list[str]]:
    text = data_of(path).decode("utf-8", errors="replace")
    return [line.split(",") for line in text.split("\n")]


def write_rows(path: Path, rows: list[list[str]]) -> None:
    write(path, "\n".join(map(",".join, rows)).encode("utf-8", errors="surrogatepass"))


def cells(folder: Path, rng: random.Random) -> None:
    path = table(folder, rng)
    rows = rows_of(path)
    for _ in range(rng.choice((1, 1, 1, 3, 30))):
        row = rng.choice(rows)
        value = nasty.cell(rng)
        quoted = '"' + value.replace('"', '""') + '"'
        row[rng.randrange(len(row))] = rng.choice((value, quoted))
    write_rows(path, rows)


def column_of_cells(folder: Path, rng: random.Random) -> None:
    """Put the same value, or any, in all cells of a column."""
    path = table(folder, rng)
    rows = rows_of(path)
    column, value, many = rng.randrange(len(rows[0])), nasty.cell(rng), rng.random() < 0.5
    value = value.replace("\n", " ").replace(",", " ")
    for row in rows[1:]:
        if column < len(row) > 1:
            row[column] = value if many else nasty.integer_text(rng)
    write_rows(path, rows)


def rows(folder: Path, rng: random.Random) -> None:
    path = table(folder, rng)
    header, *below = rows_of(path)
    i, j = rng.randint(0, len(below)), rng.randint(0, len(below))
    some = below[min(i, j) : max(i, j)]
    below = rng.choice(
        (
            lambda: [row for row in below if row not in some],
            lambda: below + some,
            lambda: below[::-1],
            lambda: rng.sample(below, len(below)),
            lambda: below[:i] + [[""]] * rng.choice((1, 3, 1000)) + below[i:],
            lambda: below + [[""] * len(header)] * rng.choice((1, 1000)),
            lambda: [*below[:i], header, *below[i:]],
            lambda: [row[: rng.randint(0, len(row))] for row in below],
            lambda: [[*row, "x"] for row in below],
            lambda: below * 3,
            list,
            lambda: below[:1],
        )
    )()
    write_rows(path, [header, *below] if rng.random() < 0.95 else below)


def columns(folder: Path, rng: random.Random) -> None:
    path = table(folder, rng)
    all_rows = rows_of(path)
    width = len(all_rows[0])
    i, j = rng.randrange(width), rng.randrange(width)
    change = rng.choice((_remove, _exchange, _repeat, _rename, _exchange_names, _add, _add_many))
    for n, row in enumerate(all_rows):
        if len(row) == width:
            change(row, (i, j), n, rng)
    write_rows(path, all_rows)


def _remove(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    del row[at[0]]


def _exchange(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    i, j = at
    row[i], row[j] = row[j], row[i]


def _repeat(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    row.insert(at[1], row[at[0]])


def _rename(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    name = row[at[0]]
    if n == 0:
        row[at[0]] = rng.choice((name.upper(), f" {name} ", name[:-1], nasty.cell(rng)))


def _exchange_names(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    if n == 0:
        _exchange(row, at, n, rng)


def _add(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    known = ("sigma_px", "role", "time_s", "sigma_east_m", "sigma_roll_deg", "file", "strip")
    row.append(rng.choice(known) if n == 0 else nasty.cell(rng).replace("\n", ""))


def _add_many(row: list[str], at: tuple[int, int], n: int, rng: random.Random) -> None:
    row.extend(f"c{k}" for k in range(100))


def units(folder: Path, rng: random.Random) -> None:
    """Write a column, or some, in another unit, with another sign or from another origin."""
    path = table(folder, rng)
    all_rows = rows_of(path)
    numeric = [k for k, name in enumerate(all_rows[0]) if re.search(r"_(m|deg|px|s)$", name)]
    chosen = rng.sample(numeric, min(len(numeric), rng.choice((1, 2, 3, 9))))
    factor = rng.choice(FACTORS)
    offset = rng.choice((0.0, 0.0, 0.0, 90.0, 180.0, 500_000.0, -1e7))
    for row in all_rows[1:]:
        for k in chosen:
            try:
                row[k] = repr(float(row[k]) * factor + offset)
            except (ValueError, IndexError):
                continue
    write_rows(path, all_rows)


def noise(folder: Path, rng: random.Random) -> None:
    """Add errors of any size to some numbers, as a bad day in the field would."""
    path = table(folder, rng)
    all_rows = rows_of(path)
    numeric = [k for k, name in enumerate(all_rows[0]) if re.search(r"_(m|deg|px)$", name)]
    size, share = 10 ** rng.uniform(-6, 4), rng.choice((0.02, 0.3, 1.0))
    for row in all_rows[1:]:
        if numeric and rng.random() < share:
            k = rng.choice(numeric)
            try:
                row[k] = repr(float(row[k]) + rng.gauss(0, size))
            except (ValueError, IndexError):
                continue
    write_rows(path, all_rows)


def fewer(folder: Path, rng: random.Random) -> None:
    """Leave out measurements, control points or images until little is determined."""
    points = [path for path in tables(folder) if path.name == "image_points.csv"]
    path = rng.choice(points or [table(folder, rng)])
    header, *below = rows_of(path)
    column = rng.choice((0, 1))
    present = sorted({row[column] for row in below if len(row) == len(header) > 1})
    kept = set(rng.sample(present, min(len(present), rng.choice((0, 1, 2, 3, 4, 8)))))
    share = rng.choice((0.0, 0.0, 0.1, 0.5))
    below = [
        row
        for row in below
        if (row[column : column + 1] and row[column] in kept) or rng.random() < share
    ]
    write_rows(path, [header, *below, [""]])


def sigmas(folder: Path, rng: random.Random) -> None:
    """State standard deviations that are allowed, and absurd."""
    known = {
        "image_points.csv": ("sigma_px",),
        "trajectory.csv": tuple(
            f"sigma_{x}" for x in ("east_m", "height_m", "roll_deg", "heading_deg")
        ),
        "control_points.csv": ("sigma_east_m", "sigma_north_m", "sigma_height_m", "role"),
    }
    path = table(folder, rng)
    column = rng.choice(known.get(path.name, ("strip",)))
    header, *below = rows_of(path)
    if column in header:
        return
    values = ("1e-9", "1e6", "0", "1", "1e-4", "0.01", "100")
    many, value = rng.random() < 0.5, rng.choice(values)
    for row in below:
        if len(row) == len(header):
            row.append(value if many else rng.choice(values))
            if column in ("role", "strip"):
                row[-1] = rng.choice(("control", "check", ""))
    write_rows(path, [[*header, column], *below])


def names(folder: Path, rng: random.Random) -> None:
    """Rename something in all files."""
    path = table(folder, rng)
    known = [row[0] for row in rows_of(path)[1:] if row[0]] + ["CAM", "LEFT", "small"]
    old, new = rng.choice(known), rng.choice((rng.choice(nasty.NAMES), nasty.any_text(rng)))
    for other in [folder / "flight.toml", *tables(folder)]:
        text = data_of(other).decode("utf-8", errors="replace")
        if other.suffix == ".toml":
            escaped = re.sub(r'["\\\x00-\x1f\x7f]', lambda m: f"\\u{ord(m[0]):04x}", new)
            text = text.replace(f".{old}]", f'."{escaped}"]').replace(f'"{old}"', f'"{escaped}"')
        else:
            cell = '"' + new.replace('"', '""').replace("\\", "\\\\") + '"'
            text = re.sub(rf"(?m)(^|,){re.escape(old)}(?=,|$)", rf"\g<1>{cell}", text)
        write(other, text.encode("utf-8", errors="surrogatepass"))
