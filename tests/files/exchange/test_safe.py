"""Files of strangers are opened safely: archives, JSON, XML, lines of text."""

import io
import zipfile

import numpy as np
import pytest

from acx4files.exchange import safe
from acx4files.exchange.safe import Cursor, Opened, cut, lines, member, records
from acx4files.flight.problems import Range
from acx4lib.errors import FlightError

# --- JSON becomes a tree whose nodes know their keys and line --------------------------------


TEXT = '{"a": [\n {"b": 1, "c": [1, 2]},\n {"b": "x",\n  "c": [[1, 2], [3, 4]]}]}'


def parsed(text):
    return safe.json_tree(Opened(file="a.json", data=text.encode()))


def message(text, do=lambda root: root):
    with pytest.raises(FlightError) as raised:
        do(parsed(text))
    return str(raised.value)


def test_values_by_their_keys():
    root = parsed(TEXT)
    assert root.one("a", 0, "b").whole() == 1
    assert root.one("a", 1, "c").numbers(2, 2).tolist() == [[1, 2], [3, 4]]
    assert root.one("a", 1, "c").numbers(-1, 2).shape == (2, 2)
    assert root.maybe("a", 2) is None
    assert [key for key, _ in root.items()] == ["a"]


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (lambda r: r.one("a", 1, "b").number(), "a.json:3: a.1.b: 'x'; must be a finite number"),
        (lambda r: r.one("a", 0, "d"), "a.json:2: a.0: 'd' is missing; required"),
        (lambda r: r.one("a", 1, "c").numbers(3), "a.json:4: a.1.c: [[1, 2], [3, 4]]; must be a"),
        (lambda r: list(r.one("a", 0).each()), "a.json:2: a.0: {'b': 1, 'c': [1, 2]}; must be"),
        (lambda r: list(r.one("a").items()), "must be an object"),
        (lambda r: r.one("a", 0).text(), "must be text"),
    ],
)
def test_what_is_wrong_is_named_with_keys_and_line(do, says):
    assert says in message(TEXT, do)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"a":\n', "a.json:2: file: Expecting value; must be valid JSON"),
        ("[" * 100_000, "has more than 60 lists and objects"),
        ('{"a": 1, "a": 2}', "'a' stands twice in one object"),
        ('{"a": NaN}', "NaN is no number"),
        ('{"a": 1e999}', "inf"),
        (f'{{"a": {"9" * 5000}}}', "must be valid JSON"),
        (f'{{"a": {"9" * 400}}}', "must be a finite number"),
    ],
)
def test_other_texts_are_refused(text, says):
    assert says in message(text, lambda root: root.one("a").number())


# --- files are opened once, and what is no text is told by line ------------------------------


def test_text_of_either_encoding(tmp_path):
    for name, code in (("a", "utf-8"), ("b", "utf-8-sig"), ("c", "utf-16")):
        (tmp_path / name).write_bytes("é\r\nb".encode(code))
        source = safe.read(tmp_path / name)
        assert source.text() == "é\nb"
        assert safe.checksums([source]) == {name: source.sha256}


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
        safe.read(tmp_path / "a.txt").text()
    assert str(raised.value).endswith(says)


def test_a_missing_or_too_large_file_and_a_folder_are_refused(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"12345")
    with pytest.raises(FlightError, match="the import needs it"):
        safe.read(tmp_path / "b.txt")
    with pytest.raises(FlightError, match="must have at most 4 bytes"):
        safe.read(tmp_path / "a.txt", most=4)
    with pytest.raises(FlightError, match="Is a directory"):
        safe.read(tmp_path)


def test_text_of_windows_is_read_where_it_is_asked_for():
    source = safe.Opened(file="a", data="5°".encode("cp1252"))
    assert safe.of_windows(source).text() == "5°"
    plain = safe.Opened(file="a", data="5°".encode())
    assert safe.of_windows(plain) is plain


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


# --- lines of text are cut into cells that know their place ----------------------------------


SMALL = Range(-1.0, 1.0)


def read(text, **options):
    return list(lines(Opened(file="a.txt", data=text.encode()), **options))


@pytest.mark.parametrize(
    ("text", "separator", "cells"),
    [
        ("a  1\t2", None, ("a", "1", "2")),
        ("'a b' \"c d\" 2", None, ("a b", "c d", "2")),
        ("a , 1,,2", ",", ("a", "1", "", "2")),
        ('"a, b", 1, "", 2', ",", ("a, b", "1", "", "2")),
        ('"a;b";1', ";", ("a;b", "1")),
    ],
)
def test_cells(text, separator, cells):
    assert cut(text, separator) == cells


