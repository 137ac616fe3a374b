"""What a results folder says of its making."""

import hashlib
import json
import shutil

import pytest
from threadpoolctl import threadpool_limits

import acx4sim
from acx4book.notebooks import runner
from acx4files import flight
from acx4files.flight import reader
from acx4files.results import folder as results
from acx4files.results import own_folder, provenance
from acx4files.stages import mounting, validation
from acx4lib.errors import FlightError, OutputError


@pytest.fixture
def kept(tmp_path):
    """A flight with a geoid-free layout, kept in a results folder by one stage."""
    at, folder = tmp_path / "flight", tmp_path / "results"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), at)
    keep(folder, at, "mounting")
    return at, folder


def keep(folder, at, *stages, skipped=()):
    """Keep a flight for all stages, of which these are run."""
    with own_folder.claim(folder, command="acx4 run") as own:
        provenance.prepare(own, flight.read(at), results.STAGES, skipped=skipped)
        for stage in stages:
            with provenance.replaced(own, stage):
                pass


def test_the_tables_are_kept_byte_for_byte_with_their_checksums(kept):
    at, folder = kept
    said = provenance.read(folder)
    assert set(said.files) == {
        "flight.toml",
        "control_points.csv",
        *(f"calibration/{name}.csv" for name in ("images", "image_points", "trajectory")),
        *(
            f"validation/{name}.csv"
            for name in ("images", "image_points", "trajectory", "control_points")
        ),
    }
    for name, sha256 in said.files.items():
        content = (at / name).read_bytes()
        assert (folder / "flight" / name).read_bytes() == content
        assert sha256 == hashlib.sha256(content).hexdigest()


def test_a_stage_has_the_digest_of_what_it_saw_and_its_versions(kept):
    said = provenance.read(kept[1])
    lines = "".join(f"{said.files[name]}  {name}\n" for name in sorted(said.files))
    assert said.stages["mounting"]["flight"] == hashlib.sha256(lines.encode()).hexdigest()
    assert set(said.stages["mounting"]["versions"]) == {"python", *provenance.PACKAGES}


def test_a_changed_flight_changes_the_digest_but_not_that_of_older_stages(kept):
    at, folder = kept
    before = provenance.read(folder).digest
    with (at / "flight.toml").open("a") as file:
        file.write("\n# one more line\n")
    keep(folder, at, "validation")
    said = provenance.read(folder)
    assert said.digest != before
    assert said.stages["mounting"]["flight"] == before
    assert said.stages["validation"]["flight"] == said.digest
    keep(folder, at, skipped=["mounting"])
    assert set(provenance.read(folder).stages) == {"validation"}


def test_a_kept_flight_is_the_flight_without_its_pixels(tmp_path):
    at, folder = tmp_path / "flight", tmp_path / "results"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), at)
    images = (at / "calibration/images.csv").read_text().splitlines()
    (at / "calibration/one.tif").write_bytes(b"pixels")
    rows = [f"{images[0]},file", f"{images[1]},one.tif", *(f"{line}," for line in images[2:])]
    (at / "calibration/images.csv").write_text("\n".join(rows) + "\n")
    read = flight.read(at)
    keep(folder, at)
    again = flight.read_kept(folder / "flight")
    assert again.name == read.name
    assert again.notes == read.notes
    assert list(again.blocks) == list(read.blocks)
    points = [one.calibration.image_points.colrow for one in (again, read)]
    assert (points[0] == points[1]).all()
    assert read.image_files["calibration"][0] is not None
    assert again.image_files["calibration"][0] is None
    assert not list((folder / "flight").rglob("*.tif"))


def test_nothing_in_it_says_when_or_where(kept):
    text = (kept[1] / "provenance.json").read_text()
    assert str(kept[0].parent) not in text
    assert set(json.loads(text)) == {"files", "stages"}


# --- stages that write their results by themselves leave the folder as a run of all of them does


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Two flights, and the results of the first by a run."""
    at = tmp_path_factory.mktemp("flown")
    for name, seed in (("flight", 1), ("other", 2)):
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=seed), at / name)
    runner.run(at / "flight", at / "results")
    return at


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_stages_one_by_one_leave_the_bytes_of_a_run(flown, tmp_path):
    flight = reader.read(flown / "flight")
    with threadpool_limits(1, user_api="blas"):  # as in a run
        mounting.run(flight, tmp_path / "results")
        validation.run(flight, tmp_path / "results")
        assert contents(tmp_path / "results") == contents(flown / "results")
        validation.run(flight, tmp_path / "results")
    assert contents(tmp_path / "results") == contents(flown / "results")
    assert provenance.read_run(tmp_path / "results").flight.name == flight.name


def test_a_folder_of_somebody_else_is_left_as_it_is(flown, tmp_path):
    (tmp_path / "letter.txt").write_text("dear all")
    with pytest.raises(OutputError, match=r"holds what acx4 run did not write \(letter\.txt\)"):
        mounting.run(reader.read(flown / "flight"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_results_of_another_flight_are_not_left_beside_new_ones(flown, tmp_path):
    results = shutil.copytree(flown / "results", tmp_path / "results")
    before = contents(results)
    with pytest.raises(FlightError, match="the results of stage validation are of the flight"):
        mounting.run(reader.read(flown / "other"), results)
    assert contents(results) == before


def test_a_calibration_of_an_earlier_flight_is_not_set_beside_the_own(flown, tmp_path):
    other, results = reader.read(flown / "other"), tmp_path / "results"
    with threadpool_limits(1, user_api="blas"):
        validation.run(other, results, flown / "results")
    runner.run(
        flown / "other",
        tmp_path / "by_run",
        stages=["validation"],
        calibration=flown / "results",
    )
    assert contents(results) == contents(tmp_path / "by_run")
    assert "calibration" in provenance.read(results).stages["validation"]
    with pytest.raises(FlightError, match="own calibration beside a validation of an earlier"):
        mounting.run(other, results)
