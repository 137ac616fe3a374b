"""Ten heads: the stored rotations beside the trial's and the factory's."""

import numpy as np


def test_the_trial_found_the_same_rotations_of_all_ten_heads(stored):
    table = stored("ten_rotations")
    assert len(table) == 9
    assert np.abs(table.filter(like="minus_trial").to_numpy()).max() < 0.005
    assert (table["x_sigma_deg"] < 0.001).all()


def test_the_factory_is_off_by_hundredths_of_a_degree_where_it_says_anything(stored):
    table = stored("ten_rotations").set_index("head")
    off = table.filter(like="minus_factory")
    assert off.loc["7 Green-531"].isna().all()
    assert 0.01 < np.nanmax(np.abs(off.to_numpy())) < 0.07
