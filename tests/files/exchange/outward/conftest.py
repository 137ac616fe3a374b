"""Calibrations whose values are known, in results folders, and what their images see."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from acx4files.exchange.outward import content
from acx4files.exchange.outward.content import orient
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from support.run_results import estimated, leave_calibration

DISTANCE_M = 900.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """Oriented images of two heads, and points that each of them sees.

    `x_m` and `colrow` are by the name of the image, `head` is the name of its camera; `x_r` are
    the points of a head's first image in the axes of the reference head, library's axes.
    """

    found: object
    oriented: object
    x_m: dict = field(default_factory=dict)
    colrow: dict = field(default_factory=dict)
    head: dict = field(default_factory=dict)
    x_r: dict = field(default_factory=dict)

    def first_images(self):
        """One image of every head."""
        return {head: name for name, head in reversed(self.head.items())}


def ahead(camera):
    """Points all over the image in the camera's axes."""
    half = 0.49 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-h, h, 9) for h in half)))
    f = camera.interior.f
    return DISTANCE_M / f * np.column_stack([x, y, np.full(81, -f)])


@pytest.fixture(scope="session")
def shown(rig):
    """Six exposures of two heads, by the library's own projection."""
    found = content.read(rig)
    oriented = orient(found, found.flight, "heads")
    block, out = oriented.block, Shown(found=found, oriented=oriented)
    T_r = found.cameras[0].T_b_c.inverse
    for i, name in enumerate(oriented.names):
        camera = block.cameras[block.images.camera_idx[i]]
        x_c, T = ahead(camera), oriented.T_m_c[i]
        calibrated_camera = next(c for c in found.cameras if c.name == camera.name)
        level = Pose(R=np.eye(3)[None], r=np.zeros((1, 3)))
        out.x_m[name] = x_c @ T.R.T + T.r
        out.colrow[name] = project(calibrated_camera, level, x_c)
        out.head[name] = camera.name
        T_r_c = T_r @ calibrated_camera.T_b_c
        out.x_r[camera.name] = x_c @ T_r_c.R.T + T_r_c.r
    return out


@pytest.fixture(scope="session")
def agrees():
    """Assert that pixels are the library's, as closely as the export says of its lens."""

    def check(colrow, wanted, left):
        apart = np.linalg.norm(np.asarray(colrow) - wanted, axis=1).max()
        assert apart <= 1.02 * left.largest_px + 2e-6
        assert left.largest_px > 0

    return check


@pytest.fixture(scope="session")
def single(tmp_path_factory):
    """Results of one camera, CAM, with blocks calibration and validation."""
    return leave_calibration(tmp_path_factory.mktemp("single"), estimated("CAM"))


@pytest.fixture(scope="session")
def rig(tmp_path_factory):
    """Results of two heads, LEFT and RIGHT, by method rig."""
    at = tmp_path_factory.mktemp("rig")
    return leave_calibration(at, estimated("LEFT", "RIGHT"), method="rig")
