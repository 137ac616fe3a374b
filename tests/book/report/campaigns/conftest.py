"""A study of three campaigns of one camera."""

import datetime as dt

import pytest

from acx4book.chapters import stability
from acx4book.chapters.stability import Flown
from acx4book.report.comparison_tables import study
from support.run_results import campaign

WARM = {2021: 8.0, 2022: 32.0, 2024: 20.0}


@pytest.fixture(scope="session")
def three():
    """Three campaigns, in memory, whose focal length follows the temperature."""
    campaigns = []
    for year, celsius in WARM.items():
        flown = Flown(date=dt.date(year, 5, 1), temperature_c=celsius)
        campaigns.append(campaign(stability.flight(year, flown)))
    return study(campaigns)
