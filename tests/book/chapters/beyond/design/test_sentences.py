import re

from acx4book.chapters.beyond.design import compared, sentences


def test_two_heights_are_said_with_the_numbers_of_the_table(tables):
    one, two = tables["ratio"][1.0], tables["ratio"][1.5]
    said = sentences.two_heights(tables["ratio"])
    assert f"is {1000 * one['f_mm']:.2g} µm" in said
    assert f"{one['f_mm'] / two['f_mm']:.2g} and {one['lever_z_m'] / two['lever_z_m']:.2g}" in said


def test_directions_and_numbers_and_control_are_said(tables):
    assert "7." in sentences.opposite(tables["turn"]).split("times smaller")[0]
    assert "12 strips of one direction" in sentences.number(tables["pairs"], tables["same_way"])
    none = tables["control"][0]["lever_z_m"]
    assert f"σ = {100 * none:.2g} cm" in sentences.control(tables["control"])


def test_the_answer_has_the_cost_of_each_flight(plan, chosen, tables):
    table = compared.table(compared.flights(plan, chosen))
    said = sentences.answer(tables["ratio"], tables["turn"], table, 1.25)
    minutes = [round(float(x)) for x in table.loc["minutes", ["the paper's", "chosen"]]]
    assert f"takes {minutes[0]} minutes" in said
    assert f"need {minutes[1]} for σ of at most 1.25 times" in said
    assert re.search(r"no σ is more than \d\.\d times the paper's\.$", said)
