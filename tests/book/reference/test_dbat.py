"""Comparisons with DBAT."""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from acx4book import campaigns
from acx4book.campaigns import Campaign
from acx4book.reference import data, dbat_files, dbat_statements
from acx4book.reference.dbat_statements import results
from acx4lib.block import select_images
from acx4lib.bundle import adjust
from acx4lib.calibration.estimates import from_bundle
from acx4lib.geometry.camera import Camera, Interior, correct, xy_from_colrow
from acx4lib.geometry.collinearity import project as collinearity_project
from acx4lib.least_squares.covariance import sigmas
from acx4lib.model import Model
from support.helpers import needs

# --- two adjustments by another program, reproduced digit by digit ---------------------------


PROJECTS = [
    pytest.param(dbat_files.camcal, id="camcal", marks=needs("dbat-camcal")),
    pytest.param(dbat_files.sxb, id="sxb", marks=needs("dbat-sxb")),
]


@pytest.fixture(scope="module", params=PROJECTS)
def project(request):
    return request.param()


@pytest.fixture(scope="module")
def table(project):
    return results(project)


def test_every_printed_number_is_reproduced_to_one_unit_of_its_last_digit(table):
    wrong = table[~table["agrees"]]
    assert wrong.empty, wrong[["quantity", "printed", "ours"]].to_string()


def test_no_decimal_number_of_the_report_is_left_out(project, table):
    """Counted in the raw text, by another pattern than the reader's."""
    decimal = re.compile(r"(?<![\w.])-?\d+\.\d+(?:e-\d+)?(?![\w.]*\.\d)")
    in_text = Counter(decimal.findall(project.report.read_text()))
    left_out = in_text - Counter(table["printed"])
    course = [  # of the other program's computation
        number
        for place, line in dbat_files.read(project.report).items()
        if not dbat_statements.is_result(place)
        for number in line.numbers
    ]
    assert left_out == Counter(number for number in course if "." in number)


def test_a_digit_changed_by_two_units_is_noticed(project, table, tmp_path):
    text = project.report.read_text()
    place = text.index("Overall point RMS: ") + len("Overall point RMS: ")
    number = text[place : place + 5]
    changed = f"{float(number) + 0.002:.3f}"
    report = tmp_path / "report.txt"
    report.write_text(text[:place] + changed + text[place + 5 :])
    again = results(replace(project, report=report))
    wrong = again[~again["agrees"]]
    assert wrong["quantity"].tolist() == ["Quality > Point Marking Residuals > Overall point RMS"]
    assert len(again) == len(table)


def test_the_start_values_are_not_the_results(project):
    """They come from resection on the control points; the reference is not read for them."""
    start, end = project.bundle.network.start, project.bundle.state
    assert np.linalg.norm(start.T_m_b.r - end.T_m_b.r, axis=1).min() > 1e-4


def test_conventions_are_converted_as_the_reference_states_them():
    """The formulas of the data set's description, written out in its own terms."""
    camera = Camera(
        name="c",
        width_px=2272,
        height_px=1704,
        pixel_mm=0.0032,
        interior=Interior(
            f=7.4, xp=0.1, yp=-0.2, k1=4e-3, k2=-4e-5, k3=-2e-6, p1=6e-5, p2=4e-5, b1=4e-4
        ),
    )
    values, _ = dbat_files.interior_to_dbat(camera, np.zeros((10, 10)))
    _, px, py, aspect, k1, k2, k3, p1, p2 = values
    xy_px = np.array([[12.0, 1500.0], [1100.0, 30.5], [2200.0, 900.0]])
    x = (xy_px[:, 0] * 0.0032 - px) * (1 + aspect)
    y = -(xy_px[:, 1] * 0.0032 - py)
    r2 = x**2 + y**2
    radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
    x_c = x + x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y
    y_c = y + y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
    ours = correct(camera.interior, xy_from_colrow(camera, xy_px - dbat_files.HALF_PIXEL))
    np.testing.assert_allclose(ours, np.column_stack([x_c, y_c]), atol=1e-12)


def test_covariance_of_the_converted_interior_is_propagated():
    camera = Camera(
        name="c",
        width_px=2272,
        height_px=1704,
        pixel_mm=0.0032,
        interior=Interior(f=7.4, xp=0.8, b1=0.1),
    )
    cov = np.diag([0.0, 4e-6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9e-6])
    _, got = dbat_files.interior_to_dbat(camera, cov)
    # the principal point is xp over one plus b1, and a constant
    assert got[1, 1] == pytest.approx(4e-6 / 1.1**2 + 9e-6 * 0.8**2 / 1.1**4)
    assert got[1, 3] == pytest.approx(-9e-6 * 0.8 / 1.1**2)


