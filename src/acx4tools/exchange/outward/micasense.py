"""The tags that MicaSense writes into the metadata of every head's pictures.

Names and units: https://support.pix4d.com/hc/en-us/articles/360016450032, the namespace
``http://pix4d.com/camera/1.0``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward import calibrated as outward_calibrated
from acx4tools.exchange.outward.brown import Brown
from acx4tools.exchange.outward.calibrated import Calibrated, Relative
from acx4tools.exchange.outward.taken import BODY, Taken, lines

ASSUMED = (
    "RigRelatives are three angles a, b, c, degrees: Rx(a) Ry(b) Rz(c) takes a ray of the head to "
    "one of {}, x right, y down, z ahead; its transpose takes a ray of {} to the head",
    "PrincipalPoint and PerspectiveFocalLength in mm; PerspectiveDistortion is k1, k2, k3, p1, p2 "
    "of OpenCV",
    "PrincipalPoint counts from the centre of the top-left pixel, as acx4 import pictures reads "
    "it; that the vendor does not mean its corner, half a pixel away, is not confirmed",
)
POSITIONS = "positions of the heads: RigRelatives are rotations only"

HEADER = "camera,rig_camera_index,a_deg,b_deg,c_deg,sigma_a_deg,sigma_b_deg,sigma_c_deg"


def cameras(calibrated: Calibrated) -> Taken:
    """Return a text of XMP tags for every head, and a table of all RigRelatives with sigma."""
    first = calibrated.cameras[0].name
    found = brown.square(calibrated)
    rig = outward_calibrated.to_first(calibrated.calibration)
    rows = list(enumerate(zip(calibrated.cameras, rig, strict=True)))
    table = [HEADER, *(_row(k, camera, one) for k, (camera, one) in rows)]
    tags = [line for k, (c, one) in rows for line in _tags(k, c, one, found[c.name])]
    assumed = (ASSUMED[0].format(first, first), *ASSUMED[1:])
    angles = [line for k, (camera, one) in rows for line in _rig_tags(k, camera, one)]
    return Taken(
        files={"rig_relatives.csv": lines(table), "xmp_tags.txt": lines(tags)},
        lenses=brown.lenses(found),
        assumed=assumed,
        left_out=(POSITIONS, BODY),
        without_lenses=Taken(
            files={"rig_relatives.csv": lines(table), "xmp_tags.txt": lines(angles)},
            assumed=assumed[:1],
            left_out=(POSITIONS, BODY),
        ),
    )


def _row(index: int, camera: Camera, one: Relative) -> str:
    angles, sigma = _angles(one), np.degrees(one.sigma_opk)
    name = f'"{camera.name.replace(chr(34), chr(34) * 2)}"'
    return ",".join([name, str(index), *(f"{v:.6f}" for v in (*angles, *sigma))])


def _tags(index: int, camera: Camera, one: Relative, lens: Brown) -> Iterator[str]:
    """Yield the tags of a head, under its name in brackets."""
    mm = camera.pixel_mm
    distortion = (lens.k1, lens.k2, lens.k3, lens.p1, lens.p2)
    yield f"[{camera.name}]"
    yield "Camera:ModelType = perspective"
    yield f"Camera:PrincipalPoint = {_listed(lens.hole.cx * mm, lens.hole.cy * mm)}"
    yield f"Camera:PerspectiveFocalLength = {_listed(lens.hole.fx * mm)}"
    yield "Camera:PerspectiveFocalLengthUnits = mm"
    yield f"Camera:PerspectiveDistortion = {_listed(*distortion)}"
    yield from _of_rig(index, one)


def _rig_tags(index: int, camera: Camera, one: Relative) -> Iterator[str]:
    """Yield the tags of a head's place in the rig alone, under its name in brackets."""
    yield f"[{camera.name}]"
    yield from _of_rig(index, one)


def _of_rig(index: int, one: Relative) -> Iterator[str]:
    yield f"Camera:RigCameraIndex = {index}"
    yield f"Camera:RigRelatives = {_listed(*_angles(one).tolist())}"
    yield "Camera:RigRelativesReferenceRigCameraIndex = 0"
    yield ""


def _angles(one: Relative) -> Array:
    """Return a, b, c of a head in degrees."""
    return np.degrees(one.T_v_r_h.opk) + 0.0  # no negative zeros


def _listed(*values: float) -> str:
    return ",".join(f"{value:.9g}" for value in values)
