"""Findings of stages on the parameters: estimates and verdicts."""

import json
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report import parameters
from acx4book.report.findings import (
    CONSEQUENCES,
    FAILS,
    LEVEL,
    ChanceTest,
    Finding,
    findings,
    judged,
    statement,
    verdict_table,
)
from acx4book.report.material import read
from acx4book.report.parameters import (
    Lens,
    balanced,
    lenses,
    pair_texts,
    profile,
    strong_pairs,
)
from acx4files.results import folder as results
from acx4lib.geometry.camera import INTERIOR, Camera, Interior, distortion
from support import figures
from support.figures import drawn
from support.run_results import SINGLE, edit

# --- the drawn image and the distortion table: axes, corners, numbers of the library ---------


mpl.use("agg")


@pytest.fixture(scope="module")
def lens(run):
    (one,) = lenses(run, run.calibration)
    return one


def test_corners_are_half_a_format_from_the_middle_less_half_a_pixel(run, lens):
    text = parameters.image_section(run).markdown
    table = figures.table(text, "tab-report-corners").set_index("Corner")
    camera = lens.camera
    x = 0.5 * (camera.width_px - 1) * camera.pixel_mm
    assert float(table.loc["upper left", "x (mm)"]) == pytest.approx(-x, abs=1e-4)
    assert float(table.loc["upper left", "y (mm)"]) > 0  # y up, rows down
    assert table.loc["lower right", "Row (px)"] == f"{camera.height_px - 1}"


def test_the_profile_ends_at_the_farthest_corner_where_it_is_balanced(lens):
    found = profile(lens)
    assert_allclose(found["radius_mm"].iloc[-1], lens.radius)
    assert_allclose(abs(found["balanced_um"].iloc[-1]), 1000 * balanced(lens).largest, rtol=1e-9)
    f, last = lens.interior.f, found.iloc[-1]
    assert_allclose(
        f * np.tan(np.radians(last["angle_deg"])), lens.radius - last["radial_um"] / 1000
    )
    assert (np.diff(found["radius_mm"]) > 0).all()


def test_the_camera_is_drawn_with_its_axes_and_the_direction_of_flight(run, lens):
    fig = parameters.image_figure(run)
    drawn(fig)
    words = {text.get_text() for text in fig.axes[0].texts}
    assert {"x", "y", "col", "row", "body x"} <= words
    forward = lens.camera.T_b_c.R[0]  # the body's x axis seen from the camera, turned by 90 degrees
    assert_allclose(forward, [0, -1, 0], atol=1e-12)
    label = next(t for t in fig.axes[0].texts if t.get_text() == "body x")
    assert label.get_position()[1] > 0  # above the tail of an arrow that points down


# --- The balanced focal length: closed form, printed certificates, minimax, and its sigma


def lens_lens(radius, f=50.0, **coefficients):
    """A square camera whose corner is at a radius, mm, to a micrometre; nothing is uncertain."""
    side = round(1000 * np.sqrt(2) * radius)
    interior = Interior(f=f, **coefficients)
    camera = Camera(name="CAM", width_px=side, height_px=side, pixel_mm=0.001, interior=interior)
    return Lens(camera=camera, cov=np.zeros((len(INTERIOR), len(INTERIOR))))


def test_k1_alone_leaves_a_chebyshev_polynomial():
    one = lens_lens(40.0, k1=2.27e-6)
    found, R = balanced(one), one.radius
    assert_allclose(found.f, 50.0 / (1 - 0.75 * 2.27e-6 * R**2), rtol=1e-14)
    assert_allclose(found.largest, found.f / 50.0 * 2.27e-6 * R**3 / 4, rtol=1e-9)


