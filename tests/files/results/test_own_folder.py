"""Where commands write: what is refused, what is removed, and who is writing."""

import json
import os
import socket
import subprocess
import sys

import pytest

from acx4files.results import own_folder
from acx4files.results.own_folder import LOCK, MARK, claim, clear, verify
from acx4files.results.whole_files import SCRATCH
from acx4lib.errors import FlightError, OutputError

RUN = "acx4 run"


def fill(folder, **files):
    """Write files into a folder as a command does."""
    names = {name.replace("__", "/"): text for name, text in files.items()}
    with claim(folder, command=RUN) as own:
        own.expect(names)
        for name, text in names.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
        own.seal()


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def refused(folder, says, **arguments):
    """Expect one line, and nothing changed."""
    with (
        pytest.raises(OutputError, match=says) as caught,
        claim(folder, **{"command": RUN, **arguments}),
    ):
        pass
    assert len(str(caught.value).splitlines()) == 1
    assert str(caught.value).startswith(f"{folder}")


def test_a_new_an_empty_and_a_marked_folder_are_taken(tmp_path):
    (tmp_path / "empty").mkdir()
    for name in ("new", "empty", "deep/below"):
        fill(tmp_path / name, table="1")
        fill(tmp_path / name, table="2", other="3")
        said = json.loads((tmp_path / name / MARK).read_text())
        assert said["made_by"] == RUN
        assert set(said["files"]) == {"table", "other"}
        assert contents(tmp_path / name).keys() == {"table", "other", MARK}


def test_what_acx4_did_not_write_is_refused_and_stays(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years")
    refused(tmp_path / "mine", r"holds what acx4 run did not write \(thesis\.tex\)")
    (tmp_path / "file").write_text("x")
    refused(tmp_path / "file", "is no folder")
    fill(tmp_path / "results", table="1")
    refused(tmp_path / "results", "is a folder of acx4 run", command="acx4 render")
    (tmp_path / "link").symlink_to(tmp_path / "results")
    refused(tmp_path / "link", "is a link; name the folder itself")
    os.mkfifo(tmp_path / "pipe")
    refused(tmp_path / "pipe", "is no folder")
    assert (tmp_path / "mine" / "thesis.tex").read_text() == "years"


def test_a_file_of_the_user_in_a_marked_folder_is_neither_written_nor_removed(tmp_path):
    fill(tmp_path / "r", table="1")
    (tmp_path / "r" / "notes").write_text("mine")
    fill(tmp_path / "r", table="2")
    with (
        pytest.raises(OutputError, match=r"notes: was not written by acx4 run; move it away"),
        claim(tmp_path / "r", command=RUN) as own,
    ):
        own.expect(["notes"])
    clear(tmp_path / "r")
    assert contents(tmp_path / "r") == {"notes": b"mine"}


def test_a_place_in_above_or_at_a_flight_is_refused(tmp_path):
    flight = tmp_path / "all" / "flight"
    (flight / "heads").mkdir(parents=True)
    (flight / "flight.toml").write_text("")
    for place in (flight, flight / "results", flight / "heads" / "deep" / "results"):
        refused(place, "lies in the flight", away_from=[flight])
        refused(place, "lies in the flight")
    os.chdir(flight)
    refused(tmp_path / "all", "holds the flight", away_from=[flight])
    assert sorted(path.name for path in flight.rglob("*")) == ["flight.toml", "heads"]


def test_a_crafted_mark_names_nothing_outside(tmp_path):
    fill(tmp_path / "r", table="1")
    (tmp_path / "precious").write_text("x")
    for name in ("../precious", str(tmp_path / "precious"), "a/../../precious", ""):
        said = {"made_by": RUN, "format": 1, "files": {name: {"bytes": None, "sha256": None}}}
        (tmp_path / "r" / MARK).write_text(json.dumps(said))
        refused(tmp_path / "r", "is damaged")
        with pytest.raises(OutputError, match="is damaged"):
            clear(tmp_path / "r")
    for text in ("", "[]", "{}", '{"made_by": 1, "files": {}}', "[" * 100_000, '{"files": 1}'):
        (tmp_path / "r" / MARK).write_text(text)
        refused(tmp_path / "r", "is damaged")
    (tmp_path / "r" / MARK).write_text(json.dumps({"made_by": RUN, "format": 2, "files": {}}))
    refused(tmp_path / "r", "has format 2, not 1; it is of another version of acx4")
    assert (tmp_path / "precious").read_text() == "x"
    assert (tmp_path / "r" / "table").read_text() == "1"


def test_what_was_changed_cut_or_removed_is_named(tmp_path):
    fill(tmp_path / "r", one="1234567890", two="22", three="333", four="4")
    verify(tmp_path / "r", cure="run again")
    (tmp_path / "r" / "one").write_text("12345")
    (tmp_path / "r" / "two").write_text("23")
    (tmp_path / "r" / "three").unlink()
    with pytest.raises(FlightError) as caught:
        verify(tmp_path / "r", cure="run again")
    at = tmp_path / "r"
    assert set(caught.value.problems) == {
        f"{at}/one: was cut or changed since acx4 run wrote it, 5 of 10 bytes; run again",
        f"{at}/two: was changed since acx4 run wrote it; run again",
        f"{at}/three: is gone since acx4 run wrote it; run again",
    }
    verify(tmp_path / "r", ["four"], cure="run again")
    with pytest.raises(OutputError, match="since acx4 run wrote it"):
        clear(tmp_path / "r")
    assert (tmp_path / "r" / "four").is_file()


def test_a_second_command_gets_one_line_with_the_process_and_the_machine(tmp_path):
    with claim(tmp_path / "r", command=RUN):
        done = subprocess.run(
            [
                *(sys.executable, "-c"),
                "import sys; from acx4files.results import own_folder as claims\n"
                f"with claims.claim(sys.argv[1], command={RUN!r}): pass",
                tmp_path / "r",
            ],
            capture_output=True,
            text=True,
            check=False,
        )
        said = done.stderr.splitlines()[-1]
        assert f"process {os.getpid()} on {socket.gethostname()} is writing there" in said
        with pytest.raises(FlightError, match="is writing there; wait for it"):
            verify(tmp_path / "r", cure="")
    assert not (tmp_path / "r").exists()


def test_a_lock_that_was_left_behind_is_taken_over(tmp_path):
    """Its process was killed: the lock is there, and so is what was not finished."""
    kill = (
        "import os, signal, sys; from acx4files.results import own_folder as claims\n"
        f"with claims.claim(sys.argv[1], command={RUN!r}) as own:\n"
        "    own.expect(['table'])\n"
        "    (own.path / 'table').write_text('half')\n"
        f"    (own.path / '{SCRATCH}x').mkdir()\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", kill, tmp_path / "r"], check=False)
    assert {path.name for path in (tmp_path / "r").iterdir()} == {
        *(LOCK, MARK, "table", f"{SCRATCH}x")
    }
    fill(tmp_path / "r", table="whole")
    assert contents(tmp_path / "r").keys() == {"table", MARK}
    assert (tmp_path / "r" / "table").read_text() == "whole"


