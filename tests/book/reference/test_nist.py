"""The least-squares core alone, on NIST's certified regressions."""

from __future__ import annotations

from pathlib import Path

import pytest

from acx4book.reference import nist
from support.helpers import needs

pytestmark = needs("nist-strd")

NOT_FROM_START_1 = {"BoxBOD"}
"""The first steps lead where its exponential vanishes; MINPACK does not get there, either."""

DIGITS = 8
"""What is asked for; the certified values have eleven."""


@pytest.fixture(scope="module")
def table():
    return nist.results()


DIGITS_BY_QR = 9.5
"""Parameters, sigma by QR, and sigma0; BoxBOD's six points give 9.8."""


def test_the_collection_has_27_sets_of_which_20_are_run(table):
    assert len({*nist.MODELS, *nist.NOT_RUN}) == 27
    assert len(nist.MODELS) == 20
    page = Path("notebooks", "05-reference-data.ipynb").read_text("utf-8")
    assert f"{', '.join(nist.NOT_RUN[:-1])} and {nist.NOT_RUN[-1]} are not there" in page
    assert set(table["dataset"]) == set(nist.MODELS)
    assert set(table["start"]) == {1, 2}


def test_eight_digits_everywhere_from_the_second_start(table):
    own = table[table["start"] == 2]
    wrong = own[~(own["digits"] >= DIGITS)]
    assert wrong.empty, wrong.to_string()


def test_eight_digits_from_the_first_start_where_the_method_gets_there(table):
    own = table[(table["start"] == 1) & ~table["dataset"].isin(NOT_FROM_START_1)]
    wrong = own[~(own["digits"] >= DIGITS)]
    assert wrong.empty, wrong.to_string()


def test_where_it_does_not_get_there_it_says_so(table):
    """A wrong minimum is never returned in silence: the parameters are open there."""
    own = table[(table["start"] == 1) & table["dataset"].isin(NOT_FROM_START_1)]
    assert (own["outcome"] == "no step reduces the cost any more").all()
    others = table[~table.index.isin(own.index)]
    assert (others["outcome"] == nist.CONVERGED).all()


def test_sigma_by_qr_keeps_the_digits_that_the_normal_matrix_loses(table):
    """A condition of 1e4 is 1e8 in the normal matrix: one or two of eleven digits in Lanczos3."""
    own = table[table["start"] == 2]
    by_normals = own["quantity"].str.endswith(nist.BY_NORMALS)
    assert own[~by_normals]["digits"].min() > DIGITS_BY_QR
    lanczos = own[own["dataset"] == "Lanczos3"]
    sigma = lanczos[lanczos["quantity"].str.startswith("sigma of")].set_index("quantity")["digits"]
    normal = sigma[sigma.index.str.endswith(nist.BY_NORMALS)]
    assert normal.min() < 10.0
    assert sigma.drop(normal.index).min() > 10.5