@pytest.mark.parametrize(
    ("f", "coefficients"),
    [  # K0, K1, K2 of the USGS reports of calibration OSL/2985 (2003) and OSL/3030 (2004)
        (153.743, (0.2616e-4, -0.2295e-8, 0.1454e-13)),
        (153.247, (0.3285e-4, -0.5215e-8, 0.1642e-12)),
    ],
)
def test_printed_certificates_are_balanced_in_this_way(f, coefficients):
    """Their last angle is 40 degrees; K0 is the slope, and corrections have the other sign."""
    k0, k1, k2 = coefficients
    found = balanced(lens_lens(f * np.tan(np.radians(40.0)), f=f, k1=-k1, k2=-k2))
    assert_allclose(found.slope, k0, rtol=0.015)  # balanced there to a micrometre at 129 mm
    assert 1000 * found.largest == pytest.approx(1.0, abs=0.1)  # printed: from -1 to 1 micrometre


COEFFICIENTS = [
    {"k1": -1e-6, "k2": 3e-9, "k3": -1e-12},
    {"k1": 2e-6, "k2": -4e-9, "k3": 1.9e-12},
    {"k2": 1e-9},
    {"k1": -5e-7},
]


@pytest.mark.parametrize("coefficients", COEFFICIENTS)
def test_no_other_focal_length_has_a_smaller_largest_distortion(coefficients):
    one = lens_lens(30.0, **coefficients)
    found, r = balanced(one), np.linspace(0, one.radius, 20001)
    outwards = distortion(one.interior, np.stack([r, 0 * r], axis=-1))[:, 0]
    ideal = (r - outwards) / one.interior.f  # tangents of the field angles

    def seen(c):
        return r - c * ideal

    assert_allclose(seen(found.f).max(), found.largest, rtol=1e-6)
    assert_allclose(seen(found.f).min(), -found.largest, rtol=1e-6)
    for other in (found.f - 1e-3, found.f + 1e-3):
        assert np.abs(seen(other)).max() > found.largest


@pytest.mark.parametrize(
    ("key", "step"), [("f", 1e-4), ("k1", 1e-10), ("k2", 1e-13), ("k3", 1e-16)]
)
def test_its_sigma_is_that_of_differences(key, step):
    one = lens_lens(30.0, k1=-1e-6, k2=3e-9, k3=-1e-12)
    ahead, behind = (
        balanced(with_value(one, key, getattr(one.interior, key) + s * step)).f for s in (1, -1)
    )
    cov = np.zeros_like(one.cov)
    cov[INTERIOR.index(key), INTERIOR.index(key)] = 1.0
    assert_allclose(
        balanced(replace(one, cov=cov)).sigma, abs(ahead - behind) / (2 * step), rtol=1e-6
    )


def with_value(one, key, value):
    interior = replace(one.interior, **{key: value})
    return replace(one, camera=one.camera.with_interior(interior))


def test_a_lens_without_distortion_is_balanced_as_it_is():
    one = lens_lens(30.0)
    cov = one.cov.copy()
    cov[0, 0] = 0.001**2
    found = balanced(replace(one, cov=cov))
    assert (found.f, found.largest) == (50.0, 0.0)
    assert_allclose(found.sigma, 0.001)


def test_profiles_are_those_of_the_library():
    one = lens_lens(30.0, k1=2e-6, k2=-4e-9, k3=1e-12, p1=3e-6, p2=-4e-6)
    told = profile(one)
    r, turn = told["radius_mm"].to_numpy(), np.linspace(0, 2 * np.pi, 721)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    both = 1000 * distortion(one.interior, r[:, None, None] * around)
    outwards = np.sum(both * around, axis=-1)
    across = both[..., 1] * around[:, 0] - both[..., 0] * around[:, 1]
    radial, decentring = told["radial_um"].to_numpy(), told["decentring_um"].to_numpy()
    assert_allclose(outwards.mean(axis=1), radial, atol=0.1)  # the decentring averages out
    assert_allclose(across.max(axis=1), decentring, rtol=1e-4)
    off = outwards - radial[:, None]
    assert_allclose(off.max(axis=1), 3 * decentring, rtol=1e-4)


