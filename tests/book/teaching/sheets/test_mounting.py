import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from acx4book.notebooks import runner
from acx4book.notebooks.functions import way_of
from acx4book.teaching import grading, handed_in
from acx4book.teaching.sheets import mounting
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.flight.reader import read
from acx4lib.results import folder


@pytest.fixture(scope="module")
def run(key, tmp_path_factory):
    """Return a student's flight and the folder of a run of it."""
    at = tmp_path_factory.mktemp("lab")
    handed_in.write(SHEETS["lab-6"], "Ada", key, at / "flight")
    runner.run(at / "flight", at / "results", way=way_of(None), stages=folder.STAGES)
    return read(at / "flight"), at / "results"


@pytest.fixture(scope="module")
def by_hand(run):
    """Return difference of places on the grid, attitude of the body, and of the camera."""
    flight, results = run
    rows = folder.read(results).exterior_orientation
    row = rows[(rows["method"] == "two_step") & (rows["image"] == "C1-03")].iloc[0]
    block = flight.calibration
    place, opk = block.frame.pose_to_grid(block.T_m_b_images[[2]])
    between = row[["east_m", "north_m", "height_m"]].to_numpy(float) - place[0]
    camera = row[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy(float)
    return (
        between,
        Rotation.from_euler("XYZ", opk[0]),
        Rotation.from_euler("XYZ", camera, degrees=True),
    )


def of_image(lever, R):
    angles = R.as_euler("XYZ", degrees=True)
    return dict(zip(mounting.OF_IMAGE, [*lever, *angles], strict=True))


def test_a_run_answers_what_it_has(run, solved):
    case, right = solved("lab-6", "Ada")
    given = handed_in.read(run[1])
    assert (given.student, given.sheet) == ("Ada", "lab-6")
    for name in (*mounting.BORESIGHT, *mounting.LEVER, mounting.TWO_STEP):
        assert given.answers[name].value == pytest.approx(right[name].value, abs=1e-9)
        assert given.answers[name].sigma == pytest.approx(right[name].sigma, rel=1e-6)
    verdicts = grading.graded(SHEETS["lab-6"], case, given.answers)
    assert {v.says for v in verdicts} == {"", "not answered"}


def test_an_image_by_hand_gives_the_right_answer_and_mistakes_are_named(by_hand, solved, handed):
    between, body, camera = by_hand
    case, right = solved("lab-6", "Ada")
    lever, boresight = body.inv().apply(between), body.inv() * camera
    for wrong, says in (
        (of_image(lever, boresight), ""),
        (of_image(between, boresight), "mapping axes"),
        (of_image(camera.inv().apply(between), boresight), "camera axes"),
        (of_image(lever, camera), "camera against the grid"),
        (of_image(lever, boresight.inv()), "transposed"),
        (of_image(-lever, boresight), "lever arm's sign"),
    ):
        verdicts = grading.graded(SHEETS["lab-6"], case, handed("lab-6", right, **wrong))
        assert bool(says) == bool([v for v in verdicts if v.says])
        assert all(says in v.says for v in verdicts if v.says)


def test_estimates_are_within_their_sigma_of_the_truth(solved):
    for name in (*mounting.BORESIGHT, *mounting.LEVER, mounting.TWO_STEP):
        errors = []
        for k in range(20):
            _, right = solved("lab-6", f"Student {k}")
            errors.append((right[name].value - right[name].truth) / right[name].sigma)
        low, high = chi2.ppf([0.0005, 0.9995], 20)
        assert low < np.sum(np.square(errors)) < high
