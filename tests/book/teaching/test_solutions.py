"""Pages on the lab sheets, and question banks."""

import re

import pytest

from acx4book.teaching import quiz
from acx4book.teaching.grading import apart
from acx4book.teaching.sheets.every import SHEETS

# --- Question banks read back as a learning platform reads them, by parsers that know no writer


STUDENT = "Ada"


def of_gift(written):
    """Return the answers of every question, as the grammar of the format has them.

    A question is ``::title::text {#answers}``, an answer ``=[%weight%]low..high#feedback``. A
    backslash stands before what is none of the format's signs. Numbers have no exponent.
    """
    found = {}
    for title, _, inside in re.findall(
        r"(?s)^::((?:\\.|[^:\\])+)::((?:\\.|[^{\\])+)\{#\n(.*?)(?<!\\)\n\}", written, re.MULTILINE
    ):
        answers = [
            re.fullmatch(r"=(?:%(\d+)%)?(-?\d+\.?\d*)\.\.(-?\d+\.?\d*)#(.*)", line).groups()
            for line in inside.splitlines()
        ]
        found[plain(title)] = [
            (float(low), float(high), int(weight or 100), plain(said))
            for weight, low, high, said in answers
        ]
    return found


def plain(escaped):
    return re.sub(r"\\(.)", r"\1", escaped)


def said_by_gift(answers, value):
    among = ((points, said) for low, high, points, said in answers if low <= value <= high)
    return next(among, None)


@pytest.fixture(scope="module", params=["lab-2", "lab-6"])
def banks(request, solved, key, tmp_path_factory):
    """Sheet, right answers, mistakes, and the bank."""
    sheet = SHEETS[request.param]
    case, right = solved(sheet.name, STUDENT)
    folder = tmp_path_factory.mktemp("quiz") / "bank"
    quiz.write(sheet, STUDENT, key, folder)
    gift = of_gift((folder / quiz.GIFT).read_text("utf-8"))
    return sheet, right, [*sheet.mistakes(case, right)], gift


def test_right_answers_are_right_and_a_bound_away_they_are_not(banks):
    _, right, _, gift = banks
    for name, one in right.items():
        for value in (one.value, one.truth, one.truth + 0.99 * one.bound):
            assert said_by_gift(gift[name], value) == (100, quiz.RIGHT)
        if one.sigma is not None:
            assert said_by_gift(gift[f"sigma_{name}"], 1.2 * one.sigma)[0] == 100
            assert said_by_gift(gift[f"sigma_{name}"], 1.4 * one.sigma)[0] == 0
        beyond = said_by_gift(gift[name], one.truth + 1.01 * one.bound)
        assert beyond is None or beyond[0] == 0
        assert said_by_gift(gift[name], 1e7) is None


def test_a_mistake_is_answered_by_its_own_sentence(banks):
    _, right, mistakes, gift = banks
    told, said_of_others = 0, 0
    for mistake in mistakes:
        for name, value in mistake.gives.items():
            if apart(name, value, right[name].truth) <= right[name].bound:
                continue
            points, says = said_by_gift(gift[name], value)
            assert points == 0
            told += says == mistake.says
            said_of_others += says != mistake.says  # which gives the same number
            assert says in {one.says for one in mistakes}
    assert told > 4 * said_of_others
    assert told > 20
