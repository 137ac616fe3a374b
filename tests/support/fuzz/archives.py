"""Cases of archives: `acx4 import metashape` of a project whose ZIP files are mutated."""

from __future__ import annotations

import contextlib
import io
import random
import shutil
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

from support.commands import complaint, said
from support.fuzz import nasty
from support.fuzz.strangers import SPOILS
from support.fuzz.strangers import spoil as spoil_file
from support.projects import metashape

PER = 1
"""Cases for each of those that are asked for."""

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
DOCUMENT = "doc.xml"
LOCAL, CENTRAL, END = b"PK\3\4", b"PK\1\2", b"PK\5\6"
FIELDS = {
    LOCAL: ("HHHHHIIIHH", 4),
    CENTRAL: ("HHHHHHIIIHHHHHII", 4),
    END: ("HHHHIIH", 4),
}
"""What stands after each mark of an archive."""

NUMBERS = (0, 1, 8, 12, 14, 99, 255, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 1000, 10**8)

Change = Callable[[bytes, random.Random], bytes]


def write_good(good: Path) -> None:
    """Write a project."""
    (good / "project").mkdir()
    metashape.write_project(good / "project")


def warm(good: Path, work: Path) -> None:
    """Import the good one, and its chunk alone."""
    for source in ("p.psx", "p.files/0/chunk.zip"):
        status, out, err = _said(good / "project" / source, work)
        assert status == 0, (out, err)


def prepare(good: Path, work: Path, seed: int, case: int) -> tuple[Path, str]:
    """Write a project with a mutated archive; the same seed and case give the same one."""
    rng = random.Random(f"{seed} {case}")
    folder = work / "project"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(good / "project", folder)
    ways = []
    for _ in range(rng.choice((1, 1, 1, 2))):
        path = rng.choice(sorted(folder.glob("**/*.zip")))
        if path.is_symlink() or not path.is_file():
            continue
        way = rng.choices(list(CHANGES), [WEIGHTS.get(name, 1.0) for name in CHANGES])[0]
        ways.append(way)
        if way == "files":
            spoil_file(path.parent, rng)
        else:
            with contextlib.suppress(MemoryError):  # packing has the limits of the case
                path.write_bytes(CHANGES[way](path.read_bytes(), rng))
    source = "p.files/0/chunk.zip" if rng.random() < 0.25 else "p.psx"
    return folder / source, "+".join(ways) or "none"


def run(source: Path, case: int) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    work = source.parents[3] if source.name == "chunk.zip" else source.parents[1]
    status, out, err = _said(source, work)
    return ("refused" if status else "accepted"), complaint(status, out, err)


def _said(source: Path, work: Path) -> tuple[int, str, str]:
    out = work / "out"
    shutil.rmtree(out, ignore_errors=True)
    return said("import", "metashape", source, "--out", out)


# --- what is done to an archive --------------------------------------------------------------


def inside(data: bytes, rng: random.Random) -> bytes:
    """Mutate a member, and pack it again, so that its checksum is right."""
    text = _document(data)
    kinds = [kind for kind in SPOILS if kind not in {"archive", "binary"}]
    for _ in range(rng.choice((1, 1, 2))):
        text = SPOILS[rng.choice(kinds)](text, rng)
    return _packed([(DOCUMENT, text)], rng)


def headers(data: bytes, rng: random.Random) -> bytes:
    """Put any number in the place of one in a header: sizes, checksums, offsets, methods, flags."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        mark = rng.choice(list(FIELDS))
        at = changed.find(mark)
        if at < 0:
            continue
        form, begin = FIELDS[mark]
        k = rng.randrange(len(form))
        place = at + begin + struct.calcsize(f"<{form[:k]}")
        size = struct.calcsize(f"<{form[k]}")
        old = int.from_bytes(changed[place : place + size], "little")
        new = rng.choice((*NUMBERS, old + 1, max(old - 1, 0), old * 2, old // 2, old * 1000))
        changed[place : place + size] = (new % 2 ** (8 * size)).to_bytes(size, "little")
    return bytes(changed)


def members(data: bytes, rng: random.Random) -> bytes:
    """Pack other members beside the document, or others alone."""
    text, n = _document(data), rng.choice((0, 1, 2, 50, 20_000))
    names = (DOCUMENT, "../doc.xml", "/doc.xml", "DOC.XML", "doc.xml/", *nasty.NAMES)
    others = [(rng.choice(names) or "x", rng.choice((b"", text, b"<chunk/>"))) for _ in range(n)]
    if n > 100:
        others = [(f"{k}", b"") for k in range(n)]
    own = [(DOCUMENT, text)] if rng.random() < 0.7 else []
    return _packed([*own, *others] if rng.random() < 0.5 else [*others, *own], rng)


def swelling(data: bytes, rng: random.Random) -> bytes:
    """Pack what is much larger than the archive."""
    text = _document(data)
    size = rng.choice((1_000_000, 20_000_000, 60_000_000))
    part = rng.choice((b" ", b"\0", b"<a/>", b"<a>", b"\n", b"9", b'<camera id="0"/>', text))
    filled = part * (size // len(part))
    at = rng.choice((0, len(text), text.find(b">") + 1))
    return _packed([(DOCUMENT, text[:at] + filled + text[at:])], rng)


def parts(data: bytes, rng: random.Random) -> bytes:
    """Name chunks, or frames, more than once, or elsewhere."""
    text = _document(data)
    begin = max(text.find(b'<chunk id="0"'), text.find(b'<frame id="0"'))
    end = text.find(b"/>", begin) + 2
    if begin < 0 or end < 2:
        return inside(data, rng)
    one = text[begin:end]
    path = rng.choice((b"../project.zip", b"0/chunk.zip", b"/dev/zero", b"", b"a" * 5000, b"0"))
    own = one.split(b'path="')[-1].split(b'"')[0]
    new = one.replace(b'"' + own + b'"', b'"' + path + b'"')
    many = rng.choice((one * 2, one * 30, one * 300, new, one + new, b""))
    return _packed([(DOCUMENT, text[:begin] + many + text[end:])], rng)


def _document(data: bytes) -> bytes:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return archive.read(DOCUMENT)
    except Exception:  # what was mutated before
        return b"<document/>"


def _packed(members_: list[tuple[str, bytes]], rng: random.Random) -> bytes:
    out, method = io.BytesIO(), rng.choice((*METHODS, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED))
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", method) as archive:
        warnings.simplefilter("ignore")  # a name that stands twice
        for name, text in members_:
            archive.writestr(name, text)
    return out.getvalue()


CHANGES: dict[str, Change] = {
    "inside": inside,
    "headers": headers,
    "members": members,
    "swelling": swelling,
    "parts": parts,
    "bytes": SPOILS["bytes"],
    "cut": SPOILS["cut"],
    "files": lambda data, _: data,
}
WEIGHTS = {"inside": 3.0, "headers": 4.0, "swelling": 0.2, "bytes": 2.0, "members": 0.6}
