"""One measured image point of an adjustment, with all that its equation needs, to be followed."""

from __future__ import annotations

from dataclasses import dataclass

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.geometry.frames import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Ray:
    """A measurement of an adjustment, and the estimates that belong to it.

    Attributes
    ----------
    point, image : str
    camera : Camera
        With the estimated interior orientation and mounting.
    T_m_b, T_m_c : Pose
        Adjusted poses of the body and of the camera, ``T_m_c = T_m_b @ T_b_c``. Where the cameras
        are adjusted by themselves, without a trajectory, the first is what the second means.
    x_m : ndarray, shape (3,)
        Adjusted place of the point, m.
    xy_mm : ndarray, shape (2,)
        Where it was measured, mm from the middle of the image.
    residual_px : ndarray, shape (2,)
        Estimated less measured, along columns to the right and rows down.
    """

    point: str
    image: str
    camera: Camera
    T_m_b: Pose
    T_m_c: Pose
    x_m: Array
    xy_mm: Array
    residual_px: Array

    def __repr__(self) -> str:
        x, y = self.xy_mm
        return f"point {self.point!r} in image {self.image!r}, measured at x {x:.4f}, y {y:.4f} mm"


def one_ray(bundle: Bundle, i: int = 0) -> Ray:
    """Return the i-th measurement that took part in an adjustment.

    Parameters
    ----------
    bundle : Bundle
    i : int
        From 0.

    Raises
    ------
    ValueError
        Where there are fewer.
    """
    network, points = bundle.network, bundle.network.image_points
    expected.whole("i", i, least=0)
    if i >= len(points):
        msg = f"i: expected less than {len(points)}, the number of measurements, got {i}"
        raise ValueError(msg)
    block, image, point = network.block, points.image_idx[i], points.point_idx[i]
    camera, T_m_c = bundle.cameras[block.images.camera_idx[image]], bundle.T_m_c[image]
    return Ray(
        point=block.points[point],
        image=block.images.names[image],
        camera=camera,
        T_m_b=T_m_c @ camera.T_b_c.inverse,
        T_m_c=T_m_c,
        x_m=bundle.state.x_m[point],
        xy_mm=xy_from_colrow(camera, points.colrow[i]),
        residual_px=bundle.solution.group("image_point").v[i],
    )
