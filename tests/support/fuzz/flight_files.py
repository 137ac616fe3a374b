"""Ways to spoil the files of a flight: tables, sizes, pixels, and what is no file."""

from __future__ import annotations

import os
import random
import re
import shutil
import socket
import struct
from pathlib import Path

from support.fuzz import nasty


def is_here(path: Path) -> bool:
    """Tell whether a path leads through no link and to none."""
    return os.path.realpath(path) == os.fspath(path)


def data_of(path: Path) -> bytes:
    """Return what a regular file holds, nothing of anything else."""
    return path.read_bytes() if is_here(path) and path.is_file() else b""


def write(path: Path, data: bytes) -> None:
    """Write a regular file, or nothing where something else stands."""
    if is_here(path) and path.parent.is_dir() and (path.is_file() or not os.path.lexists(path)):
        path.write_bytes(data)


# --- ways to spoil the tables of a flight ------------------------------------------------------


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


# --- files that are small to send and large to read --------------------------------------------


LARGEST = 10_000_000

IMAGES, POINTS = "image,camera,exposure,strip,file\n", "image,point,col_px,row_px\n"
TRAJECTORY = "exposure,east_m,north_m,height_m,omega_deg,phi_deg,kappa_deg\n"
CONTROL = "point,east_m,north_m,height_m,role\n"

