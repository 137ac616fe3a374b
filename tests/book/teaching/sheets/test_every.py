"""The code of the lab pages, run on a student's flight."""

import re

import pytest

from acx4book.notebooks import runner
from acx4book.notebooks.functions import way_of
from acx4book.teaching import handed_in
from acx4book.teaching.sheets.every import SHEETS, sheet_of
from acx4lib.results import folder
from support.helpers import ROOT

PAGES = ROOT / "book" / "teaching"


@pytest.mark.parametrize("name", SHEETS)
def test_the_code_of_a_labs_page_runs(name, key, tmp_path, monkeypatch, capsys):
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    codes = re.findall(r"^( *)```python\n(.*?)^\1```", text, re.MULTILINE | re.DOTALL)
    assert bool(codes) == (name != "lab-1")
    monkeypatch.chdir(tmp_path)
    handed_in.write(SHEETS[name], "Ada", key, tmp_path / "my_flight")
    if "acx4 run my_flight" in text:
        runner.run("my_flight", "my_results", way=way_of(None), stages=folder.STAGES)
    known = {}
    for indent, code in codes:
        exec(re.sub(f"^{indent}", "", code, flags=re.MULTILINE), known)
    assert bool(capsys.readouterr().out) == bool(codes)


def test_a_sheet_has_a_number_and_a_name():
    assert sheet_of("6") is sheet_of("lab-6") is SHEETS["lab-6"]
    with pytest.raises(ValueError, match="known: lab-1, lab-2"):
        sheet_of("10")


def test_the_syllabus_names_every_lab():
    for page in ("syllabus.md", "instructor.md"):
        text = (PAGES / page).read_text(encoding="utf-8")
        assert [name for name in SHEETS if name not in text] == []
