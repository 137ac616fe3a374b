"""The page on speed says what the benchmark's files hold, and nothing else."""

import json

import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from acx4book.pages.benchmarks import speed
from acx4book.pages.benchmarks.figure_speed import seconds_by_points

SIZE = {"images": 52, "points": 556, "image_points": 6694, "observations": 13868}
ABOUT = {
    "date": "2026-01-02",
    "processor": "a processor",
    "cores": 2,
    "memory_gb": 8.0,
    "system": "a system",
    "commit": "abc",
    "flags": "-O3",
    "ceres_tolerance": 1e-10,
    "ceres_exact_tolerance": 1e-14,
    "versions": {
        "python": "3.11",
        "numpy": "2",
        "numba": "0",
        "ceres": "2.1",
        "compiler": "g++ 12",
        "blas of ceres": "libblas",
    },
    "agreement": [
        {"problem": "a", "cost_timed": -2e-11, "cost": 3e-15, "parameters_sigma": 4e-6},
        {"problem": "b", "cost_timed": 1e-12, "cost": 0.0, "parameters_sigma": 1e-7, "sigma": 5e-9},
    ],
}


def run(solver, cpu_s, *, number=1, problem="a", **changed):
    row = {"problem": problem, **SIZE, "unknowns": 1994, "solver": solver, "run": number}
    row |= {"wall_s": cpu_s / 2, "cpu_s": cpu_s, "peak_mb": 200.0, "growth_mb": 80.0}
    return row | {"steps": 5, "converged": True, "cost": 100.0} | changed


def benchmark(rows, about=ABOUT):
    return speed.Benchmark(runs=pd.DataFrame(rows), about=about)


BESIDE_PYCOLMAP = [
    run("ours", 0.1, problem="free-5k"),
    run("pycolmap_default", 3.0, problem="free-5k"),
    run("pycolmap_tuned", 0.6, problem="free-5k", cost=100.0002),
    run("pycolmap_covariance", 1.1, problem="free-5k"),
]

COMPARED = [
    run("ours", 0.3, number=1),
    run("ours", 0.1, number=2),
    run("ours", 0.2, number=3),
    run("ceres_automatic_dense_1", 1.0, wall_s=0.9, peak_mb=850.0),
    run("ceres_automatic_dense_2", 1.5, wall_s=0.5, peak_mb=800.0),
    run("ceres_analytic_sparse_1", 0.5),
    run("ceres_analytic_sparse_2", 0.75),
    run("ceres_covariance", 2.5, peak_mb=500.0),
    run("scipy", 40.0, steps=200, converged=False, cost=100.0003),
]


@pytest.fixture(scope="module")
def text():
    return speed.page(benchmark(COMPARED))


def lines(text, label):
    """The rows of the table with a label, without its head."""
    table = text.split(f":name: {label}\n")[1].split("```")[0]
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in table.strip().splitlines()[2:]
    ]


def test_medians_stand_beside_the_best_way_of_ceres_for_each_quantity(text):
    size = ["52", "556", "13,868"]
    assert lines(text, "tab-speed-cpu") == [[*size, "0.200", "1.000", "5.0", "0.500", "2.5"]]
    assert lines(text, "tab-speed-wall") == [[*size, "0.100", "0.500", "5.0", "0.250", "2.5"]]


def test_memory_is_the_smallest_of_the_ways_of_ceres(text):
    assert lines(text, "tab-speed-memory") == [["52", "556", "13,868", "200", "80", "800", "0.25"]]


def test_what_others_need_besides_is_said(text):
    assert "with 556 points 2.50 s and 500 MB" in text
    assert "200 times ours, for 200 evaluations and then has not converged" in text
    assert "still 3·10⁻⁶ too large" in text


def test_the_worst_agreement_is_said(text):
    assert "at most 2·10⁻¹¹ from ours" in text
    assert "costs agree to 3·10⁻¹⁵ and the 14 parameters to 4·10⁻⁶" in text
    assert "agree to 5·10⁻⁹" in text


