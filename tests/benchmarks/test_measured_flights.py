"""What is stored of flights that were measured in pictures is what the chapter tells."""

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.from_pictures import sentences


def test_errors_beyond_two_sigma_are_counted_over_all_stored_flights():
    found = pd.read_csv(sentences.STORED / "measured_flights.csv")
    assert found.groupby("seed").size().tolist() == [14] * 6
    z = np.abs(found["error"] / found["sigma"])
    said = sentences.over_flights()
    assert f"{(z > 2).sum()} of 84 errors" in said
    assert f"the largest is {z.max():.1f} standard deviations" in said


def test_a_variance_of_unit_weight_that_is_one_is_said(tmp_path):
    found = pd.read_csv(sentences.STORED / "measured_flights.csv").assign(sigma0_squared=1.0)
    found.to_csv(tmp_path / "measured_flights.csv")
    assert "matches are better" not in sentences.over_flights(tmp_path)
