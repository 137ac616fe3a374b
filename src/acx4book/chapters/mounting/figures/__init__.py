"""Figures of the mounting: estimates image by image, and weak places."""
