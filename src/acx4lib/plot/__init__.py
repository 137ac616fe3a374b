"""Figures of the book: every function takes results and returns a figure, and changes nothing."""

from acx4lib.plot.flight import block_maps, control_maps
from acx4lib.plot.mounting import correlation_matrix, lever_arm_seen, mounting_per_image
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
    "difference_map",
    "lever_arm_seen",
    "mistakes",
    "mounting_per_image",
    "normalised_differences",
    "pair_histograms",
]
