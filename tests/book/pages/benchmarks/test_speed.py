"""Pages of benchmarks: speed, and what imports say."""

import re

import numpy as np
import pandas as pd
import pytest

from acx4book.pages.benchmarks import speed
from acx4book.pages.build import BENCHMARKS
from support.helpers import ROOT

# --- the page on speed says what the benchmarks' files hold, and nothing else ----------------


ABOUT = {
    "date": "2026-01-02",
    "commit": "0123456789",
    "processor": "P",
    "cores": 2,
    "memory_gb": 4.0,
    "versions": {"numpy": "2.0", "ceres": "2.1"},
}


def benchmark(rows, **about):
    return speed.Benchmark(runs=pd.DataFrame(rows), about=ABOUT | about)


def lines(text, name):
    """Return the cells of a table below its heading."""
    (table,) = re.findall(rf":name: tab-speed-{name}\n\n(.*?)\n```", text, flags=re.DOTALL)
    rows = [row.strip("| ").split(" | ") for row in table.splitlines()]
    return [[cell.strip() for cell in row] for row in rows[2:]]


def text_of(name, rows, **about):
    return speed.text(name, benchmark(rows, **about))


def test_it_says_when_and_on_what_it_was_measured():
    assert text_of("adjustment", COMPARED).startswith(
        "Measured on 2026-01-02 at commit `0123456`: P, 2 cores, 4 GB of memory; numpy 2.0, "
        "ceres 2.1.\n\n"
    )


def command(flight, name, images, cpu_s, run=1):
    size = {"flight": flight, "images": images, "measurements": 10 * images}
    return {**size, "command": name, "run": run, "wall_s": 2 * cpu_s, "cpu_s": cpu_s, "tree_mb": 50}


def test_commands_are_medians_without_what_every_run_imports():
    rows = [command("a", "imports", 5, 0.5), command("a", "check", 5, 0.3)]
    rows += [command("a", "run --numbers-only", 5, cpu, run) for run, cpu in enumerate((1, 9, 2))]
    text = text_of("commands", rows, imports="numpy")
    check, run = lines(text, "commands")
    assert check == ["a", "`acx4 check`", "5", "50", "0.6", "0.3", "–", "50"]
    assert run[3:] == ["50", "4.0", "2.0", "1.5", "50"]
    assert "times the images" not in text


def test_growth_is_that_of_the_two_largest_flights():
    name = "run --numbers-only"
    rows = [command(n, name, n_images, cpu) for n, n_images, cpu in (("a", 1, 9), ("b", 10, 2))]
    text = text_of("commands", [*rows, command("c", name, 40, 16)], imports="numpy")
    assert "With 4.0 times the images" in text
    assert "8.0 times the CPU time, the power 1.50 of their number, and 1.0 times" in text


def test_many_flights_are_compared_with_one_process():
    row = {"workers": 1, "flights": 10, "cpu_s": 20.0, "worker_mb": 250.0}
    rows = [{"way": "one", "wall_s": 30.0, **row}, {"way": "two", "wall_s": 20.0, **row}]
    found = lines(text_of("many", rows, design="d"), "many")
    assert [one[3:6] for one in found] == [["30", "1.00", "2.00"], ["20", "1.50", "2.00"]]


def test_what_was_not_measured_follows_from_pairs_and_pixels():
    """One second for the library, two for a pair and level, three for a megapixel and level."""
    sizes = [(0, 0, 0.0, 0), (8, 3, 1.0, 2), (8, 3, 2.0, 3), (8, 3, 4.0, 4), (50, 200, 8.0, 5)]
    names = ("pictures", "pairs", "megapixels", "levels")
    table = pd.DataFrame([dict(zip(names, size, strict=True)) for size in sizes])
    pixels = table["pictures"] * table["megapixels"]
    cpu = 1 + table["levels"] * (2 * table["pairs"] + 3 * pixels)
    mb = np.where(table["pictures"] > 0, 100 + 10 * table["megapixels"], 50)
    known = table.index < 4
    runs = table.assign(cpu_s=cpu.where(known), tree_mb=np.where(known, mb, np.nan))
    found = lines(text_of("measuring", runs), "measuring")
    assert [row[0] for row in found] == ["measured"] * 3 + ["computed"]
    assert found[-1][4:] == [f"{cpu.iloc[-1]:,.0f}", "180"]


def run(solver, cpu_s, problem="a", points=556, number=1):
    size = {"images": 52, "points": points, "image_points": 10 * points, "observations": 13_868}
    took = {"wall_s": cpu_s / 2, "cpu_s": cpu_s, "peak_mb": 1000 * cpu_s, "cost": 1.0}
    return {"problem": problem, **size, "solver": solver, "run": number, **took}


COMPARED = [
    *(run("ours", cpu_s, number=n) for n, cpu_s in enumerate((0.2, 0.9, 0.1))),
    *(run("ceres_automatic_dense_1", 1.0), run("ceres_automatic_sparse_2", 2.0)),
    *(run("ceres_analytic_dense_1", 0.5), run("ceres_covariance", 0.1)),
]


