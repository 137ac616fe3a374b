"""Every line of the pages on a first flight and the library runs; its output stands under it."""

import re
from subprocess import CalledProcessError

import pytest

from acx4book.pages import build
from support.helpers import ROOT

PAGE = (ROOT / "book" / "library.md").read_text("utf-8")
FILES = (ROOT / "book" / "your-files.md").read_text("utf-8")
FIRST_FLIGHT = (ROOT / "book" / "first-flight.md").read_text("utf-8")


@pytest.fixture(scope="module")
def printed():
    return list(build.outputs(PAGE))


@pytest.fixture(scope="module")
def flown():
    return list(build.outputs(FIRST_FLIGHT))


def places(page):
    """Return an empty text for every piece of code, and the names of included outputs."""
    place = r"^```(?:(?:python|shell)$|\{literalinclude\} _generated/(.*)$)"
    return re.findall(place, page, re.MULTILINE)


def expected(name, outputs):
    named = ([""] + [f"{name}-{n}.txt"] * bool(text) for n, text in enumerate(outputs, 1))
    return [one for piece in named for one in piece]


def test_the_output_of_every_piece_of_code_stands_under_it(printed, flown):
    assert places(PAGE) == expected("library", printed)
    assert places(FIRST_FLIGHT) == expected("first-flight", flown)


@pytest.mark.repeats
def test_other_programs_files_become_a_calibration():
    said = list(build.outputs(FILES))
    own = [name for name in places(FILES) if not name.startswith("imports-")]
    shown = [name for name in own if name]
    assert shown == [name for name in expected("your-files", said) if name]
    assert "still to do: my_flight/flight.toml:9: cameras.CAM.focal_mm: missing" in said[4]
    assert "check: " not in said[4]
    assert "notes" not in said[6]
    assert "results in my_results" in said[7]
    assert "for_opencv: CAM.yaml" in said[7]


def test_a_first_flight_keeps_the_promise_of_its_sigma(flown):
    errors = [float(line.split()[-1]) for line in flown[3].splitlines()[1:]]
    assert len(errors) == 14
    assert max(map(abs, errors)) < 3
    assert sum(abs(error) > 1 for error in errors) < 0.5 * len(errors)


def test_the_planted_sign_is_named(flown):
    assert "with pitch of opposite sign" in flown[5].split("notes")[1]


def test_a_command_that_fails_stops_the_page():
    with pytest.raises(CalledProcessError, match="nowhere"):
        list(build.outputs("```shell\nacx4 check nowhere\n```\n"))


def test_the_page_has_no_code_that_is_not_run():
    begun = re.findall(r"^```(?:python|\{literalinclude\})", PAGE, re.MULTILINE)
    needs_data = PAGE.count("```{code-block} python")  # run by tests/book/reference/dbat
    assert needs_data == 1
    assert PAGE.count("```") == 2 * (len(begun) + needs_data)


def test_the_estimate_from_tables_is_that_from_the_folder(printed):
    f = re.search(r"^f\s+mm\s+(\S+)", printed[2], re.MULTILINE)[1]
    assert printed[8] == f"f = {float(f):.4f} mm, as from the folder: True\n"


def test_mistakes_are_told_by_table_row_and_column(printed):
    begin = [line.split(";")[0] for line in printed[9].splitlines()]
    assert begin == [
        "calibration.image_points, row 7: sigma_px: 0.0",
        "calibration.image_points, row 7: image: 'C1_02' is unknown (did you mean 'C1-02'?)",
        "calibration.image_points, row 7: col_px: 'nan'",
    ]


def test_the_test_field_is_calibrated_within_its_sigma(printed):
    found, sigma = (
        [float(n) for n in re.findall(r"-?\d+\.\d+", line)[:3]]
        for line in printed[10].splitlines()[:2]
    )
    for value, true, own in zip(found, (50.4, 0.03, -0.02), sigma, strict=True):
        assert abs(value - true) < 4 * own


def test_a_free_network_with_a_distance_has_six_motions_open(printed):
    n_open, f, sigma = (float(n) for n in re.findall(r"\d+(?:\.\d+)?", printed[11]))
    assert n_open == 6
    assert abs(f - 50.4) < 4 * sigma


def test_pixels_have_sigma_near_what_the_height_alone_gives(printed):
    lines = printed[5].splitlines()
    sigma = [float(n) for n in lines[1].split()[4:]]
    assert sigma[2] == pytest.approx(0.5, abs=1e-3)
    assert all(0.01 < s < 1.0 for s in sigma[:2])


def test_code_runs_in_the_order_of_the_page_in_a_folder_of_its_own():
    first = "```python\nopen('a', 'w').close()\nn = 1\n```\n"
    page = f"text\n{first}\n```python\nimport os\nprint(n, os.listdir())\n```\n"
    assert list(build.outputs(page)) == ["", "1 ['a']\n"]
