"""Every line of the page about the library runs, and what it prints stands under it."""

import re

import pytest

from acx4book.pages import example
from support.helpers import ROOT

PAGE = (ROOT / "book" / "library.md").read_text("utf-8")


@pytest.fixture(scope="module")
def printed():
    return list(example.outputs(example.snippets(PAGE)))


def test_the_output_of_every_piece_of_code_stands_under_it(printed):
    place = re.compile(r"^```(?:python$|\{literalinclude\} _generated/(.*)$)", re.MULTILINE)
    expected = []
    for number, text in enumerate(printed, 1):
        expected += ["", f"library-{number}.txt"] if text else [""]
    assert place.findall(PAGE) == expected


def test_the_page_has_no_code_that_is_not_run():
    begun = re.findall(r"^```(?:python|\{literalinclude\})", PAGE, re.MULTILINE)
    assert PAGE.count("```") == 2 * len(begun)


def test_the_estimate_from_tables_is_that_from_the_folder(printed):
    f = re.search(r"^f_mm\s+(\S+)", printed[2], re.MULTILINE)[1]
    assert printed[7] == f"f = {float(f):.4f} mm, as from the folder: True\n"


def test_mistakes_are_told_by_table_row_and_column(printed):
    begin = [line.split(";")[0] for line in printed[8].splitlines()]
    assert begin == [
        "calibration.image_points, row 7: sigma_px: 0.0",
        "calibration.image_points, row 7: image: 'C1_02' is unknown (did you mean 'C1-02'?)",
        "calibration.image_points, row 7: col_px: 'nan'",
    ]


def test_the_test_field_is_calibrated_within_its_sigma(printed):
    found, sigma = (
        [float(n) for n in re.findall(r"-?\d+\.\d+", line)[:3]]
        for line in printed[9].splitlines()[:2]
    )
    for value, true, own in zip(found, (50.4, 0.03, -0.02), sigma, strict=True):
        assert abs(value - true) < 4 * own


def test_a_free_network_with_a_distance_has_six_motions_open(printed):
    n_open, f, sigma = (float(n) for n in re.findall(r"\d+(?:\.\d+)?", printed[10]))
    assert n_open == 6
    assert abs(f - 50.4) < 4 * sigma


def test_pixels_have_sigma_near_what_the_height_alone_gives(printed):
    lines = printed[4].splitlines()
    sigma = [float(n) for n in lines[1].split()[4:]]
    assert sigma[2] == pytest.approx(0.5, abs=1e-3)
    assert all(0.01 < s < 1.0 for s in sigma[:2])


def test_code_runs_in_the_order_of_the_page_in_a_folder_of_its_own():
    first = "```python\nopen('a', 'w').close()\nn = 1\n```\n"
    page = f"text\n{first}\n```python\nimport os\nprint(n, os.listdir())\n```\n"
    assert list(example.outputs(example.snippets(page))) == ["", "1 ['a']\n"]
