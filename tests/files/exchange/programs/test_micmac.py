"""A folder of MicMac becomes a flight; its own points prove the conventions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.programs import micmac
from acx4lib.errors import FlightError
from support.helpers import needs
from support.projects import micmac as projects_micmac

COLROW = np.array([[0.0, 0.0], [999, 799], [510, 390], [100, 700]])


@pytest.fixture
def folder(tmp_path):
    return projects_micmac.write(tmp_path / "m")


def rms(brought, begin):
    """Return the rms that a proof says, px."""
    said = next(one for one in brought.found if one.startswith(begin))
    return float(said.split(" px rms")[0].split()[-1])


@needs("formats/micmac")
def test_real_files_prove_the_conventions():
    """MicMac's own projections are met to what the refit of the lens leaves."""
    brought = micmac.read(data.path("formats/micmac/GroundMeasure.xml").parent)
    assert rms(brought, "surveyed points") == pytest.approx(1.43, abs=0.01)
    assert rms(brought, "points that MicMac projected itself (Verif)") < 0.02
    assert any("(40 measurements)" in one for one in brought.found)
    assert len(brought.tables["calibration/image_points.csv"]["image"]) == 19
    assert brought.tables["control_points.csv"]["point"][3] == "I-of-I"


def test_a_folder_becomes_a_flight(folder):
    brought = micmac.read(folder, orientations="adjusted", crs="EPSG:31982", pixel_um=4.0)
    assert brought.settings["crs"] == "EPSG:31982"
    assert brought.settings["cameras"]["C"]["focal_mm"] == 4.0
    assert rms(brought, "surveyed points") < 1e-9
    assert brought.tables["control_points.csv"]["sigma_height_m"] == [0.02]
    assert brought.tables["calibration/trajectory.csv"]["kappa_deg"] == [0.0]
    assert brought.left_out == (
        "1 other XML files",
        "1 measured points are tie points, since their coordinates are not there: T",
    )


@pytest.mark.parametrize(
    "model", [projects_micmac.RADIAL, projects_micmac.FRASER], ids=["ModRad", "ModPhgrStd"]
)
def test_a_distortion_takes_ideal_pixels_to_measured_ones(tmp_path, model):
    """Written out: x from the centre of distortion, r² = x² + y²."""
    calibration = projects_micmac.CALIBRATION.format(model=model)
    folder = projects_micmac.write(tmp_path / "m", **{"Ori-A/AutoCal_C.xml": calibration})
    ideal = 1000 * micmac.read_project(folder).lenses["C"].ideal(COLROW) + [500, 400]
    x, y = (ideal - [510, 390]).T
    r2 = x * x + y * y
    p1, p2, b1 = (1e-6, -2e-6, 1e-4) if "P1" in model else (0, 0, 0)
    col = ideal[:, 0] + x * 1e-8 * r2 + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y + b1 * x
    row = ideal[:, 1] + y * 1e-8 * r2 + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    assert_allclose(np.stack([col, row], axis=1), COLROW, atol=1e-8)


def test_a_camera_that_looks_down_has_the_librarys_axes(folder):
    pose = micmac.read_project(folder).images.T_w_c[0]
    assert_allclose(pose.R, np.eye(3))
    assert_allclose(pose.r, [10, 20, 100])


def test_one_of_several_orientations_must_be_chosen(folder):
    (folder / "Ori-B").mkdir()
    for path in (folder / "Ori-A").iterdir():
        (folder / "Ori-B" / path.name).write_text(path.read_text().replace("<F>1000", "<F>2000"))
    with pytest.raises(FlightError, match=r"has orientations in Ori-A, Ori-B; give one of these"):
        micmac.read(folder)
    brought = micmac.read(folder / "Ori-B", pixel_um=4.0)
    assert brought.settings["cameras"]["C"]["focal_mm"] == 8.0
    assert "control_points.csv" in brought.tables
