"""What would be seen if something were wrong: every stage, spoilt on purpose."""

from acx4lib.experiments.deformations import Deformation, deformation
from acx4lib.experiments.examined_images import (
    Examined,
    TargetErrors,
    border_distortion_of_targets,
    drawn_calibration,
    drawn_errors,
    errors_of,
    every_refinement,
    examine,
    examine_all,
    frame_deviations,
    geometry_errors,
    measured_ties,
)
from acx4lib.experiments.heads import HeldFocalLength, asked_by_gnss, held_focal_length
from acx4lib.experiments.mounting import calibrations, correlations, lever_arm_seen
from acx4lib.experiments.pixels import KnownExposure, heads_response, known_exposure, render_known
from acx4lib.experiments.rig import oriented
from acx4lib.experiments.seams import (
    OverlapPicture,
    SeamProfile,
    overlap_picture,
    seam_profile,
)
from acx4lib.experiments.shift import shifted_trajectories
from acx4lib.experiments.starts import FromBadStarts, from_bad_starts
from acx4lib.experiments.synthetic import (
    FrameErrors,
    refinements,
    simulated_ties,
    transposed,
    with_turned_heads,
    with_wrong_interiors,
)
from acx4lib.experiments.validation import validations
from acx4lib.experiments.weights import (
    fly,
    height_errors,
    height_noise,
    refraction_effect,
    scatter,
    trajectory_errors,
    wrong_sigma,
)

__all__ = [
    "Deformation",
    "Examined",
    "FrameErrors",
    "FromBadStarts",
    "HeldFocalLength",
    "KnownExposure",
    "OverlapPicture",
    "SeamProfile",
    "TargetErrors",
    "asked_by_gnss",
    "border_distortion_of_targets",
    "calibrations",
    "correlations",
    "deformation",
    "drawn_calibration",
    "drawn_errors",
    "errors_of",
    "every_refinement",
    "examine",
    "examine_all",
    "fly",
    "frame_deviations",
    "from_bad_starts",
    "geometry_errors",
    "heads_response",
    "height_errors",
    "height_noise",
    "held_focal_length",
    "known_exposure",
    "lever_arm_seen",
    "measured_ties",
    "oriented",
    "overlap_picture",
    "refinements",
    "refraction_effect",
    "render_known",
    "scatter",
    "seam_profile",
    "shifted_trajectories",
    "simulated_ties",
    "trajectory_errors",
    "transposed",
    "validations",
    "with_turned_heads",
    "with_wrong_interiors",
    "wrong_sigma",
]
