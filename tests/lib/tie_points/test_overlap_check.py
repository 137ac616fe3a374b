"""Whether pictures of an exposure belong together."""

import numpy as np
import pytest

from acx4lib.tie_points.overlap_check import check_overlaps
from support.helpers import repeats
from support.pictures import taken

K = 12
HEADS, SYNTHETIC = taken.heads(K), taken.synthetic(K)


def exposure(seed):
    ground = taken.texture(2048, np.random.default_rng(seed))
    return taken.pictures(HEADS, SYNTHETIC, ground, np.random.default_rng(seed + 100))


@pytest.fixture(scope="module")
def images():
    return exposure(1)


@pytest.fixture(scope="module")
def others():
    return exposure(2)


def turned(image):
    return np.ascontiguousarray(image[::-1, ::-1])


def replaced(images, **by):
    """The images with some of them replaced; head_2 is the third."""
    return [by.get(f"head_{k}", image) for k, image in enumerate(images)]


def check(images):
    return check_overlaps(images, HEADS, SYNTHETIC)


def test_pictures_that_belong_together_are_no_problem(images):
    assert check(images) == []


@pytest.mark.parametrize("k", [2, repeats(0)])
def test_a_turned_head_is_named(images, k):
    assert check(replaced(images, **{f"head_{k}": turned(images[k])})) == [
        f"CAM{k + 1}: its picture fits its neighbours only when turned by 180 degrees; turn the "
        "file or set its mount"
    ]


@pytest.mark.repeats
def test_two_turned_heads_are_both_named(images):
    found = check(replaced(images, head_0=turned(images[0]), head_1=turned(images[1])))
    assert [sentence[:5] for sentence in found] == ["CAM1:", "CAM2:"]
    assert all("turned by 180 degrees" in sentence for sentence in found)


@pytest.mark.parametrize("k", [1, repeats(3)])
def test_a_picture_of_another_exposure_is_named(images, others, k):
    assert check(replaced(images, **{f"head_{k}": others[k]})) == [
        f"CAM{k + 1}: its picture does not show what its neighbours show (of another exposure?)"
    ]


@pytest.mark.repeats
def test_two_and_two_exposures_are_named_as_pairs(images, others):
    found = check([*images[:2], *others[2:]])
    assert [sentence.split(":")[0] for sentence in found] == ["CAM1 and CAM4", "CAM2 and CAM3"]


@pytest.mark.parametrize(("a", "b"), [(0, 1), repeats(0, 3), repeats(1, 3)])
@pytest.mark.repeats
def test_exchanged_pictures_are_named(images, a, b):
    wrong = list(images)
    wrong[a], wrong[b] = images[b], images[a]
    assert check(wrong) == [
        f"CAM{a + 1}: its picture is exchanged with that of CAM{b + 1}; exchange their files"
    ]


@pytest.mark.repeats
def test_pictures_that_changed_places_in_a_ring_are_named(images):
    assert check([images[1], images[2], images[0], images[3]]) == [
        "CAM1: its picture is that of CAM2, in whose place it fits",
        "CAM2: its picture is that of CAM3, in whose place it fits",
        "CAM3: its picture is that of CAM1, in whose place it fits",
    ]


def water(image, rng):
    return np.rint(9000 + 47 * rng.standard_normal(image.shape)).astype(np.uint16)


@pytest.mark.repeats
def test_water_accuses_nobody(images):
    rng = np.random.default_rng(3)
    wet = [water(image, rng) for image in images]
    assert check(wet) == []
    assert check([*images[:2], *wet[2:]]) == []
    assert check([images[0], *wet[1:]]) == []


def test_a_head_shifted_by_a_hundred_pixels_still_fits(images):
    moved = np.roll(images[1], 100 // K, axis=1)
    assert check(replaced(images, head_1=moved)) == []
