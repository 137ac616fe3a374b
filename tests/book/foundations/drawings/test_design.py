"""Plans, correlations and curves are drawn from what they are given."""

import numpy as np
import pandas as pd
from numpy.testing import assert_allclose

from acx4book.foundations.designs import lines
from acx4book.foundations.drawings import design as drawings


def test_the_footprint_lies_along_the_flight():
    north = drawings.footprint(lines(0.0)[0])
    assert_allclose(np.ptp(north, axis=0), [300.0, 400.0])  # 30 x 40 mm at 500 m and 50 mm
    east = drawings.footprint(lines(90.0, height_m=1000.0)[0])
    assert_allclose(np.ptp(east, axis=0), [800.0, 600.0])


def test_every_plan_has_its_panel_and_its_control_points():
    fig = drawings.plans({"one": lines(90), "two": lines(90, 270, height_m=900.0)})
    assert [ax.get_title(loc="left") for ax in fig.axes] == ["one", "two"]
    assert len(fig.axes[0].lines[-1].get_xdata()) == len(drawings.CONTROL_M)


def test_large_correlations_are_written_once_a_pair_and_side():
    names = ["f, mm", "lever z, m"]
    table = pd.DataFrame([[1.0, -0.98], [-0.98, 1.0]], names, names)
    low = pd.DataFrame(np.eye(2), names, names)
    fig = drawings.correlations({"a": table, "b": low})
    assert [text.get_text() for text in fig.axes[0].texts] == ["−.98", "−.98"]
    assert not fig.axes[1].texts
    assert [label.get_text() for label in fig.axes[0].get_yticklabels()] == ["f", "lever z"]


def test_curves_are_drawn_over_the_ratio():
    names = ["lever x, m", "lever y, m", "lever z, m", "xp, mm", "yp, mm", "f, mm"]
    table = pd.DataFrame({1.0: np.arange(1.0, 7.0), 2.0: np.arange(2.0, 8.0)}, index=names)
    left, right = drawings.against_ratio(table).axes
    assert_allclose(left.lines[2].get_ydata(), [3.0, 4.0])
    assert right.get_ylabel() == "σ (mm)"
