"""Which calibration is taken out of results, and that it is the one that was written."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import Pose, exp, log, opk_from_rotation, rotation_from_opk
from acx4tools.exchange.outward import content
from acx4tools.exchange.outward.content import R_C_V, to_first
from support.run_results import edit, edit_summary, estimated, leave_calibration


def test_a_calibration_comes_back_with_its_a_posteriori_covariance(rig):
    found, known = content.read(rig), estimated("LEFT", "RIGHT")
    assert (found.method, found.mounted, found.others) == ("rig", True, ())
    for own, camera in zip(found.cameras, known.cameras, strict=True):
        assert_allclose(own.interior.to_array(), camera.interior.to_array(), rtol=1e-14)
        assert_allclose(own.T_b_c.R, camera.T_b_c.R, atol=1e-14)
    scale = np.sqrt(np.diag(known.cov))
    assert_allclose(
        found.calibration.cov / scale / scale[:, None],
        1.25 * known.cov / scale / scale[:, None],
        atol=1e-9,
    )


def related():
    """Two heads in the axes of CAM, with different sigma of all angles."""
    cov = np.zeros((32, 32))
    cov[np.arange(30), np.arange(30)] = np.concatenate(
        [np.tile([1e-6] * 3 + [1e-10, 2e-10, 3e-10], 2), np.tile([0.0, 1e-6, 1e-6] + [0.0] * 6, 2)]
    )
    return RelativeOrientation(
        heads=estimated("LEFT", "RIGHT").cameras,
        xyz_mm=np.zeros((2, 3)),
        opk=np.radians([[-15.0, 1.0, 90.0], [15.0, -1.0, -90.0]]),
        cov_joint=cov,
        n_exposures=6,
    )


def test_heads_without_a_mounting_have_their_relative_rotation_with_sigma(tmp_path):
    """The frame of the synthetic camera cancels; so does sigma of what the heads share."""
    left = related()
    found = content.read(leave_calibration(tmp_path, estimated("LEFT", "RIGHT"), related=left))
    assert (found.method, found.mounted) == ("relative_orientation", False)
    first, second = to_first(found.calibration)
    R_s = rotation_from_opk(left.opk)
    assert_allclose(second.T_r_h.R, R_s[0].T @ R_s[1], atol=1e-12)
    assert np.all(first.cov == 0)
    rotations = [np.linalg.inv(_opk_jacobian(opk)) for opk in left.opk]
    own = [J @ np.diag([1e-10, 2e-10, 3e-10]) @ J.T for J in rotations]
    R_h_r = second.T_r_h.R.T
    assert_allclose(second.cov[3:, 3:], own[1] + R_h_r @ own[0] @ R_h_r.T, rtol=1e-9, atol=1e-20)


def _opk_jacobian(opk):
    """By differences: d(opk) / d(rotation about the camera's axes)."""
    R, step = rotation_from_opk(opk), 1e-6
    turned = [
        (opk_from_rotation(R @ exp(d)) - opk_from_rotation(R @ exp(-d))) / (2 * step)
        for d in step * np.eye(3)
    ]
    return np.stack(turned, axis=1)


def test_what_is_not_there_is_one_line_that_says_what_is(rig, single, tmp_path):
    with pytest.raises(FlightError, match="no results of a run; acx4 run FLIGHT --results makes"):
        content.read(tmp_path)
    with pytest.raises(FlightError, match="no calibration of refined that can be exported; it has"):
        content.read(rig, method="refined")
    with pytest.raises(
        FlightError, match=r"no calibration of heads that can .*; it has single_step"
    ):
        content.read(single, heads=True)
    with pytest.raises(FlightError, match=r"no calibration of single_step .*; it is of one camera"):
        content.read(single, method="single_step", heads=True)
    with pytest.raises(ValueError, match="method: expected one of"):
        content.read(rig, method="best")


def test_a_calibration_whose_data_contradict_each_other_is_not_exported(tmp_path):
    results = leave_calibration(tmp_path, estimated("CAM"))
    edit_summary(results, "mounting/single_step", stopped=["too much: one sentence"])
    with pytest.raises(FlightError, match=r"summary\.json: was changed"):
        content.read(results)
    (results / ".acx4.json").unlink()
    with pytest.raises(FlightError, match="any method that can be exported; it has none"):
        content.read(results)
    with pytest.raises(FlightError, match="single_step that can be exported; too much: one"):
        content.read(results, method="single_step")


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        (
            "covariance",
            lambda t: t.loc.__setitem__((1, "value"), 1.0),
            r"covariance\.csv:3: value: 1; must equal its counterpart",
        ),
        (
            "parameters",
            lambda t: t.replace("LEFT", "OTHER", inplace=True),
            r":2: camera: 'OTHER' is unknown; must be a camera",
        ),
        (
            "parameters",
            lambda t: t.replace({"value": {t["value"][0]: -1.0}}, inplace=True),
            r":2: value: -1; must be positive",
        ),
    ],
)
def test_tables_that_hold_no_calibration_are_refused_by_line(tmp_path, name, change, said):
    """Where no mark says that they were changed."""
    results = leave_calibration(tmp_path, estimated("LEFT", "RIGHT"), method="rig")
    edit(results, name, change)
    (results / ".acx4.json").unlink()
    with pytest.raises(FlightError, match=said):
        content.read(results)


