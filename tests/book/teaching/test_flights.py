import hashlib
import hmac

import numpy as np
import pytest

from acx4book.teaching import flights
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.errors import FlightError

KEY = bytes(range(32))


def test_a_seed_is_the_hmac_of_purpose_sheet_and_name():
    """RFC 2104 written out: two hashes with padded keys."""
    padded = KEY.ljust(64, b"\0")
    inner = bytes(b ^ 0x36 for b in padded) + "truth\0lab-6\0zoë".encode()
    outer = bytes(b ^ 0x5C for b in padded) + hashlib.sha256(inner).digest()
    expected = int.from_bytes(hashlib.sha256(outer).digest(), "big")
    assert flights.seed(KEY, sheet="lab-6", student="Zoë", purpose="truth") == expected
    assert hmac.new(KEY, inner[64:], "sha256").digest() == expected.to_bytes(32, "big")


@pytest.mark.parametrize("spelling", ["Zoë Ng", "  zoë   NG ", "Zoe\u0308 Ng", "Zoë\u00a0Ng"])
def test_spellings_of_one_name_have_one_seed(spelling):
    one = flights.seed(KEY, sheet="lab-1", student="Zoë Ng", purpose="truth")
    assert flights.seed(KEY, sheet="lab-1", student=spelling, purpose="truth") == one


def test_any_other_name_sheet_key_or_purpose_has_another_seed():
    seeds = {
        flights.seed(key, sheet=sheet, student=name, purpose=purpose)
        for key in (KEY, KEY[::-1])
        for sheet in ("lab-1", "lab-2")
        for name in ("Ada", "Adam", "Zoe", "Zoë")
        for purpose in ("truth", "errors")
    }
    assert len(seeds) == 2 * 2 * 4 * 2


@pytest.mark.parametrize("name", ["", "  ", "=cmd()", "a\nb\x07", "x" * 201, "\u202eadA"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="must"):
        flights.shown_name(name)


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
    assert flights.folder_name("lab-6", name) == folder
    assert len(flights.folder_name("lab-6", "é" * 200).encode()) < 255


def test_a_key_is_read_without_white_space_around_it(tmp_path):
    path = tmp_path / "key.txt"
    path.write_bytes(b" " + KEY.hex().encode() + b"\r\n")
    assert flights.read_key(path) == KEY.hex().encode()


@pytest.mark.parametrize("content", [None, b"", b"secret", b"x" * 5000])
def test_a_key_that_is_missing_short_or_long_is_refused_with_the_cure(tmp_path, content):
    path = tmp_path / "key.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FlightError, match="token_hex"):
        flights.read_key(path)


def test_the_title_of_a_flight_tells_sheet_and_student():
    assert flights.of_title(flights.title("lab-6", "A: b")) == ("lab-6", "A: b")
    with pytest.raises(ValueError, match="no flight of a lab sheet"):
        flights.of_title("my flight")


def bytes_of(flight):
    return flight.toml + "".join(table.to_csv() for table in flight.tables.values())


@pytest.mark.parametrize("name", SHEETS)
def test_a_student_has_one_flight_and_another_student_another(name, key):
    ada, again, bob = (
        flights.flight_of(SHEETS[name], student, key) for student in ("Ada", " ADA", "Bob")
    )
    assert bytes_of(ada).replace("ADA", "Ada") == bytes_of(again).replace("ADA", "Ada")
    assert ada.truth == again.truth
    assert ada.truth["cameras"] != bob.truth["cameras"]
    assert not ada.tables["calibration/trajectory.csv"].equals(
        bob.tables["calibration/trajectory.csv"]
    )


def test_all_drawn_parameters_differ_by_more_than_a_flight_can_tell():
    cameras = [flights.drawn_camera(seed) for seed in range(200)]
    for name in ("f_mm", "xp_mm", "yp_mm", "k1", "p1", "p2"):
        drawn = np.array([getattr(camera, name) for camera in cameras])
        assert len(np.unique(drawn)) > 190
        assert (np.sign(drawn - np.mean(drawn)) > 0).mean() == pytest.approx(0.5, abs=0.15)
    levers = np.abs([camera.lever_m for camera in cameras])
    assert np.all(np.diff(levers, axis=1) > 0.1)  # so that swapped axes are seen


def test_the_errors_do_not_depend_on_the_truth():
    """A seed that became known would not tell the other."""
    one, two = (
        flights.fly(5, "x", flights.drawn_camera(seed), flights.WHOLE[:1]) for seed in (1, 2)
    )
    same = "calibration/trajectory.csv"
    assert one.tables[same].equals(two.tables[same])
