"""What make does with the names that it is given, and what it removes."""

import shutil
import subprocess

import pytest

from acx4lib.results.own_folder import mark_all
from support.helpers import ROOT

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")


@pytest.fixture
def copy(tmp_path):
    """A folder with the Makefile and what its `clean` needs; no environment."""
    folder = tmp_path / "clone"
    (folder / "src").mkdir(parents=True)
    shutil.copy(ROOT / "Makefile", folder)
    cache = shutil.ignore_patterns("__pycache__")
    for house in ("acx4lib", "acx4tools", "acx4sim"):
        shutil.copytree(ROOT / "src" / house, folder / "src" / house, ignore=cache)
    return folder


def make(folder, *arguments, **environment):
    return subprocess.run(
        ["make", "-C", folder, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": "/usr/local/bin:/usr/bin:/bin", **environment},
    )


@pytest.mark.parametrize(
    "name",
    [
        *("$(shell>PWNED)", "${shell>PWNED}", "`>PWNED`", "$(>PWNED)", "a;>PWNED", "a|b", "a&b"),
        *("x';>PWNED;'", '";>PWNED;"', "a:b", "a=b", "a%b", "a#b", "a\\b", "a*", "a b", "a\nb"),
        "$(shell touch PWNED)",
    ],
)
def test_the_name_of_a_flight_runs_nothing(copy, name):
    for done in (
        make(copy, "-n", "notebooks", f"FLIGHT={name}"),
        make(copy, "notebooks", FLIGHT=name),
    ):
        assert done.returncode == 2
        assert "make takes no folder with" in done.stderr
    assert not list(copy.parent.rglob("PWNED"))


SPOILT = ("8000; >PWNED", "$(shell >PWNED)", "'; >PWNED; '", "`>PWNED`", "1\n>PWNED")


@pytest.mark.parametrize("value", [*SPOILT, "8000 --bind 0.0.0.0", "-1", "1e3", " ", ""])
@pytest.mark.parametrize("name", ["PORT", "N", "SEED", "REDUCE"])
def test_a_number_runs_nothing(copy, name, value):
    for done in (make(copy, "serve", f"{name}={value}"), make(copy, "serve", **{name: value})):
        assert done.returncode == 2
        assert "must be a whole number" in done.stderr
    assert not list(copy.parent.rglob("PWNED"))


@pytest.mark.parametrize(
    ("name", "value"),
    [("IMAGES", value) for value in (*SPOILT, "A B")] + [("PYTHON", "x' --version; >PWNED; '")],
)
def test_exposures_and_a_program_run_nothing_else(copy, name, value):
    for done in (make(copy, "help", f"{name}={value}"), make(copy, "help", **{name: value})):
        assert done.returncode == 2
        assert f"{name}=" in done.stderr
    assert not list(copy.parent.rglob("PWNED"))


def test_numbers_and_exposures_reach_their_commands(copy):
    done = make(copy, "-n", "-o", ".venv/.stamp", "serve", "PORT=8123")
    assert "--directory book/_build/html 8123\n" in done.stdout
    given = ("IMAGES=H1-05,C2-05", "REDUCE=8")
    done = make(copy, "-n", "-o", ".venv/.stamp", "data/flights/acx4/flight.toml", *given)
    assert "--images 'H1-05,C2-05' --reduce '8'" in done.stdout


@pytest.mark.parametrize("name", ["flights/mine", "/tmp/Flug-1_ü+2,3", "--help"])
def test_other_names_reach_the_command_as_they_are(copy, name):
    done = make(copy, "-n", "-o", ".venv/.stamp", "notebooks", f"FLIGHT={name}")
    assert done.returncode == 0, done.stderr
    assert '-- "$FLIGHT"' in done.stdout


def test_a_file_of_the_flight_runs_nothing(copy):
    (copy / "mine" / "heads").mkdir(parents=True)
    for name in ("a;touch PWNED;.csv", "b: PWNED.csv", "$(shell touch PWNED).csv", "c=d.csv"):
        (copy / "mine" / "heads" / name).write_text("")
    done = make(copy, "-n", "-o", ".venv/.stamp", "notebooks", "FLIGHT=mine")
    assert done.returncode == 0, done.stderr
    assert "PWNED" not in done.stdout
    assert not list(copy.parent.rglob("PWNED"))


def test_the_ideal_flight_is_run_beside_the_one_that_ships_and_beside_no_other(copy):
    quick = ("-n", "-o", ".venv/.stamp", "book")
    both, other = make(copy, *quick).stdout, make(copy, *quick, "FLIGHT=mine").stdout
    results = "build/results/data-flights-acx4-ideal"
    assert "simulate acx4 --out data/flights/acx4 --images" in both
    assert "simulate acx4-ideal --out data/flights/acx4-ideal \n" in both
    assert f"--results '{results}' --stages mounting,validation -- data/flights/acx4-ideal" in both
    assert f"'build/results/data-flights-acx4' book {results}" in both
    assert "acx4-ideal" not in other
    alone = make(copy, *quick, "FLIGHT=data/flights/acx4-ideal").stdout
    assert f"--results '{results}' -- \"$FLIGHT\"" in alone
    assert f"book --strict --out 'build/books/data-flights-acx4-ideal' -- '{results}'" in alone


def test_clean_removes_what_was_made_and_nothing_else(copy):
    mine = {
        *("data/flights/mine/flight.toml", "data/flights/acx4/my notes", "build/results/mine/x"),
        "build/results/other/my notes",
    }
    made = {
        *("data/flights/acx4/flight.toml", "data/flights/acx4/heads/images.csv"),
        "data/flights/acx4-ideal/flight.toml",
        *("build/results/other/parameters.csv", "book/_build/html/index.html", "build/stamps/x"),
    }
    for name in made:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text(name)
    for name in ("acx4", "acx4-ideal"):
        mark_all(copy / f"data/flights/{name}", "acx4 simulate")
        truth = copy / f"data/flights/{name}.truth.json"
        truth.write_text('{"made_by": "acx4 simulate"}')
    (copy / "book/_build/.made-by-make").write_text("")
    mark_all(copy / "build/results/other", "acx4 run")
    for name in mine:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text(name)
    done = make(copy, "clean")
    assert done.returncode == 0, done.stderr
    left = {
        str(path.relative_to(copy))
        for top in ("data", "build", "book")
        for path in (copy / top).rglob("*")
        if path.is_file()
    }
    assert left == mine
    assert "build/results/mine: bears no mark of acx4" in done.stderr


def test_clean_leaves_a_book_that_it_did_not_make_and_a_flight_that_was_changed(copy):
    (copy / "data/flights/acx4").mkdir(parents=True)
    (copy / "data/flights/acx4/flight.toml").write_text("name = 'made'")
    mark_all(copy / "data/flights/acx4", "acx4 simulate")
    (copy / "data/flights/acx4/flight.toml").write_text("name = 'mine'")
    assert "flight.toml: was changed since" in make(copy, "clean").stderr
    assert (copy / "data/flights/acx4/flight.toml").read_text() == "name = 'mine'"
    (copy / "book/_generated").mkdir(parents=True)
    done = make(copy, "clean")
    assert done.returncode == 2
    assert "book/_generated: was not made by make; move it away" in done.stderr
    assert (copy / "book/_generated").is_dir()