def test_a_lens_of_the_results_has_their_values_and_covariance(run):
    (one,) = lenses(run, SINGLE)
    rows = run.found.parameters
    rows = rows[rows["method"] == "single_step"].set_index("parameter")
    assert one.interior.k2 == rows.loc["k2", "value"]
    assert one.interior.b1 == 0.0
    sigma = np.sqrt(np.diag(one.cov))[[INTERIOR.index(key) for key in ("f", "xp", "k1", "b1")]]
    assert_allclose(sigma[:3], rows.loc[["f_mm", "xp_mm", "k1"], "sigma"], rtol=1e-9)
    assert sigma[3] == 0.0
    of_k1 = profile(replace(one, cov=np.diag(np.eye(len(INTERIOR))[INTERIOR.index("k1")])))
    assert_allclose(of_k1["sigma_um"], 1000 * of_k1["radius_mm"] ** 3)


# --- Tables of parameters: the values of the results, with their sigma


def shown(material, name="parameters"):
    return figures.table(parameters.section(material).markdown, f"tab-report-{name}")


def test_parameters_stand_with_their_sigma(run):
    table = shown(run).set_index("Parameter")
    rows = results.parameters(run.found, SINGLE, "CAM")
    value, sigma = table.loc["$f$ (mm)", "Value and σ"].split(" ± ")
    assert_allclose(float(value), rows.loc["f_mm", "value"], atol=1e-4)
    assert_allclose(float(sigma), rows.loc["f_mm", "sigma"], rtol=0.05)
    assert len(table) == len(rows)
    methods = shown(run, "methods").set_index("Parameter")
    assert methods.loc["lever arm $x$ (m)", "Two-step, GNSS positions"] == "held"


def test_the_part_of_the_heads_stands_beside_sigma_and_is_told_as_a_share(folder):
    assert "transferred into the synthetic image" not in parameters.section(read(folder)).markdown
    assert "Of σ from the heads" not in shown(read(folder))

    def with_heads(table):
        rows = (table["method"] == "single_step") & (table["stage"] == "mounting")
        share = np.where(table.loc[rows, "parameter"] == "f_mm", 0.75, 0.25)
        table.loc[rows, "sigma_before"] = share * table.loc[rows, "sigma"].astype(float)

    edit(folder, "parameters", with_heads)
    said = parameters.section(read(folder)).markdown
    assert "It is 0.25 to 0.75 times σ, most in $f$." in said
    own = results.parameters(read(folder).found, SINGLE, "CAM").loc["f_mm", "sigma"]
    row = shown(read(folder)).set_index("Parameter").loc["$f$ (mm)"]
    assert float(row["Of σ from the heads"]) == pytest.approx(0.75 * own, rel=0.05)


def test_focal_lengths_that_the_heads_hold_are_named_beside_sigma(folder):
    def with_heads(table):
        table.loc[table["stage"] == "mounting", "sigma_before"] = 1e-12

    edit(folder, "parameters", with_heads)
    material = read(folder)
    said = "focal lengths are held: what is wrong with them"
    for free, told in ((("xp", "yp"), True), (("f", "xp"), False)):
        flight = replace(material.flight, estimate_heads=free)
        section = parameters.section(replace(material, flight=flight)).markdown
        assert (said in section) == told


# --- estimates of the report: significance, declared values, strong pairs --------------------


def test_tests_are_against_zero_or_what_was_declared(run):
    table = shown(run).set_index("Parameter")
    rows = results.parameters(run.found, SINGLE, "CAM")
    declared = run.flight.cameras["CAM"].interior.f
    assert float(table.loc["$f$ (mm)", "Against"]) == declared
    assert table.loc["boresight $\\kappa$ (°)", "Against"] == "90"
    assert table.loc["$x_p$ (mm)", "Against"] == table.loc["lever arm $z$ (m)", "Against"] == "0"
    expected = (rows.loc["f_mm", "value"] - declared) / rows.loc["f_mm", "sigma"]
    assert figures.numbers(table["t"])[0] == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize(("times", "said"), [(0.999, "no"), (-1.001, "yes")])
def test_significance_begins_at_students_critical_value(folder, times, said):
    redundancy = read(folder).found.summary[SINGLE]["redundancy"]

    def set_value(table):
        rows = (table["method"] == "single_step") & (table["parameter"] == "p2")
        sigma = table.loc[rows, "sigma"].astype(float)
        table.loc[rows, "value"] = times * stats.t.ppf(0.975, redundancy) * sigma

    edit(folder, "parameters", set_value)
    table = shown(read(folder)).set_index("Parameter")["Significant"]
    assert table.filter(like="$p_2$").tolist() == [said]


