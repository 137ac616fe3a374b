"""What the page says: the commands' own words, and counts that add up."""

from acx4book.chapters.beyond.failures import sentences
from acx4book.chapters.beyond.failures.mistakes import MISTAKES
from acx4book.typesetting.plain_text import shown


def test_the_words_of_the_commands_stand_there_unchanged(found):
    one = found["geoid"]
    text = sentences.said(one)
    assert all(shown(line) in text for line in (*one.check, *one.run))
    assert "(nothing odd)" in text  # of check
    assert sentences.said(found["no mistake"]).count("(nothing odd)") == 2


def test_every_mistake_has_a_row(found):
    table = sentences.table(found)
    assert list(table["Mistake"]) == list(MISTAKES)
    assert table.set_index("Mistake").loc["geoid", "wrong by"] == "-45 m"


def test_gross_errors_are_counted_against_those_that_were_planted(found):
    said = sentences.caught(found["gross errors"])
    planted = len({(e["kind"], e["image_or_exposure"], e.get("point", "")) for e in
                   found["gross errors"].planted})  # fmt: skip
    assert f"Of {planted} gross errors" in said


def test_the_answer_sorts_the_mistakes_by_how_they_are_found(found):
    said = sentences.answer(found)
    assert said.startswith("Of 8 mistakes, *coordinates exchanged* is refused")
    assert "*gross errors* are rejected one by one" in said
    assert "*one direction* leaves no residual" in said
    assert "names the cause of 7 mistakes" in said
    assert any("CAM f_mm is weak" in line for line in found["one direction"].run)


def test_few_strips_and_a_delay_are_put_in_numbers(found):
    assert "-7.0" in sentences.delay(found["delay"])  # 0.1 s at 70 m/s
    assert "that of $f$ is" in sentences.weakened(found["one direction"], found["no mistake"])
