"""Seams before and after they are blended."""

import re
from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.synthetic_image.seams import seams
from acx4lib.synthetic_image.frame import reduced_heads
from acx4lib.synthetic_image.response import estimate_response
from support.figures import drawn, title
from support.pictures import taken
from support.pictures.tied import PIXEL_MM, K, pictured, refined, tied


@pytest.fixture(scope="module")
def seamed(pictures, orientation, images):
    rng = np.random.default_rng(3)
    heads = reduced_heads(orientation, K)
    response = estimate_response(images, heads, taken.synthetic(K), rng=rng)
    wrong = taken.turned_heads(orientation, 0.2, rng)  # some pixels of the reduced images
    both = refined(orientation, tied(orientation, (0, 1), 10)[0], rotations=orientation)
    both.orientations["before"] = wrong
    return drawn(seams(pictures, both, response))


def rows_of(fig):
    """Per place: axes of the plan, and of the four crops."""
    return np.array(fig.axes).reshape(-1, 5)


def test_seams_are_shown_in_three_places_and_four_states(seamed):
    rows = rows_of(seamed)
    assert len(rows) == 3
    states = ["as taken", "heads refined", "and equalised", "and blended"]
    assert [title(ax) for ax in rows[0, 1:]] == states
    assert title(rows[2, 0]) == "the middle"
    assert all(re.fullmatch(r"CAM\d \| CAM\d", title(ax)) for ax in rows[:2, 0])


def test_each_step_brings_a_seam_nearer_to_what_is_blended(seamed):
    for line in rows_of(seamed):
        crops = [np.asarray(ax.images[0].get_array()) for ax in line[1:]]
        off = [np.sqrt(np.mean((crop - crops[-1]) ** 2)) for crop in crops]
        assert off[0] > off[1] > off[2]


def test_a_seam_is_marked_outside_of_its_pixels_only(seamed):
    for line in rows_of(seamed):
        for ax in line[1:4]:
            rows, cols = ax.images[0].get_array().shape[:2]
            marks = np.array([np.transpose(mark.get_data()) for mark in ax.lines])
            assert len(marks) >= 2
            size = np.array([cols, rows])
            inner = np.all((marks > -0.5 + 1e-9) & (marks < size - 0.5 - 1e-9), axis=-1)
            assert not inner.any()
        assert len(line[4].lines) == 0


def test_a_misfit_is_shown_where_it_crosses_edges(orientation):
    row, col = np.mgrid[:512, :512]
    above, below = col - row, col + row  # stripes across the misfit, to the upper right, and along
    ground = 12000 + 4000 * np.sin(2 * np.pi / 24 * np.where(row < 253, above, below))
    rng = np.random.default_rng(1)
    seen = taken.pictures(reduced_heads(orientation, K), taken.synthetic(K), ground, rng)
    xyz = orientation.xyz_mm.copy()
    xyz[:2, :2] += 2 * PIXEL_MM
    both = refined(orientation, tied(orientation, (0, 1), 10)[0], rotations=orientation)
    both.orientations["before"] = replace(orientation, xyz_mm=xyz)
    fig = drawn(seams(pictured(seen), both, None))
    assert title(fig.axes[0]) == "CAM2 | CAM3"