def test_of_what_is_declared_the_verdict_alone_says_whether_it_differs(run):
    """Beside "confirmed" stood "t = -6.5, significant"."""
    table = shown(run).set_index("Parameter")["Significant"]
    declared = [name for name in table.index if name.startswith(("$f", "lever", "boresight"))]
    assert table.index[table == "–"].tolist() == declared
    assert not any("boresight" in str(name) for name in shown(run, "joint")["Parameters"])


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
    table = shown(replace(material, flight=flight, found=found)).set_index("Parameter")
    assert table.loc["boresight $\\kappa$ (°)", "t"] == "1.0"


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
    pairs = strong_pairs(material, SINGLE)
    assert [(p.one, p.other) for p in pairs] == [tuple(names[:2]), tuple(names[1:])]
    assert_allclose([p.rho for p in pairs], [0.95, -0.91])
    assert pair_texts(pairs) == ["$f$ and $x_p$ (+0.95)", "$x_p$ and $y_p$ (-0.91)"]
    two = [replace(pairs[0], other="B/xp_mm"), pairs[1]]
    assert pair_texts(two) == [
        "$f$ of CAM and $x_p$ of B (+0.95)",
        "$x_p$ and $y_p$ of CAM (-0.91)",
    ]


def test_joint_tests_are_those_of_the_parameters_and_their_covariance(run):
    rows = results.parameters(run.found, SINGLE, "CAM")
    cov, table = results.covariance(run.found, SINGLE), shown(run, "joint")
    assert len(table) == 2
    for (_, said), keys in zip(table.iterrows(), (("k1", "k2", "k3"), ("p1", "p2")), strict=True):
        assert said["Parameters"].startswith(f"${keys[0][0]}_1$")
        names = [f"CAM/{key}" for key in keys]
        sigma = np.sqrt(np.diag(cov.loc[names, names]))
        related = cov.loc[names, names].to_numpy() / sigma / sigma[:, None]
        z = rows.loc[list(keys), "value"].to_numpy() / sigma
        f, largest = figures.numbers(said[["F", "Largest single t"]])
        assert f == pytest.approx(z @ np.linalg.solve(related, z) / len(z), abs=0.05)
        assert largest == pytest.approx(max(abs(z)), abs=0.05)


# --- the verdict: one level for all tests of a report, and what fails stands first -----------


def asked(question, *p, passed="It is right."):
    tests = tuple(
        ChanceTest(name=f"{question} {i}", p=one, said=f"bad {i}") for i, one in enumerate(p)
    )
    return Finding(question=question, state="holds", answer="Tested.", passed=passed, tests=tests)


def test_a_good_run_holds(run):
    found = findings(run)
    assert [f.question for f in found if f.state == FAILS] == []
    n = sum(len(f.tests) for f in found)
    said = statement(found)
    assert said.startswith(f"**The results hold.** None of {n} tests fails.")
    assert "error probability of 5 % (Holm)" in said
    assert n >= 15
    assert {f.question for f in found if f.tests} <= set(CONSEQUENCES)


def test_all_all_tests_a_report_share_one_level_by_holm():
    """Worked out by hand: p times 4, 3, 2, 1, never less than the one before."""
    one, two = judged([asked("One", 0.001, 0.04), asked("Two", 0.011, np.nan, 0.5)])
    assert_allclose([test.p_joint for test in one.tests], [0.004, 0.08])
    assert_allclose([test.p_joint for test in two.tests], [0.033, 0.5])
    assert [one.state, two.state] == ["fails", "fails"]
    assert one.answer == "Tested. Significant: bad 0."
    assert (two.p, two.p_joint) == (0.011, pytest.approx(0.033))
    (alone,) = judged([asked("One", 0.04, 0.2)])
    assert (alone.state, alone.answer) == ("holds", "Tested. It is right.")


