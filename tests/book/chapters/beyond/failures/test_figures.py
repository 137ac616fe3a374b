"""Panels of one scale, a mark for what stands out, a sentence for what was refused."""

import numpy as np
from matplotlib.colors import to_rgba

from acx4book.chapters.beyond.failures import figures
from acx4book.chapters.beyond.failures.examined import standardised
from acx4book.typesetting import style
from support.figures import drawn, panels


def test_bars_are_the_residuals_and_red_where_they_stand_out(found):
    fig = drawn(figures.fingerprints(found))
    by_title = {ax.get_title(loc="left"): ax for ax in panels(fig)}
    for name in ("no mistake", "delay"):
        bars = by_title[name].patches
        ends = [bar.get_x() + bar.get_width() for bar in bars]
        rms = standardised(found[name])
        np.testing.assert_allclose(ends, rms)
        red = [bar.get_facecolor() == to_rgba(style.BRICK) for bar in bars]
        assert red == list(rms > figures.SEEN)
    assert len({ax.get_xlim() for ax in by_title.values()}) == 1


def test_maps_have_one_scale_and_say_what_was_refused(found):
    fig = drawn(figures.maps(found))
    by_title = {ax.get_title(loc="left"): ax for ax in panels(fig)}
    assert len({by_title[name].get_xlim() for name in found}) == 1
    texts = [text.get_text() for text in by_title["coordinates exchanged"].texts]
    assert texts == [figures.REFUSED]
    longest = [text.get_text() for text in by_title["no mistake"].texts]
    assert longest[0].startswith("longest arrow ")
    assert longest[0].endswith(" cm")
