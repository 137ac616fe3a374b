"""Orientations projected by MicMac's formulas, written anew here."""

from xml.etree import ElementTree as ET

import numpy as np

from acx4tools.exchange.outward import micmac


def vector(root, path):
    return np.array(root.find(path).text.split(), dtype=float)


def projected(files, name, x_m):
    outer = ET.fromstring(files[f"Ori-acx4/Orientation-{name}.xml"])
    inner = ET.fromstring(files[outer.find(".//FileInterne").text])
    R = np.stack([vector(outer, f".//{row}") for row in ("L1", "L2", "L3")])
    x_c = (x_m - vector(outer, ".//Centre")) @ R
    pixel = vector(inner, ".//PP") + vector(inner, ".//F") * x_c[:, :2] / x_c[:, 2:]
    x, y = (pixel - vector(inner, ".//CDist")).T
    r2 = x**2 + y**2
    c = [float(one.text) for one in inner.findall(".//CoeffDist")]
    radial = sum(value * r2**power for power, value in enumerate(c, start=1))
    P1, P2, b1, b2 = (vector(inner, f".//{key}")[0] for key in ("P1", "P2", "b1", "b2"))
    dx = radial * x + P1 * (2 * x**2 + r2) + 2 * P2 * x * y + b1 * x + b2 * y
    dy = radial * y + P2 * (2 * y**2 + r2) + 2 * P1 * x * y
    return pixel + np.stack([dx, dy], axis=1)


def test_points_of_the_ground_are_projected_into_every_image(shown, agrees):
    made = micmac.images(shown.found, shown.oriented)
    for name, head in shown.head.items():
        agrees(projected(made.files, name, shown.x_m[name]), shown.colrow[name], made.lenses[head])


def test_b1_has_a_place(shown):
    """So that no more is lost than by a lens of two focal lengths."""
    assert all(left.largest_px < 0.01 for left in micmac.cameras(shown.found).lenses.values())
