"""Falloff of similar heads against each other."""

import numpy as np


def test_the_response_finds_the_falloff_that_the_factory_states(stored):
    table = stored("ten_vignetting")
    assert np.sqrt(np.mean((table["library"] - table["factory"]) ** 2)) < 1.2  # per cent
    infrared = table[table["head"] == "4 NIR"].iloc[-1]
    assert infrared[["seen", "factory", "library"]].between(-8, -4).all()
