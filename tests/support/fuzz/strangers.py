"""Cases of imports and exports: `acx4 import KIND`, or `acx4 export`, with mutated sources."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import shutil
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from acx4book.notebooks import runner
from acx4files.results import own_folder
from acx4lib.errors import OutputError
from support.commands import complaint, said
from support.fuzz import nasty, sources

KINDS = tuple(sources.SOURCES)
PER = len(KINDS)
"""Cases for each of those that are asked for: one of every kind."""

OUTPUT = re.compile(r"(?s).+: .+")
"""What is said of a folder that cannot be written, or of results that were changed."""

write_good = sources.write_all


def warm(good: Path, work: Path) -> None:
    """Import all good ones, which must be accepted."""
    for kind in KINDS:
        status, out, err = _said(kind, good / kind, work, 0)
        assert status == 0, (kind, out, err)


def prepare(good: Path, work: Path, seed: int, case: int) -> tuple[tuple[str, Path], str]:
    """Write a mutated source; the same seed and case give the same one."""
    kind, rng = KINDS[case % PER], random.Random(f"{seed} {case}")
    folder = work / "source"
    shutil.rmtree(folder, ignore_errors=True)
    copy(good / kind, folder)
    name = sources.SOURCES[kind].source
    ways = spoil(folder / name if rng.random() < 0.5 else folder, rng)
    if kind == "export" and rng.random() < 0.7:
        _seal(folder / name)
    return (kind, folder), f"{kind} {ways}"


def _seal(results: Path) -> None:
    """Seal mutated results as if a run had left them so."""
    with (
        contextlib.suppress(OutputError, OSError),
        own_folder.claim(results, command=runner.COMMAND) as own,
    ):
        own.seal()


def run(target: tuple[str, Path], case: int) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    kind, folder = target
    status, out, err = _said(kind, folder, folder.parent, case // PER)
    wrong = complaint(status, out, err)
    if wrong and kind == "export" and status == 2 and all(map(OUTPUT.fullmatch, err.splitlines())):
        wrong = ""
    return ("refused" if status else "accepted"), wrong


def _said(kind: str, folder: Path, work: Path, case: int) -> tuple[int, str, str]:
    out = work / "out"
    shutil.rmtree(out, ignore_errors=True)
    of = sources.SOURCES[kind]
    options = [one.replace("{}", str(folder)) for one in of.options]
    if kind == "export":
        options += sources.export_options(case)
    begin = ["export"] if kind == "export" else ["import", of.kind or kind]
    return said(*begin, folder / of.source, "--out", out, *options)


# --- ways to spoil files of any format, each drawn from a random generator ---------------------


Spoil = Callable[[bytes, random.Random], bytes]

BOMB = (
    '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9))
    + "]>"
)
OUTSIDE = '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
VALUES: tuple[Any, ...] = (
    *(None, True, [], {}, [[]], "", "x", -1, 0, 1.5, 1e308, -1e308, 1e-320, 10**400, "1", [1, 2]),
    *([[1, 2, 3]] * 3, {"a": {"b": []}}, "=1+1", "\x1b[31m", "\ud800", 2**63, 0.1 + 1e9),
)
DOUBLES = (float("nan"), float("inf"), -1e308, 1e-320, 1e9, 0.0, -1.0, 500.0)
COUNTS = (2**63, 2**64 - 1, 2**32, 2**31, 10**6, 1, 0)


def bytes_(data: bytes, rng: random.Random) -> bytes:
    """Change, insert, remove or repeat bytes anywhere."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 50))):
        a = rng.randint(0, len(changed))
        b = min(len(changed), a + rng.choice((1, 1, 2, 8, 100, 5000)))
        junk = rng.choice((rng.randbytes(rng.randint(1, 8)), changed[a:b] * 2, b"", b"\n", b"\0"))
        changed[a:b] = junk
    return bytes(changed)


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randint(0, len(data))]


