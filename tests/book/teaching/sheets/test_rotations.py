"""With scipy's rotations and PROJ, none of the library's."""

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation

from acx4book.teaching import flights, grading
from acx4book.teaching.sheets import rotations
from acx4book.teaching.sheets.every import SHEETS


def opk_deg(R):
    """Angles of M = R3 R2 R1, object to image."""
    return R.as_euler("XYZ", degrees=True)


@pytest.fixture(scope="module")
def by_hand(key):
    """Return the body's attitude against true north, the convergence, and the boresight."""
    flight = flights.flight_of(SHEETS["lab-2"], "Ada", key)
    row = flight.tables["calibration/trajectory.csv"].iloc[1]
    gamma = pyproj.Proj("EPSG:32633").get_factors(row["lon_deg"], row["lat_deg"])
    ned = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    frd = Rotation.from_euler("x", 180, degrees=True)
    turned = Rotation.from_euler("ZYX", row[["heading_deg", "pitch_deg", "roll_deg"]], degrees=True)
    mount = flight.plan.cameras["CAM"].boresight_deg
    boresight = Rotation.from_euler("XYZ", mount, degrees=True)
    return ned * turned * frd, gamma.meridian_convergence, boresight


def named(body, camera):
    return dict(zip((*rotations.BODY, *rotations.CAMERA), [*body, *camera], strict=True))


def test_the_right_answers_are_scipys_and_projs(by_hand, solved):
    true_north, gamma, boresight = by_hand
    _, right = solved("lab-2", "Ada")
    body = Rotation.from_euler("z", gamma, degrees=True) * true_north
    expected = named(opk_deg(body), opk_deg(body * boresight))
    values = {name: right[name].value for name in expected}
    assert values == pytest.approx(expected, abs=2e-6)
    assert right[rotations.GAMMA].value == pytest.approx(gamma, abs=1e-9)


def test_the_right_attitude_is_the_simulators_but_for_noise(solved):
    for k in range(5):
        case, right = solved("lab-2", f"Student {k}")
        true = case.truth["exposures"]["calibration"]["C1-02"][3:]
        off = [right[name].value - angle for name, angle in zip(rotations.BODY, true, strict=True)]
        assert np.all(np.abs(off) < 5 * 0.015)


def test_mistakes_made_by_hand_are_named(by_hand, solved, handed):
    true_north, gamma, boresight = by_hand
    case, right = solved("lab-2", "Ada")
    body = Rotation.from_euler("z", gamma, degrees=True) * true_north
    for wrong, says in (
        (named(opk_deg(true_north), opk_deg(true_north * boresight)), "forgotten"),
        (named(opk_deg(body.inv()), opk_deg((body * boresight).inv())), "transposed"),
        (named(opk_deg(body), opk_deg(body * boresight.inv())), "boresight is transposed"),
        (named(opk_deg(body), opk_deg(body)), "these are the body's"),
        (named(opk_deg(body * boresight), opk_deg(body * boresight)), "these are the camera's"),
        (named(opk_deg(body) / 0.9, opk_deg(body * boresight) / 0.9), "in gon"),
        (named(np.radians(opk_deg(body)), opk_deg(body * boresight)), "in radians"),
    ):
        verdicts = grading.graded(SHEETS["lab-2"], case, handed("lab-2", right, **wrong))
        assert [v for v in verdicts if v.says]
        assert all(says in v.says for v in verdicts if v.says)
