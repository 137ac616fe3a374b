"""Heads as bands of one image, in stripes."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.calibration.heads import declared_orientation
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.production.exposure import blended, stacked, stripes
from acx4lib.synthetic_image.rendering import render_plan

CAMERA = Camera(name="A", width_px=96, height_px=700, pixel_mm=0.01, interior=Interior(f=10.0))


@pytest.fixture
def plan():
    heads = [CAMERA, replace(CAMERA, name="B"), replace(CAMERA, name="C")]
    return render_plan(declared_orientation(heads, CAMERA), CAMERA)


@pytest.fixture
def pictures():
    rng = np.random.default_rng(1)
    return [rng.integers(1, 65535, (700, 96, 1), dtype=np.uint16) for _ in range(3)]


def test_every_head_is_a_band_of_its_own_pixels(plan, pictures):
    told = []
    fill = stacked(plan, pictures, 1)
    parts = [
        part.copy()
        for part in stripes(fill, (700, 96, 3), np.dtype("uint16"), lambda *n: told.append(n))
    ]
    assert np.array_equal(np.concatenate(parts), np.concatenate(pictures, axis=2))
    assert [len(part) for part in parts] == [512, 188]
    assert told == [(512, 700), (700, 700)]


def test_blended_heads_of_one_place_are_their_mean(plan, pictures):
    out = np.empty((700, 96, 1), np.uint16)
    blended(plan, pictures, 1)(out, 0)
    mean = np.mean(pictures, axis=0)
    assert np.abs(out - mean).max() <= 1
