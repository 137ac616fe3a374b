"""Groups of observations: ratios, redundancy, detectable errors."""

import json

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report import adjustment
from acx4book.report.adjustment import residual_plane, residuals_by_strip
from acx4book.report.material import read
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4lib.results import folder as results
from acx4lib.results.table_files import COMPONENTS
from support.helpers import dots
from support.run_results import SINGLE


def test_the_ratio_of_repeated_measurements_is_their_standard_deviation(folder, rng):
    """Residuals about a mean have redundancy 1 - 1/n each: the ratio is s / sigma exactly."""
    heading = rng.normal(0.0, 0.03, 20)
    row = {"stage": "mounting", "method": "single_step", "kind": "attitude", "point": ""}
    row |= {"component": "heading_deg", "sigma": 0.01, "redundancy": 1 - 1 / 20, "w": 0.0}
    table = pd.DataFrame(
        [
            {**row, "image_or_exposure": f"E{i}", "v": v}
            for i, v in enumerate(heading.mean() - heading)
        ]
    )
    table[list(results.COLUMNS["residuals"])].to_csv(folder / "residuals.csv", index=False)
    summary = json.loads((folder / "summary.json").read_text())
    summary["mounting/single_step"]["n_observations"] = len(table)
    (folder / "summary.json").write_text(json.dumps(summary))
    (group,) = adjustment.decisive_qualities(read(folder))
    assert (group.group, group.unit, group.n) == ("heading", "deg", 20)
    assert_allclose(group.ratio, heading.std(ddof=1) / 0.01, rtol=1e-12)
    assert_allclose(group.redundancy, 19.0)


def test_the_groups_share_the_redundancy_of_the_adjustment(run):
    found = adjustment.decisive_qualities(run)
    assert {group.group for group in found} == {
        g for g in adjustment.GROUPS.values() if "declared" not in g and g != "distances"
    }
    total = sum(group.redundancy for group in found)
    assert_allclose(total, run.found.summary[SINGLE]["redundancy"], rtol=1e-6)
    cost = sum(group.ratio**2 * group.redundancy for group in found)
    assert_allclose(cost / total, run.found.summary[SINGLE]["sigma0_squared"], rtol=1e-6)


def test_a_detectable_error_is_found_in_four_of_five_cases(run):
    """By counting: w of an observation with this error is normal about delta_0."""
    w = np.random.default_rng(1).normal(adjustment.DETECTABLE, 1.0, 100_000)
    assert_allclose(np.mean(w > 3.9), 0.8, atol=0.005)  # three sigma of the count is 0.004
    rows = run.residuals[SINGLE]
    heading = rows[rows["component"] == "heading_deg"]
    expected = np.median(adjustment.DETECTABLE * 0.015 / np.sqrt(heading["redundancy"]))
    group = next(g for g in adjustment.decisive_qualities(run) if g.group == "heading")
    assert_allclose(group.detectable, expected)


def test_every_component_of_the_results_has_a_group():
    listed = {(kind, name) for kind, names in COMPONENTS.items() for name in names}
    assert set(adjustment.GROUPS) == listed


def test_baardas_delta_is_the_textbooks_4_13():
    """alpha = 0.1 %, beta = 20 %: the same sum with another critical value."""
    assert_allclose(stats.norm.isf(0.0005) + adjustment.DETECTABLE - 3.9, 4.13, atol=0.005)


def test_the_probability_of_a_ratio_is_the_one_that_the_run_tells(run):
    told = run.found.summary[SINGLE]["sigma_tests"]
    found = adjustment.decisive_qualities(run)
    assert {group.group for group in found} == set(told)
    for group in found:
        assert group.p == told[group.group]["p"]
        assert_allclose(group.ratio, told[group.group]["ratio"], rtol=1e-6)
        assert_allclose(group.redundancy, told[group.group]["redundancy"], rtol=1e-6)


def test_in_results_of_earlier_versions_it_is_that_of_chi_square(folder):
    summary = json.loads((folder / "summary.json").read_text())
    del summary[SINGLE]["sigma_tests"]
    (folder / "summary.json").write_text(json.dumps(summary))
    for group in adjustment.decisive_qualities(read(folder)):
        square, r = group.ratio**2 * group.redundancy, group.redundancy
        expected = 2 * min(stats.chi2.cdf(square, r), stats.chi2.sf(square, r))
        assert_allclose(group.p, expected, rtol=1e-9)


# --- Residuals drawn: what the tables say is what is drawn


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
