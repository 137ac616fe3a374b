"""What is said of a flight, beside the paper's numbers where it is the paper's."""

import pytest

from acx4book.chapters.flight import tables
from acx4book.paper import printed as paper


def test_the_papers_flight_stands_beside_the_papers_numbers(flight):
    table = tables.level_table(flight).set_index("Flying height (m)")
    high, low = (table.loc[h] for h in ("2597 (2600)", "1596 (1600)"))
    assert high["Ground pixel (cm)"] == "21.1 (22)"
    assert high["Side overlap (%)"] == ""
    assert (low["Strips"], low["Images per strip"]) == ("3 (3)", "7 (7)")
    assert low["Directions"] == "1 (1)"
    (held,) = tables.content_table(flight).to_dict("records")
    assert (held["Images each"], held["Surveyed"]) == ("31 (31)", "56 (56)")


def test_every_statement_that_is_shown_is_transcribed():
    names = [name for said in tables.PRINTED.values() for name in said.values()]
    names += [*tables.PRINTED_IMAGES.values(), *tables.PRINTED_POINTS.values()]
    assert all(paper.statement(name) > 0 for name in names)


def test_other_flights_stand_alone(other):
    text = tables.level_table(other).to_csv() + tables.content_table(other).to_csv()
    assert "(26" not in text
    assert "(31)" not in text
    assert tables.content_table(other)["Cameras"].tolist() == ["port, starboard"]


def test_the_standard_deviations_are_those_of_flight_toml(flight):
    (row,) = tables.sigma_table(flight).to_dict("records")
    assert row["Image points (px)"] == flight.apriori.image_point_px
    assert row["heading (deg)"] == pytest.approx(flight.apriori.heading_deg)
