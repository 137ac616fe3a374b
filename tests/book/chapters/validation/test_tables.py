"""Tables and sentences of the validation where there is nothing to validate."""

from acx4book.chapters.validation import sentences, tables


def test_without_a_validation_the_tables_keep_their_columns():
    assert list(tables.bias([]).columns) == list(tables.BIAS)
    assert "nothing to validate" in sentences.validation([])
    assert list(tables.normalised([]).columns) == list(tables.NORMALISED)
    assert list(tables.together([]).columns) == list(tables.TOGETHER)
    assert "nothing to validate" in sentences.shared([])
