"""What would be seen if something were wrong: every stage, spoilt on purpose."""

from acx4lib.experiments.heads import HeldFocalLength, asked_by_gnss, held_focal_length
from acx4lib.experiments.mounting import calibrations, correlations, lever_arm_seen
from acx4lib.experiments.synthetic import Misfit, misfit, transposed, turned
from acx4lib.experiments.validation import validations

__all__ = [
    "HeldFocalLength",
    "Misfit",
    "asked_by_gnss",
    "calibrations",
    "correlations",
    "held_focal_length",
    "lever_arm_seen",
    "misfit",
    "transposed",
    "turned",
    "validations",
]
