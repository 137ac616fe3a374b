"""The example on the page about the library runs, and says why where it cannot."""

from acx4book.pages import example
from support.helpers import ROOT
from support.run_results import leave_results

PAGE = (ROOT / "book" / "library.md").read_text("utf-8")


def test_the_example_has_at_most_ten_lines():
    assert 5 < len([line for line in example.code(PAGE).splitlines() if line]) <= 10


def test_the_example_runs_as_far_as_a_flight_has_what_it_asks_for(tmp_path):
    at, results = leave_results(tmp_path)
    lever, first, scatter, why = example.output(example.code(PAGE), at, results).splitlines()
    assert lever.startswith("lever arm, m: [")
    assert first.startswith("first image taken at, m: [")
    assert scatter.startswith("scatter E, N, H, m: [")
    assert why == "my_flight/flight.toml: has no table [synthetic]; there is nothing to render"
