"""COLMAP's lens models, held against COLMAP's own code."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.exchange.programs.colmap.lens import MODELS

IDEAL = np.random.default_rng(1).uniform(-0.45, 0.45, (60, 2))


def parameters(name):
    """Return plausible parameters of a model, none of them zero."""
    model = MODELS[name]
    rest = 0.02 * np.random.default_rng(2).standard_normal(len(model.names) - model.first)
    if name == "FOV":
        rest[:] = 0.6
    if name == "EUCM":
        rest[:] = 0.55, 1.1
    focal = [1000.0] if model.first == 3 else [1000.0, 1010.0]
    return [*focal, 510.0, 390.0, *rest.tolist()]


@pytest.mark.parametrize("name", MODELS)
def test_every_model_has_its_inverse(name):
    model, values = MODELS[name], parameters(name)
    assert_allclose(model.ideal(model.colrow(IDEAL, values), values), IDEAL, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_colmap_s_own(name):
    pycolmap = pytest.importorskip("pycolmap", reason="environment-bench.txt has it")
    model, values = MODELS[name], parameters(name)
    camera = pycolmap.Camera(model=name, width=1000, height=800, params=values)
    seen = [camera.img_from_cam(np.append(point, 1.0)) for point in IDEAL]
    assert_allclose(model.colrow(IDEAL, values) + 0.5, seen, atol=1e-9)
    assert camera.params_info == ", ".join(model.names)
    assert int(camera.model) == model.number
