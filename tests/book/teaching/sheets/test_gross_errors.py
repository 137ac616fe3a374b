import pytest

from acx4book.notebooks import runner
from acx4book.notebooks.functions import way_of
from acx4book.teaching import handed_in
from acx4book.teaching.sheets import gross_errors
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.results import folder
from acx4lib.stages.mounting import calibrate


def strongest(bundle, kind):
    return max((r for r in bundle.rejected if r.kind == kind), key=lambda r: r.statistic).row


def test_what_was_planted_is_what_the_library_finds(solved):
    """The sheet can be solved: for every student the three large errors are rejected."""
    for k in range(6):
        case, right = solved("lab-5", f"Student {k}")
        block = case.block
        bundle = calibrate(case.flight).mountings["single_step"].bundle
        point = block.points[block.control.point_idx[strongest(bundle, "control_point")]]
        assert gross_errors.number(point) == right["control_point"].truth
        for kind, question in (("gnss", "gnss_exposure"), ("attitude", "attitude_exposure")):
            name = block.trajectory.exposures[strongest(bundle, kind)]
            assert gross_errors.number(name) == right[question].truth
        found = sum(rejection.kind == "image_point" for rejection in bundle.rejected)
        assert abs(found - right["rejected_points"].truth) <= 2


@pytest.mark.parametrize("student", ["Student 0", "Student 1"])
def test_a_check_point_shows_the_error_of_the_survey(student, key, solved, tmp_path):
    """As the page says: the wrong control point becomes a check point, and is compared."""
    _, right = solved("lab-5", student)
    handed_in.write(SHEETS["lab-5"], student, key, tmp_path / "flight")
    survey = tmp_path / "flight" / "control_points.csv"
    wrong = f"P{right['control_point'].truth:02.0f}"
    header, *rows = survey.read_text().splitlines()
    marked = [f"{row},{'check' if row.startswith(wrong) else ''}" for row in rows]
    survey.write_text("\n".join([f"{header},role", *marked]) + "\n")
    runner.run(tmp_path / "flight", tmp_path / "r", way=way_of(None), stages=folder.STAGES)
    found = folder.rows(folder.read(tmp_path / "r"), "check_points", "mounting/single_step")
    d = found.loc[found["point"] == wrong, ["d_east_m", "d_north_m", "d_height_m"]].to_numpy()[0]
    error = -d[abs(d).argmax()]
    assert abs(error - right["control_error_m"].truth) <= right["control_error_m"].bound
