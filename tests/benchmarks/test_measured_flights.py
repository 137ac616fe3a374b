"""What is stored of flights that were measured in pictures is what the chapter reads."""

import numpy as np
import pandas as pd

from acx4book.chapters.from_pictures import STORED


def test_errors_of_all_parameters_of_six_flights_are_stored():
    found = pd.read_csv(STORED / "measured_flights.csv")
    assert found.groupby("seed").size().tolist() == [14] * 6
    assert found.groupby("seed")["sigma0_squared"].nunique().tolist() == [1] * 6
    assert np.abs(found["error"] / found["sigma"]).max() < 4
