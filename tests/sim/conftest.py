"""Simulated flights, with noise and without."""

import pytest

import acx4sim

EXACT = acx4sim.Options(image_noise=0, control_noise=0, gnss_noise=0, attitude_noise=0)


@pytest.fixture(scope="session")
def flight():
    return acx4sim.acx4_ideal(seed=1)


@pytest.fixture(scope="session")
def in_heads():
    return acx4sim.acx4(seed=1)


@pytest.fixture(scope="session")
def exact():
    return acx4sim.acx4_ideal(seed=1, options=EXACT)


@pytest.fixture(scope="session")
def exact_single_head():
    return acx4sim.DESIGNS["single-head"](seed=1, options=EXACT)
