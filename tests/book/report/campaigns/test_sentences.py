"""The verdict of a comparison, for readers and in the terminal."""

from dataclasses import replace

from acx4book.report.campaigns import sentences
from acx4book.report.campaigns.study import study


def test_a_change_is_said_with_its_size_and_what_it_does(three):
    text = sentences.verdict(three)
    assert text.startswith("**The 3 campaigns are not the same.** All 14 parameters together: χ²")
    assert "the level is 0.05" in text
    assert "$f$ by " in text
    assert "µm (2021-05 to 2022-05)" in text
    assert "From 610 m above the ground a pixel of CAM that is georeferenced with" in text


def test_campaigns_that_agree_are_said_to(three):
    a, b = three.comparison.campaigns[:2]
    same = replace(a, name="copy", session=b.session)
    text = sentences.verdict(study([a, same]))
    assert text.startswith("**The 2 campaigns agree within their errors.**")
    assert "No parameter by itself has changed at the joint level." in text
    lines = sentences.for_terminal(study([a, same]))
    assert lines == [
        "2 campaigns agree within their errors: chi-square 0.0, 14 degrees of freedom, p = 1.000"
    ]


def test_a_change_that_no_parameter_shows_by_itself_is_said(three):
    tables = {name: table.copy() for name, table in three.tables.items()}
    tables["differences"]["p_joint"] = 1.0
    text = sentences.verdict(replace(three, tables=tables))
    assert "2021-05 and 2022-05; 2022-05 and 2024-05: all parameters together differ" in text


def test_a_trend_is_said_or_what_it_would_need(three):
    assert "Over temperature the slopes of all parameters together are significant" in (
        sentences.trend(three)
    )
    assert "The campaigns lie on the lines within their errors." in sentences.trend(three)
    two = study(three.comparison.campaigns[:2])
    assert sentences.trend(two).startswith("There is no regression: it needs three campaigns")


def test_what_sigma_was_used_is_said(three):
    assert "multiplied by the root of each campaign's own σ₀²" in sentences.how(three)
    plain = study(three.comparison.campaigns, apriori=True)
    assert "as they were stated before the adjustments" in sentences.how(plain)


def test_notes_are_shown_as_they_are(three):
    noted = replace(three.comparison, notes=("*a* is b",))
    assert sentences.notes(replace(three, comparison=noted)) == "- &#42;a&#42; is b."
