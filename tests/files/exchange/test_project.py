"""What is made of any program's project: tables, counts, proofs, trajectories."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4files.exchange.coordinates import UNKNOWN, stacked
from acx4files.exchange.lens import Lens, Pinhole
from acx4files.exchange.project import (
    Images,
    Measured,
    Project,
    Proof,
    Trajectory,
    flight_of,
    grid_poses_of_ecef,
)
from acx4files.exchange.safe import Opened
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, mean_origin, rotation_enu_to_ecef

FILE = Opened(file="x.json", data=b"{}")
LENS = Lens(
    width_px=100,
    height_px=80,
    hole=Pinhole(fx=100.0, fy=100.0, cx=49.5, cy=39.5),
    pixel_um=10.0,
    distortion=lambda points: points,
    wrong=lambda found, expected: FILE.wrong("camera", found, expected),
)
IMAGES = Images(
    names=("a", "b"),
    cameras=("C", "C"),
    exposures=("a", "b"),
    T_w_c=stacked([Pose(R=np.eye(3), r=np.array([0.0, 0, 10])), UNKNOWN]),
)
MEASURED = Measured(
    points=("p", "q"),
    x_w=np.array([[0.0, 0, 0], [np.nan] * 3]),
    image_idx=np.array([0, 0, 1]),
    point_idx=np.array([0, 1, 0]),
    colrow=np.array([[49.5, 42.5], [1.0, 2], [3, 4]]),
)
PROJECT = Project(
    source="P",
    sources=[FILE],
    lenses={"C": LENS},
    images=IMAGES,
    measured=MEASURED,
    proofs=(Proof(whose="its points", measured=MEASURED),),
    in_grid=lambda T: (T.r, T.opk),
)


def test_only_what_is_known_proves_anything():
    assert "its points are reprojected by the cameras as imported to 3 px rms" in str(
        flight_of(PROJECT).found
    )
    astray = replace(MEASURED, colrow=MEASURED.colrow + 10.0)
    for is_own in (False, True):  # surveyed points need not fit, the program's own must
        proof = Proof(whose="its points", measured=astray, is_own=is_own)
        warnings = flight_of(replace(PROJECT, proofs=(proof,))).warnings
        assert ["its points are reprojected" in one for one in warnings] == [True] * is_own
    unknown = replace(MEASURED, x_w=np.full((2, 3), np.nan))
    nothing = replace(PROJECT, proofs=(Proof(whose="its points", measured=unknown),))
    assert any(one.startswith("nothing proves") for one in flight_of(nothing).found)


def test_rays_of_points_without_a_place_must_meet():
    """The second image is 3 m to the right, and its ray is off by 3 px across."""
    pair = replace(
        IMAGES, T_w_c=Pose(R=np.stack([np.eye(3)] * 2), r=np.array([[0.0, 0, 10], [3, 0, 10]]))
    )
    seen = Measured(
        points=("p",),
        image_idx=np.array([0, 1]),
        point_idx=np.array([0, 0]),
        colrow=np.array([[49.5, 41.0], [19.5, 38.0]]),
    )
    found = flight_of(replace(PROJECT, images=pair, proofs=(Proof(whose="rays", measured=seen),)))
    said = next(one for one in found.found if one.startswith("rays meet in a point to "))
    assert float(said.split()[6]) == pytest.approx(1.5, abs=0.1)


def test_images_that_the_trajectory_lacks_do_not_come_along():
    brought = flight_of(replace(PROJECT, orientations="adjusted"))
    assert brought.tables["calibration/images.csv"]["image"] == ["a"]
    assert brought.tables["calibration/trajectory.csv"]["height_m"] == [10.0]
    assert brought.tables["calibration/image_points.csv"]["point"] == ["p", "q"]
    assert brought.left_out == (
        "1 images whose exposures are not in the trajectory",
        "1 measurements in images that are left out",
    )


def test_adjusted_orientations_need_a_place():
    lost = replace(PROJECT, in_grid=FILE.wrong("crs", "none", "give one"))
    with pytest.raises(FlightError, match=r"x\.json:1: crs: none; give one"):
        flight_of(replace(lost, orientations="adjusted"))
    assert flight_of(lost).left_out == ("1 adjusted orientation (--orientations adjusted)",)


def test_what_was_measured_is_the_trajectory_where_it_is_asked_for():
    table = {"exposure": ["b"], "east_m": [1.0]}
    both = replace(PROJECT, trajectory=Trajectory(table=table, assumed=("north is up",)))
    brought = flight_of(replace(both, orientations="initial"))
    assert brought.tables["calibration/trajectory.csv"] == table
    assert brought.tables["calibration/images.csv"]["image"] == ["b"]
    assert "north is up" in brought.assumed
    assert "calibration/trajectory.csv" not in flight_of(both).tables


def test_cameras_that_no_flight_has_are_refused_or_left_out():
    far = replace(LENS, pixel_um=0.5)
    images = replace(IMAGES, cameras=("C", "D"))
    two = replace(PROJECT, images=images, lenses={"C": LENS, "D": far})
    with pytest.raises(FlightError, match=r"x\.json:1: camera: D: focal_mm 0\.05 must lie between"):
        flight_of(two)
    brought = flight_of(replace(two, may_leave_cameras=True))
    assert list(brought.settings["cameras"]) == ["C"]
    assert brought.tables["calibration/images.csv"]["image"] == ["a"]
    assert any(one.startswith("camera and its images: D: ") for one in brought.left_out)


def test_poses_in_the_ecef_frame_are_brought_into_the_grid():
    opk = np.radians([[0.5, -1.0, 30.0], [1.0, 2.0, -150.0]])
    enh = np.array([[676000.0, 7184000.0, 1000.0], [676100.0, 7184050.0, 1010.0]])
    grid = GridSystem(crs="EPSG:31982")
    frame = mean_origin(grid, grid.lonlat_from_grid(enh[:, :2]))
    T_m = frame.pose_from_grid(enh, opk)
    R_e_m = rotation_enu_to_ecef(frame.origin[None])[0]
    T_e = Pose(R=R_e_m @ T_m.R, r=grid.ecef_from_geographic(frame.to_geographic(T_m.r)))
    back = grid_poses_of_ecef(grid, T_e)
    assert_allclose(back[0], enh, atol=1e-5)
    assert_allclose(rotation_from_opk(back[1]), rotation_from_opk(opk), atol=1e-9)


def bent(strength):
    """Return a lens with a term that no camera of a flight has, the 17th power of the radius."""

    def distorted(at):
        return at + at * strength * np.sum((at / 0.6) ** 2, axis=1, keepdims=True) ** 8

    return replace(
        LENS,
        distortion=distorted,
        width_px=1000,
        height_px=800,
        hole=Pinhole(fx=1000.0, fy=1000.0, cx=499.5, cy=399.5),
    )


def test_what_a_refit_leaves_is_a_warning_and_then_a_refusal():
    """Largest differences of hundredths of a pixel, half a pixel, and several."""
    small, large, too_large = (
        replace(PROJECT, lenses={"C": bent(size)}) for size in (1e-4, 0.03, 0.1)
    )
    assert not flight_of(small).warnings
    (said,) = flight_of(large).warnings
    assert said.startswith("the lens of C differs from the program's by ")
    with pytest.raises(
        FlightError, match=r"camera: C: its refit .* px; --allow [0-9.]+ takes it so"
    ):
        flight_of(too_large)
    with pytest.raises(FlightError, match=r"must be at most 0\.1 px"):
        flight_of(large, allow=0.1)
    assert flight_of(too_large, allow=20.0).warnings
