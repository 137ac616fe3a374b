"""acx4 plan, as its user meets it."""

import json
import re

import pandas as pd
import pytest

from acx4book.planning import plan as plans
from acx4files.flight.reader import read
from support.flights.planned import strip, values
from support.helpers import ROOT


@pytest.fixture
def written(tmp_path):
    """Write a plan with changes, and return its path."""

    def write(**changes):
        path = tmp_path / "my_plan.toml"
        path.write_text(plans.written(values(**changes)))
        return path

    return write


def test_a_plan_is_predicted_on_the_screen_and_in_files(acx4, written, tmp_path):
    path, out = written(), tmp_path / "predicted"
    status, said, err = acx4("plan", path, "--out", out)
    assert (status, err) == (0, "")
    assert re.search(r"CAM +boresight_kappa_deg ", said)
    table = pd.read_csv(out / "parameters.csv")
    assert set(table["method"]) == {"single_step"}
    assert table["determined"].all()
    assert set(pd.read_csv(out / "reliability.csv")["kind"]) >= {"image_point", "gnss"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["not_determined"] == []
    assert (out / "plan.svg").read_text().startswith("<svg")
    assert (out / "plan.toml").read_bytes() == path.read_bytes()


def test_the_same_plan_gives_the_same_bytes_again_and_nothing_of_others_is_replaced(
    acx4, written, tmp_path
):
    path, out = written(), tmp_path / "predicted"
    acx4("plan", path, "--out", out)
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    assert acx4("plan", path, "--out", out)[0] == 0
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    status, _, err = acx4("plan", path, "--out", tmp_path / "mine")
    assert status == 2
    assert err.count("\n") == 1


def test_what_is_not_determined_is_named_with_its_cure_and_the_status_says_so(acx4, written):
    lonely = {"strips": {"s": strip("north")}, "tie_points": 100}
    status, said, _ = acx4("plan", written(calibration=lonely, control={"number": [0, 0]}))
    assert status == 1
    assert "it would need: " in said.partition("not determined")[2]


def test_a_mistake_is_one_line_with_file_line_and_cure(acx4, written):
    path = written()
    path.write_text(path.read_text().replace("relief_m", "releif_m"))
    status, said, err = acx4("plan", path)
    assert (status, said) == (2, "")
    line = path.read_text().splitlines().index("releif_m = 20.0") + 1
    assert err.startswith(f"{path}:{line}: field.releif_m: unknown key (did you mean 'relief_m'?)")


def test_the_pages_hour_of_flying_wants_two_heights(acx4, tmp_path):
    section = (ROOT / "book" / "planning.md").read_text("utf-8").partition("**One hour of")[2]
    text = re.search(r"```toml\n(.*?)```", section, re.DOTALL)[1]
    sigma = []
    for k, height in enumerate((1400, 800)):
        path, out = tmp_path / f"{k}.toml", tmp_path / f"{k}"
        changed = re.sub(r"(?m)^((?:south|west) = .*_height_m = )1400", rf"\g<1>{height}", text)
        path.write_text(changed, encoding="utf-8")
        acx4("plan", path, "--out", out)
        table = pd.read_csv(out / "parameters.csv").set_index("parameter")["sigma"]
        sigma.append(table[["f_mm", "lever_z_m"]])
    assert (sigma[0] > 3 * sigma[1]).all()


# --- acx4 simulate of plans, and plans of its designs


def test_a_plan_is_flown_and_its_flight_is_read(acx4, tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(plans.written(values()))
    status, said, err = acx4("simulate", path, "--out", tmp_path / "flight")
    assert (status, err) == (0, "")
    assert "flight.truth.json" in said
    flight = read(tmp_path / "flight")
    assert flight.name == "two heights"
    assert flight.notes == ()


def test_the_plan_of_a_design_is_written_once_and_can_be_read(acx4, tmp_path):
    path = tmp_path / "p.toml"
    assert acx4("simulate", "single-head", "--plan", path) == (0, f"{path}\n", "")
    assert [*plans.read(path).blocks] == ["calibration", "validation"]
    path.write_text("mine")
    status, _, err = acx4("simulate", "single-head", "--plan", path)
    assert (status, path.read_text()) == (2, "mine")
    assert err == f"{path}: is there already; choose another name\n"


def test_what_cannot_be_done_is_said_in_a_line(acx4, tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(plans.written(values()))
    status, _, err = acx4("simulate", "single-head")
    assert (status, err) == (
        2,
        "give either --out FLIGHT for a flight, or --plan FILE for its plan\n",
    )
    status, _, err = acx4("simulate", path, "--plan", tmp_path / "q.toml")
    assert status == 2
    assert err.startswith("--plan is of a design: acx4, acx4-ideal, single-head; got ")
    status, _, err = acx4("simulate", tmp_path / "none.toml", "--out", tmp_path / "f")
    assert status == 2
    assert "none.toml" in err
    assert not (tmp_path / "f").exists()
