import pytest

from acx4book.chapters.beyond.design import compared, curves


def test_the_chosen_flight_is_cheaper_and_within_what_is_allowed(plan, chosen):
    assert chosen.met
    table = compared.table(compared.flights(plan, chosen))
    assert table.loc["minutes", "chosen"] < 0.8 * table.loc["minutes", "the paper's"]
    ratio = table["chosen"] / table["the paper's"]
    assert ratio[[*compared.WANTED]].max() <= 1.25
    assert table.loc["images", "the paper's"] == 52


def test_a_shorter_time_keeps_to_it(plan):
    short = compared.choice(plan, 1.25, minutes=6)
    assert short.minutes <= 6
    assert short.excess > 1
    assert {s.flying_height_m for s in short.plan.blocks["calibration"].strips.values()} == {
        1000.0,
        1500.0,
    }


def test_what_a_left_out_strip_does_is_told_by_sums_as_well(plan):
    harm, by_sums = compared.left_out(plan), compared.left_out_by_search(plan)
    assert (harm > 1).all(axis=None)
    assert by_sums.to_numpy() == pytest.approx(harm.to_numpy(), rel=0.12)


def test_the_tables_have_names_and_units(plan, chosen):
    written = compared.written(compared.table(compared.flights(plan, chosen)))
    assert written.iloc[3, 0] == "σ of $f$, mm"
    assert written.iloc[0, 1] == "5"
    bought = compared.bought(chosen)
    assert len(bought) == len(chosen.strips)
    assert bought["minutes"].iloc[-1] == f"{chosen.minutes:.1f}"
    assert bought["σ of f, mm"].iloc[-1] == f"{curves.sigmas(chosen.plan)['f_mm']:.2g}"
