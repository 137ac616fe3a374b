"""The page on rendering says what the benchmark's files hold, and nothing else."""

import html
import json

import pandas as pd
import pytest

from acx4book.pages.benchmarks import rendering, rendering_goals

ABOUT = {
    "date": "2026-01-02",
    "processor": "a processor",
    "cores": 2,
    "memory_gb": 8.0,
    "system": "a system",
    "commit": "abc",
    "versions": {"python": "3.11", "numpy": "2", "nona": "1.5"},
    "exposure": "A1",
    "reduction": 1,
    "width_px": 400,
    "height_px": 500,
    "head_pixels": 250_000,
    "position_px": {"max": 0.0021, "rms": 0.001},
    "response": {"before": 0.13, "after": 0.0061, "floor": 0.004, "systematic": 0.0046},
    "missing": {},
    "ties": [
        {"method": "corners", "points": 9000, "rms_px": 0.03, "within_0.1_px": 0.99}
        | {"wall_s": 1.0, "cpu_s": 2.0},
        {"method": "SIFT", "points": 7000, "rms_px": 0.3, "within_0.1_px": 0.4}
        | {"wall_s": 20.0, "cpu_s": 24.0},
    ],
}


def run(what, wall_s, cpu_s, *, number=1, samples=220_000, **changed):
    row = {"what": what, "reduction": 1, "width_px": 400, "height_px": 500, "pixels": 200_000}
    row |= {"samples": samples, "run": number, "wall_s": wall_s, "cpu_s": cpu_s, "peak_mb": 100.0}
    return row | {"rms_dn": None, "p999_dn": None, "max_dn": None} | changed


ERRORS = {"rms_dn": 0.4, "p999_dn": 3.6, "max_dn": 9.0}
RUNS = [
    run("copy", 0.1, 0.1, samples=200_000),
    run("plan", 0.5, 0.5, samples=0),
    run("ours_2", 2.0, 4.0, number=1, **ERRORS),
    run("ours_2", 9.0, 9.0, number=2, **ERRORS),
    run("ours_2", 1.0, 2.0, number=3, **ERRORS),
    run("ours_1", 3.3, 3.3, **ERRORS),
    run("remap_linear", 3.0, 3.0, samples=240_000, rms_dn=0.3, p999_dn=0.5, max_dn=0.8),
    run("scipy", 0.5, 0.5, samples=10_000, pixels=10_000, rms_dn=0.29, p999_dn=0.5, max_dn=0.5),
    run("acx4_render", 2.0, 3.0, peak_mb=1500.0, samples=None),
    run("nona", 30.0, 24.0, samples=None),
    run("nona", 3.0, 2.0, samples=None, reduction=4, width_px=100, height_px=125),
]


def benchmark(rows=RUNS, **about):
    return rendering_goals.Renderings(runs=pd.DataFrame(rows), about=ABOUT | about)


@pytest.fixture(scope="module")
def text():
    return rendering.page(benchmark())


def lines(text, label):
    """The rows of the table with a label, without its head."""
    table = text.split(f":name: {label}\n")[1].split("```")[0]
    return [
        [html.unescape(cell.strip()) for cell in line.strip("|").split("|")]
        for line in table.strip().splitlines()[2:]
    ]


