"""Figures of the book: every function takes results and returns a figure, and changes nothing."""

from acx4lib.plot.coverage import normalised_errors
from acx4lib.plot.experiments import held_focal_lengths
from acx4lib.plot.flight import block_maps, control_maps
from acx4lib.plot.heads import correlations, mean_residuals, radial_distortion
from acx4lib.plot.joins import seams
from acx4lib.plot.mounting import correlation_matrix, lever_arm_seen, mounting_per_image
from acx4lib.plot.overlap import overlap_ties
from acx4lib.plot.pixels import head_pictures, synthetic_picture
from acx4lib.plot.quality import (
    deviation_fields,
    distortion_taken_up,
    overlap_differences,
    seam_profiles,
)
from acx4lib.plot.reliability import image_redundancy, weak_places
from acx4lib.plot.report import (
    boresight_over_time,
    check_points,
    residual_plane,
    residuals_by_strip,
    vector,
)
from acx4lib.plot.response import response_curves
from acx4lib.plot.rig import rig_correlations, rig_deformations, rig_gains
from acx4lib.plot.speed import seconds_by_points
from acx4lib.plot.starts import from_bad_starts
from acx4lib.plot.surround import (
    surround_enlarged,
    surround_ground,
    surround_misfits,
    surround_photographs,
)
from acx4lib.plot.synthetic import footprints, refinements
from acx4lib.plot.validation import (
    difference_map,
    mistakes,
    normalised_differences,
    pair_histograms,
)
from acx4lib.plot.weights import height_noise, trajectory_errors

__all__ = [
    "block_maps",
    "boresight_over_time",
    "check_points",
    "control_maps",
    "correlation_matrix",
    "correlations",
    "deviation_fields",
    "difference_map",
    "distortion_taken_up",
    "footprints",
    "from_bad_starts",
    "head_pictures",
    "height_noise",
    "held_focal_lengths",
    "image_redundancy",
    "lever_arm_seen",
    "mean_residuals",
    "mistakes",
    "mounting_per_image",
    "normalised_differences",
    "normalised_errors",
    "overlap_differences",
    "overlap_ties",
    "pair_histograms",
    "radial_distortion",
    "refinements",
    "residual_plane",
    "residuals_by_strip",
    "response_curves",
    "rig_correlations",
    "rig_deformations",
    "rig_gains",
    "seam_profiles",
    "seams",
    "seconds_by_points",
    "surround_enlarged",
    "surround_ground",
    "surround_misfits",
    "surround_photographs",
    "synthetic_picture",
    "trajectory_errors",
    "vector",
    "weak_places",
]
