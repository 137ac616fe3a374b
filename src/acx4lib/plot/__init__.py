"""Figures of the book: every function takes results and returns a figure, and changes nothing."""

from acx4lib.plot.experiments import held_focal_lengths
from acx4lib.plot.flight import block_maps, control_maps
from acx4lib.plot.heads import correlations, mean_residuals, radial_distortion
from acx4lib.plot.mounting import correlation_matrix, lever_arm_seen, mounting_per_image
from acx4lib.plot.synthetic import differences, footprints
from acx4lib.plot.validation import (
    difference_map,
    mistakes,
    normalised_differences,
    pair_histograms,
)

__all__ = [
    "block_maps",
    "control_maps",
    "correlation_matrix",
    "correlations",
    "difference_map",
    "differences",
    "footprints",
    "held_focal_lengths",
    "lever_arm_seen",
    "mean_residuals",
    "mistakes",
    "mounting_per_image",
    "normalised_differences",
    "pair_histograms",
    "radial_distortion",
]
