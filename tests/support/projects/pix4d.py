"""A folder params of Pix4Dmapper, by the heads of its files and OpenCV; without acx4lib."""

import numpy as np
import pyproj

from support.projects import scene

OFFSET = np.array([676000.0, 7184000.0, 0.0])
K = np.array([[scene.F, 0.0, scene.CX], [0.0, scene.F, scene.CY], [0.0, 0.0, 1.0]])
HEAD = """fileName imageWidth imageHeight
camera matrix K [3x3]
radial distortion [3x1]
tangential distortion [2x1]
camera position t [3x1]
camera rotation R [3x3]
camera model m = K [R|-Rt] X

"""


def poses():
    """Return rotations from the map to x right, y down, z ahead, and centres on the map."""
    found = scene.scene()
    east_north_up = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    R = [(east_north_up @ scene.camera(*angles)).T for angles in np.radians(scene.YPR)]
    shifts = [[0, 0, 100], [8, 3, 101], [-5, 9, 99], [4, -7, 102]]
    centres = found.points_enh.mean(axis=0) + np.array(shifts, dtype=float)
    return np.array(R), centres


def opk(R):
    """Return omega, phi, kappa in degrees of a rotation, by the entries of R3 R2 R1."""
    m = np.diag([1.0, -1.0, -1.0]) @ R
    angles = np.arctan2(-m[2, 1], m[2, 2]), np.arcsin(m[2, 0]), np.arctan2(-m[1, 0], m[0, 0])
    return np.degrees(angles)


def _rows(*matrices):
    return [" ".join(map(repr, map(float, row))) for m in matrices for row in np.atleast_2d(m)]


def write(folder):
    """Write all files of a project p with four images."""
    R, centres = poses()
    parameters, external, matrices = HEAD, "imageName X Y Z Omega Phi Kappa\n", ""
    radial, tangential = (scene.K1, scene.K2, scene.K3), (scene.P1, scene.P2)
    for name, own, at in zip(scene.NAMES, R, centres, strict=True):
        t = at - OFFSET
        lines = _rows(K, radial, tangential, t, own)
        parameters += "\n".join([f"{name} {scene.WIDTH} {scene.HEIGHT}", *lines]) + "\n"
        external += " ".join([name, *_rows(np.r_[at, opk(own)])]) + "\n"
        P = K @ np.column_stack([own, -own @ t])
        matrices += " ".join([name, *_rows(P.ravel())]) + "\n"
    files = {
        "calibrated_camera_parameters.txt": parameters,
        "calibrated_external_camera_parameters.txt": external,
        "pmatrix.txt": matrices,
        "offset.xyz": " ".join(map(repr, OFFSET.tolist())),
        "wkt.prj": pyproj.CRS(scene.CRS).to_wkt("WKT1_ESRI"),
        "pix4d_calibrated_internal_camera_parameters.cam": "Pix4D camera calibration file 0\n"
        "#Focal Length mm assuming a sensor width of 4.8x3.6mm\nF 5.4375\n",
    }
    for name, text in files.items():
        (folder / f"p_{name}").write_text(text)