def test_right_reports_fail_as_often_as_is_said(rng):
    """20 independent tests, 4 000 reports; three sigma of the count are 1 %."""
    failed = 0
    for p in rng.uniform(size=(4000, 20)):
        failed += any(f.state == FAILS for f in judged([asked("A", *p[:9]), asked("B", *p[9:])]))
    assert_allclose(failed / 4000, LEVEL, atol=0.0103)


def test_what_does_not_depend_on_chance_does_not_count():
    sure = Finding(question="Convergence", state="holds", answer="")
    assert judged([sure, sure, asked("One", 0.04)])[2].state == "fails"
    assert statement([sure]).startswith("**Nothing was tested.**")


def test_a_report_that_does_not_hold_says_first_what_fails_what_it_means_and_what_to_do():
    sure = Finding(question="All parameters determined", state="fails", answer="f is not.")
    found = judged([asked("Gross errors", 1e-9), asked("Global χ² test", 0.4), sure])
    first, second, last = statement(found).split("\n\n")
    assert first.startswith("**Not everything holds. “All parameters determined” fails: ")
    assert "what is named is not known; the other parameters can be used" in first
    assert "hold it at a surveyed value" in first
    assert second.startswith("- “Gross errors” fails, too: look at the largest")
    assert last.startswith("1 of 2 tests fails.")


def test_what_fails_stands_first_in_the_table_with_its_probabilities():
    good = Finding(question="Good", state="holds", answer="")
    table = verdict_table(judged([good, asked("Bad thing", 0.0123, 0.6)]))
    assert list(table["Question"]) == ["Bad thing", "Good"]
    assert list(table["p"]) == ["0.012", ""]
    assert list(table["p joint"]) == ["0.025", ""]


def test_where_nothing_was_adjusted_the_report_says_that_nothing_was_tested(folder):
    (folder / "summary.json").write_text(json.dumps({"heads/none": {"converged": True}}))
    file = folder / "check_points.csv"
    file.write_text(file.read_text().partition("\n")[0] + "\n")
    found = findings(read(folder))
    assert not any(f.tests for f in found)
    assert statement(found).startswith("**Nothing was tested.**")


def test_what_is_rejected_and_too_small_to_matter_has_its_own_state_with_both_numbers():
    test = ChanceTest(name="σ₀²", p=1e-12, said="σ is 1.03 times too small", size=0.03, limit=0.1)
    found = judged([Finding(question="Q", state="holds", answer="A.", tests=(test,))])
    assert found[0].state == "minor"
    assert found[0].answer == (
        "A. Rejected, but below the size that matters: σ is 1.03 times too small "
        "(p <\N{NO-BREAK SPACE}0.0005; 3 %, limit 10 %)."
    )
    assert list(verdict_table(found)["Result"]) == ["≈ rejected, below 10 %"]
    said = statement(found)
    assert said.startswith("**The results hold.** None of 1 test fails; 1 rejected, but below the")


def test_no_tick_stands_beside_a_test_that_is_rejected(rng):
    """Whatever the tests say: 200 reports with sizes on both sides of their limits."""
    for p, size in zip(
        10 ** rng.uniform(-6, 0, (200, 3)), rng.uniform(0, 0.2, (200, 3)), strict=True
    ):
        tests = tuple(
            ChanceTest(name=f"{i}", p=one, said="it", size=of, limit=0.1)
            for i, (one, of) in enumerate(zip(p, size, strict=True))
        )
        table = verdict_table(
            judged([Finding(question="Q", state="holds", answer="", tests=tests)])
        )
        rejected = 3 * p.min() < LEVEL
        assert rejected == ("✓" not in table["Result"][0])


def test_a_restriction_stands_with_the_verdict_where_it_applies():
    def asked_held(size):
        test = ChanceTest(name="held", p=1e-9, said="held", size=size, limit=0.2, unit="px")
        return statement(
            judged(
                [
                    Finding(
                        question="Q", state="holds", answer="", tests=(test,), restriction="Only a"
                    )
                ]
            )
        )

    assert asked_held(0.1).startswith("**The results hold, with a restriction.** None of 1 test")
    assert asked_held(0.1).endswith("**Only a.**")
    assert "Only a" not in asked_held(0.3)
