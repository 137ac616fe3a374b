import numpy as np
import pytest

from acx4book.teaching import flights
from acx4book.teaching.sheets.every import SHEETS


def bytes_of(flight):
    return flight.toml + "".join(table.to_csv() for table in flight.tables.values())


@pytest.mark.parametrize("name", SHEETS)
def test_a_student_has_one_flight_and_another_student_another(name, key):
    ada, again, bob = (
        flights.flight_of(SHEETS[name], student, key) for student in ("Ada", " ADA", "Bob")
    )
    assert bytes_of(ada).replace("ADA", "Ada") == bytes_of(again).replace("ADA", "Ada")
    assert ada.truth == again.truth
    assert ada.truth["cameras"] != bob.truth["cameras"]
    assert not ada.tables["calibration/trajectory.csv"].equals(
        bob.tables["calibration/trajectory.csv"]
    )


def test_all_drawn_parameters_differ_by_more_than_a_flight_can_tell():
    cameras = [flights.drawn_camera(seed) for seed in range(200)]
    for name in ("f_mm", "xp_mm", "yp_mm", "k1", "p1", "p2"):
        drawn = np.array([getattr(camera, name) for camera in cameras])
        assert len(np.unique(drawn)) > 190
        assert (np.sign(drawn - np.mean(drawn)) > 0).mean() == pytest.approx(0.5, abs=0.15)
    levers = np.abs([camera.lever_m for camera in cameras])
    assert np.all(np.diff(levers, axis=1) > 0.1)  # so that swapped axes are seen


def test_the_errors_do_not_depend_on_the_truth():
    """A seed that became known would not tell the other."""
    one, two = (
        flights.fly(5, "x", flights.drawn_camera(seed), flights.WHOLE[:1]) for seed in (1, 2)
    )
    same = "calibration/trajectory.csv"
    assert one.tables[same].equals(two.tables[same])
