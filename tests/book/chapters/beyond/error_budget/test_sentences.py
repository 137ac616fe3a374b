"""Sentences have the numbers of the run."""

import re

import numpy as np
import pytest

from acx4book.chapters.beyond.error_budget import as_printed, sentences
from acx4book.chapters.beyond.error_budget.examined import BARE
from acx4lib.georeferencing import budget


def numbers(text):
    return [
        float(n.replace("\N{MINUS SIGN}", "-"))
        for n in re.findall("[\N{MINUS SIGN}]?[\\d.]*\\d", text)
    ]


def test_correlations_and_parts_add_up_to_all(found):
    lever, interior, both, all_of_it = numbers(sentences.correlations(found))
    height = found.points(BARE).mean[2]
    rest = sum(
        100 * height[budget.SOURCES.index(name)] / height.sum()
        for name in budget.CALIBRATION
        if "boresight" in name
    )
    assert lever + interior + both + rest == pytest.approx(all_of_it, abs=1.6)
    assert both < 0 < lever


def test_heights_name_the_best_and_the_highest(flown):
    said = numbers(sentences.heights(flown))
    assert said[1] in flown.height_m
    assert said[3] == flown.height_m[-1]


def test_the_format_has_its_smallest_and_largest(found):
    shown = found.over_format()
    low, high, height_low, height_high = numbers(sentences.over_format(shown))
    assert low < high < height_high
    assert height_high == pytest.approx(100 * np.nanmax(shown.sigma[..., 2]), abs=0.5)
    assert height_low == pytest.approx(100 * np.nanmin(shown.sigma[..., 2]), abs=0.5)


def test_only_errors_that_spare_the_heights_are_named(found):
    text = sentences.unexplained(found)
    left = as_printed.unexplained(
        as_printed.rms(), as_printed.predicted(found, as_printed.assumptions()[0]).rms
    )
    for one in as_printed.suspects(found):
        named = f"{one.name} ({one.needed})" in text
        assert named == (one.rms[2] <= left[2]), one.name


def test_the_answer_has_the_shares(found, flown):
    image, trajectory, calibrated = budget.shares(found.pairs(BARE).mean[2]).values()
    text = sentences.answer(found, flown)
    for share, digits in ((image, 0), (trajectory, 0), (calibrated, 1)):
        assert f"{100 * share:.{digits}f} %" in text
