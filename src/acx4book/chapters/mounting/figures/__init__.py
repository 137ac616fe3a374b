"""Figures of the mounting: estimates image by image, weak places, adjustments from bad starts."""
