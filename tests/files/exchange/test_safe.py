"""Files of other programs are opened safely: archives, JSON, XML, lines of text, records."""

import io
import zipfile

import numpy as np
import pytest

from acx4files.exchange import safe
from acx4files.exchange.safe import Opened, cut, lines, member, records
from acx4files.flight.problems import Range
from acx4lib.errors import FlightError


def opened(content, name="a"):
    return Opened(file=name, data=content if isinstance(content, bytes) else content.encode())


def packed(**members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return Opened(file="a.zip", data=buffer.getvalue())


# --- what is read ----------------------------------------------------------------------------


def test_text_of_every_encoding(tmp_path):
    for name, code in (("a", "utf-8"), ("b", "utf-8-sig"), ("c", "utf-16")):
        (tmp_path / name).write_bytes("é\r\nb".encode(code))
        source = safe.read(tmp_path / name)
        assert source.text() == "é\nb"
        assert safe.checksums([source]) == {name: source.sha256}
    assert safe.of_windows(opened("5°".encode("cp1252"))).text() == "5°"
    plain = opened("5°")
    assert safe.of_windows(plain) is plain


@pytest.mark.parametrize(
    ("text", "separator", "cells"),
    [
        ("a  1\t2", None, ("a", "1", "2")),
        ("'a b' \"c d\" 2", None, ("a b", "c d", "2")),
        ("a , 1,,2", ",", ("a", "1", "", "2")),
        ('"a, b", 1, "", 2', ",", ("a, b", "1", "", "2")),
        ('"a;b";1', ";", ("a;b", "1")),
        ('5", 1', ",", ('5"', "1")),
    ],
)
def test_cells_of_a_line(text, separator, cells):
    assert cut(text, separator) == cells


def test_lines_keep_their_numbers_and_comments_are_left_out():
    found = list(lines(opened("# x\r\n\r\na 1 2\rb 3 4\n"), comment="#"))
    assert [(line.number, line.cells[0]) for line in found] == [(3, "a"), (4, "b")]
    assert found[1].numbers(1, None, "x y").tolist() == [3, 4]
    assert found[1].whole_at(2, "y") == 4


JSON = '{"a": [\n {"b": 1, "c": [1, 2]},\n {"b": "x",\n  "c": [[1, 2], [3, 4]]}]}'
XML = '<a>\n <b n="2">x</b>\n <c><b n="3"> 1 2\n3 </b></c></a>'


def test_values_of_json_by_their_keys():
    root = safe.json_tree(opened(JSON))
    assert root.one("a", 0, "b").number() == 1
    assert root.one("a", 0, "c").numbers(2).tolist() == [1, 2]
    assert root.maybe("a", 2) is None
    assert [key for key, _ in root.items()] == ["a"]


def test_elements_of_xml_their_attributes_and_numbers():
    root = safe.xml_tree(opened(XML))
    assert [one.attribute("n") for one in root.each(".//b")] == ["2", "3"]
    assert root.one("c/b").numbers(3).tolist() == [1, 2, 3]
    assert root.one("b").number("n") == 2
    assert root.one("c").line == 3
    assert root.maybe("c/d") is None
    named = safe.xml_tree(opened('<x:a xmlns:x="http://u/"><x:b/></x:a>'))
    assert [one.tag for one in named] == ["http://u/ b"]


def test_records():
    assert records(opened(bytes([1, 0, 2, 0])), np.dtype("<u2")).tolist() == [1, 2]


def test_a_member_of_an_archive():
    found = member(packed(doc=b"<a/>"), "doc")
    assert (found.file, found.data) == ("a.zip/doc", b"<a/>")


# --- what is refused, with its line and place ------------------------------------------------


SMALL = Range(-1.0, 1.0)
BOMB = '<?xml version="1.0"?>\n<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><a>&c;</a>'
OUTSIDE = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'


def in_json(do, text=JSON):
    return lambda: do(safe.json_tree(opened(text)))


def in_xml(do, text):
    return lambda: do(safe.xml_tree(opened(text)))


def in_line(do):
    return lambda: do(next(lines(opened("a 1,5 inf 9"))))


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (in_json(lambda r: r.one("a", 1, "b").number()), "a:3: a.1.b: 'x'; must be a finite num"),
        (in_json(lambda r: r.one("a", 0, "d")), "a:2: a.0: 'd' is missing; required"),
        (
            in_json(lambda r: r.one("a", 0, "c").numbers(3)),
            "a:2: a.0.c: [1, 2]; must be",
        ),
        (in_json(lambda r: list(r.one("a", 0).each())), "a:2: a.0: {'b': 1, 'c': [1, 2]}; must"),
        (in_json(None, '{"a":\n'), "a:2: file: Expecting value; must be valid JSON"),
        (in_json(None, "[" * 100_000), "a:1: file: cannot be read; must be valid JSON"),
        (in_json(lambda r: r.one("a").number(), '{"a": NaN}'), "nan; must be a finite number"),
        (in_json(lambda r: r.one("a").number(), '{"a": 1e999}'), "inf; must be a finite number"),
        (in_xml(lambda r: r.one("c"), "<a>\n<b/></a>"), "a:1: a: <c> is missing; required"),
        (in_xml(lambda r: r.one("b").number(), "<a>\n<b>x</b></a>"), "a:2: b: 'x'; must be a fin"),
        (in_xml(lambda r: r.number("id"), "<a id='x'/>"), "a:1: a id: 'x'; must be a finite num"),
        (in_xml(None, BOMB), "a:2: file: <!DOCTYPE> may name entities"),
        (in_xml(None, OUTSIDE), "a:1: file: <!DOCTYPE> may name entities"),
        (in_xml(None, "<a>&b;</a>"), "a:1: file: undefined entity; must be valid XML"),
        (in_xml(None, "<a>\n<b></a>"), "a:2: file: mismatched tag; must be valid XML"),
        (in_xml(None, '<?xml version="1.0" encoding="klingon"?><a/>'), "encoding"),
        (in_line(lambda x: x.number_at(1, "east")), "a:1: east: '1,5'; must be a finite number"),
        (in_line(lambda x: x.number_at(4, "z")), "a:1: z: is missing, the line has 4 cells"),
        (in_line(lambda x: x.numbers(1, 3, "x y")), "a:1: x y: '1,5'; must be a finite number"),
        (in_line(lambda x: x.numbers(3, 4, "x", SMALL)), "x: '9'; must lie between -1 and 1"),
        (lambda: records(opened(bytes(3)), np.dtype("<u2")), "a:1: file: has 3 bytes; must be a"),
        (lambda: member(packed(other=b""), "doc"), "archive: has no member 'doc'; required"),
        (lambda: member(opened(b"PK\3\4"), "doc"), "is no ZIP archive that can be read"),
        (lambda: opened(b"a\n\xff").text(), "a:2: file: byte 0xff is not UTF-8; must be UTF-8"),
        (lambda: opened(b"a\n\nb\0").text(), "a:3: file: holds a null character; must be text"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(do, says):
    with pytest.raises(FlightError) as raised:
        do()
    (line,) = raised.value.problems
    assert says in line


def test_what_is_no_file_with_content_is_told(tmp_path):
    (tmp_path / "empty").write_bytes(b"")
    for name, says in (("b", "is not there"), ("empty", "is empty"), (".", "is no file")):
        with pytest.raises(FlightError, match=f":1: file: {says}; "):
            safe.read(tmp_path / name)
