"""XML becomes a tree whose elements know their line; what is dangerous is refused."""

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe import xml_tree
from acx4tools.exchange.safe.opened import Opened


def parsed(text):
    return xml_tree.tree(Opened(file="a.xml", data=text.encode()))


def message(text, do=lambda root: root):
    with pytest.raises(FlightError) as raised:
        do(parsed(text))
    return str(raised.value)


def test_elements_attributes_and_numbers():
    root = parsed('<a>\n <b n="2">x</b>\n <c><b n="3"> 1 2\n3 </b></c></a>')
    assert [one.attribute("n") for one in root.everywhere("b")] == ["2", "3"]
    assert root.one("c", "b").numbers(3).tolist() == [1, 2, 3]
    assert root.one("b").whole("n") == 2
    assert root.one("c").line == 3
    assert root.maybe("c", "d") is None


def test_a_name_space_is_part_of_the_name():
    root = parsed('<x:a xmlns:x="http://u/"><x:b/></x:a>')
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
    assert says in message(text, do)


def test_documents_with_types_and_entities_are_refused():
    bomb = '<?xml version="1.0"?>\n<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><a>&c;</a>'
    assert message(bomb).startswith("a.xml:2: file: <!DOCTYPE> may name entities")
    outside = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'
    assert "<!DOCTYPE>" in message(outside)
    assert "a.xml:1: file: undefined entity; must be valid XML" in message("<a>&b;</a>")


def test_depth_and_form_are_limited():
    assert "inside each other; must have fewer" in message("<a>" * 200 + "</a>" * 200)
    assert message("<a>\n<b></a>") == "a.xml:2: file: mismatched tag; must be valid XML"
    assert "encoding" in message('<?xml version="1.0" encoding="klingon"?><a/>')
