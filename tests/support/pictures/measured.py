"""Pictures of simulated flights, and what the simulator says of measurements in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4sim.designs import DESIGNS, PLANS
from acx4sim.files import photograph, write
from acx4sim.optics import Camera
from acx4sim.pictures import ground_from_pixels, pixels_from_ground, station

FEW = ("C1-04", "C2-04", "C4-04")
"""One exposure each of two opposite strips, and one that crosses them at another height."""


def flown(
    folder: Path,
    exposures: tuple[str, ...] = FEW,
    *,
    reduce: int = 6,
    design: str = "single-head",
    blocks: tuple[str, ...] = ("calibration",),
) -> Path:
    """Write the flight with pictures of some exposures and no image points in their blocks."""
    path = folder / "flight"
    write(photograph(DESIGNS[design](), exposures, reduce=reduce), path)
    for block in blocks:
        (path / block / "image_points.csv").unlink()
    return path


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of measurements by the simulator's exact geometry, pixels of the pictures.

    `off` are those of columns and rows; `z` the same over their standard deviations.
    """

    rows: pd.DataFrame
    off: np.ndarray
    z: np.ndarray

    @property
    def rms(self) -> float:
        """Of a coordinate of a tie point: n rays differ from their mean by n - 1 of n parts."""
        free = len(self.rows) - self.rows["point"].nunique()
        return float(np.sqrt(np.sum(self.off**2) / 2 / free))


def tie_errors(
    flight: Path, *, reduce: int = 6, design: str = "single-head", block: str = "calibration"
) -> Errors:
    """The rays of a tie point against their weighted mean on the exact ground."""
    rows, shots = _rows(flight, design, block, tie=True)
    g = _by_image(rows, shots, lambda at, camera, r: ground_from_pixels(at, camera, _colrow(r)), 3)
    code, names = pd.factorize(rows["point"])
    weight = rows["sigma_px"].to_numpy() ** -2.0
    total = np.bincount(code, weight)
    mean = np.stack([np.bincount(code, weight * g[:, k]) / total for k in range(3)], axis=1)[code]
    seen = _by_image(
        rows.assign(n=np.arange(len(rows))),
        shots,
        lambda at, camera, r: pixels_from_ground(at, camera, mean[r["n"]]),
        2,
    )
    off = _colrow(rows) - seen
    left = 1 - weight / total[code]
    sigma = rows["sigma_px"].to_numpy() * np.sqrt(np.maximum(left, 1e-3))
    assert len(names) > 50
    return Errors(rows, off / reduce, off / sigma[:, None])


def target_errors(flight: Path, truth: dict) -> Errors:
    """Surveyed points against where the exact camera has them."""
    rows, shots = _rows(flight, "single-head", "calibration", tie=False)
    seen = _by_image(
        rows,
        shots,
        lambda at, camera, r: pixels_from_ground(
            at, camera, np.array([truth["control_points"][p] for p in r["point"]])
        ),
        2,
    )
    off = _colrow(rows) - seen
    return Errors(rows, off / 6, off / rows["sigma_px"].to_numpy()[:, None])


def _rows(flight, design, block, *, tie):
    """Return measurements, and by image where the aircraft truly was, and the true camera."""
    rows = pd.read_csv(flight / block / "image_points.csv", dtype={"point": str})
    rows = rows[rows["point"].str.startswith("T") == tie].reset_index(drop=True)
    images = pd.read_csv(flight / block / "images.csv").set_index("image")
    plan = PLANS[design]()
    stations = {name: station(plan, f"{block}/{name}") for name in images["exposure"].unique()}
    shots = {
        name: (stations[image.exposure], plan.cameras[image.camera])
        for name, image in images.iterrows()
    }
    return rows, shots


def _colrow(rows):
    return rows[["col_px", "row_px"]].to_numpy()


def _by_image(rows, shots, function, width):
    out = np.zeros((len(rows), width))
    for name, index in rows.groupby("image").groups.items():
        out[index] = function(*shots[name], rows.loc[index])
    return out


# --- signalised points in simulated pictures: white discs of 60 cm on dark pads of 1.8 m -------


PAD_DN = 3200


def cut_out(camera: Camera, col: int, row: int, width: int, height: int) -> Camera:
    """Return the camera of a part of the sensor, which begins at a column and row."""
    pixel = camera.pixel_um / 1000
    dx = (col + (width - camera.width_px) / 2) * pixel
    dy = -(row + (height - camera.height_px) / 2) * pixel
    return replace(
        camera,
        width_px=width,
        height_px=height,
        xp_mm=camera.xp_mm - dx,
        yp_mm=camera.yp_mm - dy,
    )


def middle_of_disc(grey: np.ndarray, near: np.ndarray, radius_px: float) -> np.ndarray:
    """Return col, row of the centroid of what is brighter than the pad, around a place."""
    rows, cols = np.indices(grey.shape)
    white = grey.astype(float) - PAD_DN
    white[np.hypot(cols - near[0], rows - near[1]) > radius_px] = 0
    return np.array([(cols * white).sum(), (rows * white).sum()]) / white.sum()
