"""Residuals drawn: what the tables say is what is drawn."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver
from numpy.testing import assert_allclose

from acx4book.report.adjustment.residuals import residual_plane, residuals_by_strip
from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from support.helpers import dots

mpl.use("agg")

CAMERA = Camera(
    name="CAM",
    width_px=4000,
    height_px=3000,
    pixel_mm=0.005,
    interior=Interior(f=50.0),
    T_b_c=Pose(R=np.eye(3), r=np.zeros(3)),
)


@pytest.fixture
def residuals(rng):
    """4000 residuals in two strips, the second with twice the promised noise in its rows."""
    n = 4000
    strip = np.repeat(["1", "2"], n // 2)
    v = rng.normal(0, 0.5, (n, 2))
    v[strip == "2", 1] *= 2
    return pd.DataFrame(
        {
            "camera": "CAM",
            "strip": strip,
            "col_px": rng.uniform(0, 4000, n),
            "row_px": rng.uniform(0, 3000, n),
            "v_col": v[:, 0],
            "v_row": v[:, 1],
            "sigma": 0.5,
            **{f"redundancy_{axis}": 1.0 for axis in ("col", "row")},
            **{f"w_{axis}": v[:, i] / 0.5 for i, axis in enumerate(("col", "row"))},
        }
    )


def test_the_plane_has_a_panel_for_every_camera_and_marks_what_is_systematic(residuals):
    other = residuals.assign(camera="CAM2", v_col=residuals["v_col"] + 0.4)
    both = pd.concat([residuals, other])
    fig = residual_plane({"Adjusted": both}, {"CAM": CAMERA, "CAM2": CAMERA})
    assert [ax.get_title(loc="left") for ax in fig.axes] == ["Adjusted, CAM", "Adjusted, CAM2"]
    coloured = []
    for ax in fig.axes:
        (arrows,) = [a for a in ax.get_children() if isinstance(a, Quiver)]
        ink = mpl.colors.to_rgba("#e58a1f")
        coloured.append(np.mean([np.allclose(c, ink) for c in arrows.get_facecolors()]))
    # twice the noise in half of the rows leaves few cells beyond 3 sigma, a shift of 0.4 px most
    assert coloured[0] < 0.1
    assert coloured[1] > 0.9


def test_a_strip_stands_at_its_ratio_under_its_limits(residuals):
    fig = residuals_by_strip({"One": residuals})
    cols, rows, largest, _ = fig.axes
    assert_allclose(dots(cols)[:, 1], 1.0, atol=0.06)  # 2000 residuals: 4 sigma of the ratio
    assert_allclose(dots(rows)[:, 1], [1.0, 2.0], atol=0.1)
    (bars,) = [c for c in cols.collections if isinstance(c, LineCollection)]
    low, high = bars.get_segments()[0][:, 1]
    assert_allclose([low, high], 1 + np.array([-3.29, 3.29]) / np.sqrt(2 * 2000), atol=0.002)
    assert CRITICAL in [line.get_ydata()[0] for line in largest.get_lines()]
    assert_allclose(dots(largest)[0, 1], residuals["w_col"][:2000].abs().max())


def test_what_is_not_there_is_said():
    nothing = [residual_plane({}, {}), residuals_by_strip({})]
    assert all(len(fig.axes[0].texts) == 1 for fig in nothing)
