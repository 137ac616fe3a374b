"""`acx4 import --help` lists the kinds by what they bring; their options are the readers'."""

import inspect
from importlib import import_module

import pytest

from acx4book.command.importing import KINDS, app


def test_every_kind_has_its_place_in_the_help(acx4):
    status, said, _ = acx4("import", "--help")
    assert status == 0
    listed = [name for names in KINDS.values() for name in names]
    assert sorted(listed) == sorted(command.name for command in app.registered_commands)
    assert all(f"\n  {name} " in said for name in listed)
    assert all(f"{title}:\n  {names[0]} " in said for title, names in KINDS.items())


@pytest.mark.parametrize(
    ("command", "reader"),
    [
        ("metashape", "metashape.read"),
        ("colmap", "colmap.read"),
        ("opf", "opf.read"),
        ("opensfm", "opensfm.read"),
        ("micmac", "micmac.read"),
        ("bundler", "bundler.read"),
        ("bingo", "photo_lists.read_bingo"),
        ("patb", "photo_lists.read_patb"),
        ("odm-control", "odm.read"),
    ],
)
def test_options_are_those_of_the_reader(command, reader):
    """But for the heights, which only a flight that was begun can say."""
    (declared,) = (one.callback for one in app.registered_commands if one.name == command)
    module, _, name = reader.partition(".")
    read = getattr(import_module(f"acx4tools.exchange.programs.{module}"), name)
    taken, options = (
        {name: one.default for name, one in inspect.signature(function).parameters.items()}
        for function in (read, declared)
    )
    taken.pop("heights", None)
    options.pop("out")
    assert options == taken
