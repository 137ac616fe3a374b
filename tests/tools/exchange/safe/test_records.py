"""Binary files are read within their size."""

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.records import Cursor, records


def test_records_of_one_layout():
    found = records(Opened(file="a", data=bytes([1, 0, 2, 0])), np.dtype("<u2"))
    assert found.tolist() == [1, 2]
    with pytest.raises(FlightError, match="a:1: file: has 3 bytes; must be a multiple of 2"):
        records(Opened(file="a", data=bytes(3)), np.dtype("<u2"))


def test_values_one_after_another():
    cursor = Cursor(source=Opened(file="a", data=b"\x01\x02ab\0\x03\0\x04\0"))
    assert cursor.take("<BB", "id") == (1, 2)
    assert cursor.text("name") == "ab"
    assert cursor.array(np.dtype("<u2"), 2, "points").tolist() == [3, 4]
    assert cursor.left == 0


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (lambda c: c.take("<Q", "id"), "a:1: id: at byte 0: 8 bytes, 3 are left; must be complete"),
        (lambda c: c.array(np.dtype("<u8"), 2**60, "points"), "3 are left"),
        (lambda c: c.array(np.dtype("<u8"), -1, "points"), "must be complete"),
        (lambda c: c.text("name"), "a:1: name: text at byte 0 has no end"),
    ],
)
def test_what_is_cut_off_is_refused(do, says):
    with pytest.raises(FlightError) as raised:
        do(Cursor(source=Opened(file="a", data=b"abc")))
    assert says in str(raised.value)
