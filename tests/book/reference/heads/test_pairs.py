"""Which bands tie."""


def test_alike_bands_tie_best_and_infrared_ties_to_red_edge(stored):
    table = stored("ten_pairs").set_index(["head", "other"])
    assert table.loc[("2 Green", "7 Green-531"), "share"] > 0.9
    near, far = table.loc[[("4 NIR", "10 Red edge-740"), ("4 NIR", "6 Blue-444")], "share"]
    assert near > 0.9
    assert far < 0.3
    assert table["chain"].sum() == 9
    assert table.loc[table["chain"], "share"].min() > 0.6
