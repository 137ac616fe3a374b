"""The notebooks on heads that are not the paper's; `built_book/test_payloads` has pictures."""

import pytest

from acx4book.notebooks import runner
from acx4book.notebooks.execute import Notebooks
from acx4lib.results import folder as results
from support.flights import in_heads


@pytest.mark.slow
@pytest.mark.repeats  # `built_book/test_payloads` has other heads
def test_the_notebooks_run_on_heads_that_are_not_the_papers(tmp_path):
    other_path = in_heads.write_other_heads(tmp_path / "flight")
    report = runner.run(
        other_path, tmp_path / "results", way=Notebooks(), stages=("heads", "synthetic")
    )
    assert report.ran == ("heads", "synthetic")
    assert report.not_determined == report.left_out == ()
    found = results.read(tmp_path / "results")
    assert results.cameras(found, "synthetic/refined") == ("port", "starboard")
    for path in (tmp_path / "results" / "notebooks").glob("0*.ipynb"):
        text = path.read_text()
        assert '"output_type": "error"' not in text
        assert '"name": "stderr"' not in text
        assert "CAM1" not in text
