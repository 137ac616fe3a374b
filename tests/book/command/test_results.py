"""`acx4 compare` as its user meets it: what it leaves, its lines and statuses."""

import pytest

from acx4book.report.campaigns.written import PAGE


@pytest.fixture
def acx4(acx4, tmp_path):
    """Compare into a folder; return status, lines of standard output and of standard error."""

    def run(*arguments):
        status, *said = acx4("compare", *arguments, "--out", tmp_path / "out")
        return status, *(text.splitlines() for text in said)

    return run


def test_two_folders_are_compared(acx4, folders, tmp_path):
    status, said, wrong = acx4(*folders)
    assert (status, wrong) == (0, [])
    assert said[0].startswith("2 campaigns are not the same: chi-square ")
    assert any(line.startswith("CAM f_mm: +0.01") for line in said)
    assert said[-1] == str(tmp_path / "out" / PAGE)
    assert (tmp_path / "out" / PAGE).is_file()
    options = ("--method", "two_step", "--against", "first", "--height", 1000, "--apriori")
    status, said, wrong = acx4(*folders, *options, "--level", 1e-6)
    assert (status, wrong) == (0, [])
    text = (tmp_path / "out" / PAGE).read_text(encoding="utf-8")
    assert "1000\N{NO-BREAK SPACE}m" in text


def test_what_cannot_be_compared_is_one_line_and_status_2(acx4, folders, tmp_path):
    status, said, wrong = acx4(folders[0], folders[0])
    assert (status, said, len(wrong)) == (2, [], 1)
    assert "are results of the same flight" in wrong[0]
    status, said, wrong = acx4(folders[0])
    assert (status, said, len(wrong)) == (2, [], 1)
    assert "without a block of several heads" in wrong[0]
    status, said, wrong = acx4(folders[0], tmp_path / "none")
    assert (status, said, len(wrong)) == (2, [], 1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--method", "best"], "--method best: must be one of single_step, rig,"),
        (["--method", "rig,rig,rig"], "--method names 3 methods for 2 folders; name one, or 2"),
        (["--against", "last"], "--against last: must be previous or first"),
    ],
)
def test_options_that_mean_nothing_are_refused(acx4, folders, options, line):
    status, said, wrong = acx4(*folders, *options)
    assert (status, said) == (2, [])
    assert wrong[0].startswith(line)