# --- Half of the photographs of `camcal` against the other half, as two campaigns
#
# The camera was held level or turned by a quarter, in turns, and its lens gives way: eight of the
# images of either kind have another principal point. Comparing finds it, and finds nothing in the
# same images with errors of measurement alone.


LEVEL, TURNED = np.arange(0, 16, 2), np.arange(1, 16, 2)
"""Images around the sheet, by the way in which the camera was held."""


@pytest.fixture(scope="module")
def adjusted():
    return dbat_files.camcal().bundle


@pytest.fixture(scope="module")
def block(adjusted):
    return adjusted.network.block


def campaign(block, images):
    part = select_images(block, np.isin(np.arange(len(block.images)), images))
    network = replace(
        adjust.free_orientation(part, Model(free=dbat_files.FREE)), distortion_at="measured"
    )
    bundle = adjust.adjust(network)
    return Campaign(
        name=part.images.names[0],
        method="single_step",
        calibration=from_bundle(bundle),
        redundancy=bundle.solution.redundancy,
        height_m=1.5,
    )


def found(block, first, second):
    """Return the comparison of two groups of images."""
    return campaigns.compare(campaign(block, first), campaign(block, second))


@needs("dbat-camcal")
def test_a_camera_that_is_held_otherwise_has_another_principal_point(block):
    both = found(block, LEVEL, TURNED)
    assert both.test().p < 1e-12
    t = both.d / sigmas(both.cov)
    moved = {p.name for p, value in zip(both.parameters, t, strict=True) if abs(value) > 6}
    assert moved == {"xp_mm", "yp_mm"}


@needs("dbat-camcal")
def test_images_that_were_held_alike_differ_far_less(block):
    held = found(block, LEVEL, TURNED)
    per_dof = held.test().chi_square / held.test().dof
    for kind in (LEVEL, TURNED):
        alike = found(block, kind[::2], kind[1::2])
        assert alike.test().chi_square / alike.test().dof < 0.1 * per_dof


@needs("dbat-camcal")
def test_errors_of_measurement_alone_are_no_change(adjusted, block):
    """The same halves, with image points where one camera would show them: bounds of 99 %."""
    points, (camera,) = block.image_points, adjusted.cameras
    exact = collinearity_project(
        camera, adjusted.T_m_c[points.image_idx], adjusted.state.x_m[points.point_idx]
    )
    chi_square = dof = 0.0
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(size=exact.shape) * points.sigma_px[:, None]
        same = replace(block, image_points=replace(points, colrow=exact + noise))
        test = found(same, LEVEL, TURNED).test()
        chi_square, dof = chi_square + test.chi_square, dof + test.dof
    assert 0.005 < stats.chi2.cdf(chi_square, dof) < 0.995


# --- from arrays -----------------------------------------------------------------------------
#
# The page on the library calibrates a camera from two files: judged by what DBAT printed.


PAGE = Path(__file__).parents[3] / "book" / "library.md"


def code():
    (found,) = re.findall(r"```{code-block} python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    return found


@needs("dbat-camcal")
def test_the_page_s_lines_give_every_printed_digit_of_the_camera():
    names = {}
    with contextlib.chdir(data.path("dbat-camcal/images.txt").parent):
        exec(compile(code(), str(PAGE), "exec"), names)
    fit = names["fit"]
    cov = fit.solution.sigma0_sq * fit.solution.cov[:9, :9]
    order = [("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2", "b1").index(n) for n in names["free"]]
    values, cov = dbat_files.interior_to_dbat(fit.cameras[0], cov[np.ix_(order, order)])
    printed = dbat_files.read(data.path("dbat-camcal/reference_report.txt"))
    place = ("Information from last bundle", "Cameras", "Camera1 (simple)")
    headings = [dbat_statements.HEADINGS[name] for name in dbat_files.INTERIOR_NAMES]
    for name, value, sigma in zip(headings, values, np.sqrt(np.diag(cov)), strict=True):
        for what, ours in (("Value", value), ("Deviation", sigma)):
            (text,) = printed[(*place, name, what)].numbers
            assert abs(ours - float(text)) <= dbat_files.last_digit(text), (name, what)
    assert fit.solution.redundancy == 3725
