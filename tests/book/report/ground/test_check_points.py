"""Check points drawn with their predicted sigma."""

import matplotlib as mpl
import pandas as pd
from numpy.testing import assert_allclose

from acx4book.report.ground.check_points import check_points
from support.helpers import dots

mpl.use("agg")


def test_check_points_stand_on_bars_of_twice_their_sigma():
    table = pd.DataFrame({"point": ["A", "B"]})
    for axis, d in (("east", 0.1), ("north", -0.2), ("height", 0.3)):
        table[f"d_{axis}_m"] = [d, 2 * d]
        table[f"sigma_{axis}_m"] = [0.05, 0.15]
    fig = check_points(table)
    assert [ax.get_ylabel() for ax in fig.axes] == ["east (m)", "north (m)", "height (m)"]
    spans = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in fig.axes[1].patches]
    assert_allclose(spans, [(-0.1, 0.1), (-0.3, 0.3)])
    assert_allclose(dots(fig.axes[1])[:, 1], [-0.2, -0.4])
    assert [label.get_text() for label in fig.axes[2].get_xticklabels()] == ["A", "B"]


def test_no_check_points_are_said():
    assert len(check_points(pd.DataFrame()).axes[0].texts) == 1
