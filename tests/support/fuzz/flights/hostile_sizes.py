"""Files that are small to send and large to read."""

from __future__ import annotations

import os
import random
from pathlib import Path

from support.fuzz.inside import data_of, write

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