def test_a_folder_appears_whole_and_marked_or_never(tmp_path):
    with own_folder.placed(tmp_path / "a" / "flight", command="acx4 simulate") as draft:
        draft.mkdir()
        (draft / "flight.toml").write_text("x")
        draft.with_name("flight.truth.json").write_text("y")
        assert not (tmp_path / "a" / "flight").exists()
    assert contents(tmp_path / "a").keys() == {
        *("flight/flight.toml", f"flight/{MARK}", "flight.truth.json")
    }
    with (
        pytest.raises(FileNotFoundError),
        own_folder.placed(tmp_path / "b" / "flight", command="acx4 simulate") as draft,
    ):
        draft.with_name("half").joinpath("no such folder").write_text("x")
    assert not (tmp_path / "b").exists()


def test_a_single_file_is_new_or_bears_the_mark(tmp_path):
    mark = b"generator acx4"

    def says(path):
        with pytest.raises(OutputError) as caught:
            own_folder.check_file(path, mark=mark, what="a report of acx4")
        return str(caught.value).removeprefix(f"{path}: ")

    own_folder.check_file(tmp_path / "new", mark=mark, what="")
    (tmp_path / "old").write_bytes(b"... generator acx4 ...")
    own_folder.check_file(tmp_path / "old", mark=mark, what="")
    (tmp_path / "mine").write_text("mine")
    assert says(tmp_path / "mine") == "is there and is not a report of acx4; choose another name"
    assert says(tmp_path) == "is a folder, not a file"
    own_folder.check_file(tmp_path / "no" / "file", mark=mark, what="")
    (tmp_path / "link").symlink_to(tmp_path / "old")
    assert says(tmp_path / "link") == "is a link; name the file itself"
    os.mkfifo(tmp_path / "pipe")
    assert says(tmp_path / "pipe").startswith("is there and is not")
    assert says(own_folder.Path("/dev/full")).startswith("is there and is not")
    (tmp_path / "flight.toml").write_text("")
    assert says(tmp_path / "new").startswith("lies in the flight")
