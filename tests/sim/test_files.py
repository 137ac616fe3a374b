"""Written flights: the same bytes, whole or not at all, the truth beside them."""

import json
from dataclasses import replace

import pandas as pd
import pytest

import acx4sim
from acx4sim import optics


def all_bytes(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.mark.parametrize("name", acx4sim.DESIGNS)
def test_same_seed_gives_the_same_bytes(name, tmp_path):
    for folder in ("a", "b"):
        acx4sim.write(acx4sim.DESIGNS[name](seed=7), tmp_path / folder / "flight")
    assert all_bytes(tmp_path / "a") == all_bytes(tmp_path / "b")
    acx4sim.write(acx4sim.DESIGNS[name](seed=8), tmp_path / "c" / "flight")
    a, c = all_bytes(tmp_path / "a"), all_bytes(tmp_path / "c")
    differing = {name for name in a if a[name] != c[name]}
    assert all(name in differing for name in a if "image_points" in name or "trajectory" in name)


def test_truth_lies_beside_the_flight_and_never_inside(flight, tmp_path):
    acx4sim.write(flight, tmp_path / "my_flight")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["my_flight", "my_flight.truth.json"]
    assert not [path for path in all_bytes(tmp_path / "my_flight") if "truth" in path]
    truth = json.loads((tmp_path / "my_flight.truth.json").read_text())
    assert truth["seed"] == 1
    assert truth["cameras"]["SYN"]["lever_y_m"] == -0.399
    assert tuple(truth["heads_in_synthetic_frame"]["CAM2"].values()) == (
        optics.HEADS["CAM2"].boresight_deg
    )
    assert truth["rendered_boresight"]["boresight_phi_deg"] == -1.6
    assert len(truth["exposures"]["validation"]) == 268
    assert len(truth["control_points"]) == 56 + 36


def test_tables_read_back_as_they_were(flight, tmp_path):
    acx4sim.write(flight, tmp_path / "f")
    for path, table in flight.tables.items():
        back = pd.read_csv(tmp_path / "f" / path, dtype={"strip": str})
        pd.testing.assert_frame_equal(back, table, check_dtype=False, check_exact=True)


@pytest.mark.parametrize("content", ["file", "folder"])
def test_an_existing_flight_is_not_touched(flight, tmp_path, content):
    target = tmp_path / "f"
    if content == "file":
        target.write_text("mine")
    else:
        target.mkdir()
        (target / "mine.txt").write_text("mine")
    before = all_bytes(tmp_path)
    with pytest.raises(FileExistsError, match="exists already and is not an empty folder"):
        acx4sim.write(flight, target)
    assert all_bytes(tmp_path) == before


def test_an_empty_folder_is_filled(flight, tmp_path):
    (tmp_path / "f").mkdir()
    acx4sim.write(flight, tmp_path / "f")
    assert (tmp_path / "f" / "flight.toml").exists()


def test_a_failure_while_writing_leaves_nothing(flight, tmp_path):
    broken = replace(flight, truth={"not JSON": object()})
    with pytest.raises(TypeError):
        acx4sim.write(broken, tmp_path / "f")
    assert list(tmp_path.iterdir()) == []
