"""Which calibration is taken out of results, and that it is the one that was written."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import exp, opk_from_rotation, rotation_from_opk
from acx4tools.exchange.outward import calibrated
from acx4tools.exchange.outward.relative import to_first
from support.run_results import edit, edit_summary, estimated, leave_calibration


def test_a_calibration_comes_back_with_its_a_posteriori_covariance(rig):
    found, known = calibrated.read(rig), estimated("LEFT", "RIGHT")
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
    cov = np.zeros((30, 30))
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
    found = calibrated.read(leave_calibration(tmp_path, estimated("LEFT", "RIGHT"), related=left))
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
        calibrated.read(tmp_path)
    with pytest.raises(FlightError, match="no calibration of refined that can be exported; it has"):
        calibrated.read(rig, method="refined")
    with pytest.raises(
        FlightError, match=r"no calibration of heads that can .*; it has single_step"
    ):
        calibrated.read(single, heads=True)
    with pytest.raises(FlightError, match=r"no calibration of single_step .*; it is of one camera"):
        calibrated.read(single, method="single_step", heads=True)
    with pytest.raises(ValueError, match="method: expected one of"):
        calibrated.read(rig, method="best")


def test_a_calibration_whose_data_contradict_each_other_is_not_exported(tmp_path):
    results = leave_calibration(tmp_path, estimated("CAM"))
    edit_summary(results, "mounting/single_step", stopped=["too much: one sentence"])
    with pytest.raises(FlightError, match=r"summary\.json: was changed"):
        calibrated.read(results)
    (results / ".acx4.json").unlink()
    with pytest.raises(FlightError, match="any method that can be exported; it has none"):
        calibrated.read(results)
    with pytest.raises(FlightError, match="single_step that can be exported; too much: one"):
        calibrated.read(results, method="single_step")


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
        calibrated.read(results)


def test_a_kept_flight_that_was_changed_is_refused(tmp_path):
    results = leave_calibration(tmp_path, estimated("CAM"))
    (results / ".acx4.json").unlink()
    with (results / "flight" / "flight.toml").open("a") as file:
        file.write("# more\n")
    with pytest.raises(FlightError, match=r"flight\.toml changed since the run"):
        calibrated.read(results)
