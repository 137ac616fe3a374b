from dataclasses import replace

import numpy as np
import pytest

from acx4lib.flight.block import select_images
from acx4lib.planning import design, flown, text
from acx4lib.planning.choosing import target
from acx4lib.planning.choosing.strip_information import of_strips

from .conftest import CANDIDATES

ALL_POINTS = 10_000


SLOW = {
    "gnss_correlation_s": 100.0,
    "gnss_correlated_share": 0.9,
    "attitude_correlation_s": 50.0,
    "attitude_correlated_share": 0.7,
}


@pytest.fixture(
    scope="module",
    params=[((), {}), (["shift", "drift"], {}), (["shift"], SLOW)],
    ids=["white", "drift", "slow"],
)
def everything(request, plan):
    """Return the plan of all candidates, and its network."""
    gnss, slow = request.param
    values = {
        **plan.values,
        "apriori": {**plan.values["apriori"], **slow},
        "stages": {"mounting": {**plan.values["stages"]["mounting"], "gnss": [*gnss]}},
    }
    wanted = {"sigma": {"f_mm": 1.0}, "candidates": CANDIDATES}
    both = target.from_values(wanted, text.from_values(values)).plan
    block = flown.block(both, target.BLOCK)
    return both, design.calibrated(both, block, method="single_step").bundle.network


def covariance(plan, block, names):
    """Return the covariance that the library's own adjustment of a block has."""
    bundle = design.calibrated(plan, block, method="single_step").bundle
    columns = np.array([bundle.network.column_names().index(name) for name in names])
    return bundle.solution.inverse.at(columns[:, None], columns)


@pytest.mark.parametrize("chosen", [(1, 3, 7), (0, 1, 2, 5, 6, 8), tuple(range(9))])
def test_the_sum_over_strips_is_the_adjustment_of_their_images(everything, chosen):
    plan, network = everything
    information = of_strips(network, tie_points=ALL_POINTS)
    names = [information.strips[k] for k in chosen]
    block = select_images(network.block, np.isin(network.block.images.strips, names))
    cov, expected = information.covariance(chosen), covariance(plan, block, information.names)
    exact = all(e.correlation is None for e in network.equations(network.start))
    near = 1e-6 if exact else 0.15  # slow errors are correlated from strip to strip, too
    assert np.sqrt(np.diag(cov)) == pytest.approx(np.sqrt(np.diag(expected)), rel=near)


def test_a_part_of_the_tie_points_with_the_weight_of_all_tells_nearly_as_much(everything):
    _, network = everything
    whole, part = (of_strips(network, tie_points=n) for n in (ALL_POINTS, 45))
    for chosen in ((1, 3, 7), range(9)):
        a, b = (np.sqrt(np.diag(one.covariance(chosen))) for one in (whole, part))
        assert b == pytest.approx(a, rel=0.2)


def test_no_strip_makes_anything_worse(everything):
    information = of_strips(everything[1])
    sigma = [np.sqrt(np.diag(information.covariance(range(n)))) for n in range(10)]
    assert np.all(np.diff(sigma, axis=0) <= 1e-9 * sigma[0])


def test_every_image_must_have_a_strip(everything):
    _, network = everything
    images = replace(network.block.images, strips=("",) * len(network.block.images))
    with pytest.raises(ValueError, match="every image must have a strip"):
        of_strips(replace(network, block=replace(network.block, images=images)))
