"""A member of an archive is read in memory; bombs are refused."""

import io
import zipfile

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe.archive import member
from acx4tools.exchange.safe.opened import Opened


def packed(**members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return Opened(file="a.zip", data=buffer.getvalue())


def test_a_member_is_read():
    found = member(packed(doc=b"<a/>"), "doc")
    assert (found.file, found.data) == ("a.zip/doc", b"<a/>")


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (packed(other=b""), "a.zip:1: archive: has no member 'doc'; required"),
        (packed(doc=bytes(10_000_000)), "must have at most 200 times as many"),
        (Opened(file="a.zip", data=b"PK\3\4"), "is no ZIP archive that can be read"),
        (Opened(file="a.zip", data=packed(doc=b"abc" * 99).data[:-30]), "is no ZIP archive"),
    ],
)
def test_other_archives_are_refused(source, says):
    with pytest.raises(FlightError) as raised:
        member(source, "doc")
    assert says in str(raised.value)
