"""acx4 plan, as its user meets it."""

import csv
import json
import re
import subprocess
import sys

import pandas as pd
import pytest

from acx4lib.flight.reader import read
from acx4tools.planning import plan as plans
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


def test_help_loads_nothing_heavy_and_shows_a_strip():
    code = (
        "import contextlib, sys, acx4book.command.acx4\n"
        "with contextlib.suppress(SystemExit):\n"
        "    acx4book.command.acx4.main(['plan', '--help'])\n"
        "assert not {'numpy', 'pandas', 'rich', 'acx4sim'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "low = {flying_height_m = 600, course_deg = 0, length_m = 900," in done.stdout


def test_a_plan_is_predicted_on_the_screen_and_in_files(acx4, written, tmp_path):
    path, out = written(), tmp_path / "predicted"
    status, said, err = acx4("plan", path, "--out", out)
    assert (status, err) == (0, "")
    assert "CAM boresight_kappa_deg" in said
    table = pd.read_csv(out / "parameters.csv")
    assert set(table["method"]) == {"single_step"}
    assert table["determined"].all()
    cov = pd.read_csv(out / "covariance.csv").query("row == column")["value"] ** 0.5
    assert cov.to_numpy() == pytest.approx(table["sigma"].to_numpy())
    summary = json.loads((out / "summary.json").read_text())
    assert summary["mounting/single_step"]["n_images"] == 24
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


# --- `acx4 plan --target`: the page's hour of flying, and what is said of targets out of reach


PAGE = (ROOT / "book" / "planning.md").read_text("utf-8")


@pytest.fixture
def hour(tmp_path):
    """Write the files of the page's example, and return their paths."""
    section = PAGE.partition("**One hour of flying.**")[2]
    plan, target = re.findall(r"```toml\n(.*?)```", section, re.DOTALL)[:2]
    (tmp_path / "hour.toml").write_text(plan, encoding="utf-8")
    (tmp_path / "hour.target.toml").write_text(target, encoding="utf-8")
    return tmp_path / "hour.toml", tmp_path / "hour.target.toml"


def test_one_hour_at_one_height_says_what_will_be_known(acx4, hour, tmp_path):
    plan, target = hour
    folder = tmp_path / "choice"
    status, out, err = acx4("plan", plan, "--target", target, "--out", folder)
    assert status == 1
    assert re.match(r"1\d of 13 strips, 5\d\.\d min from first exposure to last\n", out)
    assert "CAM f_mm: no choice of strips gives 0.002; with all 13 candidates it is" in err
    assert "two flying heights" in err
    assert "CAM f_mm" in out.partition("mounting/single_step")[2]  # the prediction follows
    flown = plans.read(folder / "plan.toml")
    with (folder / "strips.csv").open() as file:
        rows = [*csv.DictReader(file)]
    assert [*dict.fromkeys(row["strip"] for row in rows)] == [*flown.blocks["calibration"].strips]
    assert float(rows[-1]["minutes"]) <= 60


@pytest.mark.repeats
def test_a_second_height_reaches_the_target_and_says_what_each_strip_buys(acx4, hour):
    plan, target = hour
    words = target.read_text("utf-8").replace("flying_height_m = 1400", "flying_height_m = [800]")
    target.write_text(words.replace("f_mm = 0.002", "f_mm = 0.003"), encoding="utf-8")
    status, out, err = acx4("plan", plan, "--target", target)
    assert (status, err) == (0, "")
    chosen = re.findall(r"(?m)^without (\S+): CAM \S+ \S+ -> \S+$", out)
    assert f"{len(chosen)} of 13 strips" in out
    assert "first" in chosen  # the only strip at the other height


def test_a_short_time_says_what_is_missed_and_what_would_be_enough(acx4, hour):
    plan, target = hour
    words = target.read_text("utf-8").replace("flying_height_m = 1400", "flying_height_m = [800]")
    words = words.replace("f_mm = 0.002", "f_mm = 0.003").replace("minutes = 60", "minutes = 6")
    target.write_text(words, encoding="utf-8")
    status, out, err = acx4("plan", plan, "--target", target)
    assert status == 1
    assert "2 of 13 strips" in out
    assert re.search(r"times the \S+ that is wanted; no better choice was found for 6 min", err)
    assert re.search(r"\d+ min reach the target: ", err)


def test_without_a_time_limit_nothing_is_chosen_for_a_target_out_of_reach(acx4, hour):
    plan, target = hour
    target.write_text("[sigma]\nf_mm = 1e-9\n", encoding="utf-8")
    status, out, err = acx4("plan", plan, "--target", target)
    assert (status, out) == (1, "")
    assert err.startswith("CAM f_mm: no choice of strips gives 1e-09; with all 1 candidates it is")


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
    status, _, err = acx4("simulate", path, "--out", tmp_path / "f", "--refraction")
    assert (status, err.count("\n")) == (2, 1)
    status, _, err = acx4("simulate", tmp_path / "none.toml", "--out", tmp_path / "f")
    assert status == 2
    assert "none.toml" in err
    assert not (tmp_path / "f").exists()
