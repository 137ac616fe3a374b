"""The sentences have the numbers of the campaigns."""

import pytest

from acx4book.chapters.beyond.stability import chance, sentences
from acx4book.chapters.beyond.stability.history import UM_PER_DEGREE
from acx4lib.results.campaigns.comparison import compare


def test_a_hidden_change_is_said_singly_and_jointly(every):
    text = sentences.hidden(every, 1, 2)
    assert text.startswith("The true focal length differs by -7.2 µm.")
    assert "all 14 parameters together χ² = " in text


def test_alarms_are_said_in_percent():
    shares = {chance.EACH: 0.4, chance.HOLM: 0.04, chance.JOINT: 0.05}
    assert sentences.alarms(shares, 0.05, 14) == (
        "At a level of 5 %, 40 % of the comparisons have an alarm if each of the 14 parameters is "
        "tested at this level, 4.0 % with Holm's joint level, 5.0 % with one χ² test of all."
    )


def test_the_slope_is_that_which_was_simulated(before, campaigns):
    slope, sigma = sentences.slope_of_f(before)
    assert abs(slope - UM_PER_DEGREE) < 4 * sigma
    assert f"{slope:.2f} ± {sigma:.2f} µm per °C" in sentences.temperature(before)
    with pytest.raises(ValueError, match="no temperatures"):
        sentences.slope_of_f(
            compare(
                [
                    campaigns[0],
                    campaigns[0].__class__(
                        **{**vars(campaigns[1]), "session": campaigns[0].session}
                    ),
                ]
            )
        )


def test_the_answer_names_what_was_found(every, before, rigid):
    text = sentences.answer(every, before, rigid)
    assert "$p$ <\N{NO-BREAK SPACE}0.0005 for all 6 campaigns" in text
    assert "the campaigns lie on straight lines over the temperature" in text
    assert "CAM3 was turned by 10″ at exposure H2-04" in sentences.turned(rigid)
