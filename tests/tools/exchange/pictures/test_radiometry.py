"""Vignetting and dark level by the metadata."""

import numpy as np
import pytest

from acx4tools.exchange.pictures import radiometry
from acx4tools.exchange.pictures.tags import read
from support.pictures import tagged


def test_the_polynomial_begins_with_the_radius(tmp_path):
    said = {radiometry.CENTRE: [100, 50], radiometry.POLYNOMIAL: [1e-3, -2e-5]}
    tags = read(tagged.write(tmp_path / "a.tif", said))
    found = radiometry.vignetting(tags).at(np.array([[100, 50], [103, 54]]))
    assert found == pytest.approx([1.0, 1 + 5e-3 - 25 * 2e-5])
    assert "1 head," in radiometry.sentences([tags])[-1]


def test_without_it_nothing_is_said(tmp_path):
    tags = read(tagged.write(tmp_path / "a.tif", {}))
    assert radiometry.vignetting(tags) is None
    assert radiometry.dark_level(tags) is None
    assert radiometry.sentences([tags]) == []
