"""What would be seen if something were wrong: every stage, spoilt on purpose."""

from acx4lib.experiments.deformations import Deformation, deformation
from acx4lib.experiments.heads import HeldFocalLength, asked_by_gnss, held_focal_length
from acx4lib.experiments.mounting import calibrations, correlations, lever_arm_seen
from acx4lib.experiments.rig import oriented
from acx4lib.experiments.shift import shifted_trajectories
from acx4lib.experiments.starts import FromBadStarts, from_bad_starts
from acx4lib.experiments.synthetic import Misfit, misfit, transposed, turned
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
    "FromBadStarts",
    "HeldFocalLength",
    "Misfit",
    "asked_by_gnss",
    "calibrations",
    "correlations",
    "deformation",
    "fly",
    "from_bad_starts",
    "height_errors",
    "height_noise",
    "held_focal_length",
    "lever_arm_seen",
    "misfit",
    "oriented",
    "refraction_effect",
    "scatter",
    "shifted_trajectories",
    "trajectory_errors",
    "transposed",
    "turned",
    "validations",
    "wrong_sigma",
]
