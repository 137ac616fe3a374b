"""Bundler's file, written by its manual's layout: points are met, what is cut off is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange import flight_folder
from acx4lib.exchange.programs import bundler
from acx4lib.geometry import frames

SIZE = (640, 480)
LENS = (700.0, -0.05, 0.01)
POINTS = np.array([[0.0, 0, -10], [2, 1, -11], [-2, 1.5, -9]])
ROTATIONS = [frames.exp(np.array([0.01 * k, 0.02, -0.03])) for k in range(2)]
SHIFTS = np.array([[0.0, 0, 0], [0.5, -0.1, 0.2]])


def seen(k):
    """Return pixels from the middle, y up, by the formulas of the manual."""
    P = POINTS @ ROTATIONS[k].T + SHIFTS[k]
    p = -P[:, :2] / P[:, 2:]
    r2 = np.sum(p**2, axis=1, keepdims=True)
    f, k1, k2 = LENS
    return f * (1 + k1 * r2 + k2 * r2**2) * p


def text(lenses=(LENS, LENS, (0, 0, 0))):
    lines = ["# Bundle file v0.3", f"{len(lenses)} {len(POINTS)}"]
    for k, lens in enumerate(lenses):
        R = ROTATIONS[k] if lens[0] else np.zeros((3, 3))
        t = SHIFTS[k] if lens[0] else np.zeros(3)
        lines += [" ".join(map(repr, map(float, row))) for row in (lens, *R, t)]
    for n, point in enumerate(POINTS):
        views = [f"{k} {n} {x!r} {y!r}" for k, (x, y) in ((k, seen(k)[n].tolist()) for k in (0, 1))]
        position = " ".join(map(repr, point.tolist()))
        lines += [position, "1 2 3", f"2 {' '.join(views)}"]
    return "\n".join(lines) + "\n"


def read(folder, content, names="img/a.jpg 0 700\nimg/b.jpg 0 700\nimg/c.jpg\n"):
    (folder / "bundle").mkdir(exist_ok=True)
    (folder / "list.txt").write_text(names)
    path = folder / "bundle" / "bundle.out"
    path.write_text(content)
    return bundler.read(path, size=SIZE)


def test_points_are_met_and_names_are_read(tmp_path):
    brought = read(tmp_path, text())
    assert brought.source == "Bundler v0.3"
    assert brought.tables["calibration/images.csv"]["image"] == ["a.jpg", "b.jpg"]
    assert list(brought.settings["cameras"]) == ["CAM"]
    points = brought.tables["calibration/image_points.csv"]
    first = [points["col_px"][0], points["row_px"][0]]
    assert_allclose(first, np.array([319.5, 239.5]) + seen(0)[0] * [1, -1], atol=1e-4)
    rms = float(brought.found[1].split(" to ")[1].split(" px")[0])
    assert rms < 0.01
    assert brought.left_out == (
        "2 orientations: Bundler's coordinates are in no CRS",
        "1 image that Bundler did not orient",
    )


def test_different_lenses_are_different_cameras(tmp_path):
    brought = read(tmp_path, text((LENS, (800.0, 0.0, 0.0), (0, 0, 0))))
    assert brought.tables["calibration/images.csv"]["camera"] == ["CAM1", "CAM2"]
    assert brought.settings["cameras"]["CAM2"]["focal_mm"] == 4.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("v0.3", "v9"), "bundle.out:1: version: '# Bundle file v9'"),
        (lambda t: t[: t.rindex("\n1 2 3") + 1], "color is missing at the end of the file"),
        (lambda t: t.replace("\n3 3\n", "\n3 -3\n"), ":2: counts: -3; must be zero or positive"),
        (lambda t: t.replace("\n2 0 0", "\n2 9 0", 1), "views: camera 9; must be one of 3, from 0"),
        (lambda t: t.replace("\n2 0 0", "\n3 0 0", 1), "views: 8 cells after the number 3"),
        (lambda t: t.replace("700.0", "nan"), ":3: focal length: 'nan'; must be a finite number"),
        (lambda t: t.replace("700.0", "-7"), ":3: focal length: '-7'; must be a focal length"),
    ],
)
def test_wrong_files_are_refused(tmp_path, change, message):
    with pytest.raises(FlightError, match=message):
        read(tmp_path, change(text()))


def test_a_list_of_other_length_is_refused(tmp_path):
    with pytest.raises(FlightError, match=r"list.txt:1: file: has 1 images; must have 3"):
        read(tmp_path, text(), "a.jpg\n")


def test_a_size_that_is_too_small_for_the_measurements_is_refused(tmp_path):
    read(tmp_path, text())
    small = bundler.read(tmp_path / "bundle" / "bundle.out", size=(220, 160))
    with pytest.raises(FlightError, match=r"point 1 in a\.jpg: .* 4 of 6 measurements lie outside"):
        flight_folder.write(small, tmp_path / "flight")
    assert not (tmp_path / "flight").exists()
