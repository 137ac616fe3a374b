"""A flight of two heads that are not the paper's."""

import re

import pandas as pd

import acx4sim

NAMES = {"CAM2": "port", "CAM3": "starboard"}


def write(path):
    """Write the flight into a folder that is not there yet; return the folder."""
    options = acx4sim.Options(blocks=("heads",))
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=1, options=options), path)
    toml = (path / "flight.toml").read_text()
    toml = re.sub(r"\[cameras\.CAM[14]\]\n(.+\n)+\n", "", toml)
    for old, new in {**NAMES, "SYN": "virtual"}.items():
        toml = toml.replace(f"cameras.{old}]", f"cameras.{new}]").replace(f'"{old}"', f'"{new}"')
    toml = toml.replace('"CAM1", ', "").replace(', "CAM4"', "")
    (path / "flight.toml").write_text(toml)
    images = pd.read_csv(path / "heads" / "images.csv", dtype=str)
    images = images[images["camera"].isin(NAMES)]
    points = pd.read_csv(path / "heads" / "image_points.csv", dtype=str)
    points = points[points["image"].isin(images["image"])]
    images.assign(camera=images["camera"].map(NAMES)).to_csv(
        path / "heads" / "images.csv", index=False
    )
    points.to_csv(path / "heads" / "image_points.csv", index=False)
    return path
