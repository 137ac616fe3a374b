import hashlib
import hmac

import pytest

from acx4book.teaching import students
from acx4lib.errors import FlightError

KEY = bytes(range(32))


def test_a_seed_is_the_hmac_of_purpose_sheet_and_name():
    """RFC 2104 written out: two hashes with padded keys."""
    padded = KEY.ljust(64, b"\0")
    inner = bytes(b ^ 0x36 for b in padded) + "truth\0lab-6\0zoë".encode()
    outer = bytes(b ^ 0x5C for b in padded) + hashlib.sha256(inner).digest()
    expected = int.from_bytes(hashlib.sha256(outer).digest(), "big")
    assert students.seed(KEY, sheet="lab-6", student="Zoë", purpose="truth") == expected
    assert hmac.new(KEY, inner[64:], "sha256").digest() == expected.to_bytes(32, "big")


@pytest.mark.parametrize("spelling", ["Zoë Ng", "  zoë   NG ", "Zoe\u0308 Ng", "Zoë\u00a0Ng"])
def test_spellings_of_one_name_have_one_seed(spelling):
    one = students.seed(KEY, sheet="lab-1", student="Zoë Ng", purpose="truth")
    assert students.seed(KEY, sheet="lab-1", student=spelling, purpose="truth") == one


def test_any_other_name_sheet_key_or_purpose_has_another_seed():
    seeds = {
        students.seed(key, sheet=sheet, student=name, purpose=purpose)
        for key in (KEY, KEY[::-1])
        for sheet in ("lab-1", "lab-2")
        for name in ("Ada", "Adam", "Zoe", "Zoë")
        for purpose in ("truth", "errors")
    }
    assert len(seeds) == 2 * 2 * 4 * 2


@pytest.mark.parametrize("name", ["", "  ", "=cmd()", "a\nb\x07", "x" * 201, "\u202eadA"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="must"):
        students.shown_name(name)


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("Ada Lovelace", "lab-6-ada-lovelace"),
        ("../../etc/passwd", "lab-6-etc-passwd"),
        ("O'Neil; rm -rf $HOME", "lab-6-o-neil-rm-rf-home"),
        ("李小龙", "lab-6-李小龙"),
        ("...", "lab-6"),
    ],
)
def test_the_folder_of_a_name_is_safe(name, folder):
    assert students.folder_name("lab-6", name) == folder
    assert len(students.folder_name("lab-6", "é" * 200).encode()) < 255


def test_a_key_is_read_without_white_space_around_it(tmp_path):
    path = tmp_path / "key.txt"
    path.write_bytes(b" " + KEY.hex().encode() + b"\r\n")
    assert students.read_key(path) == KEY.hex().encode()


@pytest.mark.parametrize("content", [None, b"", b"secret", b"x" * 5000])
def test_a_key_that_is_missing_short_or_long_is_refused_with_the_cure(tmp_path, content):
    path = tmp_path / "key.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FlightError, match="token_hex"):
        students.read_key(path)


def test_the_title_of_a_flight_tells_sheet_and_student():
    assert students.of_title(students.title("lab-6", "A: b")) == ("lab-6", "A: b")
    with pytest.raises(ValueError, match="no flight of a lab sheet"):
        students.of_title("my flight")
