"""Flights unlike the study run through all notebooks; no sentence says what cannot be true."""

import re

import nbformat
import pytest

from acx4book.notebooks import runner
from acx4book.notebooks.execute import Notebooks
from acx4book.pages import build, flight_book
from acx4lib.results.provenance import KEPT
from acx4lib.results.table_files import NOTEBOOKS
from support.flights import unlike

NEVER = {
    "an infinite or missing number": r"\b(inf|nan|NaN|None)\b",
    "a number as Python writes it": r"\d\.\d{13,}",
    "zero with a sign": r"(?<![\w.·⁻])[-−]0(?![\d.,:])",
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


@pytest.fixture(scope="module", params=unlike.NAMES)
def texts(request, tmp_path_factory):
    """What the cells of all notebooks show, by notebook and cell."""
    folder = tmp_path_factory.mktemp("unlike")
    flight = unlike.write(request.param, folder)
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
    return {where: "\n".join(parts) for where, parts in said.items()}


def test_every_notebook_has_something_to_say(texts):
    assert len(texts) > 5


@pytest.mark.parametrize("what", NEVER)
def test_no_text_has(texts, what):
    found = {
        where: [text[max(0, m.start() - 60) : m.end() + 40] for m in re.finditer(NEVER[what], text)]
        for where, text in texts.items()
    }
    assert {where: hits for where, hits in found.items() if hits} == {}


def test_the_papers_values_stand_beside_its_own_cameras_only(texts):
    found = {where: re.findall(OF_STUDY, text) for where, text in texts.items()}
    assert {where: hits for where, hits in found.items() if hits} == {}


def test_a_class_is_told_only_where_the_standard_has_enough_points(texts):
    said = [text for (name, _), text in texts.items() if name == "04-validation"]
    if any("not stated, n = " in text for text in said):
        assert not any("class A" in text for text in said)
        assert any("The standard PEC-PCD asks for 20 points" in text for text in said)