def test_goals_stand_beside_what_was_measured(text):
    rows = {row[0]: row[1:] for row in lines(text, "tab-rendering-goals")}
    assert rows == {
        "largest error of a position": ["≤ 0.0025 px", "0.0021 px", "yes"],
        "grey values to an exact rendering, rms": ["≤ 0.45 DN", "0.40 DN", "yes"],
        "the same, 99.9 % below": ["≤ 3.5 DN", "3.60 DN", "**no**"],
        "equalised heads disagree in overlaps by, at most": ["≤ 0.6 %", "0.61 %", "**no**"],
        # the median run, 2.0 s
        "time of the whole image on two threads, in plain copies of it on one": [
            *("≤ 35", "20.0", "yes")
        ],
        # 3.3 s for 220 000 samples, 3.0 s for 240 000
        "CPU time of a sample, in those of OpenCV's remap with its map ready": [
            *("≤ 1.2", "1.20", "yes")
        ],
        "CPU time of nona over that of acx4 render, files in and out": ["≥ 10", "8.0", "**no**"],
        "time of nona over that of acx4 render, files in and out": ["≥ 10", "15.0", "yes"],
        "peak memory of acx4 render": ["≤ 2 GB", "1.57 GB", "yes"],  # MB of 2^20 bytes
        "tie points of an overlap": ["≥ 8,000", "9,000", "yes"],
        "their errors, rms": ["≤ 0.04 px", "0.030 px", "yes"],
        "of them within 0.1 px": ["≥ 98 %", "99.0 %", "yes"],
        "CPU time of SIFT over that of ours": ["≥ 5", "12.0", "yes"],
    }


def test_noise_of_samples_is_told_from_disagreement(text):
    assert "by up to 13.00 %, afterwards by up to 0.61 %" in text
    assert "up to 0.40 %; without it, 0.46 % are left" in text


def test_windows_are_scaled_to_the_samples_of_the_image(text):
    rows = {row[0]: row[1:] for row in lines(text, "tab-rendering-time")}
    # 0.5 s for 10 000 samples; the image needs 220 000
    assert rows["scipy map_coordinates, order 1"] == [
        *("100 × 100 px, scaled", "1.000", "11.00", "11.00", "50000.0"),
        *("–", "110.0"),
    ]
    assert rows["acx4lib, two threads"][:2] == ["the image", "1.100"]


def test_errors_are_shown_of_those_that_have_some(text):
    names = [row[0] for row in lines(text, "tab-rendering-errors")]
    assert names == [
        *("acx4lib, two threads", "acx4lib, one thread", "OpenCV remap, linear"),
        "scipy map_coordinates, order 1",
    ]


def test_commands_are_sorted_by_size(text):
    rows = [row[:3] for row in lines(text, "tab-rendering-files")]
    assert rows == [
        ["acx4 render", "400 × 500 px", "2.0"],
        ["nona", "400 × 500 px", "30.0"],
        ["nona", "100 × 125 px", "3.0"],
    ]


def test_what_is_not_installed_is_said():
    text = rendering.page(benchmark(missing={"nona": "nona", "skimage": "skimage"}))
    assert "left out: nona, scikit-image warp, order 1." in text
    assert "left out" not in rendering.page(benchmark())


def test_a_part_of_the_runs_makes_a_page_too():
    text = rendering.page(benchmark([run("nona", 30.0, 24.0, samples=None)], ties=[]))
    assert "| nona |" in text
    assert "tab-rendering-time" not in text
    assert "tab-rendering-ties" not in text
    assert len(lines(text, "tab-rendering-goals")) == 2  # positions and responses
    assert rendering.limits(benchmark([RUNS[0]])) == ""


def test_limits_are_told_in_copies():
    text = rendering.limits(benchmark())
    assert "takes 0.100 s" in text
    assert "1.25 times as many" in text
    assert "33.0 copies; two in 20.0, 1.65 times as fast" in text
    assert "A sample takes 15000.0 ns" in text
    assert "hard seam" not in text
    more = [run("ours_plain_1", 2.0, 2.2), run("ours_fresh", 3.0, 5.5)]
    text = rendering.limits(benchmark([*RUNS, *more]))
    assert "hard seam, it takes 10000.0 ns" in text
    assert "difference of 1.5 s" in text


def test_a_missing_benchmark_names_the_cure(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no benchmark of rendering in .*: make bench"):
        rendering_goals.read(tmp_path)


def test_the_page_builds_from_the_stored_files(pytestconfig):
    stored = rendering_goals.read(pytestconfig.rootpath / "data" / "benchmarks")
    json.dumps(stored.about)
    text = rendering.page(stored)
    assert all(goal.measured > 0 for goal in rendering_goals.goals(stored))
    assert text.count("```{table}") == 5
    assert "nan" not in text
