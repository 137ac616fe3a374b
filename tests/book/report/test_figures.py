"""Figures of the calibration report: what the tables say is what is drawn."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver
from numpy.testing import assert_allclose

from acx4book.report.figures import (
    boresight_over_time,
    check_points,
    residual_plane,
    residuals_by_strip,
)
from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose

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


@pytest.fixture
def boresights():
    """Four images that drift about x by 0.03 degrees in three minutes."""
    drift = {"x_deg": [0.0, 0.01, 0.02, 0.03], "y_deg": np.zeros(4), "z_deg": np.zeros(4)}
    sigma = {f"sigma_{axis}_deg": 0.005 for axis in "xyz"}
    times = {"time_s": [0.0, 60.0, 120.0, 180.0], "number": [1, 2, 3, 4]}
    return pd.DataFrame({**times, "strip": ["1", "1", "2", "2"], **drift, **sigma})


def points(ax):
    """Return the places of the dots of axes, one row each."""
    lines = [line for line in ax.get_lines() if line.get_marker() == "o"]
    return np.concatenate([line.get_xydata() for line in lines])


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
    assert_allclose(points(cols)[:, 1], 1.0, atol=0.06)  # 2000 residuals: 4 sigma of the ratio
    assert_allclose(points(rows)[:, 1], [1.0, 2.0], atol=0.1)
    (bars,) = [c for c in cols.collections if isinstance(c, LineCollection)]
    low, high = bars.get_segments()[0][:, 1]
    assert_allclose([low, high], 1 + np.array([-3.29, 3.29]) / np.sqrt(2 * 2000), atol=0.002)
    assert CRITICAL in [line.get_ydata()[0] for line in largest.get_lines()]
    assert_allclose(points(largest)[0, 1], residuals["w_col"][:2000].abs().max())


def test_boresights_have_their_line_over_time_in_minutes(boresights):
    fig = boresight_over_time(boresights)
    assert [ax.get_ylabel() for ax in fig.axes] == [f"about {axis} (°)" for axis in "xyz"]
    assert fig.axes[-1].get_xlabel() == "time after the first image (min)"
    (line,) = [a for a in fig.axes[0].get_lines() if a.get_linestyle() == "--"]
    assert_allclose(line.get_xydata(), [[0, 0], [3, 0.03]], atol=1e-12)
    untimed = boresight_over_time(boresights.assign(time_s=np.nan))
    assert untimed.axes[-1].get_xlabel() == "image number"


def test_check_points_stand_on_bars_of_twice_their_sigma():
    table = pd.DataFrame({"point": ["A", "B"]})
    for axis, d in (("east", 0.1), ("north", -0.2), ("height", 0.3)):
        table[f"d_{axis}_m"] = [d, 2 * d]
        table[f"sigma_{axis}_m"] = [0.05, 0.15]
    fig = check_points(table)
    assert [ax.get_ylabel() for ax in fig.axes] == ["east (m)", "north (m)", "height (m)"]
    spans = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in fig.axes[1].patches]
    assert_allclose(spans, [(-0.1, 0.1), (-0.3, 0.3)])
    assert_allclose(points(fig.axes[1])[:, 1], [-0.2, -0.4])
    assert [label.get_text() for label in fig.axes[2].get_xticklabels()] == ["A", "B"]


def test_what_is_not_there_is_said():
    nothing = [
        residual_plane({}, {}),
        residuals_by_strip({}),
        boresight_over_time(pd.DataFrame()),
        check_points(pd.DataFrame()),
    ]
    assert all(len(fig.axes[0].texts) == 1 for fig in nothing)
