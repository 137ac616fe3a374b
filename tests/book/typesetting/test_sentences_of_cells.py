"""Sentences of notebooks: templates with numbers, in which text of a flight stays text."""

import jinja2
import pytest

from acx4book.typesetting.sentences import say


def test_a_sentence_has_the_numbers_in_the_formats_that_it_asks_for():
    text = say("$f$ is {{ f | fixed(3) }} mm, {{ d | signed(1) }}", f=74.44061, d=[-0.25, 2])
    assert str(text) == "$f$ is 74.441 mm, −0.2, +2.0"


@pytest.mark.parametrize(("n", "text"), [(1, "1 point"), (2, "2 points"), (0, "0 points")])
def test_one_of_something_has_no_s(n, text):
    assert str(say("{{ n | plural('point') }}", n=n)) == text


def test_names_of_a_flight_are_no_markdown():
    assert "*" not in str(say("{{ name }}", name="*K1*"))


def test_a_case_of_a_flight_that_lacks_something_leaves_no_trace():
    template = """
        {% if n %}
        There are {{ n }}.
        {% endif %}
        Always.
    """
    assert str(say(template, n=0)) == "Always."
    assert str(say(template, n=2)) == "There are 2.\nAlways."


def test_a_name_without_a_value_is_an_error():
    with pytest.raises(jinja2.UndefinedError, match="'m' is undefined"):
        say("{{ m }}", n=1)


def test_a_sentence_shows_itself_as_markdown():
    assert say("$x$")._repr_markdown_() == "$x$"