def numbers(data: bytes, rng: random.Random) -> bytes:
    """Put any numbers in the place of some."""
    places = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", data))
    for found in sorted(rng.sample(places, min(len(places), rng.choice((1, 1, 2, 9)))), key=_back):
        text = rng.choice((rng.choice(nasty.NUMBERS), nasty.integer_text(rng))).encode()
        data = data[: found.start()] + text + data[found.end() :]
    return data


def _back(found: re.Match[bytes]) -> int:
    return -found.start()


def names(data: bytes, rng: random.Random) -> bytes:
    """Put any text in the place of a word, everywhere or once."""
    words = list(set(re.findall(rb"[A-Za-z_][\w.-]*", data)))
    if not words:
        return data
    text = rng.choice((rng.choice(nasty.NAMES), nasty.any_text(rng)))
    new = text.encode("utf-8", errors="surrogatepass")
    return data.replace(rng.choice(words), new, rng.choice((1, -1)))


def lines(data: bytes, rng: random.Random) -> bytes:
    """Remove, repeat, exchange or cut lines."""
    rows = data.split(b"\n")
    i, j = sorted((rng.randrange(len(rows)), rng.randrange(len(rows))))
    j = min(j, i + rng.choice((1, 1, 3, 50)))
    return b"\n".join(
        rng.choice(
            (
                lambda: rows[:i] + rows[j + 1 :],
                lambda: rows[: j + 1] + rows[i:],
                lambda: rows[:i] + rows[i:j][::-1] + rows[j:],
                lambda: rows[::-1],
                lambda: [*rows[:i], rows[i][: len(rows[i]) // 2], *rows[i + 1 :]],
                lambda: [*rows[:i], rows[i] * 3, *rows[i + 1 :]],
                lambda: [*rows[:i], b" ".join(rows[i].split()[::-1]), *rows[i + 1 :]],
                lambda: rows[:i] + [b""] * 1000 + rows[i:],
            )
        )()
    )


def nested(data: bytes, rng: random.Random) -> bytes:
    """Nest deeply, at the beginning or anywhere."""
    many = rng.choice((50, 500, 100_000))
    mark = rng.choice((b"[", b'{"a":', b"<a>", b"((", b"[{"))
    at = rng.choice((0, rng.randint(0, len(data))))
    return data[:at] + mark * many + data[at:]


def entities(data: bytes, rng: random.Random) -> bytes:
    """Declare entities that grow, or that name other files, and use them."""
    text = rng.choice((BOMB, OUTSIDE)).encode()
    root = re.search(rb"<[A-Za-z]", data)
    at = root.start() if root else 0
    used = re.sub(rb">[^<]+<", b">&j;&a;<", data[at:], count=3)
    return text + used


def tags(data: bytes, rng: random.Random) -> bytes:
    """Remove an element or an attribute, or repeat it."""
    found = list(re.finditer(rb"<(\w+)[^<>]*>[^<>]*</\1>|<\w+[^<>]*/>|\s\w+=\"[^\"]*\"", data))
    if not found:
        return data
    one = rng.choice(found)
    inside = rng.choice((b"", one[0] * 2, one[0] * 1000, b"<![CDATA[" + one[0] + b"]]>"))
    return data[: one.start()] + inside + data[one.end() :]


def values(data: bytes, rng: random.Random) -> bytes:
    """Put any JSON in the place of a value, remove a key, or add one."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return bytes_(data, rng)
    for _ in range(rng.choice((1, 1, 2, 4))):
        node, key = _place(tree, rng)
        if node is None:
            continue
        if isinstance(node, dict) and rng.random() < 0.3:
            del node[key]
        elif isinstance(node, dict) and rng.random() < 0.2:
            node[rng.choice(nasty.NAMES)] = node[key]
        else:
            node[key] = rng.choice(VALUES)
    return json.dumps(tree).encode("utf-8", errors="surrogatepass")


def _place(tree: Any, rng: random.Random) -> tuple[Any, Any]:
    """Return a random object or list in a tree, and a key in it."""
    node, key = None, None
    below = tree
    while isinstance(below, dict | list) and below:
        keys = list(below) if isinstance(below, dict) else range(len(below))
        node, key = below, rng.choice(keys)
        below = node[key]
        if rng.random() < 0.15:
            break
    return node, key


def binary(data: bytes, rng: random.Random) -> bytes:
    """Put any number, or any count, in the place of eight bytes."""
    if len(data) < 8:
        return data
    at = rng.choice((rng.randrange(0, len(data) - 7), rng.randrange(0, len(data) - 7, 8)))
    new = rng.choice(
        (struct.pack("<d", rng.choice(DOUBLES)), struct.pack("<Q", rng.choice(COUNTS)))
    )
    return data[:at] + new + data[at + 8 :]


def encodings(data: bytes, rng: random.Random) -> bytes:
    text = data.decode("utf-8", errors="replace")
    code = rng.choice(("utf-16", "utf-32", "latin-1", "utf-8-sig", "utf-7", "cp037"))
    ends = rng.choice(("\n", "\r\n", "\r", "\x85", "\u2028", "\x0b"))
    return text.replace("\n", ends).encode(code, errors="replace")


def large(data: bytes, rng: random.Random) -> bytes:
    """Repeat a part until a file is large."""
    size = rng.choice((100_000, 1_000_000, 4_000_000))
    a = rng.randint(0, len(data))
    part = rng.choice((data, data[a : a + 40], b" ", b"\n", b"9", b"<a/>", b"[],", b"1 ")) or b"x"
    return data[:a] + part * (size // len(part)) + data[a:]


def archive(data: bytes, rng: random.Random) -> bytes:
    """Pack it, or something that grows."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as into:
        name = rng.choice(("doc.xml", "../doc.xml", "/etc/x", "chunk.xml", "a" * 300))
        into.writestr(name, rng.choice((data, b"\0" * 3_000_000, b" " * 3_000_000)))
    return packed.getvalue() if rng.random() < 0.7 else bytes_(packed.getvalue(), rng)


SPOILS: dict[str, Spoil] = {
    "bytes": bytes_,
    "cut": cut,
    "numbers": numbers,
    "names": names,
    "lines": lines,
    "nested": nested,
    "entities": entities,
    "tags": tags,
    "values": values,
    "binary": binary,
    "encodings": encodings,
    "large": large,
    "archive": archive,
}
WEIGHTS = {"numbers": 3.0, "values": 2.0, "tags": 2.0, "large": 0.15, "nested": 0.5, "archive": 0.5}


def spoil(source: Path, rng: random.Random) -> str:
    """Mutate a file, or files of a folder, in place; return in which ways."""
    kinds = []
    for _ in range(rng.choice((1, 1, 1, 2))):
        files = sorted(path for path in [source, *source.glob("**/*")] if _is_plain(path))
        if not files:
            break
        path = rng.choice(files)
        if rng.random() < 0.06:
            kinds.append("special")
            _special(path, files, rng)
            continue
        kind = rng.choices(list(SPOILS), [WEIGHTS.get(k, 1.0) for k in SPOILS])[0]
        kinds.append(kind)
        path.write_bytes(SPOILS[kind](path.read_bytes(), rng))
    return "+".join(kinds)


def _is_plain(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _special(path: Path, files: list[Path], rng: random.Random) -> None:
    """Replace a file by something else, by another, or by nothing."""
    other = rng.choice(files).read_bytes()
    path.unlink()
    rng.choice(
        (
            lambda: None,
            path.mkdir,
            lambda: path.write_bytes(b""),
            lambda: path.write_bytes(other),
            lambda: os.mkfifo(path),
            lambda: path.symlink_to(path.name),
            lambda: path.symlink_to("nowhere"),
            lambda: path.symlink_to(rng.choice(("/dev/zero", "/dev/null", "/proc/self/mem"))),
            lambda: path.symlink_to("/etc/passwd"),
        )
    )()


def copy(good: Path, to: Path) -> None:
    """Copy a file or a folder."""
    if good.is_dir():
        shutil.copytree(good, to)
    else:
        shutil.copyfile(good, to)
