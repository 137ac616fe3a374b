"""The orientation of the paper's heads, and what held focal lengths make of it."""

import pytest

from acx4lib.calibration.heads import Heads, calibrate_heads
from acx4lib.flight.parts import with_focal_lengths


@pytest.fixture(scope="session")
def heads(fits):
    return Heads(bundles=fits, failures={})


@pytest.fixture(scope="session")
def hold(flown, heads):
    """Return the heads with other focal lengths held: a change, mm, for each or for some."""

    def held(change_mm, only=None):
        f = {name: fit.cameras[0].interior.f for name, fit in heads.bundles.items()}
        f |= {name: f[name] + change_mm for name in only or f}
        block, free = with_focal_lengths(flown.flight.heads, f), flown.flight.estimate_heads
        return calibrate_heads(block, f, free=free, after=heads)

    return held


@pytest.fixture(scope="session")
def held(hold):
    return {change: hold(change) for change in (-0.5, 0.0, 0.5)}
