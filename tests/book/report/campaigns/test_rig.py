"""The rig of one flight: a table, a figure, sentences; and folders that have no heads."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.stability import turned
from acx4book.notebooks import functions, runner
from acx4book.report.campaigns import rig, written
from acx4lib.errors import FlightError
from acx4lib.results.campaigns import tables
from acx4sim.files import writer
from support.figures import drawn, panels


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of a rig of which one head turned."""
    at = tmp_path_factory.mktemp("rig")
    writer.write(turned.turning(turned.flown(1)), at / "flight")
    runner.run(at / "flight", at / "results", way=functions.Functions(), stages=("heads",))
    return at / "results"


@pytest.fixture(scope="module")
def found(folder):
    return rig.read(folder)


def test_the_turned_head_is_named(found):
    table = rig.table(tables.rigidity(found), level=0.05).set_index("Exposure")
    assert table.loc[turned.EXPOSURE, "Turned"] == "yes"
    assert table.loc[turned.EXPOSURE, "Head that turned most"] == turned.HEAD
    assert (table["Turned"] == "yes").sum() == 1
    assert table.index[-1] == "all at once"
    assert f"these exposures deviate: {turned.EXPOSURE}." in rig.verdict(found, level=0.05)
    assert rig.for_terminal(found, level=0.05)[1].startswith(f"exposure {turned.EXPOSURE} deviates")


def test_of_many_exposures_those_that_deviate_are_listed(found):
    many = pd.concat([tables.rigidity(found)] * 3)
    shown = rig.table(many, level=0.05)["Exposure"].tolist()
    assert shown == [turned.EXPOSURE, "all at once"] * 3


def test_the_turn_is_that_which_was_planted(found):
    own = turned.planted(found)
    assert own["p_joint"] < 1e-3
    assert abs(own["turn_arcsec"] - turned.ARCSEC) < 4 * own["sigma_arcsec"]


def test_dots_are_the_turns(found):
    ax = panels(drawn(rig.turns(found)))[1]
    heads = [line.get_label() for line in ax.get_legend_handles_labels()[0]]
    assert len(heads) == 3  # the first head is what others turn against
    value = np.degrees(found.turns[found.exposures.index(turned.EXPOSURE), 2, 1]) * 3600
    assert any(np.isclose(line.get_ydata(), value).any() for line in ax.lines)


def test_a_page_and_a_table_are_left(found, tmp_path):
    written.write_rigidity(found, tmp_path / "out", name="<b>", level=0.05)
    text = (tmp_path / "out" / written.PAGE).read_text(encoding="utf-8")
    assert "Rigidity of the rig" in text
    assert "&lt;b&gt;" in text
    assert (tmp_path / "out" / "rigidity.csv").is_file()


def test_a_rigid_rig_is_said_to_be(found):
    still = tuple(
        replace(test, explained=test.dof * 1.0, left=1.0 * test.redundancy) for test in found.tests
    )
    rigid = replace(found, tests=still)
    text = rig.verdict(rigid, level=1e-9)
    assert text.startswith("**The heads keep their places.**")
    assert text.endswith("No exposure by itself deviates at the joint level.")


def test_a_flight_without_heads_has_no_rig(folders):
    with pytest.raises(FlightError, match="name two or more folders to compare campaigns"):
        rig.read(folders[0])
