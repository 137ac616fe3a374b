"""`acx4 import --help` lists the kinds by what they bring; their options are the readers'."""

import inspect
from importlib import import_module

import pytest

from acx4book.command.exchange import blocks, projects
from acx4book.command.exchange.importing import TITLES, app


def test_every_kind_has_its_place_in_the_help(acx4):
    status, said, _ = acx4("import", "--help")
    assert status == 0
    assert "Others" not in said
    for command in app.registered_commands:
        assert f"\n  {command.name} " in said
    assert f"{TITLES['trajectories']}:\n  sbet " in said


@pytest.mark.parametrize(
    ("command", "reader"),
    [
        (projects.metashape, "metashape.read"),
        (projects.colmap, "colmap.read"),
        (projects.opf, "opf.read"),
        (blocks.opensfm, "opensfm.read"),
        (blocks.micmac, "micmac.read"),
        (blocks.bundler, "bundler.read"),
        (blocks.bingo, "photo_lists.read_bingo"),
        (blocks.patb, "photo_lists.read_patb"),
        (blocks.odm_control, "odm.read"),
    ],
)
def test_options_are_those_of_the_reader(command, reader):
    """But for the heights, which only a flight that was begun can say."""
    module, _, name = reader.partition(".")
    read = getattr(import_module(f"acx4tools.exchange.programs.{module}"), name)
    taken, options = (
        {name: one.default for name, one in inspect.signature(function).parameters.items()}
        for function in (read, command)
    )
    taken.pop("heights", None)
    options.pop("out")
    assert options == taken