def test_lines_keep_their_numbers_and_comments_are_left_out():
    found = read("# x\r\n\r\na 1 2\rb 3 4\n", comment="#")
    assert [(line.number, line.cells[0]) for line in found] == [(3, "a"), (4, "b")]
    assert found[1].numbers(1, None, "x y").tolist() == [3, 4]
    assert found[1].whole_at(2, "y") == 4


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (lambda x: x.number_at(1, "east"), "a.txt:1: east: '1,5'; must be a finite number"),
        (lambda x: x.number_at(2, "east"), "a.txt:1: east: 'inf'; must be a finite number"),
        (lambda x: x.number_at(3, "north"), "a.txt:1: north: is missing, the line has 3 cells"),
        (lambda x: x.numbers(1, 3, "x y"), "a.txt:1: x y: '1,5'; must be a finite number"),
        (lambda x: x.whole_at(0, "id"), "a.txt:1: id: 'a'; must be a whole number"),
        (lambda x: x.numbers(3, 5, "x", SMALL), "a.txt:1: x: '9'; must lie between -1 and 1"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(do, says):
    (line,) = read("a 1,5 inf 0.5 9" if "'9'" in says else "a 1,5 inf")
    with pytest.raises(FlightError) as raised:
        do(line)
    assert says in str(raised.value)


# --- Binary files are read within their size


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


# --- XML becomes a tree whose elements know their line; what is dangerous is refused ---------


def xml_tree_parsed(text):
    return safe.xml_tree(Opened(file="a.xml", data=text.encode()))


def xml_tree_message(text, do=lambda root: root):
    with pytest.raises(FlightError) as raised:
        do(xml_tree_parsed(text))
    return str(raised.value)


def test_elements_attributes_and_numbers():
    root = xml_tree_parsed('<a>\n <b n="2">x</b>\n <c><b n="3"> 1 2\n3 </b></c></a>')
    assert [one.attribute("n") for one in root.everywhere("b")] == ["2", "3"]
    assert root.one("c", "b").numbers(3).tolist() == [1, 2, 3]
    assert root.one("b").whole("n") == 2
    assert root.one("c").line == 3
    assert root.maybe("c", "d") is None


def test_a_name_space_is_part_of_the_name():
    root = xml_tree_parsed('<x:a xmlns:x="http://u/"><x:b/></x:a>')
    assert [one.tag for one in root.below] == ["http://u/ b"]


@pytest.mark.parametrize(
    ("text", "do", "says"),
    [
        ("<a>\n<b/></a>", lambda r: r.one("c"), "a.xml:1: a: <c> is missing; required"),
        ("<a>\n<b>x</b></a>", lambda r: r.one("b").number(), "a.xml:2: b: 'x'; must be a finite"),
        ("<a>\n<b>nan</b></a>", lambda r: r.one("b").number(), "a.xml:2: b: 'nan'; must be"),
        ("<a><b>1 2</b></a>", lambda r: r.one("b").numbers(3), "must be 3 numbers"),
        ("<a id='x'/>", lambda r: r.whole("id"), "a.xml:1: a id: 'x'; must be a whole number"),
        ("<a lens='x'/>", lambda r: r.attribute("len"), "is missing (did you mean 'lens'?)"),
    ],
)
def test_what_is_missing_or_no_number_is_named_with_its_line(text, do, says):
    assert says in xml_tree_message(text, do)


def test_documents_with_types_and_entities_are_refused():
    bomb = '<?xml version="1.0"?>\n<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><a>&c;</a>'
    assert xml_tree_message(bomb).startswith("a.xml:2: file: <!DOCTYPE> may name entities")
    outside = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'
    assert "<!DOCTYPE>" in xml_tree_message(outside)
    assert "a.xml:1: file: undefined entity; must be valid XML" in xml_tree_message("<a>&b;</a>")


def test_depth_and_form_are_limited():
    assert "inside each other; must have fewer" in xml_tree_message("<a>" * 200 + "</a>" * 200)
    assert xml_tree_message("<a>\n<b></a>") == "a.xml:2: file: mismatched tag; must be valid XML"
    assert "encoding" in xml_tree_message('<?xml version="1.0" encoding="klingon"?><a/>')
