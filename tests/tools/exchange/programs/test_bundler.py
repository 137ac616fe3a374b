"""Bundler's file, written by its manual's layout: points are met, what is cut off is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange import flight_folder
from acx4tools.exchange.programs import bundler
from support.projects import bundler as written


def read(folder, content, names="img/a.jpg 0 700\nimg/b.jpg 0 700\nimg/c.jpg\n"):
    (folder / "bundle").mkdir(exist_ok=True)
    (folder / "list.txt").write_text(names)
    path = folder / "bundle" / "bundle.out"
    path.write_text(content)
    return bundler.read(path, size=written.SIZE)


def test_points_are_met_and_names_are_read(tmp_path):
    brought = read(tmp_path, written.text())
    assert brought.source == "Bundler v0.3"
    assert brought.tables["calibration/images.csv"]["image"] == ["a.jpg", "b.jpg"]
    assert list(brought.settings["cameras"]) == ["CAM"]
    points = brought.tables["calibration/image_points.csv"]
    first = [points["col_px"][0], points["row_px"][0]]
    assert_allclose(first, np.array([319.5, 239.5]) + written.seen(0)[0] * [1, -1], atol=1e-4)
    said = next(one for one in brought.found if one.startswith("the program's own points"))
    rms = float(said.split(" to ")[1].split(" px")[0])
    assert rms < 0.01
    assert brought.left_out == (
        "1 images that Bundler did not orient",
        "2 adjusted orientations: their coordinates are in no CRS",
    )


def test_different_lenses_are_different_cameras(tmp_path):
    brought = read(tmp_path, written.text((written.LENS, (800.0, 0.0, 0.0), (0, 0, 0))))
    assert brought.tables["calibration/images.csv"]["camera"] == ["CAM1", "CAM2"]
    assert brought.settings["cameras"]["CAM2"]["focal_mm"] == 4.0


def test_a_size_that_is_too_small_for_the_measurements_is_refused(tmp_path):
    read(tmp_path, written.text())
    small = bundler.read(tmp_path / "bundle" / "bundle.out", size=(220, 160))
    with pytest.raises(FlightError, match=r"point 1 in a\.jpg: .* 4 of 6 measurements lie outside"):
        flight_folder.write(small, tmp_path / "flight")
    assert not (tmp_path / "flight").exists()
