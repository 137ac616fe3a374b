"""Where a reconstruction is: topocentric, or in axes of UTM; the measured positions decide."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opensfm import place, project, reading
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem
from support.reference_files import needs

ODM = "formats/orthority/odm_opensfm_reconstruction.json"


def place_of(folder, crs=None):
    found = project.project_of(folder)
    root, _ = project.reconstruction(found)
    return place.read(found, root, project.shots(root, None), crs)


def test_the_origin_of_the_project_is_at_its_altitude(tmp_path, written):
    here = place_of(written.write(tmp_path / "p"))
    at = here.in_frame(Pose(R=np.eye(3), r=np.zeros(3))).r
    lonlath = here.frame.to_geographic(at[None])[0]
    assert_allclose(lonlath, [-49.3, -25.4, 900.0], atol=1e-9)
    assert here.frame.grid.crs == "EPSG:32722"
    assert here.utm is None


def test_a_project_without_measured_positions_is_nowhere(tmp_path, written):
    whole = written.reconstruction()
    for one in whole["shots"].values():
        one["gps_dop"] = 999999.0
    assert place_of(written.write(tmp_path / "p", whole)) is None


def test_axes_of_utm_are_recognised_and_brought_back(tmp_path, written):
    """Convergence there is 0.99 degrees: 0.5 m at the outermost camera."""
    whole, grid = written.reconstruction(), GridSystem(crs="EPSG:32722", heights="ellipsoidal")
    plain = place_of(written.write(tmp_path / "p", whole))
    origin = grid.grid_from_lonlat(np.array([[-49.3, -25.4]]))[0]
    for one, centre in zip(whole["shots"].values(), written.CENTRES, strict=True):
        in_frame = plain.frame.to_grid(centre[None] + np.array([0, 0, 900.0]))[0]
        R = written.turned(0)
        shifted = in_frame - np.append(origin, 900.0)
        one |= {
            "translation": (-R @ shifted).tolist(),
            "rotation": written.shot(R, centre)["rotation"],
        }
    (tmp_path / "p" / "reconstruction.json").write_text(json.dumps([whole]))
    here = place_of(tmp_path / "p")
    assert here.utm is not None
    assert "have the axes of UTM, as ODM writes them" in here.said[1]
    R = here.in_frame(Pose(R=np.eye(3)[None], r=np.zeros((1, 3)))).R[0]
    turn = np.degrees(np.arctan2(R[1, 0], R[0, 0]))
    assert_allclose(
        turn, np.degrees(grid.convergence(np.array([[-49.3, -25.4]])))[0] * -1, atol=1e-6
    )


def test_a_crs_that_cannot_be_used_is_refused(tmp_path, written):
    with pytest.raises(FlightError, match=r"--crs:1: crs: .*must be projected and in metres"):
        place_of(written.write(tmp_path / "p"), "EPSG:4326")


@needs("formats/orthority")
def test_odms_reconstruction_gives_the_orientations_that_another_program_found():
    """Its table has omega, phi, kappa of the same shots, to a thousandth."""
    brought = reading.read(data.path(ODM), orientations="adjusted")
    table = brought.tables["calibration/trajectory.csv"]
    lines = data.path("formats/orthority/io_odm_xyz_opk.csv").read_text().splitlines()[1:]
    for line in lines:
        name, *rest = line.replace("'", " ").split()
        k = table["exposure"].index(name)
        names = ("east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg")
        got = [table[column][k] for column in names]
        assert_allclose(got, [float(one) for one in rest[:6]], atol=6e-4)
