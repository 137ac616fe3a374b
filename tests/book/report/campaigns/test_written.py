"""The folder of a comparison: its files, replaced by a later one, and nothing of others."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from acx4book.report.campaigns import written
from acx4book.report.campaigns.tables import study
from acx4book.report.campaigns.written import ADDED, Drawn, page
from acx4book.typesetting import style
from acx4lib.errors import OutputError
from acx4lib.results.own_folder import MARK
from support.helpers import ROOT

TABLES = {"campaigns", "tests", "differences", "pooled", "trends", "covariance"}


@pytest.fixture(scope="module")
def folder(three, tmp_path_factory):
    out = tmp_path_factory.mktemp("campaigns") / "out"
    written.write(three, out)
    return out


def test_a_folder_has_a_page_and_tables(three, folder):
    files = {path.name for path in folder.iterdir()}
    assert files == {written.PAGE, MARK, *(f"{name}.csv" for name in TABLES)}
    found = pd.read_csv(folder / "differences.csv")
    columns = ["difference", "sigma", "p"]
    np.testing.assert_allclose(found[columns], three.tables["differences"][columns], rtol=1e-9)
    text = (folder / written.PAGE).read_text(encoding="utf-8")
    assert "2022-05 less 2021-05" in text
    assert text.count('<svg role="img"') == 4
    assert "{numref}" not in text


def test_the_same_comparison_gives_the_same_bytes_and_replaces_the_old_one(three, folder, tmp_path):
    written.write(study(three.comparison.campaigns[:2]), tmp_path / "out")
    written.write(three, tmp_path / "out")
    for path in folder.iterdir():
        if path.name != MARK:
            assert path.read_bytes() == (tmp_path / "out" / path.name).read_bytes()
    said = json.loads((tmp_path / "out" / MARK).read_text())
    assert written.COMMAND in str(said)


def test_a_folder_of_somebody_else_is_left_alone(three, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds what acx4 compare did not write"):
        written.write(three, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


# --- The page: one file that asks for nothing, in the book's colours by day and by night


CODE = "A <script> & $x$"


def test_texts_tables_and_figures_are_numbered_and_names_are_shown_as_they_are():
    with style.applied():
        fig, _ = style.subplots(figsize=(style.WIDTH, 1))
    figures = [
        Drawn(figure=fig, name=name, caption="An *a*.", alt="a < b") for name in ("fig-a", "fig-b")
    ]
    text = page("T", CODE, ["## One\n\nSee {numref}`fig-a`.", *figures])
    assert "&lt;script&gt;" in text
    assert "<script" not in text
    assert "See Figure 1." in text
    assert "<b>Figure 2.</b> An <em>a</em>." in text
    assert not re.search(r"<link|src=|url\(http|@import", text)


def test_colours_of_the_night_are_those_of_the_book():
    of_book = (ROOT / "book/_static/acx4.css").read_text(encoding="utf-8")
    night = re.findall(r"(--figure-[\w-]+): (#\w+);", ADDED.read_text(encoding="utf-8"))
    assert {name.removeprefix("--figure-") for name, _ in night} == set(style.NAMES.values())
    own = of_book[of_book.index('data-theme="dark"') :]
    assert dict(night).items() <= dict(re.findall(r"(--figure-[\w-]+): (#\w+);", own)).items()
