"""What a folder may hold besides files and folders."""

from __future__ import annotations

import os
import random
import shutil
import socket
from pathlib import Path

from support.fuzz.inside import is_here

NAMES = (
    *("flight.toml", "control_points.csv", "heads", "calibration", "validation", "geoid.gtx"),
    *("calibration/images.csv", "calibration/image_points.csv", "calibration/trajectory.csv"),
    *("heads/images", "heads/images/E0_LEFT.tif", "heads/images.csv", "validation/images.csv"),
    *("heads/control_points.csv", "calibration/control_points.csv"),
)


def _remove(path: Path) -> None:
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
    _remove(path)
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
