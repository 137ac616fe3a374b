"""Estimates of the report: significance, declared values, strong pairs."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.report import parameters
from acx4book.report.material import read
from acx4book.report.parameters import (
    correlation_sentence,
    joint_table,
    pair_texts,
    parameter_table,
)
from acx4lib.results import folder as results
from support.run_results import SINGLE


def test_significance_is_against_zero_or_what_was_declared(run):
    found = {p.parameter: p for p in parameters.estimates(run, SINGLE)}
    camera = run.flight.cameras["CAM"]
    assert found["f_mm"].reference == camera.interior.f
    assert found["boresight_kappa_deg"].reference == pytest.approx(90.0)
    assert found["xp_mm"].reference == found["lever_z_m"].reference == 0.0
    f = found["f_mm"]
    assert_allclose(f.t, (f.value - camera.interior.f) / f.sigma)
    p2 = found["p2"]
    assert not replace(p2, t=p2.critical * 0.999).significant
    assert replace(p2, t=-p2.critical * 1.001).significant
    assert_allclose(f.critical, 1.96, atol=0.01)  # thousands of degrees of freedom


def test_of_what_is_declared_the_verdict_alone_says_whether_it_differs(run):
    """Beside "confirmed" stood "t = -6.5, significant"."""
    found = {p.parameter: p.significant for p in parameters.estimates(run, SINGLE)}
    declared = {name for name, significant in found.items() if significant is None}
    assert declared == {n for n in found if n.startswith(("f_", "lever", "boresight"))}
    shown = parameter_table(run).set_index("Parameter")["Significant"]
    assert (shown == "–").sum() == len(declared)
    assert not any("boresight" in str(name) for name in joint_table(run)["Parameters"])


def test_an_angle_on_the_other_side_of_180_degrees_is_near(folder):
    """A declared mount of 180 degrees, an estimate of -179.9."""
    material = read(folder)
    camera = material.flight.cameras["CAM"]
    turned = np.diag([-1.0, -1.0, 1.0])
    mount = replace(camera, T_b_c=replace(camera.T_b_c, R=turned))
    flight = replace(material.flight, cameras={"CAM": mount})
    moved = material.found.parameters.copy()
    kappa = moved["parameter"] == "boresight_kappa_deg"
    moved.loc[kappa, "value"] = -179.9
    moved.loc[kappa, "sigma"] = 0.1
    found = replace(material.found, parameters=moved)
    listed = parameters.estimates(replace(material, flight=flight, found=found), SINGLE)
    assert_allclose(next(p.t for p in listed if p.parameter.endswith("kappa_deg")), 1.0, atol=1e-9)


def test_strong_pairs_are_those_of_the_covariance(folder):
    sigma = np.array([2.0, 3.0, 0.5])
    rho = np.array([[1.0, 0.95, -0.2], [0.95, 1.0, -0.91], [-0.2, -0.91, 1.0]])
    names = ["CAM/f_mm", "CAM/xp_mm", "CAM/yp_mm"]
    cov = rho * sigma[:, None] * sigma
    table = pd.DataFrame(
        [
            ("mounting", "single_step", names[i], names[j], cov[i, j])
            for i in range(3)
            for j in range(3)
        ],
        columns=list(results.COLUMNS["covariance"]),
    )
    whole = read(folder)
    material = replace(whole, found=replace(whole.found, covariance=table))
    pairs = parameters.strong_pairs(material, SINGLE)
    assert [(p.one, p.other) for p in pairs] == [tuple(names[:2]), tuple(names[1:])]
    assert_allclose([p.rho for p in pairs], [0.95, -0.91])
    assert correlation_sentence(material) == (
        "Correlations above 0.9: $f$ and $x_p$ (+0.95), $x_p$ and $y_p$ (-0.91)."
    )
    two = [replace(pairs[0], other="B/xp_mm"), pairs[1]]
    assert pair_texts(two) == [
        "$f$ of CAM and $x_p$ of B (+0.95)",
        "$x_p$ and $y_p$ of CAM (-0.91)",
    ]


def test_joint_tests_are_those_of_the_parameters_and_their_covariance(run):
    rows = results.parameters(run.found, SINGLE, "CAM")["value"]
    cov = results.covariance(run.found, SINGLE)
    found = {test.keys: test for test in parameters.joint_tests(run, SINGLE)}
    listed = {p.parameter: p for p in parameters.estimates(run, SINGLE)}
    for keys in (("k1", "k2", "k3"), ("p1", "p2")):
        names = [f"CAM/{key}" for key in keys]
        sigma = np.sqrt(np.diag(cov.loc[names, names]))
        related = cov.loc[names, names].to_numpy() / sigma / sigma[:, None]
        z = rows[list(keys)].to_numpy() / sigma
        assert_allclose(found[keys].f_ratio, z @ np.linalg.solve(related, z) / len(z), rtol=1e-6)
        assert_allclose(found[keys].largest, max(abs(listed[key].t) for key in keys), rtol=1e-9)
    assert len(joint_table(run)) == len(found) == 2
