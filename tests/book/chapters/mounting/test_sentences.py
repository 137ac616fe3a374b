"""The answer of chapter 3, beside the differences that the paper prints."""

import re
from dataclasses import replace

import pytest

from acx4book.chapters.mounting import sentences
from acx4lib.calibration.estimates import parameters


def test_the_answer_has_the_single_steps_values_and_the_difference_of_the_methods(ideal, mountings):
    first, rest = sentences.answer(ideal, mountings).split("\n\n")
    values = {p.name: p.value for p in parameters(mountings["single_step"].calibration)}
    numbers = [float(text) for text in re.findall(r"-?\d+\.\d+(?= ±)", first)]
    assert numbers[:3] == pytest.approx([values[f"lever_{axis}_m"] for axis in "xyz"], abs=5e-4)
    assert "+0.0107 mm (printed: +0.0107) in $f$" in first
    assert "(printed: -0.0118) in $x_p$" in first
    assert "(printed: +0.0228) in $y_p$" in first
    assert "the lever arm, which the two-step method does not know" in rest


def test_without_a_second_method_nothing_is_compared(ideal, mountings):
    alone = replace(mountings, methods={"single_step": mountings["single_step"]})
    assert sentences.answer(ideal, alone).endswith("cannot be compared here.")
    assert sentences.answer(ideal, replace(mountings, methods={})).startswith("There is no single")
