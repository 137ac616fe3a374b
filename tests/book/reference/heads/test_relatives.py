"""What RigRelatives mean."""


def test_only_one_direction_fits_and_the_order_does_not_matter(stored):
    table = stored("ten_readings").set_index("reading")["median_px"]
    to_reference, to_head = table.iloc[:2], table.iloc[2:]
    assert to_reference.max() < 1.5
    assert to_head.min() > 10
    assert abs(to_reference.diff().iloc[1]) < 0.05
