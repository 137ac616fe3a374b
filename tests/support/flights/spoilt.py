"""Files of a written flight, and changes of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd

IMAGES = "calibration/images.csv"

POINTS = "calibration/image_points.csv"

TRAJECTORY = "calibration/trajectory.csv"

CONTROL = "control_points.csv"

TOML = "flight.toml"


def replace(folder: Path, file: str, old: str, new: str, count: int = -1) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, count))


def append(folder: Path, file: str, text: str) -> None:
    (folder / file).write_text((folder / file).read_text() + text)


def change(folder: Path, file: str, by: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    by(pd.read_csv(folder / file)).to_csv(folder / file, index=False)
