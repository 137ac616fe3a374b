"""What the study's sentences say is what its tables hold."""

from dataclasses import replace

import pytest

from acx4book.chapters.beyond.synthetic_cost import sentences, study, tables


@pytest.fixture(scope="module")
def found():
    return study.read()


def test_the_origin_names_flights_and_commit(found):
    assert "50 flights" in sentences.made(found)
    assert found.about["commit"][:7] in sentences.made(found)


def test_chi_square_compares_both_ways_of_the_same_flight(found):
    said = sentences.chi_square(found)
    mean = study.variance_factors(found, study.SYNTHETIC).mean()
    assert f"{mean:.3f} in the single step" in said


def test_an_excess_that_is_planted_is_said(found):
    own = found.parameters.copy()
    factor = own["parameter"] == "sigma0_squared"
    rig = own[factor & (own["way"] == study.RIG)].set_index("seed")["value"]
    planted = factor & (own["way"] == study.SYNTHETIC)
    own.loc[planted, "value"] = (rig.loc[own.loc[planted, "seed"]] + 0.5).to_numpy()
    said = sentences.chi_square(replace(found, parameters=own))
    assert "the difference is 0.500 ± 0.000" in said
    assert "in 50 of 50 flights" in said


def test_the_lever_arm_is_explained_by_the_square(found):
    said = sentences.lever(found)
    assert "-0.201 m in the body's" in said
    assert "Least squares over the frame makes it 0.22 m" in said


def test_the_recommendation_takes_its_factor_from_the_scatter(found):
    largest = study.scatter(found, study.SYNTHETIC)["ratio"].max()
    assert 3 < largest < 4
    assert "parameters by 4 before" in sentences.recommendation(found)


def test_the_best_height_is_one_of_the_table(found):
    said = sentences.other_heights(found)
    assert any(f"smallest near {h:.0f} m" in said for h in tables.HEIGHTS_M)


@pytest.mark.parametrize("say", ["accuracy", "parameters", "fingerprint", "centres"])
def test_no_number_is_missing(found, say):
    said = getattr(sentences, say)(found)
    assert "nan" not in said
    assert "inf" not in said.replace("inferior", "")


def test_the_answer_has_the_cost_in_accuracy_and_in_trust(found):
    said = sentences.answer(found)
    ratio = study.scatter(found, study.SYNTHETIC)["ratio"].max()
    assert f"by up to {ratio:.2f} times their stated" in said
    assert f"{study.variance_factors(found, study.SYNTHETIC).mean():.3f} on average" in said
