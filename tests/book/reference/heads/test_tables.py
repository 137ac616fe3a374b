"""Tables and figures of the chapter from stored numbers, without any picture."""

import numpy as np
import pytest

from acx4book.reference.heads import figures, tables
from acx4book.reference.heads.solved import FIVE, here


def test_rotations_less_others_have_columns_for_those_that_there_are(stored):
    ten, five = tables.beside(stored("ten_rotations")), tables.beside(stored("five_rotations"))
    assert ten.columns[2:].tolist() == [
        f"{whose} {axis} (°)" for whose in ("factory", "trial") for axis in "xyz"
    ]
    assert five.columns[2:].tolist() == [f"trial {axis} (°)" for axis in "xyz"]


def test_tables_have_the_stored_numbers(stored):
    rotations, parallax = stored("ten_rotations"), stored("ten_parallax")
    assert np.array_equal(tables.rotations(rotations)["x (°)"], rotations["x_deg"])
    assert np.array_equal(tables.places(parallax)["rows (px)"], parallax["y_px"])
    median = tables.readings(stored("ten_readings"))["median (px)"]
    assert median[:2].max() < median[2:].min() / 10  # head to reference, and back


def test_what_is_left_is_weighted_with_the_number_of_ties(stored):
    pairs = stored("ten_pairs")
    left = tables.left_px(pairs)
    assert pairs["rms_px"].min() < left < pairs["rms_px"].max()
    total = (pairs["rms_px"] ** 2 * pairs["ties"]).sum() / pairs["ties"].sum()
    assert left == pytest.approx(np.sqrt(total))


def test_nothing_is_solved_without_pictures(tmp_path):
    assert here(FIVE, folder=str(tmp_path)) is None


def test_figures_need_no_picture(stored, tmp_path):
    matrix = figures.shares(stored("ten_pairs")).axes[0]
    assert len(matrix.texts) == 45
    assert len(figures.shifts(stored("ten_parallax")).axes[0].patches) == 2
    assert len(figures.falloffs(stored("ten_vignetting")).axes) == 4
    assert figures.stack(folder=str(tmp_path)) is None
