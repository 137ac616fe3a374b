"""The scorecard of an ideal camera, with the closed chain beside."""

import pandas as pd

from acx4book.paper import scorecard_page


def card(*rows):
    return pd.DataFrame(rows, columns=["table", "quantity", "column", "ours", "verdict"])


CHAIN = card(
    (1, "k1", "CAM1", 1.0, "agrees"),
    (3, "f_mm", "single_step", 3.0, "differs"),
    (3, "k1", "two_step", 4.0, "differs"),
)
IDEAL = card((3, "k1", "two_step", 40.0, "near"), (3, "f_mm", "single_step", 30.0, "agrees"))


def test_the_ideal_camera_is_judged_and_the_chain_stands_beside_it():
    both = scorecard_page.beside_chain(CHAIN, IDEAL)
    assert both["ours"].tolist() == [1.0, 40.0, 30.0]
    assert both["chain"].tolist()[1:] == [4.0, 3.0]
    assert both["verdict"].tolist() == ["agrees", "near", "agrees"]


def test_tables_of_the_heads_have_no_chain_beside_them():
    both = scorecard_page.beside_chain(CHAIN, IDEAL)
    assert both.loc[both["table"] == 1, "chain"].isna().all()


def test_a_number_that_the_chain_does_not_have_is_missing_and_not_lost():
    both = scorecard_page.beside_chain(CHAIN.iloc[:2], IDEAL)
    assert len(both) == 3
    assert both.set_index("quantity").loc["k1", "chain"].isna().all()
