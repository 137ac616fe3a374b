"""Pictures whose trajectory says wrongly where they look: they orient themselves."""

import csv
import re
import shutil

import cv2
import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.flight import reader
from acx4lib.flight.block import select_images
from acx4tools.measuring.measure import measure_flight
from acx4tools.measuring.orientation import oriented_by_features
from support.pictures import measured

OFF = {"C1-04": (4, -5, 10), "C2-04": (-5, 3, -9), "C4-04": (5, 4, 8)}
"""Roll, pitch, heading of three exposures are wrong by these, degrees."""

NINE_M = 8e-5
"""Of latitude, degrees."""


def misled(folder, flight):
    """Copy a flight; its attitudes are wrong, its positions as well, and nothing says a height."""
    own = shutil.copytree(flight, folder / "misled", copy_function=shutil.os.link)
    (own / "control_points.csv").unlink()
    path = own / "calibration" / "trajectory.csv"
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for k, row in enumerate(rows):
        row["lat_deg"] = f"{float(row['lat_deg']) + NINE_M * (-1) ** k:.9f}"
        for name, by in zip(
            ("roll", "pitch", "heading"), OFF.get(row["exposure"], ()), strict=False
        ):
            row[f"{name}_deg"] = f"{float(row[f'{name}_deg']) + by:.6f}"
    path.unlink()
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    return own


def test_wrong_attitudes_and_positions_and_no_height_cost_no_measurement(whole, tmp_path):
    (outcome,) = measure_flight(misled(tmp_path, whole.flight), tmp_path / "measured")
    found = measured.tie_errors(tmp_path / "measured")
    right = measured.tie_errors(whole.measured)
    assert len(found.off) > 0.9 * len(right.off)
    assert found.rms < 0.06
    assert len(outcome.matched.views) == 3
    said = [re.search(r"are off by (\S+), (\S+), (\S+)°,", line) for line in outcome.sentences]
    told = np.array([found.groups() for found in said if found], float)
    # three pictures with positions that are wrong by nine metres are turned by two degrees
    np.testing.assert_allclose(told, list(OFF.values()), atol=3.0)


def test_pictures_without_anything_in_common_are_refused(whole, tmp_path):
    own = misled(tmp_path, whole.flight)
    rng = np.random.default_rng(5)
    for path in sorted((own / "calibration" / "images").glob("*.tif"))[1:]:
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        path.unlink()
        noise = rng.integers(0, 255, picture.shape).astype(picture.dtype)
        cv2.imwrite(str(path), noise, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    with pytest.raises(FlightError, match="features in common"):
        measure_flight(own, tmp_path / "out")


def test_pictures_of_one_exposure_are_refused(whole):
    block = reader.read(whole.measured).block("calibration")
    one = select_images(block, block.images.exposure_idx == block.images.exposure_idx[0])
    with pytest.raises(FlightError, match="of one exposure, whose rays meet nowhere"):
        oriented_by_features(one, [], executor=None, tell=lambda *_: None)
