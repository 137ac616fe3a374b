"""Values that break readers, writers or terminals."""

from __future__ import annotations

import random

NUMBERS = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e400", "1e-400", "0", "-0", "-0.0", "1e-320"),
    *("0x10", "0b1", "1_000", "1,5", "1.", ".5", "+3.5", "-12", "--1", "1e", "e5", "1e5.5", "٣"),
    *("9" * 30, "9" * 400, "9" * 6000, "0." + "0" * 5000 + "1", "1e" + "9" * 30, "1d5", "½", "²"),
    *("-1", "1e6", "1e9", "-1e9", "99999999", "181", "91", "361", "0.0001", "true", "1/0", "#N/A"),
    *("2147483648", "-2147483649", "9223372036854775808", "1e-9", "1 000"),
    *("\u00a01", "\uff11\uff12"),
)
NAMES = (
    *("", " ", "\t", "=1+1", "+cmd|' /C calc'!A0", "-1+1", "@SUM(A1)", "=", "-", "+"),
    *("-12", "+3.5"),
    *("\uff1d1+1", " =1+1", "\t=1", "\r=1", ";=1", "a;=1", "x" * 199, "x" * 201, "x" * 5000),
    *("a\nb", "a\rb", "a\x1b[31mb", "a\x07", "a\x7f", "a\x85b", "a\u2028b", "a\u2029b", "a\u202eb"),
    *(
        "a\u2066b",
        "a\ufeffb",
        "\u200b",
        "a\ufffe",
        "a\x00b",
        "é",
        "e\u0301",
        "日本語",
        "🛩",
        "ﷺ" * 100,
    ),
    *("$x$", "{{ x }}", "<b>", "`a`", "|", "a,b", 'a"b', '"', "'", "\\", "/", "../x", ".."),
    *(".", "~"),
    *("%s", "%(a)s", "{0}", "{", "}", "NULL", "nan", "None", "true", "con", "a/b", "-rf", "--help"),
)
CRS = (
    *("EPSG:4326", "EPSG:31982", "EPSG:31981", "EPSG:2193", "EPSG:27572", "EPSG:2263", "EPSG:0"),
    *("EPSG:" + "9" * 400, "EPSG:31982+5773", "epsg:31982", "31982", "IAU_2015:30110", "EPSG:3857"),
    *("file:/etc/passwd", "/etc/passwd", "flight.toml", "http://localhost/", "@flight.toml", "+"),
    "+proj=utm +zone=22 +south +nadgrids=/etc/passwd",
    "+proj=utm +zone=22 +geoidgrids=geoid.gtx",
    *("+init=file:flight.toml", "+init=epsg:31982", "+proj=utm +zone=22 +south +ellps=GRS80"),
    *("+proj=pipeline +step +proj=utm +zone=22", "+proj=utm"),
    *("+proj=utm +zone=1e400", "+proj=merc"),
    *("+proj=tmerc +lat_0=1e308 +a=1e308 +b=1", "+proj=tmerc +a=0 +b=0", "+proj=ob_tran +R=1"),
    *(
        "+proj=utm +zone=22 +a=nan",
        "PROJCS[",
        "PROJCRS[" * 50,
        "PROJCS[]",
        '{"proj": "utm"}',
        "WGS 84",
    ),
    'PROJCS["x",GEOGCS["y",DATUM["z",SPHEROID["w",0,0]],PRIMEM["g",0],UNIT["d",0]],PROJECTION["t"]]',
    'BOUNDCRS[SOURCECRS[PROJCRS["a"]],ABRIDGEDTRANSFORMATION["b",PARAMETERFILE["c","/etc/passwd"]]]',
    *("+proj=lcc +lat_1=90 +lat_2=-90", "+proj=stere +lat_0=90 +k=0", "+proj=aeqd +R=1e-300"),
)
HEIGHTS = (
    *("ellipsoidal", "EPSG:5773", "EPSG:3855", "EPSG:4979", "geoid.gtx"),
    *("flight.toml", "/dev/zero"),
    *("geoid.gtx,flight.toml", "../geoid.gtx", ".", "", "@geoid.gtx", "/etc/passwd"),
    *("heads", "EPSG"),
    *('geoid.gtx" +step +proj=utm +zone=1', "geoid.gtx\n", "EGM96 height", "VERTCRS[", "x" * 5000),
)
TOML = (
    *("[" * 2000, "[" * 30 + "]" * 30, "{a=" * 2000, "a." * 2000 + "b", '"""' + "x" * 5000),
    *("[[cameras]]", "[cameras]", "[]", "[[]]", "{}", "[{}]", "[1, 'a', [2]]"),
    *("1979-05-27", "07:32"),
    *(
        "1979-05-27T07:32:00-08:00",
        "0x" + "f" * 3000,
        "0o7",
        "0b1",
        "inf",
        "-nan",
        "+1",
        "1__0",
        "''",
    ),
    *("'''a\nb'''", '"\\u202e"', '"\\ud800"', '"\\U0010ffff"', '"\\n"', '"\\u0000"'),
    *('"\\q"', "true"),
    *("# x", "= 1", "x", '"a" "b"', "[a]]", "x = 1 y = 2", "\x00", "\x1b"),
    *("\ufeff", "[a.b.c.d.e.f]"),
)


def integer_text(rng: random.Random) -> str:
    """Return any number, as a text."""
    return rng.choice((repr(rng.uniform(-1e3, 1e3)), str(rng.randint(-(10**12), 10**12))))


def any_text(rng: random.Random, longest: int = 12) -> str:
    """Return characters from everywhere in Unicode, most of them from its beginning."""
    tops = (0x7F, 0x7F, 0xFF, 0x2FFF, 0xD7FF, 0x10FFFF)
    points = (rng.randint(0, rng.choice(tops)) for _ in range(rng.randint(0, longest)))
    return "".join(chr(p) for p in points if not 0xD800 <= p <= 0xDFFF)


def cell(rng: random.Random) -> str:
    """Return what may stand in a cell, or had better not."""
    return rng.choice((rng.choice(NUMBERS), rng.choice(NAMES), any_text(rng), integer_text(rng)))
