"""Files are opened once, and what is no text is told by line."""

import io
import zipfile

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.opened import Opened, member


def test_text_of_either_encoding(tmp_path):
    for name, code in (("a", "utf-8"), ("b", "utf-8-sig"), ("c", "utf-16")):
        (tmp_path / name).write_bytes("é\r\nb".encode(code))
        source = opened.read(tmp_path / name)
        assert source.text() == "é\nb"
        assert opened.checksums([source]) == {name: source.sha256}


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"a\n\xff", "a.txt:2: file: byte 0xff is not UTF-8; must be UTF-8 text"),
        (b"a\n\nb\0", "a.txt:3: file: holds a null character; must be text"),
        (b"", "a.txt:1: file: is empty; must have content"),
    ],
)
def test_other_content_is_refused(tmp_path, data, says):
    (tmp_path / "a.txt").write_bytes(data)
    with pytest.raises(FlightError) as raised:
        opened.read(tmp_path / "a.txt").text()
    assert str(raised.value).endswith(says)


def test_a_missing_or_too_large_file_and_a_folder_are_refused(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"12345")
    with pytest.raises(FlightError, match="the import needs it"):
        opened.read(tmp_path / "b.txt")
    with pytest.raises(FlightError, match="must have at most 4 bytes"):
        opened.read(tmp_path / "a.txt", most=4)
    with pytest.raises(FlightError, match="Is a directory"):
        opened.read(tmp_path)


def test_text_of_windows_is_read_where_it_is_asked_for():
    source = opened.Opened(file="a", data="5°".encode("cp1252"))
    assert opened.of_windows(source).text() == "5°"
    plain = opened.Opened(file="a", data="5°".encode())
    assert opened.of_windows(plain) is plain


# --- A member of an archive is read in memory; bombs are refused


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
