"""The stages, with notebooks of two cells on a simulated flight that has no heads."""

import shutil

import pandas as pd
import pytest

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.execute import NotebookError
from acx4files.results import folder as results
from acx4files.results import provenance
from acx4files.results.whole_files import LOCK, SCRATCH
from support.flights import written
from support.helpers import write_notebook

PARAMETERS = "flight_path = ''\nresults_path = ''\nseed = 1"
KEEP = """
import pandas
from pathlib import Path
from acx4files.results import folder, whole_files
row = ("{stage}", "{method}", "CAM", "f_mm", float(seed), 0.1, "mm", 0.0)
frame = pandas.DataFrame([row], columns=folder.COLUMNS["parameters"])
summary = {{"{stage}/{method}": {extra}}}
with whole_files.locked(Path(results_path)):
    folder.replace(results_path, ["{stage}"], tables={{"parameters": frame}}, summary=summary)
"""


@pytest.fixture(scope="session")
def flight_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("simulated") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)
    return path


def keep(stage, method, extra="{}"):
    return KEEP.format(stage=stage, method=method, extra=extra)


@pytest.fixture
def notebooks_path(tmp_path):
    folder = tmp_path / "notebooks"
    write_notebook(
        folder / "00-flight.ipynb", PARAMETERS, "import os\nassert os.path.isdir(flight_path)"
    )
    for stage, method in (("mounting", "single_step"), ("validation", "single_step")):
        write_notebook(folder / f"{runner.NOTEBOOKS[stage]}.ipynb", PARAMETERS, keep(stage, method))
    return folder


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.slow
def test_two_runs_leave_the_same_bytes_and_skipped_stages_leave_nothing(
    tmp_path, flight_path, notebooks_path
):
    told = []
    for name in ("one", "two"):
        folder = tmp_path / name / "results"
        results.replace(folder, ["heads"], tables={}, summary={"heads/bundle/OLD": {}})
        report = runner.run(
            flight_path,
            folder,
            notebooks=notebooks_path,
            tell=lambda *step: told.append(step),
        )
    one, two = contents(tmp_path / "one"), contents(tmp_path / "two")
    assert sorted(one) == sorted(
        [f"results/{name}" for name in (*results.FILES, LOCK)]
        + [f"results/{provenance.KEPT}/{name}" for name in provenance.read(folder).files]
        + [f"results/notebooks/{runner.NOTEBOOKS[s]}.ipynb" for s in (*report.ran, "flight")]
    )
    assert one == {k: v.replace(b"/two/", b"/one/") for k, v in two.items()}
    assert report.ran == ("mounting", "validation")
    assert report.skipped == (
        "heads: skipped, the flight has no block heads",
        "synthetic: skipped, the flight has no block heads",
    )
    assert set(results.read(folder).summary) == {"mounting/single_step", "validation/single_step"}
    assert [stage for stage, done, total in told if done == total] == 2 * [
        "flight",
        "mounting",
        "validation",
    ]


@pytest.mark.slow
def test_a_failing_notebook_leaves_the_stages_before_it_and_is_kept_until_it_succeeds(
    tmp_path, flight_path, notebooks_path
):
    folder = tmp_path / "results"
    mounting = notebooks_path / "03-mounting-calibration.ipynb"
    undetermined = {"not_determined": ["mounting/single_step: CAM: lever_z_m: not determined"]}
    write_notebook(mounting, PARAMETERS, keep("mounting", "single_step", undetermined))
    runner.run(flight_path, folder, notebooks=notebooks_path)
    before = contents(folder)
    name = "04-validation.ipynb"
    good = (notebooks_path / name).read_bytes()
    write_notebook(notebooks_path / name, PARAMETERS, "1 / 0", keep("validation", "two_step"))
    with pytest.raises(NotebookError) as caught:
        runner.run(flight_path, folder, notebooks=notebooks_path)
    assert (
        str(caught.value) == "notebook 04-validation, cell 2: ZeroDivisionError: division by zero"
    )
    assert caught.value.__notes__ == undetermined["not_determined"]
    after = contents(folder)
    assert b"division by zero" in after.pop(f"failed/{name}")
    del before[f"notebooks/{name}"]
    assert {*after} == {*before}
    assert {*results.read(folder).summary} == {"mounting/single_step"}
    (notebooks_path / name).write_bytes(good)
    report = runner.run(flight_path, folder, stages=["validation"], notebooks=notebooks_path)
    assert {*contents(folder)} == {*before, f"notebooks/{name}"}
    assert {*results.read(folder).summary} == {"mounting/single_step", "validation/single_step"}
    assert report.not_determined == ()


