"""MicMac, first version: AutoCal-NAME.xml; with images an Orientation-IMAGE.xml for each.

``ModPhgrStd``, Fraser's model, has all that a camera has: with x, y from the centre of distortion
in pixels, x' = x (1 + sum of c_i r^2i) + P1 (r² + 2x²) + 2 P2 x y + b1 x + b2 y, y' likewise
without b1 and b2, from the ideal to the measured point. It is the direction in which MicMac's own
``Verif`` entries agree with its ``CoeffDist`` to the last digit.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.results.whole_files import file_stem
from acx4tools.exchange import lens
from acx4tools.exchange.lens import Left
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward.brown import Brown
from acx4tools.exchange.outward.calibrated import R_C_V, Calibrated
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import BODY, SIGMA, Taken, add_numbers, as_xml

ASSUMED = (
    "ModPhgrStd: PP, F and CDist in px, distortion from the ideal to the measured point; "
    "pixel (0, 0) is taken as the centre of the top-left one",
)
WORLD = "Centre and rotation (camera to world, y down, z ahead) in axes east, north, up at {}"
FOLDER = "Ori-acx4"


def cameras(calibrated: Calibrated) -> Taken:
    """Return a calibration for every camera."""
    near = brown.skewed(calibrated)
    found = {camera.name: _fitted(camera, near[camera.name]) for camera in calibrated.cameras}
    return Taken(
        files={_file(c): _calibration(c, found[c.name][0]) for c in calibrated.cameras},
        lenses={name: left for name, (_, left) in found.items()},
        assumed=ASSUMED,
        left_out=(SIGMA, BODY, "the heads' places in a rig"),
    )


def images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the same, and the orientations of the images."""
    alone, block = cameras(calibrated), oriented.block
    files = {
        f"{FOLDER}/Orientation-{file_stem(name)}.xml": _orientation(
            oriented, i, block.cameras[block.images.camera_idx[i]]
        )
        for i, name in enumerate(oriented.names)
    }
    return Taken(
        files={**alone.files, **files},
        lenses=alone.lenses,
        assumed=(*ASSUMED, WORLD.format(oriented.origin)),
        left_out=(SIGMA,),
    )


def _file(camera: Camera) -> str:
    return f"{FOLDER}/AutoCal-{file_stem(camera.name)}.xml"


def _fitted(camera: Camera, one: Brown) -> tuple[Array, Left]:
    """Return f, cx, cy, k1, k2, p1, p2, k3, b1, b2, as `brown.pixels` has them."""
    f, affinity = one.hole.fy, (one.hole.fx / one.hole.fy - 1, one.hole.skew / one.hole.fy)
    hole = (f, one.hole.cx, one.hole.cy)
    start = np.array([*hole, one.k1, one.k2, one.p1, one.p2, one.k3, *affinity])
    return lens.model_of(camera, brown.pixels, start) if any(affinity) else (start, one.left)


def _calibration(camera: Camera, values: Array) -> str:
    f, cx, cy, *others = values.tolist()
    k1, k2, p1, p2, k3, b1, b2 = others
    root = ET.Element("ExportAPERO")
    inner = ET.SubElement(root, "CalibrationInternConique")
    ET.SubElement(inner, "KnownConv").text = "eConvApero_DistM2C"
    add_numbers(inner, "PP", (cx, cy))
    add_numbers(inner, "F", (f,))
    ET.SubElement(inner, "SzIm").text = f"{camera.width_px} {camera.height_px}"
    model = ET.SubElement(ET.SubElement(inner, "CalibDistortion"), "ModPhgrStd")
    radial = ET.SubElement(model, "RadialePart")
    add_numbers(radial, "CDist", (cx, cy))
    for power, coefficient in enumerate((k1, k2, k3), start=1):
        add_numbers(radial, "CoeffDist", (coefficient / f ** (2 * power),))
    ET.SubElement(radial, "PPaEqPPs").text = "true"
    for name, value in (("P1", p2 / f), ("P2", p1 / f), ("b1", b1), ("b2", b2)):
        add_numbers(model, name, (value,))
    return as_xml(root)


def _orientation(oriented: Oriented, i: int, camera: Camera) -> str:
    root = ET.Element("ExportAPERO")
    conic = ET.SubElement(root, "OrientationConique")
    affine = ET.SubElement(conic, "OrIntImaM2C")
    for name, text in (("I00", "0 0"), ("V10", "1 0"), ("V01", "0 1")):
        ET.SubElement(affine, name).text = text
    ET.SubElement(conic, "TypeProj").text = "eProjStenope"
    ET.SubElement(conic, "ZoneUtileInPixel").text = "true"
    ET.SubElement(conic, "FileInterne").text = _file(camera)
    ET.SubElement(conic, "RelativeNameFI").text = "true"
    outer = ET.SubElement(conic, "Externe")
    ET.SubElement(outer, "KnownConv").text = "eConvApero_DistM2C"
    add_numbers(outer, "Centre", oriented.T_m_c.r[i])
    matrix = ET.SubElement(ET.SubElement(outer, "ParamRotation"), "CodageMatr")
    for name, row in zip(("L1", "L2", "L3"), oriented.T_m_c.R[i] @ R_C_V, strict=True):
        add_numbers(matrix, name, row)
    ET.SubElement(ET.SubElement(conic, "ConvOri"), "KnownConv").text = "eConvApero_DistM2C"
    return as_xml(root)
