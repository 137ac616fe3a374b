import numpy as np
import pytest

from acx4book.chapters.beyond.design import compared, figures


def test_curves_are_the_table_in_readable_units(tables):
    fig = figures.curves(tables["ratio"], "second height over first")
    interior, lever, _ = fig.axes
    assert interior.lines[0].get_ydata() == pytest.approx(1000 * tables["ratio"].loc["f_mm"])
    assert lever.lines[0].get_ydata() == pytest.approx(100 * tables["ratio"].loc["lever_z_m"])
    assert all(ax.get_ylim()[1] / ax.get_ylim()[0] > 0.99 * figures.LEAST_RANGE for ax in fig.axes)
    both = figures.curves(tables["pairs"], "pairs", beside=tables["same_way"])
    assert len(both.axes[0].lines) == 6


def test_a_map_shows_strips_where_they_are_flown(plan, chosen):
    flights = compared.flights(plan, chosen)
    fig = figures.maps(flights)
    first = fig.axes[0]
    assert [ax.get_title() or ax.get_title(loc="left") for ax in fig.axes] == [*flights]
    arrows = [text for text in first.texts if getattr(text, "arrow_patch", None) is not None]
    assert len(arrows) == 5
    strip = plan.blocks["calibration"].strips["C2"]
    start, end = np.array(arrows[1].xyann), np.array(arrows[1].xy)
    length = 0.001 * strip.base_m * (strip.n_exposures - 1)
    assert np.hypot(*(end - start)) == pytest.approx(length)
    course = np.degrees(np.arctan2(*(end - start))) % 360
    assert course == pytest.approx(strip.course_deg % 360, abs=0.1)