def test_the_adjustment_stands_beside_the_fastest_way_of_each_kind():
    text = text_of("adjustment", COMPARED)
    ours, theirs = ["0.200", "0.100", "200"], ["1.000", "1,000", "0.500", "500"]
    assert lines(text, "adjustment") == [["52", "556", "13,868", *ours, *theirs]]
    assert "pycolmap" not in text


def test_a_problem_that_only_we_have_solved_has_no_numbers_of_others():
    text = text_of("adjustment", [*COMPARED, run("ours", 0.4, problem="b")])
    assert lines(text, "adjustment")[1][6:] == ["–"] * 4


def test_pycolmap_has_a_table_of_the_problems_that_it_can_state():
    rows = [run("ours", 0.1, "free-a"), run("pycolmap_tuned", 0.4, "free-a")]
    rows += [run("pycolmap_covariance", 0.5, "free-a"), run("pycolmap_default", 2.0, "free-a")]
    text = text_of("adjustment", [*COMPARED, *rows])
    size = ["52", "556", "13,868"]
    assert lines(text, "pycolmap") == [[*size, "0.100", "0.400", "0.500", "2.000"]]
    assert len(lines(text, "adjustment")) == 1


@pytest.mark.parametrize("power", [1.0, 1.3])
def test_growth_with_the_number_of_points_is_told_and_drawn(power):
    rows = [
        run(solver, factor * n**power, f"sweep-{n}", points=n)
        for n in (500, 1000, 2000, 4000)
        for solver, factor in (("ours", 1e-3), ("ceres_automatic_dense_1", 1e-2))
    ]
    swept = benchmark([*COMPARED, *rows])
    text = speed.text("adjustment", swept)
    assert (
        f"From 2,000 to 4,000 points on the same images our time grows with the power {power:.2f}"
        in text
    )
    total, each = speed.seconds_by_points(swept).axes
    ours = total.lines[0]
    np.testing.assert_allclose(ours.get_xdata(), [0.5, 1, 2, 4])
    per_ray = np.array(each.lines[0].get_ydata())
    np.testing.assert_allclose(per_ray * 10 * np.array(ours.get_xdata()) / 1e3, ours.get_ydata())


def test_agreement_is_the_largest_of_all_problems():
    rows = [{"cost": -2e-9, "parameters_sigma": 1e-7}, {"cost": 1e-9, "parameters_sigma": 3e-7}]
    text = text_of("adjustment", COMPARED, agreement=rows, ceres_exact_tolerance=1e-14)
    assert "costs agree to 2·10⁻⁹, and the 14 parameters to 3·10⁻⁷ of their" in text


def rendered(what, cpu_s, reduction=1, **more):
    size = {"width_px": 100 // reduction, "height_px": 80 // reduction}
    row = {"what": what, "reduction": reduction, "run": 1, **size, "pixels": 8000}
    return {**row, "samples": 10_000, "wall_s": cpu_s / 2, "cpu_s": cpu_s, "peak_mb": 9.0, **more}


def test_renderers_are_compared_by_the_time_of_a_sample():
    rows = [rendered("remap_linear", 2e-4, rms_dn=0.5), rendered("ours_1", 1e-4, rms_dn=0.25)]
    rows += [rendered("nona", 60.0), rendered("acx4_render", 4.0, 4), rendered("acx4_render", 9.0)]
    about = {"reduction": 1, "width_px": 100, "height_px": 80, "ties": []}
    text = text_of("rendering", rows, **about)
    assert lines(text, "rendering") == [
        ["acx4lib, one thread", "10.0", "5.0", "0.25"],
        ["OpenCV remap, linear", "20.0", "10.0", "0.50"],
    ]
    assert [row[:2] for row in lines(text, "files")] == [
        ["acx4 render", "100 × 80 px"],
        ["nona", "100 × 80 px"],
        ["acx4 render", "25 × 20 px"],
    ]
    assert "tab-speed-ties" not in text


def test_what_is_stored_makes_a_page_and_what_is_missing_is_named(tmp_path):
    stored = speed.read(ROOT / "data" / "benchmarks")
    texts = {f"speed-{name}.md": speed.text(name, one) for name, one in stored.items()}
    page = (ROOT / "book" / "speed.md").read_text(encoding="utf-8")
    assert sorted(texts) == sorted(set(re.findall(r"_generated/(speed-.*\.md)", page)))
    assert all(text.startswith("Measured on 20") for text in texts.values())
    assert "tab-speed-ties" in texts["speed-rendering.md"]
    with pytest.raises(FileNotFoundError, match="make bench"):
        speed.read(tmp_path)


# --- what imports said is shown with its command, long lines broken --------------------------


def test_every_kind_has_its_text():
    texts = dict(speed.of_imports(ROOT / BENCHMARKS))
    assert texts["imports-sbet.txt"].startswith("$ acx4 import sbet applanix_pdal/2-points.sbet")
    for text in texts.values():
        assert max(map(len, text.splitlines())) <= speed.WIDTH
        assert "  found: " in text
