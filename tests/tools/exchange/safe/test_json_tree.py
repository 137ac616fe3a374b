"""JSON becomes a tree whose nodes know their keys and line."""

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe import json_tree
from acx4tools.exchange.safe.opened import Opened

TEXT = '{"a": [\n {"b": 1, "c": [1, 2]},\n {"b": "x",\n  "c": [[1, 2], [3, 4]]}]}'


def parsed(text):
    return json_tree.tree(Opened(file="a.json", data=text.encode()))


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
