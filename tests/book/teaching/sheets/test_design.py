from dataclasses import replace

import pytest

from acx4book.teaching import flights
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.results import tables
from acx4lib.stages.mounting import calibrate


def test_fewer_strips_are_a_flight_with_fewer_rows(key, solved):
    """As a student can do it in the files: rows of strips 1 and 2 are left, then `calibrate`."""
    flight = flights.flight_of(SHEETS["lab-8"], "Ada", key)
    images = flight.tables["calibration/images.csv"]
    kept = images[images["strip"].isin(["1", "2"])]
    points = flight.tables["calibration/image_points.csv"]
    fewer = {
        **flight.tables,
        "calibration/images.csv": kept,
        "calibration/image_points.csv": points[points["image"].isin(kept["image"])],
    }
    case = flights.case_of(replace(flight, tables=fewer))
    single = calibrate(case.flight).mountings["single_step"].calibration
    sigma = tables.parameters(single).set_index("parameter")["sigma"]
    _, right = solved("lab-8", "Ada")
    for name in ("f_mm", "lever_x_m", "lever_z_m"):
        assert right[f"sigma_one_height_{name}"].value == pytest.approx(sigma[name], rel=1e-6)


def test_the_lesson_shows_for_every_student(solved):
    """One height leaves f and z of the lever arm nearly open."""
    for k in range(4):
        _, right = solved("lab-8", f"Student {k}")
        whole, one = (right[f"sigma_{d}_f_mm"].value for d in ("all", "one_height"))
        assert one > 5 * whole
        assert right["corr_f_lever_z_one_height"].value > 0.98
