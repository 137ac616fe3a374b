from dataclasses import replace

import numpy as np
import pytest

from acx4lib.flight.block import select_images
from acx4lib.planning import design, flown
from acx4lib.planning.choosing import target
from acx4lib.planning.choosing.strip_information import of_strips

from .conftest import CANDIDATES

ALL_POINTS = 10_000


@pytest.fixture(scope="module", params=[(), ("shift", "drift")])
def everything(request, plan):
    """Return the plan of all candidates, and its network."""
    wanted = target.from_values({"sigma": {"f_mm": 1.0}, "candidates": CANDIDATES}, plan)
    both = replace(wanted.plan, setup=replace(plan.setup, gnss=request.param))
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
    assert np.sqrt(np.diag(cov)) == pytest.approx(np.sqrt(np.diag(expected)), rel=1e-6)


def test_a_part_of_the_tie_points_with_the_weight_of_all_tells_nearly_as_much(everything):
    _, network = everything
    whole, part = (of_strips(network, tie_points=n) for n in (ALL_POINTS, 45))
    for chosen in ((1, 3, 7), range(9)):
        a, b = (np.sqrt(np.diag(one.covariance(chosen))) for one in (whole, part))
        assert b == pytest.approx(a, rel=0.1)


def test_no_strip_makes_anything_worse(everything):
    information = of_strips(everything[1])
    sigma = [np.sqrt(np.diag(information.covariance(range(n)))) for n in range(10)]
    assert np.all(np.diff(sigma, axis=0) <= 1e-9 * sigma[0])


def test_every_image_must_have_a_strip(everything):
    _, network = everything
    images = replace(network.block.images, strips=("",) * len(network.block.images))
    with pytest.raises(ValueError, match="every image must have a strip"):
        of_strips(replace(network, block=replace(network.block, images=images)))