@pytest.mark.slow
def test_what_is_not_determined_or_left_out_is_said_after_all_stages(
    tmp_path, flight_path, notebooks_path
):
    extra = {"not_determined": ["lever_z_m"], "left_out": ["two_step needs control"]}
    mounting = notebooks_path / "03-mounting-calibration.ipynb"
    write_notebook(mounting, PARAMETERS, keep("mounting", "single_step", extra))
    validation = notebooks_path / "04-validation.ipynb"
    write_notebook(
        validation, PARAMETERS, keep("validation", "two_step", {"not_determined": ["no"]})
    )
    report = runner.run(flight_path, tmp_path / "results", notebooks=notebooks_path)
    assert report.not_determined == ("lever_z_m",)
    assert report.left_out == ("two_step needs control",)


@pytest.mark.slow
def test_a_stage_that_no_other_needs_does_not_stop_the_run(tmp_path):
    flight = tmp_path / "flight"
    acx4sim.write(acx4sim.DESIGNS["acx4-ideal"](seed=1), flight)
    folder = tmp_path / "notebooks"
    write_notebook(folder / "00-flight.ipynb", PARAMETERS, "seed")
    for stage in results.STAGES:
        write_notebook(
            folder / f"{runner.NOTEBOOKS[stage]}.ipynb", PARAMETERS, keep(stage, "method")
        )
    of_rig = keep("mounting", "rig").replace('["mounting"]', '["mounting/rig"]')
    write_notebook(folder / f"{runner.NOTEBOOKS['rig']}.ipynb", PARAMETERS, of_rig)
    failing = "from acx4lib.errors import AdjustmentError\nraise AdjustmentError('no heads')"
    write_notebook(folder / "02-synthetic-image.ipynb", PARAMETERS, failing)
    report = runner.run(flight, tmp_path / "results", notebooks=folder)
    assert report.not_determined == ("no heads",)
    found = results.read(tmp_path / "results").parameters
    assert list(found["stage"]) == ["heads", "mounting", "mounting", "validation"]
    assert list(found["method"]) == ["method", "method", "rig", "method"]


@pytest.mark.slow
@pytest.mark.parametrize("heads", [1, 2])
def test_a_rig_runs_where_a_block_of_heads_has_several(tmp_path, notebooks_path, heads):
    path = written.write_flight(tmp_path / "flight", blocks=("heads",))
    if heads == 1:
        toml = (
            (path / "flight.toml")
            .read_text()
            .replace('heads = ["LEFT", "RIGHT"]', 'heads = ["LEFT"]')
        )
        (path / "flight.toml").write_text(toml)
        for name in ("images.csv", "image_points.csv"):
            table = pd.read_csv(path / "heads" / name, dtype=str)
            table[table["image"].str.endswith("LEFT")].to_csv(path / "heads" / name, index=False)
    left_out = keep("mounting", "rig", {"left_out": ["mounting/rig: no"], "notes": ["hm"]})
    of_rig = left_out.replace('["mounting"]', '["mounting/rig"]')
    write_notebook(notebooks_path / f"{runner.NOTEBOOKS['rig']}.ipynb", PARAMETERS, of_rig)
    report = runner.run(path, tmp_path / "results", stages=["mounting"], notebooks=notebooks_path)
    no_block = "mounting: skipped, the flight has no block calibration"
    if heads == 1:
        assert report.ran == ()
        assert report.skipped == (no_block, "rig: skipped, block heads has one camera only")
    else:
        assert report.ran == ("rig",)
        assert report.skipped == (no_block,)
        assert report.left_out == ("mounting/rig: no",)
        assert report.notes[-1] == "hm"
        assert report.not_determined == ()


def test_what_a_killed_run_left_behind_is_removed(tmp_path, flight_path, notebooks_path):
    (tmp_path / "results" / f"{SCRATCH}x" / "notebooks").mkdir(parents=True)
    runner.run(flight_path, tmp_path / "results", stages=[], notebooks=notebooks_path)
    assert {path.name for path in (tmp_path / "results").iterdir()} == {
        *(*results.FILES, provenance.KEPT, "notebooks", LOCK)
    }


def test_a_validation_without_a_point_in_two_images_is_skipped(
    tmp_path, flight_path, notebooks_path
):
    alone = tmp_path / "flight"
    shutil.copytree(flight_path, alone)
    points = pd.read_csv(alone / "validation" / "image_points.csv", dtype=str)
    points.drop_duplicates("point").to_csv(alone / "validation" / "image_points.csv", index=False)
    report = runner.run(
        alone, tmp_path / "results", stages=["validation"], notebooks=notebooks_path
    )
    reason = "no check point of block validation is measured in two images"
    assert report.skipped == (f"validation: skipped, {reason}",)
