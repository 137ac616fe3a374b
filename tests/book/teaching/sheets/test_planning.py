import csv

import pytest

from acx4book.notebooks import simulated
from acx4book.teaching import flights, handed_in
from acx4book.teaching.grading import graded
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.calibration.mounting import single_step
from acx4sim.plan import Options
from acx4tools.planning import choosing
from acx4tools.planning import plan as plans


def test_a_student_who_plans_flies_and_adjusts_has_all_points(key, tmp_path, solved, handed):
    """With nothing but the files of the folder, by the same steps as the commands."""
    sheet, folder = SHEETS["lab-9"], tmp_path / "lab"
    folder.mkdir()
    handed_in.write(sheet, "Ada", key, folder)
    assert {p.name for p in folder.iterdir()} == {
        "README.md", "answers.csv", "plan.toml", "target.toml",
    }  # fmt: skip
    plan = plans.read(folder / "plan.toml")
    found = choosing.choose(choosing.of(choosing.read(folder / "target.toml", plan)))
    seed = int((folder / "README.md").read_text("utf-8").partition("--seed ")[2].split("`")[0])
    flown = simulated.simulate(found.plan, seed=seed, options=Options())
    case = flights.case_of(flown)
    estimates = single_step(case.block, free=case.flight.estimate_mounting).calibration
    _, right = solved("lab-9", "Ada")
    value = estimates.cameras[0].interior.f
    assert right["f_mm"].value == pytest.approx(value, abs=1e-9)
    answers = handed("lab-9", right, strips=len(found.strips), minutes=found.minutes)
    verdicts = graded(sheet, solved("lab-9", "Ada")[0], answers)
    assert sum(v.points for v in verdicts) == sum(v.of for v in verdicts) == 9
    with (folder / "answers.csv").open() as file:
        assert [row["question"] for row in csv.DictReader(file)] == [*right]


def test_a_target_needs_a_choice_and_fits_its_budget(solved):
    case, right = solved("lab-9", "Ada")
    assert 2 <= right["strips"].value < 6
    assert right["minutes"].value < case.truth["lab_target"]["minutes"]
    assert len({*case.block.images.strips}) == right["strips"].value


def test_strips_that_nobody_needs_are_named(solved, handed):
    case, right = solved("lab-9", "Ada")
    mistake = next(m for m in SHEETS["lab-9"].mistakes(case, right) if "all strips" in m.says)
    verdicts = graded(SHEETS["lab-9"], case, handed("lab-9", right, **mistake.gives))
    said = {v.question.name: v.says for v in verdicts if v.says}
    assert {"strips", "minutes"} <= {*said}
    assert all("leave out what the target does not need" in one for one in said.values())
