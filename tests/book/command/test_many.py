"""`acx4 run` of many flights as its user meets it: table, statuses, what an interrupt leaves."""

import json
import re
import signal
import subprocess
import sys

import pandas as pd
import pytest

import acx4sim
from acx4book.command import runs
from support.flights import planted
from support.helpers import ROOT, hears_interrupts

COMMAND = [sys.executable, "-c", "from acx4book.command.acx4 import main; main()"]


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many")
    paths = [folder / f"flight{seed}" for seed in (1, 2, 3)]
    for seed, path in enumerate(paths, 1):
        acx4sim.write(planted.clean("single-head", "geodetic", "small", seed=seed), path)
    return paths


@pytest.fixture
def acx4(acx4):
    """Run flights; return status, lines of standard output and of standard error."""

    def run(*arguments):
        status, *said = acx4("run", *arguments)
        return status, *(text.splitlines() for text in said)

    return run


def test_flights_are_lines_of_a_table_and_the_status_is_the_largest(acx4, flights, tmp_path):
    folder = tmp_path / "all"
    given = (*flights[:2], tmp_path / "nowhere", "--results", folder, "--jobs", 2)
    status, out, err = acx4(*given)
    assert status == 2
    assert sorted(out[:2]) == ["flight1: done", "flight2: done"]
    assert out[2].split() == [
        "flight",
        "σ0²",
        "f_mm",
        "σ",
        "RMS",
        "east",
        "north",
        "height",
        "m",
        "status",
    ]
    assert [line.split()[0] for line in out[3:6]] == ["flight1", "flight2", "nowhere"]
    table = pd.read_csv(folder / runs.TABLE)
    for line, row in zip(out[3:6], table.itertuples(), strict=True):
        numbers = ["-"] * 3
        if row.status == 0:  # rounded on the screen, in full in the file
            numbers = [f"{row.sigma0_squared:.3f}", f"{row.f_mm:.4f}", f"{row.sigma_f_mm:.4f}"]
        assert line.split() == [row.flight, *numbers, "-", "-", "-", str(row.status)]
    assert len({len(line) for line in out[2:6]}) == 1
    assert out[6:] == [f"3 flights: 0 there already, 1 failed; {folder / runs.TABLE}"]
    assert err == [
        f"nowhere: {tmp_path / 'nowhere'}:1: folder: is no folder; "
        "must be the folder of a flight, with a flight.toml"
    ]
    status, out, err = acx4(*flights[:2], "--results", folder, "--jobs", 2)
    assert (status, err) == (0, [])
    assert out[-1] == f"2 flights: 2 there already, 0 failed; {folder / runs.TABLE}"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ["acx5", "--seeds", "1"],
            "--seeds: unknown flight 'acx5'; known:",
        ),
        (["no.toml", "--seeds", "1"], "no.toml:1: "),
        (["single-head", "--seeds", "3-1"], "--seeds: '3-1' names no seeds; give whole numbers"),
        (["a", "b", "--jobs", "2", "--cluster", "tcp://x:1"], "--jobs are of this computer"),
        (
            ["a", "--with-notebooks", "--cluster", "tcp://x:1"],
            "--cluster computes the numbers only",
        ),
        (["a", "a"], "'a' cannot be the one name of a flight's results; rename it"),
        (["a", "b", "--stages", "rig"], "unknown stage 'rig'; known: heads,"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_is_written(acx4, tmp_path, arguments, says):
    status, out, err = acx4(*arguments, "--results", tmp_path / "all")
    assert (status, out) == (2, [])
    assert len(err) == 1
    assert says in err[0]
    assert not (tmp_path / "all").exists()


def test_a_cluster_without_dask_is_a_sentence(acx4, flights, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    status, out, err = acx4(flights[0], "--cluster", "tcp://x:1", "--results", tmp_path / "all")
    assert (status, out) == (2, [])
    assert err[0].startswith("--cluster needs distributed, not installed here: pip install")


@pytest.mark.slow
def test_the_page_s_code_reads_the_tables(acx4, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    status, out, _ = acx4("single-head", "--seeds", "1-2", "--results", "monte_carlo", "--jobs", 1)
    assert (status, out[:2]) == (0, ["single-head-1: done", "single-head-2: done"])
    page = (ROOT / "book" / "many-flights.md").read_text(encoding="utf-8")
    namespace = {}
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(code, namespace)
    printed = capsys.readouterr().out.splitlines()
    focal = pd.read_csv("monte_carlo/flights.csv")["f_mm"]
    assert printed[0].split()[:2] == ["f_mm", str(focal.std())]
    assert namespace["two_step"].groupby("parameter").size()["lever_z_m"] == 2
    truth = json.loads((tmp_path / "monte_carlo/simulated/single-head-1.truth.json").read_text())
    assert focal.to_numpy() == pytest.approx(truth["cameras"]["CAM"]["f_mm"], abs=0.008)  # 5 sigma


@pytest.mark.slow
def test_an_interrupt_leaves_whole_what_is_finished(acx4, flights, tmp_path):
    folder = tmp_path / "all"
    command = [*COMMAND, "run", *flights, "--results", folder, "--jobs", "1"]
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **{**how, "preexec_fn": hears_interrupts}) as run:
        run.stdout.readline()  # the next flight may begin before this is told
        run.send_signal(signal.SIGINT)
        run.wait(timeout=120)
    assert run.returncode == 130
    assert pd.read_csv(folder / runs.TABLE)["flight"].tolist() == ["flight1"]
    status, said, err = acx4(*flights, "--results", folder, "--jobs", "1")
    assert (status, err) == (0, [])
    assert "there already, 0 failed" in said[-1]
