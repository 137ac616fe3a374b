"""The block in space shows the adjusted block, in metres."""

import json
import re

import numpy as np
import pytest

from acx4book.chapters.mounting import in_space
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting
from acx4lib.geometry.collinearity import project


@pytest.fixture(scope="module")
def single_step(mounted):
    return Mounting(method="single_step", calibration=from_bundle(mounted), bundle=mounted)


@pytest.fixture(scope="module")
def layers(single_step):
    text = in_space.view(single_step).html
    data = json.loads(re.search(r'<script type="application/json">(.*?)</script>', text)[1])
    return {layer["name"]: layer for layer in data["layers"]}


def at(layer):
    return np.array(layer["at"]).reshape(-1, 3)


def named(layers, beginning):
    return [layer for name, layer in layers.items() if name.startswith(beginning)]


def test_every_image_has_a_pyramid_whose_corners_are_those_of_the_image(mounted, layers):
    edges = np.concatenate([at(layer) for layer in named(layers, "cameras")]).reshape(-1, 16, 3)
    assert len(edges) == len(mounted.T_m_c)
    (control,) = named(layers, "control")
    middle = mounted.state.x_m[mounted.network.control.point_idx[0]] - at(control)[0]
    for pyramid in edges + middle:
        image = np.argmin(np.linalg.norm(mounted.T_m_c.r - pyramid[0], axis=1))
        camera = mounted.cameras[mounted.network.block.images.camera_idx[image]]
        colrow = project(camera, mounted.T_m_c[np.full(4, image)], pyramid[1:8:2])
        width, height = camera.width_px - 1, camera.height_px - 1
        expected = np.array([[0, 0], [width, 0], [width, height], [0, height]])
        assert colrow == pytest.approx(expected, abs=20)  # coordinates are rounded to 0.1 m


def test_rays_lead_from_all_images_of_a_point_to_it(mounted, layers):
    (rays,) = named(layers, "the ")
    ends = at(rays).reshape(-1, 2, 3)
    assert np.ptp(ends[:, 1], axis=0) == pytest.approx(0.0)
    seen = mounted.network.image_points.point_idx
    assert len(ends) == np.bincount(seen)[in_space.tie_points(mounted)].max()


def test_ellipsoids_are_the_covariances_of_tie_points(mounted, layers):
    (drawn,) = named(layers, "error ellipsoids")
    times = float(re.search(r"([\d.e+]+) times", drawn["name"])[1])
    axes = np.array(drawn["axes"]).reshape(-1, 3, 3) / times
    chosen = in_space.thinned(in_space.tie_points(mounted), in_space.MOST_ELLIPSOIDS)
    cov = np.einsum("nki,nkj->nij", axes, axes)
    expected = mounted.solution.cov_points[chosen]
    scale = np.trace(expected, axis1=1, axis2=2)[:, None, None]
    assert cov / scale == pytest.approx(expected / scale, abs=0.03)


def test_control_points_are_labelled(mounted, layers):
    (control,) = named(layers, "control")
    names = [mounted.network.block.points[k] for k in mounted.network.control.point_idx]
    assert control["labels"] == names[: in_space.MOST_LABELS]
    assert len(at(control)) == len(names)


def test_of_many_only_every_nth_is_shown():
    assert in_space.thinned(np.arange(10), 4).tolist() == [0, 3, 6, 9]
    assert in_space.thinned(np.arange(4), 4).tolist() == [0, 1, 2, 3]
    assert in_space.thinned(np.arange(0), 4).tolist() == []
