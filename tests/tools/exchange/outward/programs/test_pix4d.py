"""The .cam and the external parameters, projected by the formulas that Pix4D publishes."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.errors import OutputError
from acx4tools.exchange.outward import orientations, pix4d


def cam(text):
    pairs = [line.split() for line in text.splitlines()[1:] if not line.startswith("#")]
    return {key: float(value) for key, value in pairs}


def test_points_ahead_are_projected_into_every_head(shown, agrees):
    made = pix4d.cameras(shown.found)
    for camera in shown.found.cameras:
        own, name = cam(made.files[f"{camera.name}.cam"]), shown.first_images()[camera.name]
        T = shown.oriented.T_m_c[shown.oriented.names.index(name)]
        x_c = (shown.x_m[name] - T.r) @ T.R * [1, -1, -1]
        x, y = (x_c[:, :2] / x_c[:, 2:]).T
        r2 = x**2 + y**2
        d = 1 + own["K1"] * r2 + own["K2"] * r2**2 + own["K3"] * r2**3
        xd = x * d + 2 * own["T1"] * x * y + own["T2"] * (r2 + 2 * x**2)
        yd = y * d + 2 * own["T2"] * x * y + own["T1"] * (r2 + 2 * y**2)
        mm = np.stack([own["F"] * xd + own["Px"], own["F"] * yd + own["Py"]], axis=1)
        agrees(mm / camera.pixel_mm - 0.5, shown.colrow[name], made.lenses[camera.name])


def test_external_parameters_are_those_of_the_table(shown):
    text = pix4d.images(shown.found, shown.oriented).files[pix4d.EXTERNAL]
    head, *rows = text.splitlines()
    assert head == "imageName X Y Z Omega Phi Kappa"
    table = orientations.in_grid(shown.oriented)
    assert [row.split()[0] for row in rows] == list(table["image"])
    values = np.array([row.split()[1:] for row in rows], dtype=float)
    np.testing.assert_allclose(values, table.iloc[:, 1:7], atol=1e-6)


def test_names_with_blanks_have_no_place_there(shown):
    block = shown.oriented.block
    names = ("a b", *block.images.names[1:])
    images = replace(block.images, names=names)
    oriented = replace(shown.oriented, block=replace(block, images=images))
    with pytest.raises(OutputError, match="'a b': a name with blanks has no place"):
        pix4d.images(shown.found, oriented)
