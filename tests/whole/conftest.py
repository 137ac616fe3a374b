"""What tests of all commands share."""

import pytest

from support import commands, every_command


@pytest.fixture(scope="session")
def material(tmp_path_factory):
    """A folder with flights, results and files of other programs; nobody writes into it."""
    return every_command.material(tmp_path_factory.mktemp("given"))


@pytest.fixture(scope="module")
def command():
    """A function that runs a command in a folder: its status, and its standard error."""
    with commands.commands() as run:
        yield run
