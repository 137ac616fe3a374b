"""What flew, above the paper's numbers where it is the paper's flight."""

import pandas as pd

from acx4book.chapters.flight import tables
from acx4book.paper import printed as paper
from acx4lib.flight.design import level_table


def flown(flight):
    return pd.concat({n: level_table(flight.mounted(n)) for n in flight.blocks}, names=["block"])


def test_the_papers_flight_stands_above_the_papers_numbers(flight):
    table = tables.beside_paper(flown(flight), flight)
    high, said, low, said_low = (row for _, row in table.iterrows())
    assert list(table.index.get_level_values("of")) == ["flown", "paper"] * 2
    heights = [row["height above ground (m)"] for row in (high, said, low, said_low)]
    assert [round(height) for height in heights] == [2597, 2600, 1596, 1600]
    assert (round(high["ground pixel (cm)"], 1), said["ground pixel (cm)"]) == (21.1, 22)
    assert (low["strips"], said_low["strips"]) == (3, 3)
    assert pd.isna(high["side overlap (%)"])
    assert said_low["side overlap (%)"] == 50
    (held,) = tables.printed_contents(flight).to_dict("records")
    assert held == {"paper: images each": 31, "paper: surveyed": 56}


def test_every_statement_that_is_shown_is_transcribed():
    names = [name for said in tables.PRINTED.values() for name in said.values()]
    names += [*tables.PRINTED_IMAGES.values(), *tables.PRINTED_POINTS.values()]
    assert all(paper.statement(name) > 0 for name in names)
    keys = {key for said in tables.PRINTED.values() for key in said}
    assert keys == {key for key, _ in tables.COLUMNS.values()}


def test_other_flights_stand_alone(other):
    alone = flown(other)
    pd.testing.assert_frame_equal(tables.beside_paper(alone, other), alone)
    contents = other.table()
    assert list(contents.join(tables.printed_contents(other))) == list(contents)
