"""Flights unlike the study run through all notebooks; no sentence says what cannot be true."""

import re

import nbformat
import pytest

from acx4book.notebooks import runner
from acx4book.notebooks.execute import Notebooks
from acx4book.pages import build, flight_book
from acx4lib.results import folder as results
from acx4lib.results.provenance import KEPT
from acx4lib.results.table_files import NOTEBOOKS
from support.flights import in_heads, planned
from support.helpers import repeats

# --- unlike flights --------------------------------------------------------------------------
#
# Flights unlike the study run through all notebooks; no sentence says what cannot be true.


NEVER = {
    "an infinite or missing number": r"\b(inf|nan|NaN|None)\b",
    "a number as Python writes it": r"\d\.\d{13,}",
    "zero with a sign": r"(?<![\w.·⁻])[-−]0(\.0+)?(?![\d.,:])",
    "nothing where a value belongs": r"(finds|are|is|of|by)\s+[.,;°]",
    "several where there is one": (
        r"(?<![\d.,−-])1 (points|images|exposures|heads|check points|strips|pairs)\b"
    ),
    "a value of the code": r"<[A-Za-z_.]+ (object|at) |Failed\(|array\(",
    "a simulation": r"[Ss]imulated",
}
"""What no text of a real flight has, by what it would be."""

OF_STUDY = r"[Tt]he paper's|[Pp]rinted:"
"""What stands only beside flights of the paper's camera, in what is computed."""


SAYS = {
    "mounting held": ("09-weights", "3 check points of this block are compared"),
    "no check point": ("09-weights", "no check point is measured in this one"),
    "one strip, one check point": ("04-validation", "1 check point cannot show a distribution"),
    "parallel heads": ("02-synthetic-image", "make no mosaic"),
    "heads without control": ("02-synthetic-image", "make no mosaic"),
    "300 km": ("00-flight", "opposite directions"),
}
"""What is said of some flights, and where."""


OF_NAMES = [name if name == "parallel heads" else repeats(name) for name in planned.NAMES]


@pytest.fixture(scope="module", params=OF_NAMES)
def texts(request, tmp_path_factory):
    """What the cells of all notebooks show, by notebook and cell."""
    folder = tmp_path_factory.mktemp("unlike")
    flight = planned.write(request.param, folder)
    runner.run(flight, folder / "results", way=Notebooks())
    executed = folder / "results" / "notebooks"
    places = {"flight_path": str(folder / "results" / KEPT), "results_path": str(executed.parent)}
    for name, stage in flight_book.CHAPTERS.items():
        of_stage = NOTEBOOKS[stage]
        if name != of_stage and (executed / f"{of_stage}.ipynb").is_file():
            build.run_here(name, executed, places)
    said = {}
    for path in sorted(executed.glob("*.ipynb")):
        for number, cell in enumerate(nbformat.read(path, as_version=4).cells):
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                text = data.get("text/markdown", data.get("text/plain", output.get("text", "")))
                if "image/svg+xml" not in data:
                    said.setdefault((path.stem, number), []).append(text)
    return Texts(request.param, {where: "\n".join(parts) for where, parts in said.items()})


class Texts(dict):
    """What cells show, by notebook and cell, and which flight it is."""

    def __init__(self, name, said):
        super().__init__(said)
        self.name = name


def test_every_notebook_has_something_to_say(texts):
    assert len(texts) > 5


@pytest.mark.parametrize("what", NEVER)
def test_no_text_has(texts, what):
    found = {
        where: [text[max(0, m.start() - 60) : m.end() + 40] for m in re.finditer(NEVER[what], text)]
        for where, text in texts.items()
    }
    assert {where: hits for where, hits in found.items() if hits} == {}


def test_what_is_peculiar_to_a_flight_is_said(texts):
    notebook, sentence = SAYS.get(texts.name, ("00-flight", "measured image points"))
    said = " ".join(text for (name, _), text in texts.items() if name == notebook)
    assert sentence in " ".join(said.split())


def test_no_overlap_is_larger_than_all(texts):
    table = next(t for (n, _), t in texts.items() if n == "00-flight" and "side overlap" in t)
    rows = [line.split("|")[-3:-1] for line in table.splitlines()[2:] if line.startswith("|")]
    shares = [float(cell) for row in rows for cell in row if cell.strip() not in {"–", ""}]
    assert all(0 <= share <= 100 for share in shares)


def test_the_papers_values_stand_beside_its_own_cameras_only(texts):
    found = {where: re.findall(OF_STUDY, text) for where, text in texts.items()}
    assert {where: hits for where, hits in found.items() if hits} == {}


def test_a_class_is_told_only_where_the_standard_has_enough_points(texts):
    said = [text for (name, _), text in texts.items() if name == "04-validation"]
    if any("not stated, n = " in text for text in said):
        assert not any("class A" in text for text in said)
        assert any("The standard PEC-PCD asks for 20 points" in text for text in said)


# --- notebooks -------------------------------------------------------------------------------
#
# The notebooks on heads that are not the paper's; `built_book/test_payloads` has pictures.


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
