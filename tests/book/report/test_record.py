"""The report as JSON: the values of the results, whole and without NaN."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.report import record, verdict
from acx4lib.results import folder
from support.helpers import ROOT
from support.run_results import SINGLE


@pytest.fixture(scope="module")
def told(run):
    text = record.text(run, verdict.findings(run))
    assert record.MARK in text.encode()[:4096]
    return json.loads(text, parse_constant=pytest.fail)


def test_parameters_and_covariance_are_those_of_the_results(run, told):
    method = told["methods"][told["calibration"]]
    cov = folder.covariance(run.found, SINGLE)
    assert method["parameters"] == list(cov.index)
    assert_allclose(method["covariance_matrix"], cov, rtol=1e-15)
    sigma = np.sqrt(np.diag(cov))
    assert_allclose(method["correlation_matrix"], cov / sigma / sigma[:, None], atol=1e-12)
    camera = method["cameras"]["CAM"]
    rows = folder.parameters(run.found, SINGLE, "CAM")
    assert {k: v["value"] for k, v in camera["parameters"].items()} == dict(rows["value"])
    assert camera["interior"]["f_mm"] == rows.loc["f_mm", "value"]
    assert camera["corners"][0]["x_mm"] < 0 < camera["corners"][0]["y_mm"]


def test_the_statement_is_that_of_the_page(run, told):
    found = verdict.findings(run)
    assert [f["question"] for f in told["statement"]["findings"]] == [f.question for f in found]
    assert told["statement"]["holds"] is True
    assert (told["statement"]["level"], told["statement"]["procedure"]) == (0.05, "Holm")
    by_question = {f["question"]: f for f in told["statement"]["findings"]}
    assert by_question["Convergence"]["p"] is None
    tested = by_question["Boresight stable over time"]
    assert tested["p"] == min(test["p"] for test in tested["tests"])
    assert tested["p"] < tested["p_joint"] <= 1
    assert not any(test["fails"] for test in tested["tests"])
    assert any("MTF" in one for one in told["statement"]["not_examined"])
    assert (
        told["check_points"]["n_points"] == run.found.summary["validation/single_step"]["n_points"]
    )
    assert told["certificate"] == {}


def test_every_key_is_explained(told):
    page = (ROOT / "book" / "results.md").read_text(encoding="utf-8")
    section = page[page.index("(certificate)=") :]
    camera = told["methods"][told["calibration"]]["cameras"]["CAM"]
    budget, (adjustment, *_) = told["error_budget"], told["adjustments"].values()
    inner = (budget, budget["sources"][0], told["check_points"], told["groups"][0], adjustment)
    for key in (*told, *camera, *camera["distortion"][0], *(key for part in inner for key in part)):
        assert f"`{key}`" in section
