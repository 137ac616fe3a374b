"""What tests of the command share."""

import pytest

from acx4book.command.acx4 import main


@pytest.fixture
def acx4(capsys):
    """Run the command; return status, standard output and standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return end.value.code, captured.out, captured.err

    return run
