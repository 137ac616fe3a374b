"""Pictures reduced to the pixels of a figure, against means that are written out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.typesetting.pictures import smaller


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_smaller_picture_has_the_means_of_squares_from_the_middle(dtype):
    rng = np.random.default_rng(2)
    image = rng.integers(0, 250, (23, 31, 3)).astype(dtype)
    found = smaller(image, 5)
    middle = image[1:21]
    squares = [[middle[i : i + 5, j : j + 5] for j in range(0, 30, 5)] for i in range(0, 20, 5)]
    assert found.shape == (4, 6, 3)
    assert_allclose(found, np.mean(squares, axis=(2, 3), dtype=float), rtol=1e-6)
