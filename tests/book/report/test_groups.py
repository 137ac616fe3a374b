"""Groups of observations: ratios, redundancy, detectable errors, probabilities."""

import json

import numpy as np
import pandas as pd
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report.groups import GROUPS, qualities
from acx4book.report.material import read
from acx4files.results import folder as results
from acx4files.results.folder import COMPONENTS
from acx4lib.bundle.rejections import noncentrality
from support.run_results import SINGLE, stamp


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
    stamp(folder)
    (group,) = qualities(read(folder))
    assert (group.group, group.unit, group.n) == ("heading", "deg", 20)
    assert_allclose(group.ratio, heading.std(ddof=1) / 0.01, rtol=1e-12)
    assert_allclose(group.redundancy, 19.0)


def test_the_groups_share_the_redundancy_of_the_adjustment(run):
    found = qualities(run)
    assert {group.group for group in found} == {
        g for g in GROUPS.values() if "declared" not in g and g != "distances"
    }
    total = sum(group.redundancy for group in found)
    assert_allclose(total, run.found.summary[SINGLE]["redundancy"], rtol=1e-6)
    cost = sum(group.ratio**2 * group.redundancy for group in found)
    assert_allclose(cost / total, run.found.summary[SINGLE]["sigma0_squared"], rtol=1e-6)


def test_a_detectable_error_grows_with_one_over_the_root_of_the_redundancy(run):
    rows = run.residuals[SINGLE]
    heading = rows[rows["component"] == "heading_deg"]
    expected = np.median(noncentrality() * 0.015 / np.sqrt(heading["redundancy"]))
    group = next(g for g in qualities(run) if g.group == "heading")
    assert_allclose(group.detectable, expected)


def test_every_component_of_the_results_has_a_group():
    listed = {(kind, name) for kind, names in COMPONENTS.items() for name in names}
    assert set(GROUPS) == listed


def test_the_probability_of_a_ratio_is_the_one_that_the_run_tells(run):
    told = run.found.summary[SINGLE]["sigma_tests"]
    found = qualities(run)
    assert {group.group for group in found} == set(told)
    for group in found:
        assert group.p == told[group.group]["p"]
        assert_allclose(group.ratio, told[group.group]["ratio"], rtol=1e-6)
        assert_allclose(group.redundancy, told[group.group]["redundancy"], rtol=1e-6)


def test_in_results_of_earlier_versions_it_is_that_of_chi_square(folder):
    summary = json.loads((folder / "summary.json").read_text())
    del summary[SINGLE]["sigma_tests"]
    (folder / "summary.json").write_text(json.dumps(summary))
    for group in qualities(read(folder)):
        square, r = group.ratio**2 * group.redundancy, group.redundancy
        expected = 2 * min(stats.chi2.cdf(square, r), stats.chi2.sf(square, r))
        assert_allclose(group.p, expected, rtol=1e-9)
