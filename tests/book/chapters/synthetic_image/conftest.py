"""Results of the heads, refined; an exposure of Table 1's heads, its tie points and response."""

import shutil

import numpy as np
import pytest

from acx4files.stages import heads, synthetic
from acx4lib.synthetic_image.frame import reduced_heads
from acx4lib.synthetic_image.response import OverlapResponse, Response, ResponseFit
from support.pictures import known as made
from support.pictures import taken
from support.pictures.known import PIXEL_MM, K, joined, pictured, tied


@pytest.fixture(scope="session")
def folder(tmp_path_factory, flight, stage):
    """Return a results folder that the heads stage has left."""
    folder = tmp_path_factory.mktemp("results")
    heads.write(flight, folder, stage.heads, stage.orientation)
    return folder


@pytest.fixture(scope="session")
def refined(flight, folder, tmp_path_factory):
    copy = shutil.copytree(folder, tmp_path_factory.mktemp("refined") / "results")
    return synthetic.run(flight, copy), copy


@pytest.fixture(scope="session")
def orientation():
    return taken.heads(1)


@pytest.fixture(scope="session")
def images(orientation):
    rng = np.random.default_rng(1)
    ground = taken.texture(512, rng)
    ground[200:204, 100:104] *= 4  # a white square, for its place
    return taken.pictures(reduced_heads(orientation, K), taken.synthetic(K), ground, rng)


@pytest.fixture(scope="session")
def pictures(images):
    return pictured(images)


@pytest.fixture(scope="session")
def found(orientation):
    """150 tie points of heads 1 and 2 that differ by 0.3 and 0.4 pixels, fewer of others."""
    shift = (0.3 * PIXEL_MM, 0.4 * PIXEL_MM)
    ties, xy = tied(orientation, (0, 1), 150, shift_mm=shift)
    elsewhere, _ = tied(orientation, (0, 1), 100, exposure=3)
    across, _ = tied(orientation, (2, 3), 40)
    return made.refined(orientation, joined(ties, elsewhere, across)), xy


@pytest.fixture(scope="session")
def fit():
    """Two heads, three bands."""
    g = np.array([[0.02, 0.0, -0.01], [-0.02, 0.0, 0.01]])
    coefficients = np.stack([g, np.full((2, 3), -0.3), np.full((2, 3), 0.05)], axis=-1)
    overlap = OverlapResponse(
        head_a=0,
        head_b=1,
        before=np.log1p([0.1, 0.2, 0.05]),
        after=np.log1p([0.006, 0.005, 0.004]),
        n_used=np.full(3, 900),
        n_saturated=np.zeros(3, int),
        n_dark=np.zeros(3, int),
    )
    return ResponseFit(
        response=Response(coefficients=coefficients),
        sigma=np.full((2, 3, 3), 1e-3),
        overlaps=(overlap,),
    )
