"""Text like that of Pix4D: a .cam for every camera; with images their external parameters.

Formulas of the lens: "How are the internal and external camera parameters defined?", Pix4D. Layout
of the .cam: as other programs write it for Pix4D; no file of Pix4D itself was at hand.
"""

from __future__ import annotations

from acx4lib.errors import OutputError
from acx4lib.geometry.camera import Camera
from acx4lib.results.whole_files import file_stem
from acx4tools.exchange.outward import brown, orientations
from acx4tools.exchange.outward.brown import CORNER, Brown
from acx4tools.exchange.outward.calibrated import Calibrated
from acx4tools.exchange.outward.orientations import CENTRE, GRID, OPK, Oriented
from acx4tools.exchange.outward.taken import BODY, SIGMA, Taken

ASSUMED = (
    "F, Px, Py in mm, the principal point from the outer corner of the top-left pixel; K1 to K3, "
    "T1, T2 as R1 to R3, T1, T2 of Pix4D, which are k1 to k3, p1, p2 of OpenCV",
    "the layout of the .cam is that which other programs write for Pix4D; it was not tried there",
)
EXTERNAL = "external_camera_parameters.txt"


def cameras(calibrated: Calibrated) -> Taken:
    """Return a .cam file for every camera."""
    found = brown.square(calibrated)
    return Taken(
        files={
            f"{file_stem(camera.name)}.cam": _cam(camera, found[camera.name])
            for camera in calibrated.cameras
        },
        lenses=brown.lenses(found),
        assumed=ASSUMED,
        left_out=(SIGMA, BODY, "the heads' places in a rig: --to micasense or opf has them"),
    )


def images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the same, and positions with omega, phi, kappa of the images."""
    alone = cameras(calibrated)
    if blank := [name for name in oriented.names if len(name.split()) != 1]:
        msg = f"{EXTERNAL}: {blank[0]!r}: a name with blanks has no place there; export --to opk"
        raise OutputError(msg)
    table = orientations.in_grid(oriented).iloc[:, :7]
    lines = ["imageName X Y Z Omega Phi Kappa"]
    for name, *numbers in table.itertuples(index=False):
        at, angles = numbers[:3], numbers[3:]
        said = [*(f"{v:.6f}" for v in at), *(f"{v:.9f}" for v in angles)]
        lines.append(" ".join([str(name), *said]))
    grid = oriented.block.frame.grid
    axes = OPK.format(GRID.format(grid.crs, grid.heights))
    return Taken(
        files={**alone.files, EXTERNAL: "\n".join([*lines, ""])},
        lenses=alone.lenses,
        assumed=(*alone.assumed, CENTRE, axes),
        left_out=alone.left_out,
    )


def _cam(camera: Camera, one: Brown) -> str:
    mm = camera.pixel_mm
    width, height = camera.width_px * mm, camera.height_px * mm
    values = {
        f"#Focal Length mm assuming a sensor width of {width:.9g}x{height:.9g}mm": {
            "F": one.hole.fx * mm
        },
        "#Principal Point mm": {
            "Px": (one.hole.cx + CORNER) * mm,
            "Py": (one.hole.cy + CORNER) * mm,
        },
        "#Symmetrical Lens Distortion Coeffs": {"K1": one.k1, "K2": one.k2, "K3": one.k3},
        "#Tangential Lens Distortion Coeffs": {"T1": one.p1, "T2": one.p2},
    }
    lines = ["Pix4D camera calibration file 0"]
    for title, own in values.items():
        lines += [title, *(f"{key} {value!r}" for key, value in own.items())]
    return "\n".join([*lines, ""])
