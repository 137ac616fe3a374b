"""`acx4 export` as its user meets it: files, lines and statuses."""

import shutil

import pytest

from acx4lib.results import provenance
from acx4tools.exchange.outward.kinds import KINDS
from support.run_results import estimated, leave_calibration


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
    assert len(names) >= 3  # at least one file, export.md, the mark
    for name in names:
        assert (outs[0] / name).read_bytes() == (outs[1] / name).read_bytes()


def test_what_is_written_says_which_flight_it_is_of(acx4, rig, tmp_path):
    acx4("export", rig, "--to", "toml", "--out", tmp_path / "out")
    text = (tmp_path / "out" / "export.md").read_text()
    digest = provenance.read(rig).digest
    assert f"Calibrated on the flight 'small'; SHA-256 of its tables {digest}.\n" in text


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


def test_angles_of_a_rig_are_written_where_its_lenses_cannot_be(acx4, rig, tmp_path):
    out = tmp_path / "out"
    options = ("--to", "micasense", "--allow", "1e-9", "--out", out)
    status, said, wrong = acx4("export", rig, *options)
    assert (status, wrong) == (0, "")
    assert "left out: lenses: " in said
    assert "the other program's lens differs by" in (out / "export.md").read_text()
    tags = (out / "xmp_tags.txt").read_text()
    assert tags.count("Camera:RigRelatives = ") == 2
    assert "Perspective" not in tags
    assert len((out / "rig_relatives.csv").read_text().splitlines()) == 3


def test_a_later_flight_that_is_none_is_refused(acx4, rig, tmp_path):
    options = ("--to", "opk", "--orientations", "heads", "--out", tmp_path / "out")
    status, _, wrong = acx4("export", rig, *options, "--flight", tmp_path / "none")
    assert status == 2
    assert "none/flight.toml:1: file: is not there" in wrong


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--to", "nothing"], "--to nothing: must be one of toml, "),
        (["--to", "toml", "--method", "best"], "--method best: must be one of single_step, "),
        (["--to", "toml", "--method", "refined"], "no calibration of refined that can be exported"),
        (["--to", "opk"], "--to opk needs --orientations BLOCK"),
        (["--to", "toml", "--orientations", "heads"], "--to toml has no place for orientations"),
        (["--to", "toml", "--flight", "x"], "--flight needs --orientations"),
        (["--to", "opencv", "--allow", "1e-9"], "the other program's lens differs by"),
        (["--to", "pix4d"], "more than 0.05 px; --allow "),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_status_2(acx4, rig, tmp_path, options, line):
    status, said, wrong = acx4("export", rig, *options, "--out", tmp_path / "out")
    assert (status, said, len(wrong.splitlines())) == (2, "", 1)
    assert line in wrong
    assert not (tmp_path / "out").exists()
