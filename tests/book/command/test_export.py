"""Commands that write a new flight, results for others, and what is taught."""

import csv
import io
import shutil

import pytest

from acx4files.exchange.outward.programs import KINDS
from support.run_results import estimated, leave_calibration

# --- `acx4 export` as its user meets it: files, lines and statuses ---------------------------


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    at = tmp_path_factory.mktemp("rig")
    return leave_calibration(at, estimated("LEFT", "RIGHT"), method="rig")


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_is_written_said_and_the_same_again(acx4, rig, tmp_path, kind):
    options = ["--orientations", "heads"] if KINDS[kind].oriented else []
    options += ["--allow", "1"]  # some have no place for b1
    outs = [tmp_path / "a", tmp_path / "b"]
    for out in outs:
        status, said, wrong = acx4("export", rig, "--to", kind, "--out", out, *options)
        assert (status, wrong) == (0, "")
    assert said.startswith(f"{kind}: LEFT, RIGHT by rig\n")
    assert said.rstrip().endswith(", export.md")
    names = sorted(p.relative_to(outs[0]) for p in outs[0].rglob("*") if p.is_file())
    assert len(names) >= 2  # at least one file, and export.md
    for name in names:
        assert (outs[0] / name).read_bytes() == (outs[1] / name).read_bytes()


def test_images_of_a_later_flight_are_oriented_by_it(acx4, rig, tmp_path):
    """Of which nothing is measured, and where there is no control."""
    later = tmp_path / "later"
    shutil.copytree(rig.parent / "flight", later)
    (later / "control_points.csv").unlink()
    for block in ("heads", "calibration"):
        (later / block / "image_points.csv").unlink()
    options = ("--to", "opk", "--orientations", "heads", "--out", tmp_path / "out")
    assert acx4("export", rig, *options, "--flight", later)[0] == 0
    lines = (tmp_path / "out/orientations.csv").read_text().splitlines()
    assert len(lines) == 1 + 12  # six exposures of two heads
    acx4("export", rig, *options[:-1], tmp_path / "own")
    own = (tmp_path / "own/orientations.csv").read_text().splitlines()
    assert own == lines  # its trajectory is that of the calibration


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--to", "nothing"], "--to nothing: must be one of toml, "),
        (["--to", "toml", "--method", "best"], "--method best: must be one of single_step, "),
        (["--to", "opk"], "--to opk needs --orientations BLOCK"),
        (["--to", "toml", "--orientations", "heads"], "--to toml has no place for orientations"),
        (["--to", "toml", "--flight", "x"], "--flight needs --orientations"),
        (["--to", "opencv", "--allow", "1e-9"], "the other program's lens differs by"),
        (["--to", "opk", "--orientations", "heads", "--flight", "x"], "x/flight.toml:1: file: is"),
        (["--to=opf"], "opf is gone; instead: acx4 export --to colmap, metashape or opencv"),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_status_2(acx4, rig, tmp_path, options, line):
    status, said, wrong = acx4("export", rig, *options, "--out", tmp_path / "out")
    assert (status, said, len(wrong.splitlines())) == (2, "", 1)
    assert line in wrong
    assert not (tmp_path / "out").exists()


# --- `acx4 new` as its user meets it ---------------------------------------------------------


def test_options_answer_all_questions(acx4, tmp_path):
    options = ("--cameras", "RGB", "--crs", "EPSG:31982", "--heights", "-25.5")
    status, said, wrong = acx4("new", tmp_path / "f", *options)
    assert (status, wrong) == (0, "")
    assert "still to do: " in said
    assert "cameras.RGB.width_px: missing; required" in said
    assert "heights = -25.5" in (tmp_path / "f" / "flight.toml").read_text()
    status, _, wrong = acx4("new", tmp_path / "f", *options)
    assert status == 2
    assert wrong.endswith("choose a new or empty folder\n")


