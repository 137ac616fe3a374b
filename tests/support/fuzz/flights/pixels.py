"""Spoilt TIFFs and geoid grids."""

from __future__ import annotations

import random
import struct
from pathlib import Path

from support.fuzz.inside import data_of, is_here, write

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
