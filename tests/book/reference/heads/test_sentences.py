"""What the chapter says from stored numbers, without any picture."""

from acx4book.reference.heads import figures, sentences, tables


def test_every_sentence_and_table_is_made_of_stored_numbers(stored):
    pairs, rotations = stored("ten_pairs"), stored("ten_rotations")
    five_pairs, five_rotations = stored("five_pairs"), stored("five_rotations")
    parallax, falloff = stored("ten_parallax"), stored("ten_vignetting")
    said = [
        sentences.chain(pairs),
        sentences.agreement(pairs, rotations),
        sentences.readings(stored("ten_readings")),
        sentences.parallax(parallax),
        sentences.falloff(falloff),
        sentences.five(five_pairs, five_rotations),
        sentences.answer(pairs, rotations, five_rotations),
    ]
    assert not any("nan" in sentence for sentence in said)
    assert said[0].startswith("Of 45 pairs, 45 tie.")
    beside = tables.beside(five_rotations, "c", name="n")
    assert "factory" not in beside
    assert "trial x" in beside


def test_figures_need_no_picture(stored, tmp_path):
    matrix = figures.shares(stored("ten_pairs")).axes[0]
    assert len(matrix.texts) == 45
    assert len(figures.shifts(stored("ten_parallax")).axes[0].patches) == 2
    assert len(figures.falloffs(stored("ten_vignetting")).axes) == 4
    assert figures.stack(folder=str(tmp_path)) is None