TABLES = (
    ("image_points.csv", POINTS, lambda i: "\n"),
    ("image_points.csv", POINTS, lambda i: "\na,b,1,1\n"),
    ("image_points.csv", POINTS, lambda i: "a\n"),
    ("image_points.csv", POINTS, lambda i: "a,b,1,1\n"),
    ("image_points.csv", POINTS, lambda i: f"E0_CAM,{i:x},1,1\n"),
    ("image_points.csv", POINTS, lambda i: f"E0_CAM,{i:x},-1,x\n"),
    ("image_points.csv", POINTS, lambda i: '"a","b","1","1"\n'),
    ("image_points.csv", POINTS, lambda i: '"\n","b",1,1\n'),
    ("image_points.csv", POINTS, lambda i: '"",'),
    ("image_points.csv", POINTS, lambda i: f"{i:0190d},{i:0190d},1,1\n"),
    ("image_points.csv", "image,point," + "".join(f"col_{i}," for i in range(900)), lambda i: "a,"),
    ("image_points.csv", "", lambda i: f"c{i},"),
    ("image_points.csv", POINTS, lambda i: "a,"),
    ("image_points.csv", POINTS, lambda i: "a"),
    ("image_points.csv", POINTS, lambda i: "a,b," + "9" * 90_000 + ",1\n"),
    ("image_points.csv", POINTS, lambda i: " "),
    ("images.csv", IMAGES, lambda i: f"i{i},CAM,E0,,a/{i}.tif\n"),
    ("images.csv", IMAGES, lambda i: f"i{i},CAM,E{i},{i},\n"),
    ("images.csv", IMAGES, lambda i: f"i{i},C{i},E{i},s,{'../' * 9}{i}\n"),
    ("images.csv", IMAGES, lambda i: f"=i{i},@{i},+{i}x,\t,\n"),
    ("trajectory.csv", TRAJECTORY, lambda i: f"E{i},669850.0,7187900.0,1900.0,0.3,-0.1,2.0\n"),
    ("trajectory.csv", TRAJECTORY, lambda i: f"E{i},1,1,1,1,1,1\n"),
    ("../control_points.csv", CONTROL, lambda i: f"G{i},669850.0,7187900.0,900,control\n"),
    ("../control_points.csv", CONTROL, lambda i: f"G{i},1,2,3,contro{i}\n"),
)
TOMLS = (
    *(lambda n, c=c: c * (n // len(c)) for c in (" ", "\n", "[", "a.", "{a=", '"', "'", "\\", "=")),
    *(
        lambda n, c=c: "x = [" + c * (n // len(c)) + "]"
        for c in ("1,", "{},", '"k1",', "[],", "1.5,")
    ),
    *(
        lambda n, c=c: "x = " + c * (n // len(c))
        for c in ("9", "{", "[", '"', "'''", '""" ""', "1.")
    ),
    lambda n: "".join(f"k{i} = 1\n" for i in range(n // 12)),
    lambda n: "".join(f"[cameras.c{i}]\n" for i in range(n // 18)),
    lambda n: "[[cameras]]\n" * (n // 12),
    lambda n: "".join(f"[a{i}.b.c]\n" for i in range(n // 14)),
    lambda n: "".join(f"a{i}.b.c.d.e = 1\n" for i in range(n // 20)),
    lambda n: "x = '" + "y" * n + "'\n",
    lambda n: "y" * n + " = 1\n",
    lambda n: " " * n + "x\n",
    lambda n: "x = 1" + " " * n + "1\n",
    lambda n: "[synthetic]\ncamera = 'CAM'\nheads = [" + "'CAM'," * (n // 6) + "]\n",
    lambda n: "[stages.mounting]\nestimate = [" + "'k1'," * (n // 5) + "]\n",
)


def large(folder: Path, rng: random.Random) -> None:
    """Let a file be large in one of many ways; the larger, the rarer."""
    size = min(int(30_000 * rng.paretovariate(0.6)), LARGEST)
    if rng.random() < 0.4:
        path = folder / "flight.toml"
        before = data_of(path) if rng.random() < 0.7 else b""
        write(path, before + rng.choice(TOMLS)(size).encode())
        return
    name, header, row = rng.choice(TABLES)
    block = rng.choice([p for p in sorted(folder.iterdir()) if p.is_dir()] or [folder])
    path, parts, length, i = Path(os.path.normpath(block / name)), [header], len(header), 0
    while length < size:
        parts.append(row(i))
        length += len(parts[-1])
        i += 1
    before = data_of(path) if rng.random() < 0.3 else b""
    write(path, before + "".join(parts).encode())


# --- spoilt TIFFs and geoid grids --------------------------------------------------------------


SIZES = (0, 1, 255, 65_535, 2**31 - 1, 2**32 - 1, 7, 100)


def _files(folder: Path, pattern: str) -> list[Path]:
    return [path for path in sorted(folder.glob(pattern)) if is_here(path) and path.is_file()]


def pictures(folder: Path, rng: random.Random) -> None:
    """Spoil one of the heads' pictures: bytes, length, or a field of its directory."""
    files = _files(folder, "heads/images/*.tif")
    if not files:
        return
    path = rng.choice(files)
    data = bytearray(path.read_bytes())
    how = rng.randrange(5)
    if how == 0:
        del data[rng.randint(0, len(data)) :]
    elif how == 1:
        for _ in range(rng.choice((1, 4, 100))):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif how == 2:
        data = bytearray(
            rng.choice((b"", b"\xff\xd8\xff", b"\x89PNG\r\n", b"II*\0", b"MM\0*\0\0\0\x08"))
        )
    else:
        for _ in range(how - 2):
            _change_directory(data, rng)
    path.write_bytes(bytes(data))


def _change_directory(data: bytearray, rng: random.Random) -> None:
    """Change one field of one entry of a TIFF's first directory; BigTIFF's a little blindly."""
    if len(data) < 16:
        return
    at = struct.unpack_from("<I", data, 4)[0] if data[2] == 42 else 16
    if at + 14 > len(data):
        return
    n = struct.unpack_from("<H", data, at)[0]
    entry = at + 2 + 12 * rng.randrange(max(min(n, 30), 1))
    field = entry + rng.choice((0, 2, 4, 8))
    if field + 4 <= len(data):
        value = rng.choice((*SIZES, at, len(data), rng.getrandbits(32), rng.randrange(300)))
        struct.pack_into("<I", data, field, value)


def geoid(folder: Path, rng: random.Random) -> None:
    """Spoil the geoid grid: header, values, length, or another format altogether."""
    path = folder / "geoid.gtx"
    if not is_here(path) or not path.is_file():
        return
    data = bytearray(path.read_bytes())
    if len(data) >= 40:
        rng.choice((_cut, _change_origin, _change_size, _change_bytes, _change_format))(data, rng)
    path.write_bytes(bytes(data))
    if rng.random() < 0.2:  # PROJ looks at the end of the name, too
        suffix = rng.choice((".tif", ".gsb", ".byn", ".bin", ".asc", ".gri", ""))
        path.rename(folder / f"geoid{suffix}")
        toml = folder / "flight.toml"
        write(toml, data_of(toml).replace(b"geoid.gtx", f"geoid{suffix}".encode()))


def _cut(data: bytearray, rng: random.Random) -> None:
    del data[rng.randint(0, len(data)) :]


def _change_origin(data: bytearray, rng: random.Random) -> None:
    numbers = (0.0, -1.0, 1e308, float("nan"), float("inf"), 1e-300, -27.0, 360.0)
    struct.pack_into(">d", data, 8 * rng.randrange(4), rng.choice(numbers))


def _change_size(data: bytearray, rng: random.Random) -> None:
    count = rng.choice((0, -1, 1, 2, 2**31 - 1, 46_341, 65_536, 1000))
    struct.pack_into(">i", data, 32 + 4 * rng.randrange(2), count)


def _change_bytes(data: bytearray, rng: random.Random) -> None:
    for _ in range(rng.choice((1, 20))):
        data[rng.randrange(len(data))] = rng.randrange(256)


def _change_format(data: bytearray, rng: random.Random) -> None:
    data[:] = rng.randbytes(3000)
    data[:8] = rng.choice((b"II*\0\x08\0\0\0", b"MM\0*\0\0\0\x08", b"NTv2    ", b"NUM_OREC"))


# --- what a folder may hold besides files and folders ------------------------------------------


NAMES = (
    *("flight.toml", "control_points.csv", "heads", "calibration", "validation", "geoid.gtx"),
    *("calibration/images.csv", "calibration/image_points.csv", "calibration/trajectory.csv"),
    *("heads/images", "heads/images/E0_LEFT.tif", "heads/images.csv", "validation/images.csv"),
    *("heads/control_points.csv", "calibration/control_points.csv"),
)


def _take_away(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as bound:
        here = os.open(path.parent, os.O_RDONLY)
        try:  # a path may be too long for a socket
            bound.bind(f"/proc/self/fd/{here}/{path.name}")
        finally:
            os.close(here)


def special(folder: Path, rng: random.Random) -> None:
    """Replace a file or a folder by something else, or by nothing."""
    path = folder / rng.choice(NAMES)
    if not path.parent.is_dir() or not is_here(path.parent):
        return
    if rng.random() < 0.1 and path.exists() and is_here(path):
        path.chmod(rng.choice((0o000, 0o111, 0o200)))
        return
    _take_away(path)
    make = rng.choice(
        (
            lambda: None,
            lambda: os.mkfifo(path),
            path.mkdir,
            lambda: path.write_bytes(b""),
            lambda: path.symlink_to(path.name),
            lambda: path.symlink_to("nowhere"),
            lambda: path.symlink_to("."),
            lambda: path.symlink_to(".."),
            lambda: path.symlink_to(
                rng.choice(("/dev/zero", "/dev/full", "/dev/null", "/dev/tty"))
            ),
            lambda: path.symlink_to(
                rng.choice(("/proc/self/mem", "/proc/self/environ", "/proc/sys"))
            ),
            lambda: path.symlink_to("/proc/kmsg"),
            lambda: _socket(path),
            (path.parent / "\udcff\n\x1b[31m").mkdir,
            (path.parent / "a\nb").mkdir,
        )
    )
    make()
    if rng.random() < 0.2:  # a folder of a misspelt block, with an odd name
        odd = Path(os.fsdecode(os.fsencode(folder) + b"/" + rng.choice((b"\xff", b"a\nb", b"H"))))
        odd.mkdir(exist_ok=True)
        (odd / "images.csv").write_bytes(b"")
