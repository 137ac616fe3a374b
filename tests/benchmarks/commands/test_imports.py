"""What imports say of real files is what is stored."""

import pandas as pd
import pytest

from acx4book.pages.build import BENCHMARKS
from benchmarks.commands import imports
from support.helpers import ROOT
from support.reference_files import needs

QUICK = ("sbet", "orientations")


def same(names):
    known = pd.read_csv(ROOT / BENCHMARKS / "imports.csv")
    expected = known[known["kind"].isin(names)]["line"].tolist()
    assert [row["line"] for row in imports.said(names)] == expected


@needs("ign-uce-m3")
@needs("applanix_pdal")
def test_quick_imports_say_what_is_stored():
    same(QUICK)


@pytest.mark.repeats
@needs("formats")
def test_all_imports_say_what_is_stored():
    same([name for name in imports.RUNS if name not in QUICK])


def test_a_command_that_fails_is_told():
    with pytest.raises(RuntimeError, match="nowhere:1: file: is not there"):
        imports.printed("acx4 import orientations nowhere --out f")