def test_what_is_not_answered_is_asked_on_a_terminal_only(acx4, tmp_path, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    status, _, wrong = acx4("new", tmp_path / "f", "--crs", "EPSG:31982")
    assert status == 2
    assert wrong == "--cameras, --heights: missing; on a terminal the command asks for them\n"
    monkeypatch.setattr("sys.stdin", Terminal("A, B\n\n"))
    status, _, wrong = acx4("new", tmp_path / "f", "--crs", "EPSG:31982")
    assert status == 0
    assert "Names of the cameras" in wrong
    assert 'heads = ["A", "B"]' in (tmp_path / "f" / "flight.toml").read_text()


@pytest.mark.parametrize(
    ("cameras", "crs", "heights", "says"),
    [
        ("=A", "EPSG:31982", "ellipsoidal", "would be computed as a formula"),
        ("A,A", "EPSG:31982", "ellipsoidal", "must be names that are all different"),
        ("A", "EPSG:31982", "5773", "--heights: 5773: must be at most 200 m either way"),
        ("A", "EPSG:4326", "ellipsoidal", "'EPSG:4326' (WGS 84) is not a projected CRS; must be"),
        ("A", "EPSG:2225", "ellipsoidal", "in US survey foot, not in metres"),
        ("A", "my own", "ellipsoidal", "is neither an authority code, nor WKT"),
    ],
)
def test_what_no_flight_may_have_is_refused_at_once(acx4, tmp_path, cameras, crs, heights, says):
    options = ("--cameras", cameras, "--crs", crs, "--heights", heights)
    status, _, wrong = acx4("new", tmp_path / "f", *options)
    assert (status, says in wrong, wrong.count("\n")) == (2, True, 1)
    assert not (tmp_path / "f").exists()


def test_a_geoid_grid_is_brought_into_the_flight(acx4, tmp_path):
    (tmp_path / "geoid.gtx").write_bytes(b"grid")
    options = ("--cameras", "A", "--crs", "EPSG:31982", "--heights", tmp_path / "geoid.gtx")
    status, said, _ = acx4("new", tmp_path / "f", *options)
    assert status == 0
    assert 'heights = "geoid.gtx"' in (tmp_path / "f" / "flight.toml").read_text()
    assert (tmp_path / "f" / "geoid.gtx").read_bytes() == b"grid"
    assert "PROJ cannot read it as a geoid grid" in said


# --- the commands `acx4 lab` and `acx4 grade`, as a lecturer meets them ----------------------


@pytest.fixture
def with_key(acx4, tmp_path, monkeypatch):
    """Run the command in a folder with a key; return status, standard output and error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "key.txt").write_text("ab" * 32)
    return acx4


def test_from_a_students_flight_to_marks(with_key, tmp_path):
    lab = ("lab", "1", "--student", "Ada Lovelace", "--key", "key.txt")
    assert with_key(*lab) == (0, "lab-1-ada-lovelace\n", "")
    folder = tmp_path / "lab-1-ada-lovelace"
    assert with_key("check", str(folder))[0] == 0
    assert with_key(*lab, "--out", "again")[0] == 0
    for path in folder.rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "again" / path.relative_to(folder)).read_bytes()
    status, out, err = with_key("grade", str(folder), "--key", "key.txt", "--out", "marks.csv")
    assert (status, err) == (0, "")
    assert out.startswith("Ada Lovelace  lab-1  0 of 7\n    x_mm: not answered\n")
    with (tmp_path / "marks.csv").open() as file:
        assert {row["verdict"] for row in csv.DictReader(file)} == {"not answered"}
    again = with_key("grade", str(folder), "--key", "key.txt", "--out", "marks.csv")
    assert again[0] == 0  # its own table is replaced


def test_a_quiz_is_two_question_banks_and_no_flight(with_key, tmp_path):
    lab = ("lab", "2", "--student", "Ada", "--key", "key.txt", "--quiz")
    assert with_key(*lab) == (0, "quiz-2-ada\n", "")
    files = {path.name for path in (tmp_path / "quiz-2-ada").iterdir()}
    assert files == {"questions.gift"}
    assert with_key(*lab)[0] == 2  # it is there already


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("lab", "99", "--student", "Ada", "--key", "key.txt"), "unknown sheet '99'; known: lab-1"),
        (("lab", "1", "--student", " ", "--key", "key.txt"), "is empty; must be a name"),
        (("lab", "1", "--student", "=1+1", "--key", "key.txt"), "formula"),
        (("lab", "1", "--student", "Ada", "--key", "none.txt"), "token_hex"),
        (("lab", "1", "--student", "Ada", "--key", "key.txt", "--out", "."), "already"),
        (("grade", "nothing", "--key", "key.txt"), "not graded"),
        (("grade", ".", "--key", "key.txt"), "no answers.csv and no results"),
        (("grade", "key.txt", "--key", "key.txt", "--out", "key.txt"), "choose another name"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(with_key, arguments, says):
    status, _, err = with_key(*arguments)
    assert status == 2
    assert says in err
