"""Checksums of files that a command wrote."""

import pytest

from acx4lib.results.own_folder import marks


def test_a_file_that_the_system_cannot_read_is_named(tmp_path):
    """Linux gives an input or output error for the memory of a process, as for a damaged disk."""
    path = tmp_path / "covariance.csv"
    path.symlink_to("/proc/self/mem")
    with pytest.raises(OSError, match="Input/output error") as raised:
        marks.written(path)
    assert raised.value.filename == str(path)
