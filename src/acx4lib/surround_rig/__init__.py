"""The ground around a car from its four fisheye cameras: the same task with another geometry.

As heads are projected into the plane of the synthetic image, so are these cameras into the ground.
An image is resampled once, from where it was taken; an undistorted image in between would blur it
a second time. Grey values of even ground tell the cameras' gains, corners of the printed target
how far apart their views are, and by which changes of the cameras they fit.
"""

from acx4lib.surround_rig.cameras import (
    FRAME_PX,
    FisheyeCamera,
    Place,
    border_px,
    fisheye_from_undistorted,
    frame_from_undistorted,
    ghost_cm,
    image_from_frame,
    place,
    undistorted_from_frame,
)
from acx4lib.surround_rig.corners import Corners, corner_misfits, find_corners, image_misfits, rms
from acx4lib.surround_rig.greys import grey_correlation, grey_samples, overlapping
from acx4lib.surround_rig.refinement import (
    TARGET_PX,
    Free,
    left_out_misfits,
    refined,
    shift,
    target_seen,
)
from acx4lib.surround_rig.views import View, blended, camera_map, view

__all__ = [
    "FRAME_PX",
    "TARGET_PX",
    "Corners",
    "FisheyeCamera",
    "Free",
    "Place",
    "View",
    "blended",
    "border_px",
    "camera_map",
    "corner_misfits",
    "find_corners",
    "fisheye_from_undistorted",
    "frame_from_undistorted",
    "ghost_cm",
    "grey_correlation",
    "grey_samples",
    "image_from_frame",
    "image_misfits",
    "left_out_misfits",
    "overlapping",
    "place",
    "refined",
    "rms",
    "shift",
    "target_seen",
    "undistorted_from_frame",
    "view",
]
