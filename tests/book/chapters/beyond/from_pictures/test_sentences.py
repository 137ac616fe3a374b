import pytest

from acx4book.chapters.beyond.from_pictures import exact, sentences

pytestmark = pytest.mark.repeats


def test_numbers_are_those_of_the_flight(found):
    ties = exact.of_ties(found)
    said = sentences.ties(ties, exact.same_height(found, ties))
    assert f"{ties.rms:.3f} px" in said
    assert f"Of {len(ties.off)} measurements" in said
    assert sentences.answer(found, ties).startswith("Yes. From 8 pictures")
    assert sentences.said(found).startswith("~~~text\ncalibration: ")
    assert "discs were centred" in sentences.control(exact.of_control(found))
