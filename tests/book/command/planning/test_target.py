"""`acx4 plan --target`: the page's hour of flying, and what is said of targets out of reach."""

import csv
import re

import pytest

from acx4lib.planning import text
from support.helpers import ROOT

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
    flown = text.read(folder / "plan.toml")
    with (folder / "strips.csv").open() as file:
        rows = [*csv.DictReader(file)]
    assert [*dict.fromkeys(row["strip"] for row in rows)] == [*flown.blocks["calibration"].strips]
    assert float(rows[-1]["minutes"]) <= 60


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
