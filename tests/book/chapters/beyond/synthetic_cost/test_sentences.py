"""What the study's sentences say is what its tables hold."""

from dataclasses import replace

import pytest

from acx4book.chapters.beyond.synthetic_cost import sentences, study, tables


@pytest.fixture(scope="module")
def found():
    return study.read()


def test_the_origin_names_flights_and_commit(found):
    assert f"{found.n_flights} flights" in sentences.made(found)
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
    assert f"in {found.n_flights} of {found.n_flights} flights" in said


def test_the_lever_arm_is_explained_by_the_square(found):
    said = sentences.lever(found)
    assert "-0.201 m in the body's" in said
    assert "Least squares over the frame makes it 0.22 m" in said


def test_what_is_stated_holds_among_flights_with_the_same_heads(found):
    within = study.scatter_of_shared(found)
    assert within.between(0.6, 1.3).all()
    anew = study.scatter(found, study.SYNTHETIC)["ratio"].max()
    assert 3 < anew < 4
    assert f"by up to {anew:.1f} times their stated σ" in sentences.recommendation(found)
    assert f"at most {within.max():.2f} times" in sentences.answer(found)


def test_the_focal_length_follows_where_the_printed_lever_arm_is_found(found):
    said = sentences.focal_length_follows(found)
    assert "the paper's moves by +0.0107 mm" in said
    assert "$f$ moves by +0.010" in said
    assert "within 5 %" in said


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
