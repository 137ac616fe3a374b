"""Figures of the book: every function takes results and returns a figure, and changes nothing."""

from acx4lib.plot.coverage import normalised_errors
from acx4lib.plot.experiments import held_focal_lengths
from acx4lib.plot.flight import block_maps, control_maps
from acx4lib.plot.heads import correlations, mean_residuals, radial_distortion
from acx4lib.plot.mounting import correlation_matrix, lever_arm_seen, mounting_per_image
from acx4lib.plot.reliability import image_redundancy, weak_places
from acx4lib.plot.report import (
    boresight_over_time,
    check_points,
    residual_plane,
    residuals_by_strip,
    vector,
)
from acx4lib.plot.rig import rig_correlations, rig_deformations, rig_gains
from acx4lib.plot.speed import seconds_by_points
from acx4lib.plot.starts import from_bad_starts
from acx4lib.plot.synthetic import differences, footprints
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
    "difference_map",
    "differences",
    "footprints",
    "from_bad_starts",
    "height_noise",
    "held_focal_lengths",
    "image_redundancy",
    "lever_arm_seen",
    "mean_residuals",
    "mistakes",
    "mounting_per_image",
    "normalised_differences",
    "normalised_errors",
    "pair_histograms",
    "radial_distortion",
    "residual_plane",
    "residuals_by_strip",
    "rig_correlations",
    "rig_deformations",
    "rig_gains",
    "seconds_by_points",
    "trajectory_errors",
    "vector",
    "weak_places",
]