def test_processor_flags_date_and_commit_are_said(text):
    assert "2026-01-02 at commit `abc`: a processor, 2 cores, 8 GB" in text
    assert "compiled by `g++ 12` with `-O3`; BLAS `libblas`" in text


def test_a_benchmark_without_ceres_has_a_page():
    about = ABOUT | {"agreement": [], "versions": dict.fromkeys(("python", "numpy", "numba"), "1")}
    text = speed.page(benchmark([run("ours", 0.2)], about))
    assert "Ceres was not there" in text
    assert lines(text, "tab-speed-cpu")[0][3:] == ["0.200", "–", "–", "–", "–"]


def sweep(power):
    return [
        run(
            solver,
            factor * ties**power,
            problem=f"sweep-{ties}",
            points=ties,
            image_points=12 * ties,
        )
        for ties in (500, 1000, 2000, 4000)
        for solver, factor in (("ours", 1e-5), ("ceres_automatic_dense_1", 5e-5))
    ]


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_the_power_of_the_growth_is_found(power):
    text = speed.growth(benchmark(sweep(power)))
    assert text.startswith("From 2,000 to 4,000 points")
    assert f"power {power:.2f} " in text


def test_the_sweep_is_no_problem_of_the_tables():
    text = speed.page(benchmark([*COMPARED, *sweep(1.0)]))
    assert len(lines(text, "tab-speed-cpu")) == 1


def test_time_that_is_proportional_is_level_for_each_measurement():
    figure = seconds_by_points(benchmark(sweep(1.0)).sweep)
    FigureCanvasAgg(figure).draw()
    total, each = figure.axes
    for line, factor in zip(each.lines, (1e-5, 5e-5), strict=True):
        assert line.get_ydata() == pytest.approx(4 * [1e6 * factor / 12])
    assert [t.get_text() for t in figure.legends[0].get_texts()] == [
        "acx4lib, with covariance",
        "Ceres, automatic derivatives",
    ]
    assert all("(" in ax.get_xlabel() and "(" in ax.get_ylabel() for ax in (total, each))


def test_without_a_sweep_the_figure_says_so():
    figure = seconds_by_points(benchmark(COMPARED).sweep)
    assert [t.get_text() for t in figure.axes[0].texts] == [
        "No numbers of tie points were compared."
    ]
    assert speed.growth(benchmark(COMPARED)) == ""


def test_files_that_are_missing_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="make bench"):
        speed.read(tmp_path)


def test_the_files_of_the_repository_make_a_page(pytestconfig):
    folder = pytestconfig.rootpath / "data" / "benchmarks"
    stored = speed.read(folder)
    assert stored.about == json.loads((folder / "adjustment.json").read_text("utf-8"))
    text = speed.page(stored)
    assert len(lines(text, "tab-speed-cpu")) == len(stored.problems)
    assert "nan" not in text


def test_pycolmap_has_a_table_of_its_own_where_it_was_measured():
    about = {**ABOUT, "versions": {**ABOUT["versions"], "pycolmap": "4.2.1"}}
    text = speed.page(benchmark([*COMPARED, *BESIDE_PYCOLMAP], about))
    assert "pycolmap 4.2.1" in text
    row = next(line for line in text.splitlines() if "0.600" in line)
    for number in ("0.100", "6.0", "1.100", "11.0", "3.000", "30.0"):
        assert number in row
    assert "Costs agree to 2·10⁻⁶" in text
    assert benchmark([*COMPARED, *BESIDE_PYCOLMAP]).problems == ["a"]
    assert "pycolmap" not in speed.page(benchmark(COMPARED))


def test_the_first_adjustment_of_a_process_is_told_where_it_was_measured():
    rows = [run("ours", 0.1, first_cpu_s=0.14, first_wall_s=0.2), *COMPARED[3:]]
    sentence = "0.14 s of CPU time instead of 0.10 s with 556 points"
    assert sentence in speed.page(benchmark(rows))
    assert "first adjustment" not in speed.page(benchmark(COMPARED))
