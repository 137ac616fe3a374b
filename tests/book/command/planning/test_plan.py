"""acx4 plan, as its user meets it."""

import json
import subprocess
import sys

import pandas as pd
import pytest

from acx4lib.planning import text
from support.flights.planned import strip, values


@pytest.fixture
def written(tmp_path):
    """Write a plan with changes, and return its path."""

    def write(**changes):
        path = tmp_path / "my_plan.toml"
        path.write_text(text.written(values(**changes)))
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
