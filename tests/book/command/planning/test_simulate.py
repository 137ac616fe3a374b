"""acx4 simulate of plans, and plans of its designs."""

from acx4lib.flight.reader import read
from acx4lib.planning import text
from support.flights.planned import values


def test_a_plan_is_flown_and_its_flight_is_read(acx4, tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(text.written(values()))
    status, said, err = acx4("simulate", path, "--out", tmp_path / "flight")
    assert (status, err) == (0, "")
    assert "flight.truth.json" in said
    flight = read(tmp_path / "flight")
    assert flight.name == "two heights"
    assert flight.notes == ()


def test_the_plan_of_a_design_is_written_once_and_can_be_read(acx4, tmp_path):
    path = tmp_path / "p.toml"
    assert acx4("simulate", "single-head", "--plan", path) == (0, f"{path}\n", "")
    assert [*text.read(path).blocks] == ["calibration", "validation"]
    path.write_text("mine")
    status, _, err = acx4("simulate", "single-head", "--plan", path)
    assert (status, path.read_text()) == (2, "mine")
    assert err == f"{path}: is there already; choose another name\n"


def test_what_cannot_be_done_is_said_in_a_line(acx4, tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(text.written(values()))
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