def test_a_kept_flight_that_was_changed_is_refused(tmp_path):
    results = leave_calibration(tmp_path, estimated("CAM"))
    (results / ".acx4.json").unlink()
    with (results / "flight" / "flight.toml").open("a") as file:
        file.write("# more\n")
    with pytest.raises(FlightError, match=r"flight\.toml changed since the run"):
        content.read(results)


# --- Heads relative to the first: against a numerical derivative, and as a chain of poses


RIG = estimated("LEFT", "RIGHT")


def moved(k, step):
    """Return the rig with one mounting changed: lever arm along body, rotation about camera."""
    cameras = list(RIG.cameras)
    T = cameras[k].T_b_c
    cameras[k] = replace(cameras[k], T_b_c=Pose(R=T.R @ exp(step[3:]), r=T.r + step[:3]))
    return replace(RIG, cameras=tuple(cameras))


def test_points_go_from_head_to_reference_as_through_the_body():
    first, second = RIG.cameras
    x_h = np.array([0.3, -0.2, -5.0])
    x_b = second.T_b_c.R @ x_h + second.T_b_c.r
    x_r = first.T_b_c.R.T @ (x_b - first.T_b_c.r)
    T = to_first(RIG)[1]
    assert_allclose(T.T_r_h.R @ x_h + T.T_r_h.r, x_r, atol=1e-12)
    assert_allclose(T.T_v_r_h.R @ (R_C_V @ x_h) + T.T_v_r_h.r, R_C_V @ x_r, atol=1e-12)


def test_the_covariance_is_that_of_numerical_derivatives():
    at, step = to_first(RIG)[1].T_r_h, 1e-5
    J = np.zeros((6, RIG.n_columns))
    for k in range(2):
        for j, column in enumerate(RIG.layout.mount[k]):
            for sign in (1, -1):
                T = to_first(moved(k, sign * step * np.eye(6)[j]))[1].T_r_h
                change = np.concatenate([T.r - at.r, log(at.R.T @ T.R)])
                J[:, column] += sign * change / (2 * step)
    assert_allclose(to_first(RIG)[1].cov, J @ RIG.cov @ J.T, rtol=1e-6, atol=1e-14)


def test_sigma_of_angles_is_that_of_many_rotations(rng):
    one = to_first(RIG)[1]
    turns = rng.multivariate_normal(np.zeros(3), one.cov[3:, 3:], size=20_000)
    R = one.T_r_h.R @ exp(turns)
    opk = Pose(R=R_C_V @ R @ R_C_V, r=np.zeros((len(R), 3))).opk
    assert_allclose(one.sigma_opk, opk.std(axis=0), rtol=0.03)  # 4 sigma of 20 000 draws
